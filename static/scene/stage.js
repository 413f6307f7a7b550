// The pointer in the scene: a click selects a link or an object, a drag of a link turns its joint, and a
// double-click looks at a point. Everything else turns the camera.
import { matches, sceneIn, styled } from "../dom.js";
import { mayDrive } from "../page/lease.js";
import { readArm } from "../server.js";
import { Branches } from "./branches.js";
import { Clearance } from "./clearance.js";
import { Glow, shapesOf } from "./glow.js";
import { Handle } from "./handle.js";
import { Joints } from "./joints.js";
import { Views } from "./views.js";

const CLICK = 5; // px, within which a press and its release count as a click
const TABLE = "/table";
const SOLID = ["/arm", "/cup", "/basin", "/objects", TABLE]; // nodes that a ray can meet
const OBJECT = /^\/(cup|basin|objects\/[^/]+)$/; // name of the node of an object

/** @param {MouseEvent} event @returns {Page.Pixel} */
const pixelOf = ({ clientX, clientY }) => [clientX, clientY];

export class Stage {
  #stage;
  #scene;
  #page;
  joints;
  handle;
  #views;
  /** @type {Branches | null} */
  #branches = null; // only for an arm that has some
  /** @type {import("./selection.js").Selection | null} */
  selection = null; // the selected object, loaded with the first click on one
  /** @type {Page.Pixel | null} */
  #press = null; // [x, y] of a press that may become a click
  /** @type {{ pixel: Page.Pixel | null } | null} */
  #over = null; // pixel of the pointer, to be looked up in the next frame
  /** @type {Three.Object3D | null} */
  #pointed = null; // node of the object under the pointer
  #glow = new Glow();

  /** @param {Page.Context} page */
  constructor(page) {
    const { stage, scene } = page;
    this.#stage = stage;
    this.#scene = scene;
    this.#page = page;
    styled("scene.css", import.meta.url);
    this.joints = new Joints(stage, scene, page);
    this.handle = new Handle(stage, scene, page.store);
    new Clearance(stage, scene, page.store);
    this.#load();
    this.#views = new Views(stage, scene);
    this.#listen();
    Object.assign(window.katana ?? {}, {
      turned: () => this.#views.turned(),
      /** @param {ViserPage.Message} message */
      dragged: (message) => this.handle.hear(message),
    });
    scene.addEventListener("load", () => this.#listen());
    // What is held at a stop, or when another person drives, moves nothing afterwards.
    page.store.follow((status, before) => {
      this.#fade();
      // While the arm is stopped, a new drag is refused with the reason.
      if ((status.stopped && !before?.stopped) || !mayDrive(page.store.live)) this.drop();
    });
    window.addEventListener("selected", () => this.selection || this.#loadSelection());
    document.addEventListener("visibilitychange", () => document.hidden && this.joints.lose());
    window.addEventListener("blur", () => this.#blur());
  }

  // Show in the panel whether its controls move the arm.
  #fade() {
    const refused = !mayDrive(this.#page.store.live) || Boolean(this.#page.store.status?.stopped);
    this.#scene.contentDocument?.documentElement.toggleAttribute("data-refused", refused);
  }

  async #load() {
    const arm = await readArm().catch(() => null);
    if (!arm) return;
    this.joints.arm = arm;
    if (arm.joints_only) return;
    this.#branches = new Branches(this.#stage, this.#scene, arm, this.#page.store);
    if (this.#scene.contentWindow) this.#branches.listen(this.#scene.contentWindow);
  }

  // Names of the joints, such as "2 shoulder"; empty before the arm is known.
  get jointLabels() {
    return this.joints.arm?.links.map(({ label }) => label) ?? [];
  }

  // Select nothing.
  clear() {
    this.joints.select(null);
    this.handle.close();
    this.selection?.clear();
  }

  // Release what the pointer holds.
  drop() {
    this.joints.drop();
    this.handle.drop();
  }

  #listen() {
    const inner = this.#scene.contentWindow;
    if (!inner) return;
    /** @type {<K extends keyof WindowEventMap>(kind: K, act: (event: WindowEventMap[K]) => void) => void} */
    const on = (kind, act) => inner.addEventListener(kind, act.bind(this), { capture: true });
    on("pointerdown", this.#down);
    on("pointermove", this.#move);
    on("pointerup", this.#up);
    on("pointercancel", ({ pointerId }) => this.joints.holds(pointerId) && this.joints.lose());
    on("pointerout", ({ relatedTarget }) => relatedTarget || this.#hover(null));
    on("blur", this.#blur);
    this.handle.listen(inner);
    on("dblclick", this.#focus);
    this.#branches?.listen(inner);
    this.#fade();
  }

  // The focus may only have moved between the two documents.
  #blur() {
    setTimeout(() => document.hasFocus() || this.joints.lose());
  }

  /** @param {PointerEvent} event */
  #down(event) {
    const { target, pointerId, pointerType, button, isPrimary } = event;
    this.handle.note(event);
    this.#press = null;
    if (button || !isPrimary || this.joints.dragging || !matches(target, "canvas")) return;
    const pixel = pixelOf(event);
    this.#press = pixel;
    this.handle.light(sceneIn(this.#scene).partAt(pixel));
    const hit = this.#pick(pixel);
    const joint = hit && this.joints.of(hit.object);
    if (!hit || !this.joints.takes(joint, pointerType === "touch")) return;
    // Neither the camera nor a node behind the link gets the press.
    event.stopImmediatePropagation();
    target.setPointerCapture(pointerId);
    this.joints.take(joint, hit, pixel, pointerId, pointerType === "touch");
  }

  /** @param {PointerEvent} event */
  #move(event) {
    const pixel = pixelOf(event);
    this.handle.note(event);
    if (this.joints.holds(event.pointerId)) {
      event.stopImmediatePropagation();
      this.joints.move(pixel);
    } else if (event.pointerType !== "touch") this.#hover(event.buttons || !matches(event.target, "canvas") ? null : pixel);
  }

  /** Look up the link under the pointer once per frame. @param {Page.Pixel | null} pixel */
  #hover(pixel) {
    const waits = this.#over !== null;
    this.#over = { pixel };
    if (waits) return;
    requestAnimationFrame(() => {
      const pixel = this.#over?.pixel ?? null;
      this.#over = null;
      const part = pixel && sceneIn(this.#scene).partAt(pixel);
      this.handle.light(part);
      const hit = pixel && !part ? this.#pick(pixel) : null;
      const joint = hit ? this.joints.of(hit.object) : null;
      this.joints.hover(joint, pixel);
      if (!this.joints.dragging) this.#point(hit?.object ?? null, joint);
    });
  }

  // Show that a click selects the object of which `shape` is a part; `joint` is under the pointer otherwise.
  /** @param {Three.Object3D | null} shape @param {number | null} joint */
  #point(shape, joint) {
    const object = joint === null ? this.#objectOf(shape) : null;
    if (object === this.#pointed) return;
    this.#pointed = object;
    this.#light();
    if (object || joint === null) sceneIn(this.#scene).drawing().canvas.style.cursor = object ? "pointer" : "";
  }

  /** Return the node of the object of which `shape` is a part; null without one. @param {Three.Object3D | null} shape */
  #objectOf(shape) {
    const { nameOf, owner } = sceneIn(this.#scene);
    return owner(shape, (part) => OBJECT.test(nameOf(part)));
  }

  // Highlight the object under the pointer, or the selected one.
  #light() {
    this.#glow.show(shapesOf(this.#pointed ?? this.selection?.node));
    sceneIn(this.#scene).drawing().requestRender();
  }

  /** @param {PointerEvent} event */
  #up(event) {
    const pixel = pixelOf(event);
    if (this.joints.holds(event.pointerId) && this.joints.release()) this.#press = null;
    const press = this.#press;
    this.#press = null;
    if (press && !event.button && Math.hypot(pixel[0] - press[0], pixel[1] - press[1]) < CLICK) this.#click(pixel);
  }

  /** Select the link or the object at a pixel; nothing beside both. @param {Page.Pixel} pixel */
  async #click(pixel) {
    const hit = this.#pick(pixel);
    const joint = hit && this.joints.of(hit.object);
    this.joints.select(joint, pixel);
    const object = hit && joint === null ? this.#objectOf(hit.object) : null;
    if (object && !this.selection) await this.#loadSelection();
    this.selection?.pick(object ? sceneIn(this.#scene).nameOf(object) : "", pixel);
  }

  async #loadSelection() {
    const { Selection } = await import("./selection.js");
    this.selection ??= new Selection(this.#stage, this.#scene, this.#page, () => this.#light());
  }

  /** Look at the point of a part or an object under the pointer. @param {MouseEvent} event */
  #focus(event) {
    const hit = matches(event.target, "canvas") && this.#pick(pixelOf(event));
    if (hit) this.#views.focus(hit.point);
  }

  // Return the point [x, y] of the table at a pixel, in m in the base frame; null if something else is there.
  /** @param {Page.Pixel} pixel @returns {Page.Pixel | null} */
  tableAt(pixel) {
    const { node, owner, world } = sceneIn(this.#scene);
    const [hit, table] = [this.#pick(pixel), node(TABLE)];
    if (!hit || !owner(hit.object, (part) => part === table)) return null;
    const { x, y } = world().worldToLocal(hit.point.clone());
    return [x, y];
  }

  /** @param {Page.Pixel} pixel */
  #pick(pixel) {
    return sceneIn(this.#scene).pick(pixel, SOLID);
  }
}
