// A handle while a person drags it: how far it is from where it was, in words beside the pointer.
import { sceneIn, write } from "../dom.js";
import { html, signed } from "../instruments/shape.js";
import { placeBeside } from "./place_near.js";

const AXES = ["x", "y", "z"];
const RINGS = ["pitch", "roll", "elbow"]; // nodes whose last word names the turn
const DEGREES = 180 / Math.PI;
const STRAIGHT = 1 - 1e-9; // cosine of a turn from which on it counts as none
const MOVED = 1e-6; // m, below which a handle rests

/**
 * `axis` is its own axis along which it moves, or about which it turns; null before it does. `value` is how far it is
 * from its start, in m or rad.
 * @typedef {object} Drag
 * @property {string} name @property {Three.Matrix4} start @property {number | null} axis @property {boolean} turns
 * @property {number} value
 */

export class Handle {
  #scene;
  #store;
  /** @type {Drag | null} */
  #drag = null;
  /** @type {Page.Pixel} */
  #pixel = [0, 0]; // of the pointer
  #touch = false;
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
  note({ clientX, clientY, pointerType, isPrimary }) {
    if (!isPrimary) return;
    this.#pixel = [clientX, clientY];
    this.#touch = pointerType === "touch";
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
    if (phase === "Start" && start) this.#drag = { name, start, axis: null, turns: false, value: 0 };
    else if (phase === "End") this.drop();
    this.#follow();
  }

  // Forget the drag, which has ended or was ended by something else.
  drop() {
    this.#drag = null;
    this.#draw();
  }

  // Find how far viser's page has moved the handle.
  #follow() {
    const drag = this.#drag;
    const now = drag && sceneIn(this.#scene).node(drag.name)?.matrix;
    if (!now) return;
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
    if (drag.turns) {
      // A ring can be turned by more than half a circle.
      const change = Math.atan2(sines[drag.axis], cosine) - drag.value;
      drag.value += change - 2 * Math.PI * Math.round(change / (2 * Math.PI));
    } else drag.value = shifts[drag.axis];
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
  #words({ name, turns, value }, axis) {
    const ring = name.slice(name.lastIndexOf("/") + 1);
    const what = turns ? (RINGS.includes(ring) ? ring : `about ${AXES[axis]}`) : AXES[axis];
    const number = signed(value * (turns ? DEGREES : 1000));
    return `${what} ${/^[1-9]|^0\.[1-9]/.test(number) ? "+" : ""}${number}${turns ? "°" : " mm"}`;
  }
}
