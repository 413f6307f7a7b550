// The keys of the page, in both documents.
import { closest, element, matches } from "../dom.js";
import * as Edit from "../edit.js";
import * as Jog from "../jog.js";

// What Space types into: text, but neither a number nor the search in a list, which keeps the focus after a choice.
const TEXT = "textarea, input:is(:not([type]), [type=text]):not([readonly], [inputmode], [aria-haspopup])";
const TYPED = "input:not([type=range], [type=radio], [type=checkbox]), textarea, select"; // what takes letters

/**
 * Returns the function for each key event. Space, except in a text, and Esc only stop the arm, whatever has the focus.
 * @param {import("./parts.js").Parts} parts @param {() => void} stop
 */
export function keyHandler(parts, stop) {
  /** Act on an event of a key that is no STOP; return whether it was handled. @param {KeyboardEvent} event */
  function act(event) {
    const { target, key, repeat } = event;
    const down = event.type === "keydown";
    // A key that stays pressed is one click.
    if (key === "Enter" && repeat && closest(target, "button")) return true;
    if (matches(target, TYPED)) return false;
    if (key === "?" && down) {
      if (!repeat) element("help-button", HTMLButtonElement).click();
      return true;
    }
    return Boolean(parts.stage?.handle.key(event)) || Jog.key(event) || Edit.key(event) || Boolean(parts.episodes?.key(event));
  }

  return (/** @type {KeyboardEvent} */ event) => {
    const { key, type } = event;
    const stops = (key === " " && !matches(event.target, TEXT)) || key === "Escape";
    // Also in a text box, to which the focus may have moved.
    if (type === "keyup") Jog.release(event.code);
    if (stops && type === "keydown" && !event.repeat) stop();
    if (key === "Escape") {
      for (const dialog of document.querySelectorAll("dialog")) dialog.close();
      parts.stage?.clear();
    }
    if (!stops && !act(event)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
  };
}
