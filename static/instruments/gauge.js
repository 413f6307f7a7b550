// Gauges: a number on an arc with zones, and rows of bars for several numbers of one kind.
import { write } from "../dom.js";
import { arc } from "./parts.js";
import { clamp, drawing, html, set, svg } from "./shape.js";

/** @typedef {{ below?: number, above?: number, tone: string }} Zone */
/**
 * @typedef {object} GaugeOptions
 * @property {string} title @property {number} low @property {number} high @property {string} unit
 * @property {(value: number) => string} text @property {Zone[]} [zones] @property {number} [origin]
 */
const RING = 44;
const [FROM, TO] = [-120, 120]; // degrees of the dial
const HIGH = 0.9; // fraction of a limit from which a bar warns

export class Gauge {
  #options;
  #parts;

  // text: returns the text of a value. zones: [{below | above, tone}], of which the first match counts.
  // origin: the value where the arc begins, low by default.
  /** @param {GaugeOptions} options */
  constructor(options) {
    this.#options = options;
    const { title, low, high, zones = [], unit } = options;
    this.#parts = {
      way: svg("path", { class: "way" }),
      value: html("output", { class: "value" }, "–"),
      note: html("span", { class: "note" }, " "),
    };
    const marks = zones.map(({ below, above, tone }) => {
      const [from, to] = below === undefined ? [above ?? high, high] : [low, below];
      return svg("path", { class: `zone ${tone}`, d: arc(53, this.#turn(from), this.#turn(to)) });
    });
    const range = svg("path", { class: "range", d: arc(RING, FROM, TO) });
    const picture = drawing("-58 -58 116 92", range, this.#parts.way, ...marks.reverse());
    const dial = html("div", { class: "dial" }, picture, this.#parts.value, html("span", { class: "unit" }, unit));
    const values = { "aria-valuemin": low, "aria-valuemax": high, "aria-valuenow": low, "aria-valuetext": "none" };
    this.element = html("div", { class: "gauge", role: "meter", "aria-label": title, ...values }, dial, this.#parts.note);
  }

  /** Show `value` with a note; null if there is no value. @param {number | null} value */
  show(value, note = " ") {
    const { text, low, origin = low, zones = [] } = this.#options;
    const { way, value: shown, note: below } = this.#parts;
    const words = value === null ? "–" : text(value);
    write(shown, words);
    write(below, note);
    /** @param {Zone} zone */
    const fits = ({ below = -Infinity, above = Infinity }) => value !== null && (value < below || value > above);
    set(this.element, "data-tone", zones.find(fits)?.tone ?? "ok");
    const [from, to] = [this.#turn(origin), this.#turn(value ?? origin)];
    set(way, "d", Math.abs(to - from) < 0.5 ? "" : arc(RING, from, to));
    set(this.element, "aria-valuenow", value === null ? low : value.toFixed(3));
    set(this.element, "aria-valuetext", value === null ? "none" : `${words} ${this.#options.unit} ${note}`.trim());
  }

  /** @param {number} value */
  #turn(value) {
    const { low, high } = this.#options;
    return FROM + ((TO - FROM) * clamp(value - low, 0, high - low)) / (high - low);
  }
}

export class Bars {
  #rows;
  #text;

  // rows: [{label, limit}]; each bar extends from the middle to either side, up to its limit.
  /** @param {{ title: string, rows: { label: string, limit: number }[], text: (value: number) => string, unit: string }} options */
  constructor({ title, rows, text, unit }) {
    this.#text = text;
    this.#rows = rows.map(({ label, limit }) => {
      const bar = html("i");
      const value = html("output", {}, "–");
      const values = { "aria-valuemin": (-limit).toFixed(1), "aria-valuemax": limit.toFixed(1), "aria-valuenow": "0" };
      const name = html("span", {}, label.replace("Axis ", ""));
      const row = html("div", { role: "meter", "aria-label": `${title}, ${label}`, ...values }, name, html("div", { class: "track" }, bar), value);
      return { row, bar, value, limit };
    });
    const limits = html("p", { class: "note" }, `${unit}, full scale is the limit`);
    this.element = html("div", { class: "bars" }, ...this.#rows.map(({ row }) => row), limits);
  }

  /** @param {number[]} values */
  show(values) {
    this.#rows.forEach(({ row, bar, value, limit }, i) => {
      const fraction = clamp(values[i] / limit, -1, 1);
      bar.style.transform = `scaleX(${fraction.toFixed(4)})`;
      set(row, "data-tone", Math.abs(fraction) > HIGH ? "warn" : "ok");
      write(value, this.#text(values[i]));
      set(row, "aria-valuenow", values[i].toFixed(1));
    });
  }
}
