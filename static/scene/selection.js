// The selected object: its name with a button to remove it, and the arrows that move it, in this window alone.
import { repeating, sceneIn, sceneOf, write } from "../dom.js";
import { button, html } from "../instruments/shape.js";
import { readObjects } from "../server.js";
import { placeNear } from "./place_near.js";

const EVERY = 1000; // ms between two looks at the object, which others may move or remove
const PROPS = ["cup", "basin"]; // objects whose nodes have their names

/** Return the path of the node of an object. @param {string} name */
const pathOf = (name) => (PROPS.includes(name) ? `/${name}` : `/objects/${encodeURIComponent(name)}`);

export class Selection {
  #scene;
  #page; // {say, store}
  #changed;
  /** @type {Api.SceneObject | null} */
  #object = null; // once it is read
  #pixel = /** @type {Page.Pixel | null} */ (null); // where it was clicked
  #watch = repeating(() => this.#read(), EVERY);
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
    window.addEventListener("selected", () => this.#follow());
    this.#follow();
  }

  // The node that shows it; undefined without one.
  get node() {
    return this.#object ? sceneIn(this.#scene).node(pathOf(this.#object.name)) : undefined;
  }

  /** Select the object of a node, whose bar is shown near a pixel; "" for none. @param {string} path @param {Page.Pixel} pixel */
  pick(path, pixel) {
    this.#pixel = pixel;
    this.#page.store.select(decodeURIComponent(path.slice(path.lastIndexOf("/") + 1)));
    this.#pixel = null;
  }

  // Remove the selected object. Return whether there is one.
  remove() {
    const { object } = this.#page.store;
    if (!object) return false;
    this.#page.say({ do: "remove", name: object });
    this.clear();
    return true;
  }

  // Select nothing.
  clear() {
    this.#page.store.select("");
  }

  // Show another object, or none.
  #follow() {
    this.#arrows(false);
    this.#object = null;
    this.#bar.hidden = true;
    this.#changed();
    this.#watch(this.#page.store.object !== "");
  }

  async #read() {
    const [{ store }, pixel] = [this.#page, this.#pixel];
    const name = store.object;
    const object = (await readObjects()).find((other) => other.name === name);
    if (store.object !== name) return;
    if (!object) return this.clear();
    const isNew = this.#object === null;
    this.#object = object;
    // viser hides them again after a lost connection.
    this.#arrows(true);
    this.#bar.hidden = object.held;
    // The node of one that was just added comes later.
    this.#changed();
    if (!isNew) return;
    write(this.#name, name);
    const place = [0, 1, 2].map((row) => object.T[row][3]);
    placeNear(this.#bar, this.#scene, pixel ?? sceneIn(this.#scene).pixelOf(place) ?? [0, 0]);
  }

  /** Show the arrows of the object, or show them as the server does. What the arm carries has none. @param {boolean} own */
  #arrows(own) {
    if (!this.#object) return;
    const { name, held, fixed } = this.#object;
    const mine = own && !held && !fixed && this.#page.store.live?.role !== "viewer";
    sceneOf(this.#scene)?.reveal(`/handles/${encodeURIComponent(name)}`, mine || undefined);
  }
}
