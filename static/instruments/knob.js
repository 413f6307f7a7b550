// A knob: an arc for the range, a pointer for the goal, a mark for the value of the arm.
import { write } from "../dom.js";
import { arc, onDial } from "./parts.js";
import { clamp, drawing, html, set, svg } from "./shape.js";

/**
 * @typedef {object} KnobOptions
 * @property {string} title @property {number} low @property {number} high @property {number} step @property {number} [full]
 * @property {(value: number) => string} text @property {import("./command.js").Command} command
 */
const RING = 47;
const MAX_TURN = 330; // degrees, maximum range of a dial
const DEAD = 10; // px, radius round the middle where the direction is ignored
const FINE = 0.1; // fraction of a step with Shift
const PAGE = 10; // steps
const SHAKEN = 600; // ms for which a refused knob is marked

export class Knob {
  #range;
  #text;
  #step;
  #command;
  #turn; // {of, back}: value to degrees on the dial, and degrees to value
  /** @type {{ pointer: number, angle: number | null } | null} */
  #held = null; // {pointer, angle} during a drag
  /** @type {number | null} */
  #goal = null;
  #now = 0;
  #parts;

  // low, high, step: range and step of the value. full: degrees on the dial per unit; without it the
  // range fills the dial. text: returns the text of a value. command: the Command that sends values.
  /** @param {KnobOptions} options */
  constructor({ title, low, high, step, full, text, command }) {
    this.#range = [low, high];
    this.#step = step;
    this.#text = text;
    this.#command = command;
    const scale = Math.min(full ?? Infinity, (full ? MAX_TURN : 270) / (high - low));
    const middle = full ? 0 : (low + high) / 2;
    this.#turn = { of: (/** @type {number} */ value) => (value - middle) * scale, back: (/** @type {number} */ degrees) => degrees / scale };
    const limits = [low, high].map((limit) => onDial(RING, this.#turn.of(limit)));
    const way = svg("path", { class: "way" });
    const pointer = svg("line", { class: "pointer", y1: -29, y2: -35 });
    const mark = svg("circle", { class: "mark", cy: -RING, r: 5 });
    const goal = html("output", { class: "goal" }, "–");
    const now = html("span", { class: "now" });
    this.#parts = { way, pointer, mark, goal, now };
    const range = svg("path", { class: "range", d: arc(RING, this.#turn.of(low), this.#turn.of(high)) });
    const ends = limits.map(([x, y]) => svg("circle", { class: "limit", cx: x.toFixed(2), cy: y.toFixed(2), r: 4 }));
    const picture = drawing("-53 -53 106 106", range, ...ends, way, svg("circle", { class: "cap", r: 40 }), pointer, mark);
    const values = { "aria-valuemin": low, "aria-valuemax": high, "aria-orientation": "horizontal" };
    this.dial = html("div", { class: "dial", role: "slider", tabindex: 0, "aria-label": title, ...values }, picture, html("div", { class: "read" }, goal, now));
    this.element = html("div", { class: "knob" }, this.dial);
    this.#listen();
  }

  /** Show the goal and the value of the arm in `state`. @param {Api.State} state @param {number} goal @param {number} now */
  take(state, goal, now) {
    this.#now = now;
    // A turn that began before a stop is void after it.
    if (this.#held === null) this.#command.revocations = state.revocations;
    if (this.#held === null && this.#command.heededIn(state)) this.#goal = goal;
    this.#draw();
  }

  /** @param {Api.Done | Api.Refused} message */
  answered(message) {
    if (message.is !== "refused") return this.#command.done(message);
    const { retry } = message;
    // A value that came late is sent again while the hand still holds the knob.
    if (retry && this.#held) {
      this.#command.done({});
      setTimeout(() => this.#held && this.#command.send(this.#goal ?? 0), 1000 * retry);
      return;
    }
    this.spring();
    this.element.classList.add("refused");
    setTimeout(() => this.element.classList.remove("refused"), SHAKEN);
  }

  // Return to the state of the arm: end the drag and drop pending requests.
  spring() {
    this.#held = null;
    this.#command.forget();
    this.dial.classList.remove("held");
  }

  /** @param {number} value */
  #request(value) {
    const [low, high] = this.#range;
    const target = clamp(value, low, high);
    if (target === this.#goal) return;
    this.#goal = target;
    this.#command.send(target);
    this.#draw();
  }

  /** @param {number} count @param {boolean} fine */
  #notch(count, fine) {
    const by = this.#step * (fine ? FINE : 1);
    if (this.#goal !== null) this.#request(Math.round((this.#goal + count * by) / by) * by);
  }

  #listen() {
    const { dial } = this;
    /** @param {PointerEvent} event */
    const angle = ({ clientX, clientY }) => {
      const { left, top, width, height } = dial.getBoundingClientRect();
      const [x, y] = [clientX - left - width / 2, clientY - top - height / 2];
      return Math.hypot(x, y) < DEAD ? null : (Math.atan2(x, -y) * 180) / Math.PI;
    };
    dial.addEventListener("pointerdown", (event) => {
      if (event.button || this.#goal === null || this.#held) return;
      dial.setPointerCapture(event.pointerId);
      dial.classList.add("held");
      this.#held = { pointer: event.pointerId, angle: angle(event) };
    });
    // The knob turns by the same angle as the pointer, so a mere touch moves nothing.
    dial.addEventListener("pointermove", (event) => {
      if (event.pointerId !== this.#held?.pointer || this.#goal === null) return;
      const [before, now] = [this.#held.angle, angle(event)];
      this.#held.angle = now ?? before;
      if (before === null || now === null) return;
      const by = ((now - before + 540) % 360) - 180;
      this.#request(this.#goal + this.#turn.back(by) * (event.shiftKey ? FINE : 1));
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"])
      dial.addEventListener(end, () => {
        this.#held = null;
        dial.classList.remove("held");
      });
    // The wheel works only with the focus, so that scrolling past does not move the arm.
    dial.addEventListener(
      "wheel",
      (event) => {
        if (document.activeElement !== dial || event.deltaY === 0) return;
        event.preventDefault();
        this.#notch(-Math.sign(event.deltaY), event.shiftKey);
      },
      { passive: false },
    );
    /** Home and End are left out: a single key would move the arm to a limit. @type {Record<string, number>} */
    const keys = {
      ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: PAGE, PageDown: -PAGE,
    };
    dial.addEventListener("keydown", (event) => {
      if (!(event.key in keys) || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      this.#notch(keys[event.key], event.shiftKey);
    });
  }

  #draw() {
    const { way, pointer, mark, goal, now } = this.#parts;
    if (this.#goal === null) return;
    const [to, from] = [this.#goal, this.#now].map(this.#turn.of);
    const [target, is] = [this.#goal, this.#now].map(this.#text);
    set(pointer, "transform", `rotate(${to.toFixed(2)})`);
    set(mark, "transform", `rotate(${from.toFixed(2)})`);
    set(way, "d", Math.abs(to - from) < 0.2 ? "" : arc(RING, from, to));
    write(goal, target);
    write(now, target === is ? "" : is);
    set(this.dial, "aria-valuenow", this.#goal.toFixed(2));
    set(this.dial, "aria-valuetext", target === is ? target : `${target}, now ${is}`);
  }
}
