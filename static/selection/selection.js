// The selected object: a frame round it in the picture, with its name and a button to remove it, and the
// arrows that move it, in this window alone.
import { sceneOf, styled, write } from "../dom.js";
import { button, html } from "../instruments/shape.js";
import { readObjects } from "../server.js";

const EVERY = 100; // ms between two updates of the frame
const MARGIN = 6; // px
const EDGE = 4; // px between the bar and the edge of the scene

/** @typedef {{ left: number, right: number, top: number, bottom: number }} Box */

// Return the corners [m], in the base frame, of the box round an object. Its own frame is in the
// middle of its underside.
/** @param {Api.SceneObject} object */
function corners({ shape, size, scale, T }) {
  const [a, b, c] = size.map((length) => length * scale);
  const wide = shape === "cylinder" ? [2 * a, 2 * a, b] : shape === "sphere" ? [2 * a, 2 * a, 2 * a] : [a, b, c];
  return [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => {
    const point = wide.map((length, i) => length * (((corner >> i) & 1) - (i < 2 ? 0.5 : 0)));
    return [0, 1, 2].map((row) => T[row][3] + point.reduce((sum, value, i) => sum + T[row][i] * value, 0));
  });
}

export class Selection {
  #scene;
  #page; // {say, store}
  /** @type {Api.SceneObject | null} */
  #object = null;
  #timer = 0;
  #name = html("b");
  #frame;
  #bar;

  /** @param {HTMLElement} stage @param {HTMLIFrameElement} scene @param {Pick<Page.Context, "say" | "store">} page */
  constructor(stage, scene, page) {
    this.#scene = scene;
    this.#page = page;
    styled("selection.css", import.meta.url);
    const remove = button(["Remove ", html("kbd", {}, "Del")], () => this.remove());
    const clear = button("×", () => this.clear(), { "aria-label": "Deselect" });
    this.#bar = html("div", { role: "group", "aria-label": "Selected object" }, this.#name, remove, clear);
    this.#frame = html("div", { id: "selection", hidden: "" }, this.#bar);
    stage.append(this.#frame);
  }

  // Select the object in the picture at a pixel of viser's document; the smallest one if several are
  // there. Without one, select nothing.
  /** @param {number} x @param {number} y */
  async pick(x, y) {
    const objects = await readObjects();
    const hit = objects
      .filter(({ held, hidden }) => !held && !hidden)
      .flatMap((object) => {
        const box = this.#bounds(object);
        return box && x >= box.left && x <= box.right && y >= box.top && y <= box.bottom ? [{ object, box }] : [];
      })
      .sort((a, b) => area(a.box) - area(b.box))[0];
    this.#show(hit?.object ?? null);
  }

  // Remove the selected object. Return whether there is one.
  remove() {
    if (!this.#object) return false;
    this.#page.say({ do: "remove", name: this.#object.name });
    this.#show(null);
    return true;
  }

  // Select nothing.
  clear() {
    this.#show(null);
  }

  /** @param {Api.SceneObject | null} object */
  #show(object) {
    if (this.#object && this.#object.name !== object?.name) this.#arrows(false);
    this.#object = object;
    clearInterval(this.#timer);
    this.#frame.hidden = !object;
    if (!object) return;
    write(this.#name, object.name);
    // The sheet of objects, if it is open, shows the same one.
    window.dispatchEvent(new CustomEvent("selected", { detail: object.name }));
    this.#arrows(true);
    this.#place();
    let ticks = 0;
    this.#timer = setInterval(() => {
      this.#place();
      // The object may be moved or removed by others.
      if ((ticks += 1) % 10 === 0) this.#refresh();
    }, EVERY);
  }

  async #refresh() {
    const name = this.#object?.name;
    const object = (await readObjects()).find((other) => other.name === name && !other.held);
    if (this.#object?.name !== name) return;
    if (!object) return this.#show(null);
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

  #place() {
    const box = this.#object && this.#bounds(this.#object);
    this.#frame.style.visibility = box ? "" : "hidden";
    if (!box) return;
    const { offsetLeft, offsetTop } = this.#scene;
    this.#frame.style.left = `${offsetLeft + box.left}px`;
    this.#frame.style.top = `${offsetTop + box.top}px`;
    this.#frame.style.width = `${box.right - box.left}px`;
    this.#frame.style.height = `${box.bottom - box.top}px`;
    this.#keepInside();
  }

  // Move the bar so far that it lies in the scene, also at the edges.
  #keepInside() {
    const view = this.#scene.getBoundingClientRect();
    this.#bar.style.translate = "";
    const bar = this.#bar.getBoundingClientRect();
    /** @param {number} start @param {number} end @param {number} from @param {number} to */
    const shift = (start, end, from, to) => Math.max(from + EDGE - start, Math.min(0, to - EDGE - end));
    const [x, y] = [shift(bar.left, bar.right, view.left, view.right), shift(bar.top, bar.bottom, view.top, view.bottom)];
    this.#bar.style.translate = `${x}px ${y}px`;
  }

  // Return the rectangle round an object in viser's document; null behind the camera.
  /** @param {Api.SceneObject} object @returns {Box | null} */
  #bounds(object) {
    const points = corners(object);
    const pixels = points.flatMap((corner) => {
      const pixel = sceneOf(this.#scene)?.pixelOf(corner);
      return pixel ? [pixel] : [];
    });
    if (pixels.length < points.length) return null;
    const [xs, ys] = [0, 1].map((i) => pixels.map((pixel) => pixel[i]));
    return {
      left: Math.min(...xs) - MARGIN,
      right: Math.max(...xs) + MARGIN,
      top: Math.min(...ys) - MARGIN,
      bottom: Math.max(...ys) + MARGIN,
    };
  }
}

/** @param {Box} box */
const area = ({ left, right, top, bottom }) => (right - left) * (bottom - top);
