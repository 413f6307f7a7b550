// The board of instruments: a card for each, of which a person chooses those that are shown.
import { button, html, set } from "./shape.js";

/** @typedef {import("./catalogue.js").Instrument} Instrument */
/** @typedef {{ instrument: Instrument, card: HTMLElement, chip: HTMLElement, seen: boolean }} Entry */
const KEY = "katana450.instruments"; // of the names whose choice differs from the catalogue

export class Board {
  #kept;
  #changed;
  #entries;

  /** kept: the storage of the browser. @param {Instrument[]} catalogue @param {Page.Kept} kept */
  constructor(catalogue, kept) {
    this.#kept = kept;
    this.#changed = new Set(kept.getItem(KEY)?.split(","));
    this.instruments = catalogue;
    this.#entries = catalogue.map((instrument) => this.#entry(instrument));
    this.list = html("div", { class: "list", role: "group", "aria-label": "Instruments to show", hidden: "" }, ...this.#entries.map(({ chip }) => chip));
    this.grid = html("div", { class: "grid" }, ...this.#entries.map(({ card }) => card));
    const sight = new IntersectionObserver((sights) => {
      for (const { target, isIntersecting } of sights) {
        const entry = this.#entries.find(({ card }) => card === target);
        if (!entry) continue;
        entry.seen = isIntersecting;
        entry.instrument.plot?.refresh();
      }
    });
    for (const entry of this.#entries) {
      this.#draw(entry);
      sight.observe(entry.card);
    }
  }

  // Return the instruments that are visible in the window.
  get visible() {
    return this.#entries.filter(({ card, seen }) => !card.hidden && seen).map(({ instrument }) => instrument);
  }

  /** @param {Instrument} instrument @returns {Entry} */
  #entry(instrument) {
    const { id, title, size, element } = instrument;
    const header = html("header", {}, html("h2", { title }, title));
    const card = html("article", { class: "card", "data-id": id, "data-size": size, "aria-label": title }, header, element);
    const entry = { instrument, card, chip: button(title, () => this.#toggle(entry), { class: "chip" }), seen: true };
    return entry;
  }

  /** @param {Entry} entry */
  #toggle(entry) {
    const { id } = entry.instrument;
    if (!this.#changed.delete(id)) this.#changed.add(id);
    this.#kept.setItem(KEY, [...this.#changed].join());
    this.#draw(entry);
  }

  /** @param {Entry} entry */
  #draw({ instrument, card, chip }) {
    card.hidden = instrument.shown === this.#changed.has(instrument.id);
    set(chip, "aria-pressed", !card.hidden);
    instrument.plot?.refresh();
  }
}
