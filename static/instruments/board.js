// The board with all cards, which a person can arrange.
import { Card } from "./card.js";
import * as layouts from "./layout.js";
import { html, set } from "./shape.js";

/** @typedef {import("./catalogue.js").Instrument} Instrument */

export class Board {
  #catalogue;
  #kept;
  #layout;
  #entries; // card, and the chip that shows it, by the id of the instrument
  /** @type {{ card: Card, over: Card } | null} */
  #lifted = null; // {card, over} while one is dragged
  #arranging = false;
  #status = html("p", { class: "report", role: "status" });

  /** kept: the storage of the browser; null if there is none. @param {Instrument[]} catalogue @param {Storage | null} kept */
  constructor(catalogue, kept) {
    this.#catalogue = catalogue;
    this.#kept = kept;
    this.#layout = layouts.read(kept, catalogue);
    /** @type {import("./card.js").Arranging} */
    const on = {
      lift: (card, event) => this.#lift(card, event),
      nudge: (id, by) => this.#nudge(id, by),
      grow: (id) => this.#grow(id),
      hide: (id) => this.#toggle(id),
    };
    this.#entries = new Map(catalogue.map((instrument) => [instrument.id, { card: new Card(instrument, on), chip: this.#chip(instrument) }]));
    const reset = html("button", { type: "button" }, "Reset layout");
    reset.addEventListener("click", () => this.#set(layouts.initial(this.#catalogue)));
    this.list = html(
      "div",
      { class: "list", role: "group", "aria-label": "Instruments to show", hidden: "" },
      ...[...this.#entries.values()].map(({ chip }) => chip),
      reset,
      this.#status,
    );
    this.grid = html("div", { class: "grid" });
    this.#follow();
    this.#place();
  }

  // Return the instruments that are visible in the window.
  get visible() {
    return [...this.#entries.values()].filter(({ card }) => !card.element.hidden && card.seen).map(({ card }) => card.instrument);
  }

  get instruments() {
    return this.#catalogue;
  }

  /** Switch the arrange mode, in which instruments are inactive. @param {boolean} on */
  arrange(on) {
    this.#arranging = on;
    this.list.hidden = !on;
    this.grid.classList.toggle("arranging", on);
    for (const { element } of this.#catalogue) element.inert = on;
  }

  /** @param {layouts.Place[]} layout */
  #set(layout) {
    this.#layout = layout;
    layouts.write(this.#kept, layout);
    this.#place();
  }

  #place() {
    const focus = document.activeElement;
    this.#layout.forEach((place, n) => {
      const { card, chip } = this.#entry(place.id);
      if (this.grid.children[n] !== card.element) this.grid.insertBefore(card.element, this.grid.children[n] ?? null);
      card.place(place);
      set(chip, "aria-pressed", place.shown);
    });
    // A moved element loses the focus.
    if (focus instanceof HTMLElement && focus !== document.activeElement && this.grid.contains(focus)) focus.focus();
  }

  /** @param {Instrument} instrument */
  #chip({ id, title }) {
    const chip = html("button", { type: "button", class: "chip" }, title);
    chip.addEventListener("click", () => this.#toggle(id));
    return chip;
  }

  /** @param {string} id */
  #of(id) {
    const place = this.#layout.find((other) => other.id === id);
    if (!place) throw new Error(`There is no instrument ${id}.`);
    return place;
  }

  /** @param {string} id */
  #entry(id) {
    const entry = this.#entries.get(id);
    if (!entry) throw new Error(`There is no instrument ${id}.`);
    return entry;
  }

  /** @param {string} id */
  #toggle(id) {
    const shown = !this.#of(id).shown;
    const { card, chip } = this.#entry(id);
    if (!shown && card.element.contains(document.activeElement)) chip.focus();
    this.#set(layouts.changed(this.#layout, id, { shown }));
  }

  /** @param {string} id */
  #grow(id) {
    const { sizes } = this.#entry(id).card.instrument;
    const size = sizes[(sizes.indexOf(this.#of(id).size) + 1) % sizes.length];
    this.#set(layouts.changed(this.#layout, id, { size }));
  }

  /** @param {string} id @param {number} by */
  #nudge(id, by) {
    this.#set(layouts.nudged(this.#layout, id, by));
    const shown = this.#layout.filter((place) => place.shown);
    const place = shown.findIndex((other) => other.id === id) + 1;
    this.#status.textContent = `${this.#entry(id).card.instrument.title}: place ${place} of ${shown.length}`;
  }

  /** @param {Card} card @param {PointerEvent} event */
  #lift(card, event) {
    if (!this.#arranging) return;
    event.preventDefault();
    card.grip.focus();
    this.#lifted = { card, over: card };
    card.element.classList.add("lifted");
    // The grid captures the pointer, because a moved card would lose it.
    this.grid.setPointerCapture(event.pointerId);
  }

  #follow() {
    this.grid.addEventListener("pointermove", ({ clientX, clientY }) => {
      if (!this.#lifted) return;
      const target = document.elementFromPoint(clientX, clientY)?.closest(".card");
      const over = target instanceof HTMLElement && this.#entries.get(target.dataset.id ?? "")?.card;
      // Move only once past each card, because the same card may then lie under the pointer again.
      if (!over || over === this.#lifted.over) return;
      this.#lifted.over = over;
      if (over !== this.#lifted.card)
        this.#set(layouts.moved(this.#layout, this.#lifted.card.instrument.id, over.instrument.id));
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"])
      this.grid.addEventListener(end, () => {
        this.#lifted?.card.element.classList.remove("lifted");
        this.#lifted = null;
      });
    const sight = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        const { card } = this.#entry((target instanceof HTMLElement && target.dataset.id) || "");
        card.seen = isIntersecting;
        card.instrument.plot?.refresh();
      }
    });
    for (const { card } of this.#entries.values()) sight.observe(card.element);
  }
}
