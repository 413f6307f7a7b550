// A plot of some channels over the last seconds, drawn by uPlot, with a cursor for reading.
import { t, write } from "../dom.js";
import uPlot from "../uplot/uPlot.esm.js";
import { GAP } from "./history.js";
import { toggle } from "./parts.js";
import { clamp, html, set, signed } from "./shape.js";

/** @typedef {{ span: number, end: number | null }} Span */
/** @typedef {{ at: number, text: string, line: string, font: string, series: string[] }} Palette */
const APART = [2, 5, 10, 20, 40, 60]; // s between vertical lines
const LABEL_WIDTH = 56; // px for the time below a line
const LINE_HEIGHT = 24; // px between horizontal lines, at least
const COLOURS_KEPT = 500; // ms
const SERIES = 5; // number of colours in instruments.css; further lines repeat them
const READ_BY = 0.01; // fraction of the width by which a key moves the cursor
/** @type {Record<string, number>} */
const READ_KEYS = { ArrowLeft: -READ_BY, ArrowRight: READ_BY };

/** Return the number of decimals of the multiples of `by`. @param {number} by */
function digits(by) {
  let count = 0;
  while (Math.abs(Math.round(by * 10 ** count) / 10 ** count - by) > 1e-9 * by) count += 1;
  return count;
}

export class Plot {
  #history;
  #view;
  #least;
  #digits;
  #legend;
  #box = html("div", { class: "drawn", tabindex: 0, role: "img" });
  #when = html("output", { hidden: "" });
  /** @type {uPlot | null} */
  #plot = null;
  #stale = true;
  #drawn = 0;
  /** @type {Palette} */
  #colours = { at: -Infinity, text: "", line: "", font: "", series: [] };

  // history: of the values. channels: indices in it. view: {span, end} [s] of all plots; end is null while they run.
  // least: minimum range of the vertical axis. decimals: decimals of the read-out.
  /**
   * @param {object} options
   * @param {string} options.title @param {import("./history.js").History} options.history
   * @param {number[]} options.channels @param {Span} options.view @param {number} options.least @param {number} options.decimals
   */
  constructor({ title, history, channels, view, least, decimals }) {
    this.#history = history;
    this.#view = view;
    this.#least = least;
    this.#digits = decimals;
    set(this.#box, "aria-label", `${title} over time; arrow keys move a cursor along it`);
    this.#legend = channels.map((channel, i) => this.#entry(channel, i));
    this.element = html("div", { class: "plot" }, this.#box, html("div", { class: "legend" }, ...this.#legend.map(({ button }) => button)));
    this.#box.append(this.#when);
    new ResizeObserver(() => this.#resize()).observe(this.#box);
    this.#listen();
  }
  // Draw again, because something other than time has changed.
  refresh() {
    this.#stale = true;
  }

  draw() {
    const now = performance.now();
    // A plot that would move by less than half a pixel is not drawn again.
    if (!this.#plot || (!this.#stale && now - this.#drawn < (500 * this.#view.span) / this.#plot.width)) return;
    this.#stale = false;
    this.#drawn = now;
    this.#colours = this.#palette(now);
    this.#plot.setData(this.#data());
    this.#read();
  }

  /** @param {number} channel @param {number} i */
  #entry(channel, i) {
    const value = html("output", {}, "–");
    const { label, short = label } = this.#history.channels[channel];
    // The rest of the label is for screen readers: a name has to contain what is seen.
    const name = html("span", {}, html("small", {}, label.slice(0, label.length - short.length)), short);
    const button = toggle([html("i"), name, value], (on) => {
      this.#plot?.setSeries(i + 1, { show: on });
      this.refresh();
    }, { "aria-pressed": true, class: `series-${(i % SERIES) + 1}` });
    return { channel, button, value };
  }

  // The times before the end of the view [s], and the values of each channel; a row without values interrupts the lines.
  #data() {
    const history = this.#history;
    const to = this.#view.end ?? history.newest;
    /** @type {number[]} */
    const times = [];
    const values = this.#legend.map(() => /** @type {(number | null)[]} */ ([]));
    const first = Math.max(history.first, history.at(to - this.#view.span) - 1);
    for (let n = first; n < history.end && history.time(n) <= to; n++) {
      const gap = n > first && history.time(n) - history.time(n - 1) > GAP;
      // Between its ends, so that the times increase.
      for (const time of gap ? [history.time(n) - GAP / 2, history.time(n)] : [history.time(n)]) {
        times.push(time - to);
        this.#legend.forEach(({ channel }, i) => {
          const value = time < history.time(n) ? NaN : history.value(channel, n);
          values[i].push(Number.isNaN(value) ? null : value);
        });
      }
    }
    return /** @type {uPlot.AlignedData} */ ([times, ...values]);
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.#box;
    if (!width || !height) return;
    this.#colours = this.#palette(performance.now());
    if (this.#plot) this.#plot.setSize({ width, height });
    else this.#box.prepend((this.#plot = this.#made(width, height)).root);
    this.refresh();
  }

  /** @param {number} width @param {number} height */
  #made(width, height) {
    const stroke = () => this.#colours.text;
    const grid = { stroke: () => this.#colours.line, width: 1 };
    const { font } = this.#colours;
    return new uPlot({
      width, height, legend: { show: false }, padding: [8, 16, 0, 0],
      cursor: { y: false, drag: { x: false, y: false }, points: { size: 7 } },
      scales: {
        x: { time: false, range: () => [-this.#view.span, 0] },
        y: {
          range: (_, low, high) => {
            const spare = Math.max(this.#least - ((high ?? 0) - (low ?? 0)), 0) / 2;
            return uPlot.rangeNum((low ?? 0) - spare, (high ?? 0) + spare, 0.1, true);
          },
        },
      },
      axes: [
        {
          stroke, grid, font, ticks: { show: false }, size: 20, gap: 4, incrs: APART, space: LABEL_WIDTH,
          values: (_, times) => times.map((time) => t(time < 0 ? `−${-time} s` : this.#view.end === null ? "now" : "paused")),
        },
        {
          stroke, grid, font, ticks: { show: false }, size: 44, gap: 4, space: LINE_HEIGHT,
          values: (_, values, _axis, _space, by) => values.map((value) => t(signed(value, digits(by)))),
        },
      ],
      series: [{}, ...this.#legend.map((_, i) => ({ stroke: () => this.#colours.series[i], width: 1.5, points: { show: false } }))],
      hooks: { setCursor: [() => this.#read()] },
    }, this.#data());
  }

  #listen() {
    this.#box.addEventListener("keydown", (event) => {
      const by = READ_KEYS[event.key];
      const { clientWidth: width = 0 } = this.#plot?.over ?? {};
      if (by === undefined || !width) return;
      event.preventDefault();
      const { left = -1 } = this.#plot?.cursor ?? {};
      this.#plot?.setCursor({ left: clamp((left < 0 ? width : left) + by * width, 0, width), top: 0 });
    });
    this.#box.addEventListener("blur", () => this.#plot?.setCursor({ left: -1, top: -1 }));
    // uPlot follows a mouse alone.
    this.#box.addEventListener("pointermove", ({ pointerType, clientX }) => {
      const plot = this.#plot;
      if (pointerType !== "mouse") plot?.setCursor({ left: clamp(clientX - plot.over.getBoundingClientRect().left, 0, plot.over.clientWidth), top: 0 });
    });
  }

  /** A canvas cannot use CSS variables, so the colours are read from elements that use them. @param {number} now */
  #palette(now) {
    if (now - this.#colours.at < COLOURS_KEPT) return this.#colours;
    const { color, borderTopColor, fontFamily } = getComputedStyle(this.#box);
    const series = this.#legend.map(({ button }) => getComputedStyle(button.firstElementChild ?? button).backgroundColor);
    return { at: now, text: color, line: borderTopColor, font: `11px ${fontFamily}`, series };
  }

  // Show the values at the cursor, or the newest ones.
  #read() {
    const [times, ...values] = this.#plot?.data ?? [[]];
    const read = this.#plot?.cursor.idx ?? null;
    const n = read ?? times.length - 1;
    this.#legend.forEach(({ value }, i) => {
      const number = values[i]?.[n];
      write(value, number == null ? "–" : signed(number, this.#digits));
    });
    this.#when.hidden = read === null;
    if (read !== null) write(this.#when, `${signed(times[n], 2)} s`);
  }
}
