// The joints in the picture: which link is under the pointer, its highlight, and the bar of the selected
// one. A link that is dragged turns its joint; the pointer's events come from `stage.js`.
import { element, repeating, sceneIn, write } from "../dom.js";
import { button, html, signed } from "../instruments/shape.js";
import { mayDrive } from "../page/lease.js";
import { readState } from "../server.js";
import { Glow, shapesOf } from "./glow.js";
import { Grab } from "./grab.js";
import { placeBeside, placeNear } from "./place_near.js";

const EVERY = 40; // ms between two commands of a drag
const READ = 250; // ms between two reads of the angle in the bar
const STILL = 5; // px, below which a press is a click
const DEGREES = 180 / Math.PI;
const ID = "joint-drag"; // id of the commands of a drag

/**
 * @typedef {object} Drag
 * @property {number} joint @property {number} pointer @property {boolean} touch @property {Page.Pixel} start
 * @property {Page.Pixel} pixel @property {Grab | null} grab @property {number | null} value @property {boolean} moved
 * @property {number} sent @property {number | null} timer @property {number} [revocations] @property {number} [last]
 */

export class Joints {
  #scene;
  #page; // {say, store}
  /** @type {Api.Arm | null} */
  arm = null; // description of the arm, once it is there
  /** @type {number | null} */
  #hovered = null; // number of a joint
  /** @type {number | null} */
  #selected = null;
  /** @type {Drag | null} */
  #drag = null;
  #glow = new Glow();
  #watch = repeating(() => document.hidden || this.#read(), READ);
  #label = html("p", { id: "joint-label", class: "scene-label", hidden: "" });
  #name = html("b");
  #angle = html("output");
  /** @type {HTMLButtonElement[]} */
  #steps;
  #bar;

  /** @param {HTMLElement} stage @param {HTMLIFrameElement} scene @param {Pick<Page.Context, "say" | "store">} page */
  constructor(stage, scene, page) {
    this.#scene = scene;
    this.#page = page;
    /** @param {number} sign */
    const step = (sign) => button("", () => this.#step(sign));
    this.#steps = [step(-1), step(1)];
    const clear = button("×", () => this.select(null), { "aria-label": "Deselect" });
    this.#bar = html(
      "div", { id: "joint", role: "group", "aria-label": "Selected joint", hidden: "" },
      this.#name, this.#steps[0], this.#angle, this.#steps[1], clear,
    );
    stage.append(this.#label, this.#bar);
    element("jog", HTMLElement).addEventListener("change", () => this.#selected !== null && this.#show(this.#selected));
  }

  // Whether some pointer holds a joint.
  get dragging() {
    return this.#drag !== null;
  }

  /** Whether this pointer holds one. @param {number} pointer */
  holds(pointer) {
    return this.#drag?.pointer === pointer;
  }

  /** Return the number of the joint that moves an object of three.js; null without one. @param {Three.Object3D} object */
  of(object) {
    const links = this.arm?.links.map((_, joint) => this.#link(joint)) ?? [];
    const link = sceneIn(this.#scene).owner(object, (part) => links.includes(part));
    return link && links.indexOf(link);
  }

  /** Show that the pointer can take hold of a joint; null for none. @param {number | null} joint @param {Page.Pixel | null} pixel */
  hover(joint, pixel) {
    if (this.#drag) return;
    const shown = mayDrive(this.#page.store.live) ? joint : null;
    if (shown !== this.#hovered) {
      this.#hovered = shown;
      this.#light();
      this.#viewer.canvas.style.cursor = shown === null ? "" : "pointer";
    }
    this.#tell(shown === null ? null : this.#known.links[shown].label, pixel);
  }

  // Whether a press on a joint takes hold of it. A finger, which may turn the camera, takes hold only of
  // the selected one, and so does a person who does not drive: the refusal then has a reason to be shown.
  /** @param {number | null} joint @param {boolean} touch @returns {joint is number} */
  takes(joint, touch) {
    return joint !== null && !this.#drag && (joint === this.#selected || (!touch && mayDrive(this.#page.store.live)));
  }

  // Take hold of a joint at a hit {point} of the ray from a pixel.
  /** @param {number} joint @param {{ point: Three.Vector3 }} hit @param {Page.Pixel} pixel @param {number} pointer @param {boolean} touch */
  async take(joint, { point }, pixel, pointer, touch) {
    /** @type {Drag} */
    const drag = { joint, pointer, touch, start: pixel, pixel, grab: null, value: null, moved: false, sent: 0, timer: null };
    this.#drag = drag;
    const link = this.#link(joint);
    if (!link) return this.drop();
    link.updateWorldMatrix(true, false);
    const state = await readState();
    if (this.#drag !== drag) return;
    if (!state) return this.drop();
    drag.revocations = state.revocations;
    const { links, slides } = this.#known;
    drag.grab = new Grab(this.#viewer, link, point, { axis: links[joint].axis, slides: slides[joint] }, pixel, state.q[joint]);
    this.#follow();
  }

  /** The pointer that holds a joint is at another pixel. @param {Page.Pixel} pixel */
  move(pixel) {
    const drag = this.#drag;
    if (!drag) return;
    drag.pixel = pixel;
    drag.moved ||= Math.hypot(pixel[0] - drag.start[0], pixel[1] - drag.start[1]) >= STILL;
    this.#bar.classList.toggle("away", drag.moved);
    if (drag.grab) this.#follow();
  }

  // Release the joint, which stays there. Return whether it was moved; otherwise it was a click.
  release() {
    const drag = this.#drag;
    if (drag?.moved && drag.grab) this.#send();
    this.drop();
    return Boolean(drag?.moved);
  }

  // End the drag because the pointer is lost: the arm comes to rest.
  lose() {
    if (this.#drag?.sent) this.#page.say({ do: "hold", revocations: this.#drag.revocations });
    this.drop();
  }

  /** Give up a drag whose command was refused; one that came late is sent again. @param {Api.Refused} answer */
  refused({ id, retry }) {
    if (id !== ID) return;
    if (retry && this.#drag) delete this.#drag.last;
    else this.drop();
  }

  // End the drag, and send nothing.
  drop() {
    if (!this.#drag) return;
    clearTimeout(this.#drag.timer ?? undefined);
    this.#drag = null;
    this.#bar.classList.remove("away");
    this.#hovered = null;
    this.#tell(null);
    this.#light();
    this.#viewer.canvas.style.cursor = "";
  }

  #follow() {
    const drag = this.#drag;
    if (!drag?.moved || !drag.grab) return;
    const { joint, grab, pixel, timer, sent } = drag;
    const { lower, upper, links } = this.#known;
    const value = Math.min(upper[joint], Math.max(lower[joint], grab.at(pixel)));
    drag.value = value;
    this.#light();
    this.#viewer.canvas.style.cursor = "grabbing";
    this.#tell(`${links[joint].label} ${this.#words(joint, value)}`, pixel);
    if (!timer) drag.timer = setTimeout(() => this.#send(), Math.max(0, sent + EVERY - performance.now()));
  }

  #send() {
    const drag = this.#drag;
    if (!drag) return;
    const { joint, value, timer, revocations } = drag;
    clearTimeout(timer ?? undefined);
    drag.timer = null;
    if (value === null || value === drag.last) return;
    Object.assign(drag, { sent: performance.now(), last: value });
    this.#page.say({ do: "joint", axis: joint + 1, value, revocations, id: ID });
  }

  /** Select a joint, whose bar is shown near a pixel; null for none. @param {number | null} joint @param {Page.Pixel} pixel */
  select(joint, pixel = [0, 0]) {
    this.#selected = joint;
    this.#bar.hidden = joint === null;
    this.#light();
    if (joint === null) return this.#watch(false);
    this.#angle.textContent = "";
    this.#show(joint);
    placeNear(this.#bar, this.#scene, pixel);
    this.#watch(true);
  }

  /** @param {number} joint */
  #show(joint) {
    const { links, slides } = this.#known;
    const unit = slides[joint] ? " mm" : "°";
    write(this.#name, links[joint].label);
    const size = this.#size();
    this.#steps.forEach((button, i) => {
      const [sign, word] = i ? ["+", "plus"] : ["−", "minus"];
      write(button, `${sign}${size}${unit}`);
      button.setAttribute("aria-label", `${links[joint].label} ${word} ${size}${unit}`);
      button.hidden = this.#page.store.live?.role === "viewer";
    });
  }

  async #read() {
    const joint = this.#selected;
    const state = await readState();
    // viser makes the link again after a lost connection.
    this.#light();
    if (state && joint === this.#selected && joint !== null) write(this.#angle, this.#words(joint, state.q[joint]));
  }

  // Return the step [mm or degrees] that is chosen in Jog, otherwise 1.
  #size() {
    /** @type {HTMLInputElement | null} */
    const chosen = document.querySelector("#jog [name=step]:checked");
    return Number(chosen?.value) || 1;
  }

  /** @param {number} sign */
  #step(sign) {
    const joint = this.#selected;
    if (joint === null) return;
    const by = (sign * this.#size()) / (this.#known.slides[joint] ? 1000 : DEGREES);
    this.#page.say({ do: "nudge", axis: joint + 1, by });
  }

  /** Show words beside a pixel; null for none. @param {string | null} words @param {Page.Pixel | null} pixel */
  #tell(words, pixel = null) {
    this.#label.hidden = words === null;
    if (words === null || !pixel) return;
    write(this.#label, words);
    placeBeside(this.#label, this.#scene, pixel, Boolean(this.#drag?.touch));
  }

  // Highlight the link of the joint that is dragged, under the pointer, or selected.
  #light() {
    const joint = this.#drag?.moved ? this.#drag.joint : this.#hovered ?? this.#selected;
    const links = this.arm?.links.map((_, i) => this.#link(i)) ?? [];
    this.#glow.show(joint === null ? new Set() : shapesOf(links[joint], links));
    sceneIn(this.#scene).viewer()?.requestRender();
  }

  /** @param {number} joint */
  #link(joint) {
    const path = this.#known.links[joint].path.map(encodeURIComponent).join("/");
    return sceneIn(this.#scene).node(`/arm/${path}`);
  }

  /** @param {number} joint @param {number} value */
  #words(joint, value) {
    return this.#known.slides[joint] ? `${signed(1000 * value)} mm` : `${signed(DEGREES * value)}°`;
  }

  // The description of the arm, which is there when a joint is under the pointer.
  get #known() {
    if (!this.arm) throw new Error("The arm is not known yet.");
    return this.arm;
  }

  get #viewer() {
    return sceneIn(this.#scene).drawing();
  }
}
