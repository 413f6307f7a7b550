// Names for screen readers of the controls in viser's panel, which viser leaves without one.
import { controlOf } from "./viser.js";

const EVERY = 300; // ms
const LIST = ", ";
let waiting = false;

/** @param {Element} control */
const labelOf = (control) => ("labels" in control ? /** @type {HTMLInputElement} */ (control).labels?.[0] : null);

/** A row of several boxes has one label that is a list, such as "x, y, z". @param {Element} control */
const isNameless = (control) => !control.getAttribute("aria-label") && (labelOf(control)?.textContent?.includes(LIST) ?? true);

/** @param {Element} control */
function nameOfInput(control) {
  const { label, index } = controlOf(control);
  return label.split(LIST)[index] ?? label;
}

function nameAll() {
  waiting = false;
  for (const control of document.querySelectorAll("input:not([type=hidden]), [role=slider]"))
    if (isNameless(control)) control.setAttribute("aria-label", nameOfInput(control));
  // viser hides the steps of a number from screen readers.
  for (const button of document.querySelectorAll("[data-direction][aria-hidden]")) {
    button.removeAttribute("aria-hidden");
    button.setAttribute("aria-label", `${nameOfInput(button)} ${button.matches("[data-direction=up]") ? "plus" : "minus"}`);
  }
  for (const button of document.querySelectorAll("button:not([aria-hidden])"))
    if (isNameless(button) && !button.textContent) button.setAttribute("aria-label", button.closest("[role=alert]") ? "Close this message" : "Settings of the display");
}

new MutationObserver(() => {
  if (waiting) return;
  waiting = true;
  setTimeout(nameAll, EVERY);
}).observe(document, { childList: true, subtree: true });
