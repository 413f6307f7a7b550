// The pointer in the scene: a click selects a link or an object, a drag of a link turns its joint, and a
// double-click looks at a point. Everything else turns the camera.
import { html } from "../instruments/shape.js";
import { Branches } from "./branches.js";
import { Glow, shapesOf } from "./glow.js";
import { Joints } from "./joints.js";
import { Steps } from "./steps.js";
import { Views } from "./views.js";

const CLICK = 5; // px, within which a press and its release count as a click
const TABLE = "/table";
const SOLID = ["/arm", "/cup", "/basin", "/objects", TABLE]; // nodes that a ray can meet
const OBJECTS = ["/cup", "/basin"]; // nodes of objects; the others are below the next one
const MORE = "/objects";
const STYLE = new URL("scene.css", import.meta.url).href;

export class Stage {
  #stage;
  #scene;
  #page; // {say, toast, status, edit}
  #joints;
  #views;
  #steps;
  #branches = null; // only for an arm that has some
  #selection = null; // the selected object, loaded with the first click beside the arm
  #press = null; // [x, y] of a press that may become a click
  #over = null; // pixel of the pointer, to be looked up in the next frame
  #pointed = null; // node of the object under the pointer
  #glow = new Glow();

  constructor(stage, scene, page) {
    this.#stage = stage;
    this.#scene = scene;
    this.#page = page;
    document.head.append(html("link", { rel: "stylesheet", href: STYLE }));
    this.#joints = new Joints(stage, scene, page);
    this.#load();
    this.#views = new Views(stage, scene);
    this.#steps = new Steps(page.say, page.edit);
    this.#listen();
    window.katana.turned = () => this.#views.turned();
    scene.addEventListener("load", () => this.#listen());
    // What is held at a stop, or when another person drives, moves nothing afterwards.
    let stopped = false;
    window.addEventListener("status", ({ detail }) => {
      // While the arm is stopped, a new drag is refused with the reason.
      const stops = detail.stopped && !stopped;
      stopped = Boolean(detail.stopped);
      if (stops || (!detail.mine && detail.holder !== null)) this.drop();
    });
    document.addEventListener("visibilitychange", () => document.hidden && this.#joints.lose());
    window.addEventListener("blur", () => this.#blur());
  }

  async #load() {
    const answer = await fetch("api/v1/arm").catch(() => null);
    if (!answer?.ok) return;
    const arm = await answer.json();
    this.#joints.arm = arm;
    if (arm.joints_only) return;
    this.#branches = new Branches(this.#stage, this.#scene, arm, this.#page.status);
    this.#branches.listen(this.#scene.contentWindow);
  }

  // Names of the joints, such as "2 shoulder"; empty before the arm is known.
  get jointLabels() {
    return this.#joints.arm?.links.map(({ label }) => label) ?? [];
  }

  // Remove the selected object. Return whether there is one.
  remove() {
    return Boolean(this.#selection?.remove());
  }

  // Select nothing.
  clear() {
    this.#joints.select(null);
    this.#selection?.clear();
  }

  // Release what the pointer holds.
  drop() {
    this.#joints.drop();
  }

  refused(answer) {
    this.#joints.refused(answer);
  }

  #listen() {
    const inner = this.#scene.contentWindow;
    const on = (kind, act) => inner.addEventListener(kind, act.bind(this), { capture: true });
    on("pointerdown", this.#down);
    on("pointermove", this.#move);
    on("pointerup", this.#up);
    on("pointercancel", ({ pointerId }) => this.#joints.holds(pointerId) && this.#joints.lose());
    on("pointerout", ({ relatedTarget }) => relatedTarget || this.#hover(null));
    on("blur", this.#blur);
    on("dblclick", this.#focus);
    this.#branches?.listen(inner);
    this.#steps.listen(inner);
  }

  // The focus may only have moved between the two documents.
  #blur() {
    setTimeout(() => document.hasFocus() || this.#joints.lose());
  }

  #down(event) {
    const { target, pointerId, pointerType, button, isPrimary } = event;
    this.#press = null;
    if (button || !isPrimary || this.#joints.dragging || !target.matches?.("canvas")) return;
    const pixel = [event.clientX, event.clientY];
    this.#press = pixel;
    const hit = this.#pick(pixel);
    const joint = hit && this.#joints.of(hit.object);
    if (!hit || !this.#joints.takes(joint, pointerType === "touch")) return;
    // Neither the camera nor a node behind the link gets the press.
    event.stopImmediatePropagation();
    target.setPointerCapture(pointerId);
    this.#joints.take(joint, hit, pixel, pointerId, pointerType === "touch");
  }

  #move(event) {
    const pixel = [event.clientX, event.clientY];
    if (this.#joints.holds(event.pointerId)) {
      event.stopImmediatePropagation();
      this.#joints.move(pixel);
    } else if (event.pointerType !== "touch") this.#hover(event.buttons || !event.target.matches?.("canvas") ? null : pixel);
  }

  // Look up the link under the pointer once per frame.
  #hover(pixel) {
    const waits = this.#over !== null;
    this.#over = { pixel };
    if (waits) return;
    requestAnimationFrame(() => {
      const { pixel } = this.#over;
      this.#over = null;
      const hit = pixel && this.#pick(pixel);
      const joint = hit ? this.#joints.of(hit.object) : null;
      this.#joints.hover(joint, pixel);
      if (!this.#joints.dragging) this.#point(hit?.object, joint);
    });
  }

  // Show that a click selects the object of which `shape` is a part; `joint` is under the pointer otherwise.
  #point(shape, joint) {
    const { node, viewer } = this.#scene.contentWindow.katanaScene;
    const [objects, more] = [OBJECTS.map(node), node(MORE)];
    let each = joint === null ? shape : null;
    while (each && !objects.includes(each) && !(more && each.parent === more)) each = each.parent;
    if ((each ?? null) === this.#pointed) return;
    this.#pointed = each ?? null;
    this.#glow.show(shapesOf(this.#pointed));
    if (this.#pointed || joint === null) viewer().canvas.style.cursor = this.#pointed ? "pointer" : "";
    viewer().requestRender();
  }

  #up(event) {
    const pixel = [event.clientX, event.clientY];
    if (this.#joints.holds(event.pointerId) && this.#joints.release()) this.#press = null;
    const press = this.#press;
    this.#press = null;
    if (press && !event.button && Math.hypot(pixel[0] - press[0], pixel[1] - press[1]) < CLICK) this.#click(pixel);
  }

  // Select the link or the object at a pixel; nothing beside both.
  async #click(pixel) {
    const hit = this.#pick(pixel);
    const joint = hit && this.#joints.of(hit.object);
    this.#joints.select(joint, pixel);
    if (joint !== null) return this.#selection?.clear();
    if (!this.#selection) {
      const { Selection } = await import("../selection/selection.js");
      this.#selection ??= new Selection(this.#stage, this.#scene, this.#page);
    }
    this.#selection.pick(...pixel);
  }

  // Look at the point of a part or an object under the pointer.
  #focus({ target, clientX, clientY }) {
    const hit = target.matches?.("canvas") && this.#pick([clientX, clientY]);
    if (hit) this.#views.focus(hit.point);
  }

  // Return the point [x, y] of the table at a pixel, in m in the base frame; null if something else is there.
  tableAt(pixel) {
    const { node } = this.#scene.contentWindow.katanaScene;
    const [hit, table] = [this.#pick(pixel), node(TABLE)];
    for (let each = hit?.object; each; each = each.parent) {
      if (each !== table) continue;
      const { x, y } = node("").worldToLocal(hit.point.clone());
      return [x, y];
    }
    return null;
  }

  #pick(pixel) {
    return this.#scene.contentWindow.katanaScene.pick(pixel, SOLID);
  }
}
