// Sentences for people: the names of joints in them, and messages over the scene.
import { element, write } from "../dom.js";

const TOAST = 4000; // ms
const box = element("toast", HTMLElement);
/** @type {number | undefined} */
let timer;

// The browser's locale, or the language of the page where another one was chosen.
const { lang } = document.documentElement;
export const locale = navigator.language.startsWith(lang) ? navigator.language : lang;

/** Return a time of the day as the locale writes it. @param {Date} time @param {Intl.DateTimeFormatOptions} [style] */
export const clock = (time, style) => time.toLocaleTimeString(locale, style);

/** Return `words` for the person `name`, who is "You" where they begin with what that one did. @param {string} words @param {string} name */
export const addressed = (words, name) =>
  words.startsWith(`${name} `) ? `You${words.slice(name.length)}`.replace(/^You drives/, "You drive") : words;

// Name the joints in a sentence that numbers them: "axis 2 (shoulder)", and write its times, which are in UTC, as the
// browser does. labels: of the joints, with their numbers.
/** @param {string} words @param {string[]} labels */
export function named(words, labels) {
  const timed = words.replace(/\d{4}-\d\d-\d\dT[\d:]+\+00:00/g, (time) => clock(new Date(time), { timeStyle: "short" }));
  // An axis that is in the way is a line in space, not a joint.
  return timed.replace(/\baxis (\d+)\b(?! is in the way)/gi, (axis, number) => {
    const name = labels[number - 1]?.replace(/^\d+ /, "") ?? "";
    return /^[a-z]/i.test(name) && !words.includes(name) ? `${axis} (${name})` : axis;
  });
}

/** @param {string} words */
export function showToast(words) {
  write(box, words);
  box.classList.add("shown");
  clearTimeout(timer);
  timer = setTimeout(() => box.classList.remove("shown"), TOAST);
}
