// The selected object: its name with a button to remove it, and the arrows that move it, in this window alone.
import { repeating, sceneIn, sceneOf, write } from "../dom.js";
import { button, html } from "../instruments/shape.js";
import { readObjects } from "../server.js";
import { placeNear } from "./place_near.js";

const EVERY = 1000; // ms between two looks at the object, which others may move or remove

export class Selection {
  #scene;
  #page; // {say, store}
  #changed;
  /** @type {Api.SceneObject | null} */
  #object = null;
  /** @type {Three.Object3D | null} */
  node = null; // that shows it
  #watch = repeating(() => this.#refresh(), EVERY);
  #name = html("b");
  #bar;

  /**
   * `changed` is called when another object is selected, or none.
   * @param {HTMLElement} stage @param {HTMLIFrameElement} scene @param {Pick<Page.Context, "say" | "store">} page
   * @param {() => void} changed
   */
  constructor(stage, scene, page, changed) {
    this.#scene = scene;
    this.#page = page;
    this.#changed = changed;
    const remove = button(["Remove ", html("kbd", {}, "Del")], () => this.remove());
    const clear = button("×", () => this.clear(), { "aria-label": "Deselect" });
    this.#bar = html("div", { id: "selection", role: "group", "aria-label": "Selected object", hidden: "" }, this.#name, remove, clear);
    stage.append(this.#bar);
    // The sheet of objects shows another one.
    window.addEventListener("chosen", (event) => /** @type {CustomEvent<string>} */ (event).detail !== this.#object?.name && this.clear());
  }

  /** Select the object that a node shows, whose bar is shown near a pixel; null for none. @param {Three.Object3D | null} node @param {Page.Pixel} pixel */
  async pick(node, pixel) {
    const objects = node ? await readObjects() : [];
    const object = node && this.#shownBy(node, objects);
    this.#show(object?.held ? null : object, node);
    if (this.#object) placeNear(this.#bar, this.#scene, pixel);
  }

  // Remove the selected object. Return whether there is one.
  remove() {
    if (!this.#object) return false;
    this.#page.say({ do: "remove", name: this.#object.name });
    this.clear();
    return true;
  }

  // Select nothing.
  clear() {
    this.#show(null, null);
  }

  /** The object whose frame is nearest to that of its node. @param {Three.Object3D} node @param {Api.SceneObject[]} objects */
  #shownBy(node, objects) {
    const { world } = sceneIn(this.#scene);
    const place = world().worldToLocal(node.getWorldPosition(node.position.clone())).toArray();
    /** @param {Api.SceneObject} object */
    const distance = ({ T }) => Math.hypot(...place.map((x, row) => x - T[row][3]));
    const shown = objects.filter(({ hidden }) => !hidden);
    return shown.sort((a, b) => distance(a) - distance(b)).at(0) ?? null;
  }

  /** @param {Api.SceneObject | null} object @param {Three.Object3D | null} node */
  #show(object, node) {
    if (this.#object?.name !== object?.name) this.#arrows(false);
    this.#object = object;
    this.node = object && node;
    this.#bar.hidden = !object;
    this.#changed();
    this.#watch(object !== null);
    if (!object) return;
    write(this.#name, object.name);
    // The sheet of objects, if it is open, shows the same one.
    window.dispatchEvent(new CustomEvent("selected", { detail: object.name }));
    this.#arrows(true);
  }

  async #refresh() {
    const { name } = this.#object ?? {};
    const object = (await readObjects()).find((other) => other.name === name && !other.held);
    if (this.#object?.name !== name) return;
    if (!object) return this.clear();
    this.#object = object;
    // viser hides them again after a lost connection.
    this.#arrows(true);
  }

  /** Show the arrows of the object, or show them as the server does. What the arm carries has none. @param {boolean} own */
  #arrows(own) {
    if (!this.#object) return;
    const { name, held, fixed } = this.#object;
    const mine = own && !held && !fixed && this.#page.store.live?.role !== "viewer";
    sceneOf(this.#scene)?.reveal(`/handles/${encodeURIComponent(name)}`, mine || undefined);
  }
}
