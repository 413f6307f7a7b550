// The selected object: a frame round it in the picture, with its name and a button to remove it, and the
// arrows that move it, in this window alone.
import { html, write } from "../instruments/shape.js";

const EVERY = 100; // ms between two updates of the frame
const MARGIN = 6; // px
const EDGE = 4; // px between the bar and the edge of the scene
const STYLE = new URL("selection.css", import.meta.url).href;

// Return the corners [m], in the base frame, of the box round an object. Its own frame is in the
// middle of its underside.
function corners({ shape, size, scale, T }) {
  const [a, b, c] = size.map((each) => each * scale);
  const wide = { cylinder: [2 * a, 2 * a, b], sphere: [2 * a, 2 * a, 2 * a] }[shape] ?? [a, b, c];
  return [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => {
    const at = wide.map((length, i) => length * (((corner >> i) & 1) - (i < 2 ? 0.5 : 0)));
    return [0, 1, 2].map((row) => T[row][3] + at.reduce((sum, value, i) => sum + T[row][i] * value, 0));
  });
}

export class Selection {
  #scene;
  #page; // {say, status}
  #object = null;
  #timer = null;
  #name = html("b");
  #frame;
  #bar;

  constructor(stage, scene, page) {
    this.#scene = scene;
    this.#page = page;
    document.head.append(html("link", { rel: "stylesheet", href: STYLE }));
    const remove = html("button", { type: "button" }, "Remove ", html("kbd", {}, "Del"));
    const clear = html("button", { type: "button", "aria-label": "Deselect" }, "×");
    remove.addEventListener("click", () => this.remove());
    clear.addEventListener("click", () => this.clear());
    this.#bar = html("div", { role: "group", "aria-label": "Selected object" }, this.#name, remove, clear);
    this.#frame = html("div", { id: "selection", hidden: "" }, this.#bar);
    stage.append(this.#frame);
  }

  // Select the object in the picture at a pixel of viser's document; the smallest one if several are
  // there. Without one, select nothing.
  async pick(x, y) {
    const objects = await this.#objects();
    const hit = objects
      .filter(({ held, hidden }) => !held && !hidden)
      .map((object) => [object, this.#bounds(object)])
      .filter(([, box]) => box && x >= box.left && x <= box.right && y >= box.top && y <= box.bottom)
      .sort(([, a], [, b]) => area(a) - area(b))[0];
    this.#show(hit?.[0] ?? null);
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

  async #objects() {
    const answer = await fetch("api/v1/objects").catch(() => null);
    return answer?.ok ? (await answer.json()).objects : [];
  }

  #show(object) {
    if (this.#object && this.#object.name !== object?.name) this.#arrows(false);
    this.#object = object;
    clearInterval(this.#timer);
    this.#frame.hidden = !object;
    if (!object) return;
    write(this.#name, object.name);
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
    const found = (await this.#objects()).find((each) => each.name === name && !each.held);
    if (this.#object?.name !== name) return;
    if (!found) return this.#show(null);
    this.#object = found;
    // viser hides them again after a lost connection.
    this.#arrows(true);
  }

  // Show the arrows of the object, or show them as the server does. What the arm carries has none.
  #arrows(own) {
    const { name, held, fixed } = this.#object;
    const mine = own && !held && !fixed && this.#page.status()?.role !== "viewer";
    this.#scene.contentWindow.katanaScene?.reveal(`/handles/${encodeURIComponent(name)}`, mine || undefined);
  }

  #place() {
    const box = this.#bounds(this.#object);
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
    const shift = (start, end, from, to) => Math.max(from + EDGE - start, Math.min(0, to - EDGE - end));
    const [x, y] = [shift(bar.left, bar.right, view.left, view.right), shift(bar.top, bar.bottom, view.top, view.bottom)];
    this.#bar.style.translate = `${x}px ${y}px`;
  }

  // Return the rectangle round an object in viser's document; null behind the camera.
  #bounds(object) {
    const pixels = corners(object).map((corner) => this.#scene.contentWindow.katanaScene?.pixelOf(corner));
    if (pixels.some((each) => !each)) return null;
    const [xs, ys] = [0, 1].map((i) => pixels.map((each) => each[i]));
    return {
      left: Math.min(...xs) - MARGIN,
      right: Math.max(...xs) + MARGIN,
      top: Math.min(...ys) - MARGIN,
      bottom: Math.max(...ys) + MARGIN,
    };
  }
}

const area = ({ left, right, top, bottom }) => (right - left) * (bottom - top);
