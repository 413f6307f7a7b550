// The frame of an instrument: its name and, in arrange mode, controls for place and size.
import { html, set } from "./shape.js";

/** @typedef {import("./catalogue.js").Instrument} Instrument */
/**
 * @typedef {object} Arranging
 * @property {(card: Card, event: PointerEvent) => void} lift
 * @property {(id: string, by: number) => void} nudge
 * @property {(id: string) => void} grow
 * @property {(id: string) => void} hide
 */
/** @type {Record<string, number>} */
const KEYS = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 };
/** @type {Record<string, string>} */
const SIZES = { small: "Small", wide: "Wide", large: "Large", broad: "Full width" };
/** @type {Record<string, string>} */
const LETTERS = { small: "S", wide: "W", large: "L", broad: "F" };

export class Card {
  // on: {lift(card, event), nudge(id, by), grow(id), hide(id)}, called when a person arranges the card.
  /** @param {Instrument} instrument @param {Arranging} on */
  constructor(instrument, on) {
    const { id, title, sizes } = instrument;
    this.instrument = instrument;
    this.seen = true;
    this.grip = tool(`Move ${title}`, "⠿", "Drag, or arrow keys");
    this.#size = tool(`Size of ${title}`, "", "Change the size");
    this.#size.hidden = sizes.length < 2;
    const hide = tool(`Hide ${title}`, "×", "Hide");
    const action = instrument.plot ? [instrument.plot.action] : [];
    const header = html("header", {}, this.grip, html("h2", { title }, title), ...action, this.#size, hide);
    this.element = html("article", { class: "card", "data-id": id, "aria-label": title }, header, instrument.element);
    this.grip.addEventListener("keydown", (event) => {
      if (!(event.key in KEYS)) return;
      event.preventDefault();
      on.nudge(id, KEYS[event.key]);
    });
    header.addEventListener("pointerdown", (event) => {
      const onButton = event.target instanceof Element && event.target.closest("button:not(.grip)");
      if (!event.button && !onButton) on.lift(this, event);
    });
    this.grip.classList.add("grip");
    this.#size.addEventListener("click", () => on.grow(id));
    hide.addEventListener("click", () => on.hide(id));
  }

  #size;

  /** @param {import("./layout.js").Place} place */
  place({ size, shown }) {
    this.element.hidden = !shown;
    set(this.element, "data-size", size);
    set(this.#size, "aria-description", SIZES[size]);
    this.#size.textContent = LETTERS[size];
    this.instrument.plot?.refresh();
  }
}

/** @param {string} name @param {string} sign @param {string} title */
function tool(name, sign, title) {
  return html("button", { type: "button", class: "tool", "aria-label": name, title }, sign);
}
