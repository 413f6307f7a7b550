// The board with all cards, which a person can arrange.
import { Card } from "./card.js";
import * as layouts from "./layout.js";
import { html, set } from "./shape.js";

export class Board {
  #catalogue;
  #kept;
  #layout;
  #cards;
  #chips;
  #lifted = null; // {card, over} while one is dragged
  #arranging = false;
  #status = html("p", { class: "report", role: "status" });

  // kept: the storage of the browser; null if there is none.
  constructor(catalogue, kept) {
    this.#catalogue = catalogue;
    this.#kept = kept;
    this.#layout = layouts.read(kept, catalogue);
    const on = {
      lift: (card, event) => this.#lift(card, event),
      nudge: (id, by) => this.#nudge(id, by),
      grow: (id) => this.#grow(id),
      hide: (id) => this.#toggle(id),
    };
    this.#cards = new Map(catalogue.map((each) => [each.id, new Card(each, on)]));
    this.#chips = new Map(catalogue.map(({ id, title }) => [id, this.#chip(id, title)]));
    const reset = html("button", { type: "button" }, "Reset layout");
    reset.addEventListener("click", () => this.#set(layouts.initial(this.#catalogue)));
    this.list = html(
      "div",
      { class: "list", role: "group", "aria-label": "Instruments to show", hidden: "" },
      ...this.#chips.values(),
      reset,
      this.#status,
    );
    this.grid = html("div", { class: "grid" });
    this.#follow();
    this.#place();
  }

  // Return the instruments that are visible in the window.
  get visible() {
    return [...this.#cards.values()]
      .filter(({ element, seen }) => !element.hidden && seen)
      .map(({ instrument }) => instrument);
  }

  get instruments() {
    return this.#catalogue;
  }

  // Switch the arrange mode, in which instruments are inactive.
  arrange(on) {
    this.#arranging = on;
    this.list.hidden = !on;
    this.grid.classList.toggle("arranging", on);
    for (const { instrument } of this.#cards.values()) instrument.element.inert = on;
  }

  #set(layout) {
    this.#layout = layout;
    layouts.write(this.#kept, layout);
    this.#place();
  }

  #place() {
    const focus = /** @type {HTMLElement | null} */ (document.activeElement);
    this.#layout.forEach((place, n) => {
      const card = this.#cards.get(place.id);
      if (this.grid.children[n] !== card.element) this.grid.insertBefore(card.element, this.grid.children[n] ?? null);
      card.place(place);
      set(this.#chips.get(place.id), "aria-pressed", place.shown);
    });
    // A moved element loses the focus.
    if (focus !== document.activeElement && this.grid.contains(focus)) focus.focus();
  }

  #chip(id, title) {
    const chip = html("button", { type: "button", class: "chip" }, title);
    chip.addEventListener("click", () => this.#toggle(id));
    return chip;
  }

  #of(id) {
    return this.#layout.find((place) => place.id === id);
  }

  #toggle(id) {
    const shown = !this.#of(id).shown;
    if (!shown && this.#cards.get(id).element.contains(document.activeElement)) this.#chips.get(id).focus();
    this.#set(layouts.changed(this.#layout, id, { shown }));
  }

  #grow(id) {
    const { sizes } = this.#cards.get(id).instrument;
    const size = sizes[(sizes.indexOf(this.#of(id).size) + 1) % sizes.length];
    this.#set(layouts.changed(this.#layout, id, { size }));
  }

  #nudge(id, by) {
    this.#set(layouts.nudged(this.#layout, id, by));
    const shown = this.#layout.filter((place) => place.shown);
    const place = shown.findIndex((each) => each.id === id) + 1;
    this.#status.textContent = `${this.#cards.get(id).instrument.title}: place ${place} of ${shown.length}`;
  }

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
      /** @type {HTMLElement | null | undefined} */
      const found = document.elementFromPoint(clientX, clientY)?.closest(".card");
      const over = found && this.#cards.get(found.dataset.id);
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
        const card = this.#cards.get(/** @type {HTMLElement} */ (target).dataset.id);
        card.seen = isIntersecting;
        card.instrument.plot?.refresh();
      }
    });
    for (const { element } of this.#cards.values()) sight.observe(element);
  }
}
