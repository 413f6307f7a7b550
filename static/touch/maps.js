// The pressure on both pads of the gripper, with the forces and the centres of pressure.
import { styled, write } from "../dom.js";
import { clamp, html, set, signed } from "../instruments/shape.js";

const ROWS = 16; // taxels along a finger, from the palm to the tip
const COLUMNS = 8;
const FULL = 50_000; // Pa, pressure of the last colour
const [LENGTH, WIDTH] = [74.5, 19.2]; // mm of a pad
const MM = 1000;
// Colours of hardly any pressure, a third, two thirds and the full one, as on the fingers in the scene.
const COLOURS = [[46, 94, 200], [20, 164, 156], [246, 196, 40], [226, 52, 40]];

/**
 * @typedef {object} Drawn
 * @property {string} finger @property {string} name @property {CanvasRenderingContext2D | null} canvas
 * @property {HTMLElement} centre @property {HTMLElement} force @property {HTMLElement} map
 */

styled("maps.css", import.meta.url);

export class PressureMaps {
  /** @type {Drawn[]} */
  #pads = [];
  /** @type {string | null} */
  #shown = null; // forces and squeeze that are drawn

  constructor() {
    const maps = html("div", { class: "maps" });
    for (const [finger, name] of [["finger_left_link", "Left"], ["finger_right_link", "Right"]]) {
      const canvas = html("canvas", { width: ROWS, height: COLUMNS });
      const centre = html("i", { hidden: "" });
      const force = html("output", {}, "–");
      const map = html("div", { class: "map", role: "img", "aria-label": `${name} pad` }, canvas, centre);
      maps.append(html("section", {}, html("p", {}, html("span", {}, name), force), map));
      this.#pads.push({ finger, name, canvas: canvas.getContext("2d"), centre, force, map });
    }
    const scale = html("i");
    scale.style.background = `linear-gradient(to right, ${COLOURS.map((rgb) => `rgb(${rgb})`)})`;
    const legend = html("p", { class: "scale" }, "0", scale, `${FULL / 1000} kPa`, html("span", {}, "palm → tip"));
    this.element = html("div", { class: "pressure" }, maps, legend);
  }

  /** Show the value `touch` of a state. @param {Page.Touch | null} touch */
  show(touch) {
    if (!touch) return;
    const shown = [touch.squeeze, ...touch.pads.map(({ force }) => force)].join();
    if (shown === this.#shown) return;
    this.#shown = shown;
    for (const drawn of this.#pads) {
      const pad = touch.pads.find(({ finger }) => finger === drawn.finger);
      if (pad) this.#draw(drawn, pad);
    }
  }

  /** @param {Drawn} drawn @param {Page.Pad} pad */
  #draw({ name, canvas, centre, force, map }, { force: newtons, centre: middle, pressure }) {
    if (!canvas) return;
    const image = canvas.createImageData(ROWS, COLUMNS);
    pressure.forEach((value, i) => {
      if (value <= 0) return;
      // The taxels come row by row; a row of the pad is a column of the picture.
      const place = 4 * (Math.floor(i / COLUMNS) + ROWS * (i % COLUMNS));
      image.data.set([...colour(value / FULL), 255], place);
    });
    canvas.putImageData(image, 0, 0);
    write(force, `${signed(newtons, 1)} N`);
    centre.hidden = middle === null;
    let words = `${name} pad: ${signed(newtons, 1)} N`;
    if (middle) {
      const [along, across] = middle.map((value) => value * MM);
      centre.style.left = `${((100 * along) / LENGTH).toFixed(1)}%`;
      centre.style.top = `${(50 + (100 * across) / WIDTH).toFixed(1)}%`;
      words += `, centre of pressure ${signed(along, 0)} mm from the palm and ${signed(across, 0)} mm across`;
    }
    set(map, "aria-label", words);
    set(map, "title", words);
  }
}

/** @param {number} fraction */
function colour(fraction) {
  const place = clamp(fraction, 0, 1) * (COLOURS.length - 1);
  const low = Math.min(Math.floor(place), COLOURS.length - 2);
  return COLOURS[low].map((from, i) => Math.round(from + (place - low) * (COLOURS[low + 1][i] - from)));
}
