// The joints in the picture: which link is under the pointer, its highlight, and the bar of the selected
// one. A link that is dragged turns its joint; the pointer's events come from `stage.js`.
import { html, signed, write } from "../instruments/shape.js";
import { Glow, shapesOf } from "./glow.js";
import { Grab } from "./grab.js";

const EVERY = 40; // ms between two commands of a drag
const READ = 250; // ms between two reads of the angle in the bar
const STILL = 5; // px, below which a press is a click
const ABOVE = 60; // px from the click to the bar, so that a finger does not cover it
const EDGE = 8; // px between the bar and the edge of the scene
const DEGREES = 180 / Math.PI;
const ID = "joint-drag"; // id of the commands of a drag

export class Joints {
  #scene;
  #page; // {say, toast, status}
  arm = null; // description of the arm, once it is there
  #hovered = null; // number of a joint
  #selected = null;
  #drag = null; // {joint, pointer, pixel, grab, value, sent, timer, revocations}
  #glow = new Glow();
  #timer = null;
  #label = html("p", { id: "joint-label", class: "scene-label", hidden: "" });
  #name = html("b");
  #angle = html("output");
  #steps;
  #bar;

  constructor(stage, scene, page) {
    this.#scene = scene;
    this.#page = page;
    const step = (sign) => {
      const button = html("button", { type: "button" });
      button.addEventListener("click", () => this.#step(sign));
      return button;
    };
    this.#steps = [step(-1), step(1)];
    const clear = html("button", { type: "button", "aria-label": "Deselect" }, "×");
    clear.addEventListener("click", () => this.select(null));
    this.#bar = html(
      "div", { id: "joint", role: "group", "aria-label": "Selected joint", hidden: "" },
      this.#name, this.#steps[0], this.#angle, this.#steps[1], clear,
    );
    stage.append(this.#label, this.#bar);
    document.getElementById("jog").addEventListener("change", () => this.#selected !== null && this.#show());
  }

  // Whether some pointer holds a joint.
  get dragging() {
    return this.#drag !== null;
  }

  // Whether this pointer holds one.
  holds(pointer) {
    return this.#drag?.pointer === pointer;
  }

  // Return the number of the joint that moves an object of three.js; null without one.
  of(object) {
    const links = this.arm?.links.map((_, joint) => this.#link(joint)) ?? [];
    for (let each = object; each; each = each.parent) {
      const joint = links.indexOf(each);
      if (joint >= 0) return joint;
    }
    return null;
  }

  // Show that the pointer can take hold of a joint; null for none.
  hover(joint, pixel) {
    if (this.#drag) return;
    const shown = this.#mayDrive() ? joint : null;
    if (shown !== this.#hovered) {
      this.#hovered = shown;
      this.#light();
      this.#viewer.canvas.style.cursor = shown === null ? "" : "pointer";
    }
    this.#tell(shown === null ? null : this.arm.links[shown].label, pixel);
  }

  // Whether a press on a joint takes hold of it. A finger, which may turn the camera, takes hold only of
  // the selected one, and so does a person who does not drive: the refusal then has a reason to be shown.
  takes(joint, touch) {
    return joint !== null && !this.#drag && (joint === this.#selected || (!touch && this.#mayDrive()));
  }

  // Take hold of a joint at a hit {point} of the ray from a pixel.
  async take(joint, { point }, pixel, pointer, touch) {
    const drag = { joint, pointer, touch, start: pixel, pixel, grab: null, value: null, moved: false, sent: 0, timer: null };
    this.#drag = drag;
    const viewer = this.#viewer;
    const { axis } = this.arm.links[joint];
    const slides = this.arm.slides[joint];
    const link = this.#link(joint);
    link.updateWorldMatrix(true, false);
    // The geometry at the press, before the answer comes.
    const made = (value) => new Grab(viewer, link, point, { axis, slides }, pixel, value);
    const state = await this.#state();
    if (this.#drag !== drag) return;
    if (!state) return this.drop();
    drag.revocations = state.revocations;
    drag.grab = made(state.q[joint]);
    this.#follow();
  }

  // The pointer that holds a joint is at another pixel.
  move(pixel) {
    const drag = this.#drag;
    drag.pixel = pixel;
    drag.moved ||= Math.hypot(pixel[0] - drag.start[0], pixel[1] - drag.start[1]) >= STILL;
    this.#bar.classList.toggle("away", drag.moved);
    if (drag.grab) this.#follow();
  }

  // Release the joint, which stays there. Return whether it was moved; otherwise it was a click.
  release() {
    const drag = this.#drag;
    if (drag.moved && drag.grab) this.#send();
    this.drop();
    return drag.moved;
  }

  // End the drag because the pointer is lost: the arm comes to rest.
  lose() {
    if (this.#drag?.sent) this.#page.say({ do: "hold", revocations: this.#drag.revocations });
    this.drop();
  }

  // Give up a drag whose command was refused.
  refused({ id }) {
    if (id === ID) this.drop();
  }

  // End the drag, and send nothing.
  drop() {
    if (!this.#drag) return;
    clearTimeout(this.#drag.timer);
    this.#drag = null;
    this.#bar.classList.remove("away");
    this.#hovered = null;
    this.#tell(null);
    this.#light();
    this.#viewer.canvas.style.cursor = "";
  }

  #follow() {
    const { joint, grab, pixel, moved, timer, sent } = this.#drag;
    if (!moved) return;
    const { lower, upper, links } = this.arm;
    const value = Math.min(upper[joint], Math.max(lower[joint], grab.at(pixel)));
    this.#drag.value = value;
    this.#light();
    this.#viewer.canvas.style.cursor = "grabbing";
    this.#tell(`${links[joint].label} ${this.#words(joint, value)}`, pixel);
    if (!timer) this.#drag.timer = setTimeout(() => this.#send(), Math.max(0, sent + EVERY - performance.now()));
  }

  #send() {
    const { joint, value, timer, revocations } = this.#drag;
    clearTimeout(timer);
    this.#drag.timer = null;
    if (value === null || value === this.#drag.last) return;
    Object.assign(this.#drag, { sent: performance.now(), last: value });
    this.#page.say({ do: "joint", axis: joint + 1, value, revocations, id: ID });
  }

  // Select a joint, whose bar is shown near a pixel; null for none.
  select(joint, pixel) {
    this.#selected = joint;
    clearInterval(this.#timer);
    this.#bar.hidden = joint === null;
    this.#light();
    if (joint === null) return;
    this.#angle.textContent = "";
    this.#show();
    this.#place(pixel);
    this.#read();
    this.#timer = setInterval(() => document.hidden || this.#read(), READ);
  }

  #show() {
    const joint = this.#selected;
    const { links, slides } = this.arm;
    const unit = slides[joint] ? " mm" : "°";
    write(this.#name, links[joint].label);
    const size = this.#size();
    for (const [button, sign, word] of [[this.#steps[0], "−", "minus"], [this.#steps[1], "+", "plus"]]) {
      write(button, `${sign}${size}${unit}`);
      button.setAttribute("aria-label", `${links[joint].label} ${word} ${size}${unit}`);
      button.hidden = this.#page.status()?.role === "viewer";
    }
  }

  async #read() {
    const joint = this.#selected;
    const state = await this.#state();
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

  #step(sign) {
    const joint = this.#selected;
    const by = (sign * this.#size()) / (this.arm.slides[joint] ? 1000 : DEGREES);
    this.#page.say({ do: "nudge", axis: joint + 1, by });
  }

  // Put the bar above a pixel, inside the scene. It stays there, so that its buttons can be pressed again.
  #place([x, y]) {
    const { offsetLeft, offsetTop } = this.#scene;
    const { left, top, width } = this.#viewer.canvas.getBoundingClientRect();
    const inside = (at, size, from, room) => Math.max(from + EDGE, Math.min(at, from + room - size - EDGE));
    const { offsetWidth, offsetHeight } = this.#bar;
    const above = y - ABOVE - offsetHeight;
    this.#bar.style.left = `${offsetLeft + inside(x - offsetWidth / 2, offsetWidth, left, width)}px`;
    this.#bar.style.top = `${offsetTop + (above < top + EDGE ? y + ABOVE : above)}px`;
  }

  // Show words beside a pixel; null for none.
  #tell(words, pixel) {
    this.#label.hidden = words === null;
    if (words === null) return;
    write(this.#label, words);
    const { offsetLeft, offsetTop } = this.#scene;
    const { width } = this.#viewer.canvas.getBoundingClientRect();
    const down = this.#drag?.touch ? -ABOVE : 14;
    const right = pixel[0] + 18 + this.#label.offsetWidth > width;
    this.#label.style.left = `${offsetLeft + pixel[0] + (right ? -12 - this.#label.offsetWidth : 18)}px`;
    this.#label.style.top = `${offsetTop + pixel[1] + down}px`;
  }

  // Highlight the link of the joint that is dragged, under the pointer, or selected.
  #light() {
    const joint = this.#drag?.moved ? this.#drag.joint : this.#hovered ?? this.#selected;
    const links = this.arm?.links.map((_, each) => this.#link(each)) ?? [];
    this.#glow.show(joint === null ? new Set() : shapesOf(links[joint], links));
    this.#viewer?.requestRender();
  }

  #link(joint) {
    const path = this.arm.links[joint].path.map(encodeURIComponent).join("/");
    return this.#scene.contentWindow.katanaScene.node(`/arm/${path}`);
  }

  #words(joint, value) {
    const [number, unit] = this.arm.slides[joint] ? [1000 * value, " mm"] : [DEGREES * value, "°"];
    return signed(number) + unit;
  }

  // Whether a drag of this person would be accepted if the arm is not stopped.
  #mayDrive() {
    const status = this.#page.status();
    return Boolean(status && status.role !== "viewer" && (status.mine || status.holder === null));
  }

  async #state() {
    const answer = await fetch("api/v1/state").catch(() => null);
    return answer?.ok ? answer.json() : null;
  }

  get #viewer() {
    return this.#scene.contentWindow.katanaScene.viewer();
  }
}
