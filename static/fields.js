// Number boxes of viser's panel. viser sends each keystroke, so the arm would move to 5, 50 and 500.
// Here typed text is a draft, which viser gets on Enter or when the box is left.
import { notNumber, numberIn } from "./number.js";
import * as Viser from "./viser.js";
import { NUMBER_BOX } from "./viser/names.js";

const UNFINISHED = /^-?\.?$/;
/** @type {Record<string, number>} */
const STEPS = { ArrowUp: 1, ArrowDown: -1 };

/** @type {Map<string, ViserPage.ControlProps>} */
const controls = new Map(); // the range and step of each control, by its id
/** @type {HTMLInputElement | null} */
let box = null; // the box that has the focus
let sending = false;
/** @type {Page.Toast} */
let tell = () => {};

/** @param {EventTarget | null} target */
const boxOf = (target) => (target instanceof HTMLInputElement && target.matches(NUMBER_BOX) ? target : null);
const stopped = () => window.parent.document.body.dataset.mood === "stopped";

/** Return the draft of a box with a point for the comma of a number, such as 12,5. @param {HTMLInputElement} field */
const draft = (field) => field.value.trim().replace(/^([-+]?\d*),(\d*)$/, "$1.$2");

/** @param {HTMLInputElement} field */
function range(field) {
  const { id, label, index } = Viser.controlOf(field);
  const { min = null, max = null, step = 1 } = controls.get(id) ?? {};
  const [low, high] = [min, max].map((end) => (Array.isArray(end) ? end[index] : end));
  return { label, low: low ?? -Infinity, high: high ?? Infinity, step };
}

/** Return why the draft cannot be sent; empty if it can. @param {HTMLInputElement} field */
function objection(field) {
  const { label, low, high } = range(field);
  const value = numberIn(draft(field));
  if (!Number.isFinite(value)) return notNumber(label, field.value);
  return value < low || value > high ? `${label}: ${field.value} is not between ${low} and ${high}. It was not sent.` : "";
}

/** @param {HTMLInputElement} field @param {boolean} invalid */
const mark = (field, invalid) => (field.ariaInvalid = invalid ? "true" : null);

/** @param {HTMLInputElement} field */
function restore(field) {
  field.value = Viser.shownIn(field);
  mark(field, false);
}

/** @param {HTMLInputElement} field */
function commit(field) {
  if (field.value === Viser.shownIn(field)) return mark(field, false);
  const why = objection(field);
  if (why) {
    restore(field);
    if (field === box) field.select();
    return tell(why);
  }
  sending = true;
  Viser.type(field, draft(field));
  sending = false;
}

/** @param {HTMLInputElement} field */
function leave(field) {
  box = null;
  // A value typed before a stop must not be sent after Clear stop, which was clicked to leave the box.
  if (stopped()) restore(field);
  else commit(field);
}

/** @param {HTMLInputElement} field @param {number} sign */
function step(field, sign) {
  const { low, high, step } = range(field);
  const from = Number(objection(field) ? Viser.shownIn(field) : draft(field));
  const decimals = Math.max(...[from, step].map((x) => String(x).split(".")[1]?.length ?? 0));
  const next = Math.min(high, Math.max(low, from + sign * step));
  Viser.fill(field, String(Number(next.toFixed(decimals))));
  mark(field, false);
}

/** @type {<K extends keyof WindowEventMap>(kind: K, listen: (event: WindowEventMap[K]) => void) => void} */
const on = (kind, listen) => window.addEventListener(kind, listen, { capture: true });

on("input", (event) => {
  const field = boxOf(event.target);
  if (sending || !field) return;
  event.stopImmediatePropagation();
  mark(field, !UNFINISHED.test(draft(field)) && objection(field) !== "");
});
on("change", (event) => {
  const field = boxOf(event.target);
  if (!field) return;
  event.stopImmediatePropagation();
  // Assistive technology can set a value without the focus.
  if (field !== box) commit(field);
});
on("focusin", ({ target }) => {
  box = boxOf(target) ?? box;
});
// When the window loses the focus, the box keeps it, and the draft remains.
on("focusout", ({ target }) => {
  const field = boxOf(target);
  if (field && document.activeElement !== field) leave(field);
});
// The buttons beside the box start from the typed value. A click in the scene does not move the focus.
on("pointerdown", ({ target }) => {
  if (box && target !== box && !stopped()) commit(box);
});
on("keydown", (event) => {
  const field = boxOf(event.target);
  if (!field) return;
  if (event.key === "Enter") commit(field);
  // Both keys also stop the arm.
  else if (event.key === "Escape" || event.key === " ") restore(field);
  else if (event.key in STEPS) {
    event.preventDefault();
    event.stopImmediatePropagation();
    step(field, STEPS[event.key]);
  }
});

// A draft of before a stop, or of before its end, must not be sent by a later click, also where another person clears it.
function restoreAtStops() {
  let before = stopped();
  new MutationObserver(() => {
    if (stopped() === before) return;
    before = !before;
    if (box) restore(box);
  }).observe(window.parent.document.body, { attributeFilter: ["data-mood"] });
}

/** Store the ranges and steps of the controls from messages of the server. @param {ViserPage.Message[]} messages */
export const hear = (messages) => Viser.keepControls(controls, messages);

/** `say` shows a sentence to the person. @param {Page.Toast} say */
export function begin(say) {
  tell = say;
  if (window.parent !== window) restoreAtStops();
}
