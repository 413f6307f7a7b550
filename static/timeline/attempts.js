// The tree of attempts: what was done between two continuations from earlier moments. Loaded when it is opened.
import { onPick, t, write } from "../dom.js";
import { button, html } from "../instruments/shape.js";
import { messageOf, queryOf } from "../server.js";
import { answered, ask, RING } from "./api.js";
import { placeOf } from "./axis.js";
import { OUTCOMES, timeInWords } from "./controls.js";

/** @typedef {import("./api.js").Attempt} Attempt */
/** What the timeline does: `seek` shows a moment, `beside` a second run from a moment. @typedef {{ selection: import("./selection.js").Selection, seek: (t: number) => void, beside: (t: number) => void, change: () => void }} Acts */
const MAX_DEPTH = 8; // of the indent
/** @type {Record<string, string>} */
const SOURCES = { program: " (script)", policy: " (policy)" }; // of motions, beside persons
/** @param {Attempt} attempt */
const nameOf = ({ name, number }) => name || `Attempt ${number}`;

export class Attempts {
  #of = RING;
  /** @type {Attempt[]} */
  #attempts = [];
  /** @type {Attempt | undefined} */
  #shown;
  #list = html("div", { class: "list" });
  #name = html("input", { maxlength: 200, autocomplete: "off", "aria-label": "Name of the attempt" });
  #outcome = html("select", { "aria-label": "Outcome of the attempt" }, ...OUTCOMES.map(([value, words]) => new Option(words, value)));
  #second = html("select", { "aria-label": "Attempt to compare with" });
  #keep = button("Keep as episode", () => this.#shown && this.acts.selection.keep({ of: RING, from: this.#shown.path[0][0], to: this.#shown.end }, this.#shown.outcome), { title: "From its root to its end, without what was rewound" });
  #hide = button("Hide", () => this.#describe({ hidden: !this.#shown?.hidden }));
  #table = html("table", { hidden: "" });

  /** @param {HTMLElement} box @param {Page.Context} page @param {Acts} acts */
  constructor(box, page, acts) {
    this.page = page;
    this.acts = acts;
    this.#name.addEventListener("change", () => this.#describe({ name: this.#name.value }));
    this.#outcome.addEventListener("change", () => this.#describe({ outcome: this.#outcome.value }));
    onPick(this.#second, (number) => this.#compare(this.#attempts[Number(number) - 1]));
    box.replaceChildren(this.#list, html("div", { class: "row" }, this.#name, this.#outcome, this.#second, this.#keep, this.#hide), this.#table);
  }

  /** Show the attempts of a recording. @param {string} of @param {import("./api.js").Span[]} spans @param {Attempt[]} attempts @param {Attempt} shown */
  draw(of, spans, attempts, shown) {
    if (of !== this.#of || shown.number !== this.#shown?.number) this.#table.hidden = true;
    [this.#of, this.#attempts, this.#shown] = [of, attempts, shown];
    const { name: own, role } = this.page.store.status ?? {};
    /** @param {number | null} parent @param {number} depth @returns {HTMLElement[]} */
    const below = (parent, depth) => attempts.filter((attempt) => attempt.parent === parent).flatMap((attempt) => {
      const drivers = attempt.drivers.map(([name, source]) => (name === own ? "You" : name + (SOURCES[source] ?? "")));
      const seconds = placeOf(spans, attempt.end) - placeOf(spans, attempt.start);
      const words = [timeInWords(attempt.start), `${seconds.toFixed(1)} s`, ...drivers].join(", ");
      const entry = button([html("b", {}, nameOf(attempt)), html("span", {}, words)], () => this.#show(attempt), { class: attempt.outcome, "aria-current": attempt === shown });
      entry.style.marginLeft = `${Math.min(depth, MAX_DEPTH)}rem`;
      // A hidden one is found again at its moment.
      return [...(attempt.hidden && attempt !== shown ? [] : [entry]), ...below(attempt.number, depth + 1)];
    });
    const focused = [...this.#list.children].findIndex((entry) => entry === document.activeElement);
    this.#list.replaceChildren(...below(null, 0));
    if (this.#list.children[focused] instanceof HTMLElement) this.#list.children[focused].focus();
    // What an opened file says is not changed.
    for (const control of [this.#name, this.#outcome, this.#keep, this.#hide]) control.hidden = of !== RING || role === "viewer";
    if (document.activeElement !== this.#name) [this.#name.value, this.#name.placeholder] = [shown.name, t(nameOf({ ...shown, name: "" }))];
    this.#outcome.value = shown.outcome;
    write(this.#hide, shown.hidden ? "Show in the list" : "Hide");
    if (document.activeElement === this.#second) return;
    this.#second.replaceChildren(new Option("Compare with…", ""), ...attempts.filter((other) => other !== shown && !other.hidden).map((other) => new Option(nameOf(other), String(other.number))));
  }

  /** Show the end of an attempt, and select it. @param {Attempt} attempt */
  #show({ start, end }) {
    this.acts.selection.set(start, end);
    this.acts.seek(end);
  }

  /** Change the description of the attempt that is shown. @param {Partial<Attempt>} changes */
  async #describe(changes) {
    if (!this.#shown) return;
    // The next change may come before the tree.
    const { end, name, outcome, hidden } = Object.assign(this.#shown, changes);
    await ask(this.page.name, { do: "describe_attempt", t: end, name, outcome, hidden }).catch((error) => this.page.toast(messageOf(error)));
    this.acts.change();
  }

  /** Show what differs from another attempt, and both beside each other from where they part. @param {Attempt} other */
  async #compare(other) {
    const { end = 0, ...shown } = this.#shown ?? other;
    try {
      /** @type {{ starts: [number | null, number | null], rows: string[][] }} */
      const { starts: [mine, start], rows } = await answered(`api/v1/playback/${this.#of}/difference?${queryOf({ t: end, t2: other.end })}`);
      this.#table.replaceChildren(...[["", nameOf({ ...shown, end }), nameOf(other)], ...rows].map((cells) => html("tr", {}, ...cells.map((words) => html("td", {}, words)))));
      this.#table.hidden = false;
      this.acts.selection.set(mine, end);
      if (mine !== null && start !== null) this.acts.beside(start);
    } catch (error) {
      this.page.toast(messageOf(error));
    }
  }
}
