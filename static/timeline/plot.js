// The difference of two runs over one clock: the largest of a joint, and the distance of the tools.
import { html, svg } from "../instruments/shape.js";

const [WIDTH, HEIGHT] = [1000, 64];
/** @type {["joints" | "slides" | "tool", unit: string, label: string][]} */
const LINES = [["joints", "°", "largest joint difference"], ["slides", "mm", "largest slide difference"], ["tool", "mm", "tool distance"]];

export class Plot {
  #box;
  #length = 0;
  #cursor = svg("line", { y1: 0, y2: HEIGHT, class: "cursor" });

  /** @param {HTMLElement} box */
  constructor(box) {
    this.#box = box;
  }

  /** Draw the difference, or nothing for null. @param {import("./api.js").Difference | null} runs */
  draw(runs) {
    this.#box.hidden = !runs;
    if (!runs) return;
    this.#length = runs.t.at(-1) || 1;
    const picture = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", role: "img" });
    /** @type {{ name: string, text: string }[]} */
    const words = [];
    for (const [name, unit, label] of LINES) {
      const values = runs[name];
      if (!values.length) continue;
      const high = Math.max(...values, 1e-3);
      const points = values.map((value, i) => [(WIDTH * runs.t[i]) / this.#length, HEIGHT - 3 - ((HEIGHT - 6) * value) / high]);
      picture.append(svg("polyline", { points: points.map((point) => point.map((x) => x.toFixed(1)).join()).join(" "), class: name }));
      words.push({ name, text: `${label}, up to ${Math.max(...values).toFixed(1)} ${unit}`.replace(" °", "°") });
    }
    picture.append(this.#cursor);
    picture.setAttribute("aria-label", `Difference of the two runs: ${words.map(({ text }) => text).join("; ")}`);
    const legend = words.map(({ name, text }) => html("span", { class: name }, text));
    this.#box.replaceChildren(html("p", {}, ...legend), picture);
  }

  /** Mark the time [s] since the start of both runs. @param {number} t */
  mark(t) {
    const x = (WIDTH * Math.max(0, Math.min(t, this.#length))) / (this.#length || 1);
    for (const end of ["x1", "x2"]) this.#cursor.setAttribute(end, String(x));
  }
}
