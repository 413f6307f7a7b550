// The view cube: it turns as the scene does, and its faces turn the camera. Below it are the views that are
// no face, and Fit. For fingers, to which some faces are too narrow, a list replaces it.
import { element, onPick, sceneIn, sceneOf } from "../dom.js";
import { button, html } from "../instruments/shape.js";
import { NARROW, PANEL } from "../viser/names.js";

const NEAR = 0.6; // m, maximum distance to a point that is looked at
const MOVING = 500; // ms for which the camera counts as moving after its last message
const EDGE = 12; // px from the cube to the edges of the scene
/** @typedef {Page.Vector} Direction */
// Name, view of the server, outward direction, and the direction that is up on the face; in the base frame.
/** @type {[string, string, Direction, Direction][]} */
const FACES = [
  ["Front", "Front", [1, 0, 0], [0, 0, 1]],
  ["Back", "Back", [-1, 0, 0], [0, 0, 1]],
  ["Left", "Left", [0, 1, 0], [0, 0, 1]],
  ["Right", "Side", [0, -1, 0], [0, 0, 1]],
  ["Top", "Top", [0, 0, 1], [0, 1, 0]],
];
const MORE = [
  ["Iso", "3D", "Iso: view from above and the side"],
  ["Tool", "Tool", "View that follows the tool until another one is chosen"],
];

/** @type {(a: Direction, b: Direction) => Direction} */
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
/** The y axis of CSS points down. A direction of the base frame as one of the cube's box: @type {(direction: Direction) => Direction} */
const boxed = ([x, y, z]) => [x, -y, z];
/** @param {number[][]} columns */
const matrix = (...columns) => `matrix3d(${columns.map((column) => column.map((x) => x.toFixed(5)).join()).join()})`;

/** Return the transform of a face at half the cube's edge from its centre. @param {Direction} out @param {Direction} up */
function facing(out, up) {
  const right = boxed(cross(up, out));
  const down = boxed(up).map((x) => -x);
  return `${matrix([...right, 0], [...down, 0], [...boxed(out), 0], [0, 0, 0, 1])} translateZ(calc(var(--edge) / 2))`;
}

export class Views {
  #scene;
  #group;
  #cube = html("div", { id: "cube" });
  #riding = false; // the camera follows the tool
  #shown = ""; // transform of the cube
  #placed = "";
  /** @type {Element | null} */
  #canvas = null;
  /** @type {Element | null} */
  #sheet = null;
  #until = 0; // ms, when the camera counts as still again
  #sized = new ResizeObserver(() => {
    // The width of viser's panel beside the picture.
    element("desk", HTMLElement).style.setProperty("--panel", `${this.#scene.clientWidth - (this.#canvas?.clientWidth ?? 0)}px`);
    this.turned();
  });

  /** @param {HTMLElement} stage @param {HTMLIFrameElement} scene */
  constructor(stage, scene) {
    this.#scene = scene;
    /** @param {string} label @param {string} view @param {string} name */
    const choosing = (label, view, name) => button(label, () => this.#choose(view), { "aria-label": name, title: name });
    for (const [label, view, out, up] of FACES) {
      const face = choosing(label, view, `View: ${label.toLowerCase()}`);
      face.style.transform = facing(out, up);
      this.#cube.append(face);
    }
    const fit = button("Fit", () => this.#fit(), { title: "Show all of arm and handle" });
    const more = MORE.map(([label, view, name]) => choosing(label, view, name));
    const list = html("select", { "aria-label": "View" }, new Option("View", ""));
    for (const [label, view] of [...FACES, ...MORE]) list.add(new Option(label, view));
    onPick(list, (view) => this.#choose(view));
    const row = html("div", {}, ...more, list, fit);
    this.#group = html("div", { id: "views", role: "group", "aria-label": "Camera" }, this.#cube, row);
    stage.append(this.#group);
    this.turned();
  }

  // The camera has moved: follow it for a moment. A page at rest draws nothing.
  turned() {
    const runs = performance.now() < this.#until;
    this.#until = performance.now() + MOVING;
    if (runs) return;
    const turn = () => {
      this.#follow();
      if (performance.now() < this.#until) requestAnimationFrame(turn);
    };
    requestAnimationFrame(turn);
  }

  /** Look at a point of three.js's world from nearer, in the same direction. @param {Three.Vector3} point */
  focus(point) {
    const { drawing, world, seen, look } = sceneIn(this.#scene);
    const at = point.clone().applyMatrix4(world().matrixWorld.clone().invert()).toArray();
    const { position, look_at } = seen();
    const away = position.map((x, i) => x - look_at[i]);
    const nearer = Math.min(1, NEAR / Math.hypot(...away));
    look({ position: at.map((x, i) => x + nearer * away[i]), look_at: at });
    drawing().requestRender();
  }

  /** @param {string} view */
  #choose(view) {
    this.#riding = view === "Tool";
    sceneIn(this.#scene).press("View", view);
  }

  #fit() {
    // The camera on the tool would return at the next step.
    if (this.#riding) this.#choose("3D");
    else sceneIn(this.#scene).fit();
  }

  // Turn the cube as the camera sees the base frame, and keep it in the corner of the picture.
  #follow() {
    const { viewer, node } = sceneOf(this.#scene) ?? {};
    const state = viewer?.();
    const world = state?.cameraControl && node?.("");
    if (!world) return;
    const { camera, canvas } = state;
    // The panel of a phone, whose upper half lies over the picture at full height.
    const narrow = this.#scene.contentWindow?.matchMedia(NARROW).matches;
    const sheet = narrow ? canvas.ownerDocument.querySelector(PANEL) : null;
    if (canvas !== this.#canvas || sheet !== this.#sheet) {
      this.#sized.disconnect();
      this.#sized.observe((this.#canvas = canvas));
      if ((this.#sheet = sheet)) this.#sized.observe(sheet);
    }
    const { elements: m } = camera.matrixWorldInverse.clone().multiply(world.matrixWorld);
    // From the box of the cube to the base frame, to the camera, and to the screen, whose y points down.
    const [x, y, z] = [0, 1, 2].map((column) => {
      const sign = column === 1 ? -1 : 1;
      return [sign * m[4 * column], -sign * m[4 * column + 1], sign * m[4 * column + 2], 0];
    });
    const shown = matrix(x, y, z, [0, 0, 0, 1]);
    if (shown !== this.#shown) this.#cube.style.transform = this.#shown = shown;
    const { left, bottom: end } = canvas.getBoundingClientRect();
    const bottom = Math.min(end, sheet ? sheet.getBoundingClientRect().top : end);
    const placed = `${left + EDGE}px ${bottom - EDGE}px`;
    if (placed === this.#placed) return;
    this.#placed = placed;
    this.#group.style.translate = placed;
  }
}
