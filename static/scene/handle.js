// A handle while a person drags it: how far it is from where it was, in words beside the pointer. With Ctrl it goes by
// steps, with Shift more finely. Both change the poses of viser's own messages, which remain the only commands.
import { sceneIn, write } from "../dom.js";
import { html, signed } from "../instruments/shape.js";
import { placeBeside } from "./place_near.js";

const AXES = ["x", "y", "z"];
const RINGS = ["pitch", "roll", "elbow"]; // nodes whose last word names the turn
const DEGREES = 180 / Math.PI;
const STRAIGHT = 1 - 1e-9; // cosine of a turn from which on it counts as none
const MOVED = 1e-6; // m, below which a handle rests
const STEPS = { move: 0.01, turn: 15 / DEGREES }; // m and rad, with Ctrl
const FINE = 0.2; // fraction of the way of the pointer, with Shift

/**
 * `axis` is its own axis along which it moves, or about which it turns; null before it does. How far it is from its
 * start, in m or rad: `raw` as viser's page moves it, `value` more finely, `shown` by steps too.
 * @typedef {object} Drag
 * @property {string} name @property {Three.Matrix4} start @property {number | null} axis @property {boolean} turns
 * @property {number} raw @property {number} value @property {number} shown @property {string} drawn
 */

/** Place a handle where its drag shows it. @param {Three.Matrix4} matrix @param {Drag} drag */
function place({ elements }, { start, axis, turns, shown }) {
  const [from, k] = [start.elements, axis ?? 0];
  const [a, b, cosine, sine] = [4 * ((k + 1) % 3), 4 * ((k + 2) % 3), Math.cos(shown), Math.sin(shown)];
  from.forEach((element, i) => (elements[i] = element));
  for (let i = 0; i < 3; i++)
    if (turns) {
      elements[a + i] = cosine * from[a + i] + sine * from[b + i];
      elements[b + i] = cosine * from[b + i] - sine * from[a + i];
    } else elements[12 + i] += shown * from[4 * k + i];
}

/** Change the pose of a message in itself, because viser's page keeps the same arrays. @param {ViserPage.Message} message @param {Drag} drag @param {number} by */
function change({ position = [], wxyz = [] }, { start, axis, turns }, by) {
  if (axis === null || by === 0) return;
  if (!turns) {
    position.forEach((x, i) => (position[i] = x + by * start.elements[4 * axis + i]));
    return;
  }
  const [cosine, sine] = [Math.cos(by / 2), Math.sin(by / 2)];
  const [k, a, b] = [1 + axis, 1 + ((axis + 1) % 3), 1 + ((axis + 2) % 3)];
  const q = [...wxyz];
  wxyz[0] = q[0] * cosine - q[k] * sine;
  wxyz[k] = q[k] * cosine + q[0] * sine;
  wxyz[a] = q[a] * cosine + q[b] * sine;
  wxyz[b] = q[b] * cosine - q[a] * sine;
}

export class Handle {
  #scene;
  #store;
  /** @type {Drag | null} */
  #drag = null;
  /** @type {Page.Pixel} */
  #pixel = [0, 0]; // of the pointer
  #touch = false;
  #snaps = false;
  #fine = false;
  // The state line and the panel say the same to screen readers.
  #label = html("p", { id: "handle-label", class: "scene-label", "aria-hidden": "true", hidden: "" });

  /** @param {HTMLElement} stage @param {HTMLIFrameElement} scene @param {Page.Store} store */
  constructor(stage, scene, store) {
    this.#scene = scene;
    this.#store = store;
    stage.append(this.#label);
    store.follow(() => this.#draw());
  }

  /** Note where the pointer is, before viser's page gets the event. @param {PointerEvent} event */
  note(event) {
    if (!event.isPrimary) return;
    this.#pixel = [event.clientX, event.clientY];
    this.#touch = event.pointerType === "touch";
    this.#snaps = event.ctrlKey || event.metaKey;
    this.#fine = event.shiftKey;
    // viser's page would turn a ring by steps of its own.
    if (this.#drag) Object.defineProperty(event, "shiftKey", { value: false });
  }

  /** Listen to the pointer after viser's page, which moves the handle. @param {Window} inner */
  listen(inner) {
    inner.addEventListener("pointermove", () => this.#follow());
  }

  /** A message of viser's page about a drag is about to be sent. @param {ViserPage.Message} message */
  hear(message) {
    const { node, phaseOf } = sceneIn(this.#scene);
    const { name = "" } = message;
    const phase = phaseOf(message);
    const start = node(name)?.matrix.clone();
    if (phase === "Start" && start) this.#drag = { name, start, axis: null, turns: false, raw: 0, value: 0, shown: 0, drawn: "" };
    else if (phase === "End") this.drop();
    this.#follow();
    if (phase === "Update" && this.#drag) change(message, this.#drag, this.#drag.shown - this.#drag.raw);
  }

  // Forget the drag, which has ended or was ended by something else.
  drop() {
    this.#drag = null;
    this.#draw();
  }

  // Find how far viser's page has moved the handle, and draw it where it is sent to.
  #follow() {
    const drag = this.#drag;
    const now = drag && sceneIn(this.#scene).node(drag.name)?.matrix;
    // viser's page has not moved it since it was drawn here.
    if (!now || now.elements.join() === drag.drawn) return;
    const e = drag.start.clone().invert().multiply(now).elements;
    const shifts = [e[12], e[13], e[14]];
    const sines = [e[6] - e[9], e[8] - e[2], e[1] - e[4]].map((twice) => twice / 2);
    const cosine = (e[0] + e[5] + e[10] - 1) / 2;
    if (drag.axis === null) {
      drag.turns = cosine < STRAIGHT;
      const sizes = (drag.turns ? sines : shifts).map(Math.abs);
      if (!drag.turns && Math.max(...sizes) < MOVED) return;
      drag.axis = sizes.indexOf(Math.max(...sizes));
    }
    let by = (drag.turns ? Math.atan2(sines[drag.axis], cosine) : shifts[drag.axis]) - drag.raw;
    // A ring can be turned by more than half a circle.
    if (drag.turns) by -= 2 * Math.PI * Math.round(by / (2 * Math.PI));
    const step = drag.turns ? STEPS.turn : STEPS.move;
    drag.raw += by;
    drag.value += this.#fine ? FINE * by : by;
    drag.shown = this.#snaps ? step * Math.round(drag.value / step) : drag.value;
    if (drag.shown !== drag.raw) place(now, drag);
    drag.drawn = now.elements.join();
    this.#draw();
  }

  #draw() {
    const drag = this.#drag;
    this.#label.hidden = !drag || drag.axis === null;
    if (!drag || drag.axis === null) return;
    const { clearance } = this.#store.live ?? {};
    const near = clearance ? `\n${clearance.distance.toFixed(1)} mm to the ${clearance.parts[1]}` : "";
    write(this.#label, `${this.#words(drag, drag.axis)}${near}`);
    placeBeside(this.#label, this.#scene, this.#pixel, this.#touch);
  }

  /** @param {Drag} drag @param {number} axis */
  #words({ name, turns, shown }, axis) {
    const ring = name.slice(name.lastIndexOf("/") + 1);
    const what = turns ? (RINGS.includes(ring) ? ring : `about ${AXES[axis]}`) : AXES[axis];
    const number = signed(shown * (turns ? DEGREES : 1000));
    return `${what} ${/^[1-9]|^0\.[1-9]/.test(number) ? "+" : ""}${number}${turns ? "°" : " mm"}`;
  }
}
