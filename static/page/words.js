// Sentences for people: the names of joints in them, and messages over the scene.
import { element, write } from "../dom.js";

const TOAST = 4000; // ms
const box = element("toast", HTMLElement);
/** @type {number | undefined} */
let timer;

// Name the joints in a sentence that numbers them: "axis 2 (shoulder)". labels: of the joints, with their numbers.
/** @param {string} words @param {string[]} labels */
export function named(words, labels) {
  // An axis that is in the way is a line in space, not a joint.
  return words.replace(/\baxis (\d+)\b(?! is in the way)/gi, (axis, number) => {
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
