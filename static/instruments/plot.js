// A plot of some channels over the last seconds, with a cursor for reading.
import { t, write } from "../dom.js";
import { GAP } from "./history.js";
import { toggle } from "./parts.js";
import { digits, scale } from "./scale.js";
import { clamp, html, set, signed } from "./shape.js";

/** @typedef {{ span: number, end: number | null }} Span */
/** @typedef {{ left: number, right: number, top: number, bottom: number }} Box */
/** @typedef {(value: number) => number} Place */
/** @typedef {{ at: number, text: string, line: string, font: string, series: string[] }} Palette */
/** @typedef {{ low: number, high: number, by: number }} Axis */
const MARGIN = { left: 42, right: 8, top: 8, bottom: 18 }; // px
const LINE_HEIGHT = 24; // px between horizontal lines, about
/** @type {Record<number, number>} */
const APART = { 10: 2, 30: 5, 120: 20 }; // s between vertical lines, for each span
const LABEL_WIDTH = 56; // px for the time below a line; the outermost labels are not centred
const COLOURS_KEPT = 500; // ms
const SERIES = 5; // number of colours in instruments.css; further lines repeat them
const READ_BY = 0.01; // fraction of the width by which a key moves the cursor
/** @type {Record<string, number>} */
const READ_KEYS = { ArrowLeft: -READ_BY, ArrowRight: READ_BY };

export class Plot {
  #history;
  #view;
  #least;
  #digits;
  #legend;
  #canvas = html("canvas", { tabindex: 0, role: "img" });
  #size = { width: 0, height: 0 };
  /** @type {number | null} */
  #cursor = null; // fraction of the width
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
    set(this.#canvas, "aria-label", `${title} over time; arrow keys move a cursor along it`);
    this.#legend = channels.map((channel, i) => this.#entry(channel, i));
    this.element = html(
      "div",
      { class: "plot" },
      this.#canvas,
      html("div", { class: "legend" }, ...this.#legend.map(({ button }) => button)),
    );
    this.#listen();
  }

  // Draw again, because something other than time has changed.
  refresh() {
    this.#stale = true;
  }

  draw() {
    const now = performance.now();
    const { width, height } = this.#size;
    // A plot that would move by less than half a pixel is not drawn again.
    if (!this.#stale && now - this.#drawn < (500 * this.#view.span) / Math.max(1, width)) return;
    if (!width || !height) return;
    this.#stale = false;
    this.#drawn = now;
    this.#paint();
  }

  /** @param {number} channel @param {number} i */
  #entry(channel, i) {
    const value = html("output", {}, "–");
    const { label, short = label } = this.#history.channels[channel];
    // The rest of the label is for screen readers: a name has to contain what is seen.
    const name = html("span", {}, html("small", {}, label.slice(0, label.length - short.length)), short);
    const button = toggle([html("i"), name, value], () => this.refresh(), { "aria-pressed": true, class: `series-${(i % SERIES) + 1}` });
    return { channel, button, value };
  }

  #listen() {
    const canvas = this.#canvas;
    new ResizeObserver(() => {
      const { clientWidth, clientHeight } = canvas;
      this.#size = { width: clientWidth, height: clientHeight };
      canvas.width = Math.round(clientWidth * devicePixelRatio);
      canvas.height = Math.round(clientHeight * devicePixelRatio);
      this.refresh();
    }).observe(canvas);
    /** @param {number | null} fraction */
    const read = (fraction) => {
      this.#cursor = fraction === null ? null : clamp(fraction, 0, 1);
      this.refresh();
    };
    /** @param {PointerEvent} event */
    const across = ({ offsetX }) => (offsetX - MARGIN.left) / (this.#size.width - MARGIN.left - MARGIN.right);
    canvas.addEventListener("pointermove", (event) => read(across(event)));
    canvas.addEventListener("pointerdown", (event) => read(across(event)));
    canvas.addEventListener("pointerleave", () => read(null));
    canvas.addEventListener("blur", () => read(null));
    canvas.addEventListener("keydown", (event) => {
      const by = READ_KEYS[event.key];
      if (by === undefined) return;
      event.preventDefault();
      read((this.#cursor ?? 1) + by);
    });
  }

  /** A canvas cannot use CSS variables, so the colours are read from elements that use them. @param {number} now */
  #palette(now) {
    if (now - this.#colours.at < COLOURS_KEPT) return this.#colours;
    const { color, borderTopColor, fontFamily } = getComputedStyle(this.#canvas);
    const series = this.#legend.map(({ button }) => getComputedStyle(button.firstElementChild ?? button).backgroundColor);
    this.#colours = { at: now, text: color, line: borderTopColor, font: `11px ${fontFamily}`, series };
    return this.#colours;
  }

  #paint() {
    const to = this.#view.end ?? this.#history.newest;
    const from = to - this.#view.span;
    const shown = this.#legend.map(({ button }) => button.getAttribute("aria-pressed") === "true");
    const axis = this.#scale(from, to, shown);
    const pen = this.#canvas.getContext("2d");
    if (!pen) return;
    const { width, height } = this.#size;
    const box = {
      left: MARGIN.left, right: width - MARGIN.right, top: MARGIN.top, bottom: height - MARGIN.bottom,
    };
    /** @type {Place} */
    const x = (t) => box.left + ((t - from) / (to - from)) * (box.right - box.left);
    /** @type {Place} */
    const y = (value) => box.bottom - ((value - axis.low) / (axis.high - axis.low)) * (box.bottom - box.top);
    const colours = this.#palette(this.#drawn);
    pen.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    pen.clearRect(0, 0, width, height);
    this.#grid(pen, box, axis, y, colours);
    pen.save();
    pen.beginPath();
    pen.rect(box.left, box.top - 2, box.right - box.left, box.bottom - box.top + 4);
    pen.clip();
    pen.lineWidth = 1.5;
    pen.lineJoin = "round";
    if (this.#history.end)
      this.#legend.forEach(({ channel }, i) => shown[i] && this.#trace(pen, channel, colours.series[i], from, to, x, y));
    pen.restore();
    this.#readOut(pen, box, from, to, x, y, shown, colours);
  }

  /** @param {number} from @param {number} to @param {boolean[]} shown */
  #scale(from, to, shown) {
    let [low, high] = [Infinity, -Infinity];
    for (let n = this.#history.at(from); n < this.#history.end && this.#history.time(n) <= to; n += 1)
      this.#legend.forEach(({ channel }, i) => {
        const value = this.#history.value(channel, n);
        if (!shown[i] || Number.isNaN(value)) return;
        low = Math.min(low, value);
        high = Math.max(high, value);
      });
    const lines = Math.max(2, this.#size.height / LINE_HEIGHT);
    return low <= high ? scale(low, high, this.#least, lines) : scale(0, 0, this.#least, lines);
  }

  /** @param {CanvasRenderingContext2D} pen @param {Box} box @param {Axis} axis @param {Place} y @param {Palette} palette */
  #grid(pen, box, axis, y, { text, line, font }) {
    const { span, end } = this.#view;
    pen.strokeStyle = line;
    pen.fillStyle = text;
    pen.font = font;
    pen.lineWidth = 1;
    pen.beginPath();
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (let k = 0; axis.low + k * axis.by <= axis.high + axis.by / 2; k += 1) {
      const value = axis.low + k * axis.by;
      const at = Math.round(y(value)) + 0.5;
      pen.moveTo(box.left, at);
      pen.lineTo(box.right, at);
      pen.fillText(t(signed(value, digits(axis.by))), box.left - 6, at);
    }
    pen.textBaseline = "alphabetic";
    const room = ((box.right - box.left) * APART[span]) / span;
    const labelled = APART[span] * Math.ceil(LABEL_WIDTH / room);
    for (let back = 0; back <= span; back += APART[span]) {
      const at = Math.round(box.right - ((box.right - box.left) * back) / span) - 0.5;
      pen.moveTo(at, box.top);
      pen.lineTo(at, box.bottom);
      if (back % labelled) continue;
      pen.textAlign = back === 0 ? "right" : back === span ? "left" : "center";
      pen.fillText(t(back > 0 ? `−${back} s` : end === null ? "now" : "paused"), at, box.bottom + 14);
    }
    pen.stroke();
  }

  // If there are more samples than pixels, draw the minimum and the maximum of each few.
  /**
   * @param {CanvasRenderingContext2D} pen @param {number} channel @param {string} colour @param {number} from
   * @param {number} to @param {Place} x @param {Place} y
   */
  #trace(pen, channel, colour, from, to, x, y) {
    const history = this.#history;
    const first = Math.max(history.first, history.at(from) - 1);
    const end = Math.min(history.end, history.at(to) + 1);
    const few = Math.max(1, Math.floor((end - first) / this.#size.width));
    let before = -Infinity;
    pen.strokeStyle = colour;
    pen.beginPath();
    for (let n = first - (first % few); n < end; n += few) {
      let [low, high] = [-1, -1];
      for (let k = Math.max(n, first); k < Math.min(n + few, end); k += 1) {
        const value = history.value(channel, k);
        if (Number.isNaN(value)) continue;
        if (low < 0 || value < history.value(channel, low)) low = k;
        if (high < 0 || value > history.value(channel, high)) high = k;
      }
      if (low < 0) continue;
      for (const k of low === high ? [low] : [Math.min(low, high), Math.max(low, high)]) {
        const t = history.time(k);
        const height = y(history.value(channel, k));
        if (t - before > GAP) pen.moveTo(x(t), height);
        else pen.lineTo(x(t), height);
        before = t;
      }
    }
    pen.stroke();
  }

  /**
   * @param {CanvasRenderingContext2D} pen @param {Box} box @param {number} from @param {number} to @param {Place} x
   * @param {Place} y @param {boolean[]} shown @param {Palette} palette
   */
  #readOut(pen, box, from, to, x, y, shown, { text, line, series }) {
    const history = this.#history;
    const read = this.#cursor !== null && history.end > 0;
    const n = history.nearest(read ? from + (this.#cursor ?? 0) * (to - from) : to);
    this.#legend.forEach(({ channel, value }) => {
      const number = n < 0 ? NaN : history.value(channel, n);
      write(value, Number.isNaN(number) ? "–" : signed(number, this.#digits));
    });
    if (!read || n < 0 || history.time(n) < from) return;
    const at = x(history.time(n));
    pen.strokeStyle = text;
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(at, box.top);
    pen.lineTo(at, box.bottom);
    pen.stroke();
    this.#legend.forEach(({ channel }, i) => {
      if (!shown[i]) return;
      pen.fillStyle = series[i];
      pen.beginPath();
      pen.arc(at, y(history.value(channel, n)), 3.5, 0, 2 * Math.PI);
      pen.fill();
    });
    const words = t(`${signed(history.time(n) - to, 2)} s`);
    const wide = pen.measureText(words).width + 10;
    const left = clamp(at - wide / 2, box.left, box.right - wide);
    pen.fillStyle = line;
    pen.fillRect(left, box.bottom + 3, wide, 15);
    pen.fillStyle = text;
    pen.textAlign = "left";
    pen.fillText(words, left + 5, box.bottom + 14);
  }
}
