// The texts of a document in another language than English, for which alone this file is loaded. What appears in the
// document is looked up in the catalogue: a whole text, a pattern such as "Pose {1} of {2}", or the parts of a text.
import { styled } from "../dom.js";

const { lang } = window.parent.document.documentElement;
document.documentElement.lang = lang;
const ATTRIBUTES = ["title", "aria-label", "placeholder", "alt", "aria-valuetext", "data-drop"];
const KEPT = "kbd, script, style, textarea, [translate=no]";
const HOLE = /\{\d\}/; // in a pattern
const SHORT = 12; // letters of a pattern; a value in a shorter one is a name or a number, otherwise within one sentence
const TIME = /^\d+:[\d:]+ /; // before an event
const GAPS = [/((?<=[.!?…]) )/, /(; )/, /( · )/, /((?<=^[^:]*:) )/, /(, )/, /((?<=^\d+) )/, /( – )/]; // between the parts of a text
const MAX_SHOWN = 2000;

/** @type {Record<string, string>} */
const catalogue = await (await fetch(new URL(`${lang}.json`, import.meta.url))).json();
const point = new Intl.NumberFormat(lang).format(0.5)[1];
const longest = Object.keys(catalogue).filter((key) => HOLE.test(key)).sort((one, other) => other.length - one.length);
const patterns = longest.map((key) => {
  const literals = key.split(HOLE).map((words) => words.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"));
  const value = literals.join("").length < SHORT ? "((?:(?![.,:] ).)+?)" : "((?:(?!\\. ).)+?)";
  const end = key.endsWith("}") ? "(?<![.,:;])" : ""; // the mark at the end is looked up by itself
  return { pattern: new RegExp(`^${literals.join(value)}${end}$`), text: catalogue[key] };
});
/** @type {Map<string, string>} */
const shown = new Map(); // by the English text, and by the shown one

/** Return `words` with the decimal mark of the language. @param {string} words */
const localized = (words) => words.replace(/(?<![\w.:/]|\w-)(\d+)\.(\d+)(?![\w.:])/g, `$1${point}$2`);

/** Return the translation of a whole text; undefined without one. @param {string} words */
function find(words) {
  if (Object.hasOwn(catalogue, words)) return catalogue[words];
  for (const { pattern, text } of patterns) {
    const values = pattern.exec(words);
    // A value in quotes is a word of a script.
    if (values) return text.replace(/(['`]?)\{(\d)\}/g, (_, quote, number) => quote + (quote ? values[number] : translated(values[number])));
  }
  return undefined;
}

/** Return the translation of a text or of its parts; undefined without one. @param {string} words @returns {string | undefined} */
function composed(words) {
  const [time] = TIME.exec(words) ?? [];
  if (time) return time + translated(words.slice(time.length));
  const whole = find(words);
  if (whole !== undefined) return whole;
  const [, initial, rest, end] = /^(.?)(.*?)([.,:;]?)$/.exec(words) ?? [];
  const same = find(initial + rest);
  // A reason begins with a capital where it is a sentence.
  const reason = same ?? find(initial.toLowerCase() + rest);
  if (reason !== undefined) return (same ?? reason.charAt(0).toUpperCase() + reason.slice(1)) + (catalogue[end] ?? end);
  for (const gap of GAPS) {
    const parts = words.split(gap);
    const texts = parts.map((part, i) => (parts.length === 1 ? undefined : i % 2 ? catalogue[part] : composed(part)));
    if (texts.some((text, i) => i % 2 === 0 && text !== undefined)) return texts.map((text, i) => text ?? localized(parts[i])).join("");
  }
  return undefined;
}

/** Return `words` in the language, or in English with its numbers. @param {string} words @returns {string} */
function translated(words) {
  const text = shown.get(words) ?? composed(words);
  if (text === undefined) return localized(words);
  if (shown.size > MAX_SHOWN) shown.clear();
  shown.set(words, text).set(text, text);
  return text;
}
window.translated = translated;

/** @param {Text} node */
function translateText(node) {
  const { data, parentElement: parent } = node;
  if (!parent || !/\p{L}{2}|\d\.\d/u.test(data) || parent.closest(KEPT)) return;
  if (parent instanceof HTMLOptionElement && !parent.hasAttribute("value")) parent.value = parent.text;
  const words = data.trim().replace(/[ \n]+/g, " ");
  const text = translated(words);
  if (text !== words) node.data = data.replace(data.trim(), () => text);
  // A screen reader speaks a sentence without a translation as English.
  if (shown.has(words)) parent.removeAttribute("lang");
  else if (/[a-z] [a-z]{2}/.test(words) && parent.childElementCount === 0) parent.lang = "en";
}

/** @param {Element} element */
function translateAttributes(element) {
  for (const name of ATTRIBUTES) {
    const words = element.getAttribute(name) ?? "";
    const text = words && !element.closest(KEPT) ? translated(words) : words;
    if (text !== words) element.setAttribute(name, text);
  }
}

/** Show the value of a drop-down or a number in the language; scripts read and write it in English. @param {HTMLInputElement} input */
function translateValue(input) {
  const shownValue = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value");
  const value = Object.getOwnPropertyDescriptor(input, "value") ?? shownValue;
  let words = input.value;
  /** @param {string} next */
  const set = (next) => {
    words = next;
    value?.set?.call(input, next);
    shownValue?.set?.call(input, translated(next));
  };
  const isNumber = input.inputMode === "decimal";
  const get = () => {
    const now = shownValue?.get?.call(input);
    return isNumber ? now.replace(point, ".") : now === translated(words) ? words : value?.get?.call(input);
  };
  Object.defineProperty(input, "value", { configurable: true, get, set });
  input.value = words;
}

/** @param {Node} root */
function translate(root) {
  const nodes = document.createTreeWalker(root, NodeFilter.SHOW_TEXT | NodeFilter.SHOW_ELEMENT);
  for (let node = /** @type {Node | null} */ (root); node; node = nodes.nextNode()) {
    if (node instanceof Text) translateText(node);
    else if (node instanceof Element) translateAttributes(node);
    if (node instanceof HTMLInputElement && node.matches("[role=combobox], [inputmode=decimal]")) translateValue(node);
  }
}

const observer = new MutationObserver((changes) => {
  for (const { type, target, addedNodes } of changes) {
    if (type === "childList") addedNodes.forEach(translate);
    else if (target instanceof Text) translateText(target);
    else translateAttributes(/** @type {Element} */ (target));
  }
  // The changes that were made here.
  observer.takeRecords();
});
if (window.parent === window) styled("language.css", import.meta.url);
translate(document);
observer.observe(document, { subtree: true, childList: true, characterData: true, attributeFilter: ATTRIBUTES });
document.documentElement.dataset.translated = "";
