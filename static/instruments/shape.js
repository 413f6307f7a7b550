// Functions that create HTML and SVG elements and format numbers.
const SVG = "http://www.w3.org/2000/svg";

/** @typedef {Record<string, string | number | boolean>} Attributes */
/** @template {keyof HTMLElementTagNameMap} K @param {K} tag @param {Attributes} attributes @param {(Node | string)[]} children */
export function html(tag, attributes = {}, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

/** Return a button. @param {Node | string | (Node | string)[]} content @param {() => void} act @param {Attributes} attributes */
export function button(content, act, attributes = {}) {
  const control = html("button", { type: "button", ...attributes }, ...[content].flat());
  control.addEventListener("click", act);
  return control;
}

/** @template {keyof SVGElementTagNameMap} K @param {K} tag @param {Attributes} attributes @param {(Node | string)[]} children */
export function svg(tag, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, tag), attributes, children);
}

/** Return a drawing that screen readers leave out. @param {string} viewBox @param {Node[]} parts */
export const drawing = (viewBox, ...parts) => svg("svg", { viewBox, "aria-hidden": "true" }, ...parts);

/** @template {Element} T @param {T} element @param {Attributes} attributes @param {(Node | string)[]} children */
function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) set(element, name, value);
  element.append(...children);
  return element;
}

// Write only changes: at 30 updates a second, writing is most of the cost of a card.
/** @param {Element} element @param {string} name @param {string | number | boolean} value */
export function set(element, name, value) {
  const text = String(value);
  if (element.getAttribute(name) !== text) element.setAttribute(name, text);
}

/** @param {number} value @param {number} low @param {number} high */
export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

/** Return `value` with a true minus sign, and never "−0". @param {number} value */
export function signed(value, digits = 1) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}
