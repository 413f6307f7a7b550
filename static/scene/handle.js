// A handle while a person drags it: how far it is from where it was, in words beside the pointer. With Ctrl it goes by
// steps, with Shift more finely, and a typed number takes it there. All of it changes the poses of viser's own messages,
// which remain the only commands.
import { sceneIn, write } from "../dom.js";
import { numberBox } from "../instruments/parts.js";
import { html, signed } from "../instruments/shape.js";
import { numberIn } from "../number.js";
import { isMesh } from "./glow.js";
import { placeBeside } from "./place_near.js";

const AXES = ["x", "y", "z"];
const RINGS = ["pitch", "roll", "elbow"]; // nodes whose last word names the turn
const DEGREES = 180 / Math.PI;
const STRAIGHT = 1 - 1e-9; // cosine of a turn from which on it counts as none
const MOVED = 1e-6; // m, below which a handle rests
const STEPS = { move: 0.01, turn: 15 / DEGREES }; // m and rad, with Ctrl
const FINE = 0.2; // fraction of the way of the pointer, with Shift
const SOON = 5000; // ms after a drag in which a typed number belongs to it
const FARTHEST = 1.5; // m; the server takes no larger coordinate
const SIZE = "/size"; // end of the name of a node at a corner of a box, which changes its size
const HINTS = [[SIZE, "Change the size"], ["/turn", "Turn the object"], ["", "Move the object"]]; // by the ends of names
const HANDLES = ["/target/move", "/target/elbow", "/handles"];
const FADED = 0.25; // opacity of the other parts while one is under the pointer or dragged

/**
 * `axis` is its own axis along which it moves, or about which it turns; null before it does. How far it is from its
 * start, in m or rad: `raw` as viser's page moves it, `value` more finely, `shown` by steps too. All of them count from
 * `lengths`, those of a box, otherwise 0. `sent` has the last message of each phase.
 * @typedef {object} Drag
 * @property {string} name @property {Three.Matrix4} start @property {number | null} axis @property {boolean} turns
 * @property {number[]} lengths @property {number} raw @property {number} value @property {number} shown @property {string} drawn
 * @property {Record<string, ViserPage.Message>} sent
 */

/** Put a handle where its drag shows it. @param {Three.Matrix4} matrix @param {Drag} drag */
function put({ elements }, drag) {
  const { start, axis, turns, shown } = drag;
  const [from, k] = [start.elements, axis ?? 0];
  const [a, b, cosine, sine] = [4 * ((k + 1) % 3), 4 * ((k + 2) % 3), Math.cos(shown), Math.sin(shown)];
  from.forEach((element, i) => (elements[i] = element));
  for (let i = 0; i < 3; i++)
    if (turns) {
      elements[a + i] = cosine * from[a + i] + sine * from[b + i];
      elements[b + i] = cosine * from[b + i] - sine * from[a + i];
    } else elements[12 + i] += shown * from[4 * k + i];
  drag.drawn = elements.join();
}

/** Give a message the pose of its node, in its own arrays, because viser's page keeps them too. @param {ViserPage.Message} message @param {Three.Object3D} node */
function take({ position = [], wxyz = [] }, { matrix, quaternion }) {
  const { w, x, y, z } = quaternion.clone().setFromRotationMatrix(matrix);
  position.splice(0, 3, ...matrix.elements.slice(12, 15));
  wxyz.splice(0, 4, w, x, y, z);
}

export class Handle {
  #scene;
  #store;
  /** @type {Drag | null} */
  #drag = null;
  /** @type {Drag | null} */
  #last = null; // the one before, for a number that is typed soon after it
  #ended = 0; // time of its end [ms]
  /** @type {Drag | null} */
  #typed = null; // the one whose number is typed
  #sending = false;
  /** @type {Three.Object3D | null} */
  #lit = null; // the part under the pointer, or that is dragged
  #hint = ""; // what it changes of an object, whose two handles look alike
  /** @type {{ pixel: Page.Pixel, touch: boolean, snaps: boolean, fine: boolean }} */
  #pointer = { pixel: [0, 0], touch: false, snaps: false, fine: false };
  // The state line and the panel say the same to screen readers.
  #label = html("p", { id: "handle-label", class: "scene-label", "aria-hidden": "true", hidden: "" });
  #what = html("label", { for: "handle-number" });
  #number = numberBox({ id: "handle-number", size: 7 });
  #unit = html("span");
  #form = html("form", { id: "handle-form", hidden: "" }, this.#what, this.#number, this.#unit);

  /** @param {HTMLElement} stage @param {HTMLIFrameElement} scene @param {Page.Store} store */
  constructor(stage, scene, store) {
    this.#scene = scene;
    this.#store = store;
    stage.append(this.#label, this.#form);
    store.follow(() => this.#draw());
    this.#form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#enter();
    });
    this.#number.addEventListener("blur", () => this.close());
  }

  // Light the part of a handle that is under the pointer: all other parts fade. A drag keeps its part.
  /** @param {Three.Object3D | null} part */
  light(part) {
    if (this.#drag || part === this.#lit) return;
    this.#lit = part;
    const { drawing, nameOf, node, owner } = sceneIn(this.#scene);
    const handle = owner(part, (object) => /^\/handles\//.test(nameOf(object)));
    this.#hint = handle ? HINTS.find(([end]) => nameOf(handle).endsWith(end))?.[1] ?? "" : "";
    this.#draw();
    /** @type {Three.Mesh[]} */
    const shapes = [];
    for (const name of HANDLES) node(name)?.traverse((object) => void (isMesh(object) && shapes.push(object)));
    const own = new Set();
    part?.traverse((object) => own.add(object));
    const fades = shapes.some((shape) => own.has(shape));
    for (const shape of shapes) shape.material.opacity = fades && !own.has(shape) ? FADED : 1;
    drawing().requestRender();
  }

  /** Note where the pointer is, before viser's page gets the event. @param {PointerEvent} event */
  note(event) {
    const { clientX, clientY, ctrlKey, metaKey, shiftKey, pointerType, isPrimary } = event;
    if (!isPrimary) return;
    this.#pointer = { pixel: [clientX, clientY], touch: pointerType === "touch", snaps: ctrlKey || metaKey, fine: shiftKey };
    // viser's page would turn a ring by steps of its own.
    if (this.#drag) Object.defineProperty(event, "shiftKey", { value: false });
  }

  /** Listen to the pointer after viser's page, which moves the handle. @param {Window} inner */
  listen(inner) {
    inner.addEventListener("pointermove", () => this.#follow());
  }

  /** A message of viser's page about a drag is about to be sent. @param {ViserPage.Message} message */
  hear(message) {
    if (this.#sending) return;
    const { node, phaseOf } = sceneIn(this.#scene);
    const { name = "" } = message;
    const phase = phaseOf(message);
    const handle = node(name);
    if (phase === "Start" && handle)
      this.#drag = { name, start: handle.matrix.clone(), axis: null, turns: false, lengths: lengthsOf(name, handle.matrix), raw: 0, value: 0, shown: 0, drawn: "", sent: {} };
    this.#follow();
    const drag = this.#drag;
    if (!drag || !phase) return;
    drag.sent[phase] = message;
    if (phase === "Update" && handle && drag.shown !== drag.raw) take(message, handle);
    if (phase !== "End") return;
    [this.#drag, this.#last, this.#ended] = [null, drag, performance.now()];
    // A mouse is still there.
    if (this.#pointer.touch) this.light(null);
    this.#draw();
  }

  // Forget the drag, which was ended by something else.
  drop() {
    this.#drag = this.#last = null;
    this.light(null);
    this.close();
  }

  // Close the box of the number.
  close() {
    this.#typed = null;
    this.#form.hidden = true;
    this.#draw();
  }

  /** Open the box of the number with its first key; return whether the event was handled. @param {KeyboardEvent} event */
  key({ key, type, ctrlKey, metaKey, altKey }) {
    const drag = this.#drag ?? (performance.now() - this.#ended < SOON ? this.#last : null);
    if (type !== "keydown" || ctrlKey || metaKey || altKey || !/^[\d-]$/.test(key)) return false;
    if (!drag || drag.axis === null || !drag.sent.Update) return false;
    this.#typed = drag;
    write(this.#what, nameOf(drag, drag.axis));
    write(this.#unit, drag.turns ? "°" : "mm");
    this.#number.value = key;
    this.#number.ariaInvalid = "false";
    this.#form.hidden = false;
    this.#draw();
    placeBeside(this.#form, this.#scene, this.#pointer.pixel, this.#pointer.touch);
    this.#number.focus();
    return true;
  }

  // Send the handle of the drag to the typed number.
  #enter() {
    const drag = this.#typed;
    const { Start, Update, End } = drag?.sent ?? {};
    const { drawing, node, send } = sceneIn(this.#scene);
    const handle = drag && node(drag.name);
    if (!drag || drag.axis === null || !Update || !handle) return this.close();
    const shown = numberIn(this.#number.value) / (drag.turns ? DEGREES : 1000) - drag.lengths[drag.axis];
    const isPossible = Math.abs(shown) <= (drag.turns ? Math.PI : FARTHEST);
    this.#number.ariaInvalid = String(!isPossible);
    if (!isPossible) return;
    drag.value = drag.shown = shown;
    put(handle.matrix, drag);
    take(Update, handle);
    drawing().requestRender();
    this.#sending = true;
    for (const message of drag === this.#drag ? [Update] : [Start, Update, End]) send(message);
    this.#sending = false;
    this.#ended = performance.now();
    this.close();
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
    const [step, length] = [drag.turns ? STEPS.turn : STEPS.move, drag.lengths[drag.axis]];
    drag.raw += by;
    drag.value += this.#pointer.fine ? FINE * by : by;
    drag.shown = this.#pointer.snaps ? step * Math.round((drag.value + length) / step) - length : drag.value;
    if (drag.shown !== drag.raw) put(now, drag);
    else drag.drawn = now.elements.join();
    this.#draw();
  }

  #draw() {
    const drag = this.#drag;
    const isDragged = drag !== null && drag.axis !== null;
    this.#label.hidden = !(isDragged || (!drag && this.#hint)) || this.#typed !== null;
    if (this.#label.hidden) return;
    if (!drag || drag.axis === null) {
      write(this.#label, this.#hint);
      return placeBeside(this.#label, this.#scene, this.#pointer.pixel, this.#pointer.touch);
    }
    const { clearance } = this.#store.live ?? {};
    const near = clearance ? `\n${clearance.distance.toFixed(1)} mm to the ${clearance.parts[1]}` : "";
    const number = signed((drag.shown + drag.lengths[drag.axis]) * (drag.turns ? DEGREES : 1000));
    const plus = /^[1-9]|^0\.[1-9]/.test(number) && !drag.name.endsWith(SIZE) ? "+" : "";
    write(this.#label, `${nameOf(drag, drag.axis)} ${plus}${number}${drag.turns ? "°" : " mm"}${near}`);
    placeBeside(this.#label, this.#scene, this.#pointer.pixel, this.#pointer.touch);
  }
}

/** Return the lengths [m] of the box at whose corner a handle of this pose is, from the middle of its underside; 0 for another. @param {string} name @param {Three.Matrix4} pose */
const lengthsOf = (name, { elements: e }) =>
  [2, 2, 1].map((sides, k) => (name.endsWith(SIZE) ? sides * (e[12] * e[4 * k] + e[13] * e[4 * k + 1] + e[14] * e[4 * k + 2]) : 0));

/** Return the word for what a drag changes. @param {Drag} drag @param {number} axis */
function nameOf({ name, turns }, axis) {
  const ring = name.slice(name.lastIndexOf("/") + 1);
  if (turns) return RINGS.includes(ring) ? ring : `about ${AXES[axis]}`;
  return name.endsWith(SIZE) ? `size ${AXES[axis]}` : AXES[axis];
}
