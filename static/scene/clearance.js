// The two nearest parts while they are near each other: a line between their nearest points, with its length.
import { sceneOf, write } from "../dom.js";
import { html, set, svg } from "../instruments/shape.js";

const RADIUS = 3.5; // px, of the points
const BESIDE = 16; // px from the line to its length

export class Clearance {
  #scene;
  #store;
  #line = svg("line");
  #points = [svg("circle", { r: RADIUS }), svg("circle", { r: RADIUS })];
  // The state line has the same in words.
  #picture = svg("svg", { id: "clearance", "aria-hidden": "true", hidden: "" }, this.#line, ...this.#points);
  #label = html("p", { id: "clearance-label", class: "scene-label", "aria-hidden": "true", hidden: "" });
  #frame = 0;

  /** @param {HTMLElement} stage @param {HTMLIFrameElement} scene @param {Page.Store} store */
  constructor(stage, scene, store) {
    this.#scene = scene;
    this.#store = store;
    stage.append(this.#picture, this.#label);
    store.follow(() => this.#draw());
  }

  // Draw it, and again with each frame, because the camera may turn.
  #draw() {
    const { clearance } = this.#store.live ?? {};
    const { hasHidden, pixelOf } = sceneOf(this.#scene) ?? {};
    // Hidden nodes mean that the picture shows the past.
    const [from, to] = clearance && pixelOf && !hasHidden?.() ? clearance.points.map(pixelOf) : [];
    this.#label.hidden = !from || !to;
    this.#picture.toggleAttribute("hidden", this.#label.hidden);
    if (!clearance || !from || !to) return;
    cancelAnimationFrame(this.#frame);
    this.#frame = requestAnimationFrame(() => this.#draw());
    const ends = [from, to];
    ends.forEach(([x, y], i) => {
      set(this.#line, `x${i + 1}`, x);
      set(this.#line, `y${i + 1}`, y);
      set(this.#points[i], "cx", x);
      set(this.#points[i], "cy", y);
    });
    write(this.#label, `${clearance.distance.toFixed(1)} mm`);
    // To its left: the label of a drag is at the right of the pointer.
    const left = Math.min(ends[0][0], ends[1][0]) - BESIDE - this.#label.offsetWidth;
    this.#label.style.left = `${Math.max(0, left)}px`;
    this.#label.style.top = `${(ends[0][1] + ends[1][1] - this.#label.offsetHeight) / 2}px`;
  }
}
