// Numbers that a person types, with a point or a comma: the browser writes them in its own language, which need not be that
// of the page.

/** Return the number in a typed text; NaN without one. @param {string} text */
export const numberIn = (text) => (text.trim() ? Number(text.trim().replace(",", ".").replace("−", "-")) : NaN);

/** Return why a typed text was not sent. @param {string} name @param {string} text */
export const notNumber = (name, text) => (text.trim() ? `${name}: ${text} is not a number.` : `${name} needs a number.`);
