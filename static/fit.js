// Keep arm and gizmo in the picture. If the requested view would cut them off, look in the same
// direction from farther away. Fit again when the picture changes its size, unless the person has
// turned the camera since.
import { drawing, missing, node, viewer, viewsIn, world } from "./viser.js";

const FILLED = 0.9; // maximum fraction of the picture's width and height for arm and gizmo
const SAME = 1e-3; // m, below which two views count as equal
const AGAIN = 200; // ms
const NODES = ["/arm", "/target/move"];

/** @type {Page.View | null} */
let base = null; // requested {position, look_at}; m, in viser's world
/** @type {Page.View | null} */
let put = null; // the same, fitted
let chosen = false;
let riding = false; // the camera is on the tool and gets a new view at every step
let begun = false;
let pressed = false; // a pointer may hold a handle, under which the picture must stay
let late = false; // the picture has changed its size meanwhile

const root = () => world().matrixWorld;
/** @param {number[]} xyz */
const vector = ([x, y, z]) => drawing().camera.position.clone().set(x, y, z);
/** Return whether two views are the same. @param {Page.View} a @param {Page.View} b */
const isSame = (a, b) =>
  /** @type {const} */ (["position", "look_at"]).every((key) => a[key].every((x, i) => Math.abs(x - b[key][i]) < SAME));

// Return the corners of the bounding boxes of all shapes of arm and gizmo, in viser's world.
function corners() {
  /** @type {Three.Vector3[]} */
  const points = [];
  const inverse = root().clone().invert();
  for (const name of NODES)
    node(name)?.traverseVisible((object) => {
      const { geometry } = object;
      if (!geometry?.attributes?.position) return;
      if (!geometry.boundingBox) geometry.computeBoundingBox();
      const { boundingBox: box } = geometry;
      if (!box) return;
      object.updateWorldMatrix(true, false);
      for (let corner = 0; corner < 8; corner++) {
        const ends = /** @type {const} */ (["x", "y", "z"]).map((axis, i) => ((corner >> i) & 1 ? box.max : box.min)[axis]);
        points.push(vector(ends).applyMatrix4(object.matrixWorld).applyMatrix4(inverse));
      }
    });
  return points;
}

// Return the view in the same direction with all `points` in the picture; no nearer than `view`, but if
// `filling` as near as possible.
/** @param {Page.View} view @param {Three.Vector3[]} points @returns {Page.View} */
function fitted(view, points, filling = false) {
  const { camera, canvas } = drawing();
  const [eye, target] = [vector(view.position), vector(view.look_at)];
  const forward = target.clone().sub(eye).normalize();
  const right = forward.clone().cross(vector([0, 0, 1])).normalize();
  const up = right.clone().cross(forward);
  const high = FILLED * Math.tan((camera.fov * Math.PI) / 360);
  const wide = (high * canvas.clientWidth) / canvas.clientHeight;
  // A point is in the picture if |offset right or up| <= slope * depth, both from the eye.
  // On each side of the picture the outermost point counts.
  /** @param {Three.Vector3} axis @param {number} slope */
  const outermost = (axis, slope) =>
    [1, -1].map((sign) => Math.max(...points.map((p) => sign * axis.dot(p) - slope * forward.dot(p))));
  const sides = [{ axis: right, slope: wide }, { axis: up, slope: high }].map(({ axis, slope }) => {
    const [most, least] = outermost(axis, slope);
    return { axis, slope, most, least };
  });
  const inside = sides.every(({ axis, slope, most, least }) => {
    const [across, depth] = [axis.dot(eye), forward.dot(eye)];
    return most <= across - slope * depth && least <= -across - slope * depth;
  });
  if ((inside && !filling) || !points.length) return view;
  const depths = sides.map(({ slope, most, least }) => -(most + least) / (2 * slope));
  const depth = Math.min(filling ? Infinity : forward.dot(eye), ...depths);
  const placed = forward.clone().multiplyScalar(depth);
  for (const { axis, most, least } of sides) placed.addScaledVector(axis, (most - least) / 2);
  const away = points.reduce((sum, p) => sum + forward.dot(p), 0) / points.length - depth;
  return { position: placed.toArray(), look_at: placed.clone().addScaledVector(forward, away).toArray() };
}

// Return the camera's present view.
export function seen() {
  const { cameraControl } = drawing();
  const inverse = root().clone().invert();
  /** @param {Three.Vector3} three */
  const inWorld = (three) => three.applyMatrix4(inverse).toArray();
  return {
    position: inWorld(cameraControl.getPosition(vector([0, 0, 0]))),
    look_at: inWorld(cameraControl.getTarget(vector([0, 0, 0]))),
  };
}

/** @param {Page.View} view */
export function look(view) {
  const { cameraControl } = drawing();
  cameraControl.setPosition(...vector(view.position).applyMatrix4(root()).toArray(), false);
  cameraControl.setTarget(...vector(view.look_at).applyMatrix4(root()).toArray(), false);
}

function refit() {
  late = pressed;
  if (!base?.position.length || !base.look_at.length || riding || pressed) return;
  if (!drawing().canvas.clientHeight || !isSame(seen(), put ?? base)) return;
  put = fitted(base, corners());
  look(put);
}

for (const kind of ["pointerdown", "pointerup", "pointercancel"])
  window.addEventListener(kind, ({ type }) => {
    pressed = type === "pointerdown";
    if (!pressed && late) refit();
  }, { capture: true });

// Note the views that the server sets, and fit views that a person chose before viser gets them. `last` takes the place of
// the first view.
/** @param {ViserPage.Message[]} messages @param {Page.View | null} last */
export function hear(messages, last) {
  const [position, target] = viewsIn(messages);
  if (position?.initial ?? target?.initial) {
    if (last && position) position.position = last.position;
    if (last && target) target.look_at = last.look_at;
    if (chosen || last) return;
    base = {
      position: position?.position ?? base?.position ?? [],
      look_at: target?.look_at ?? base?.look_at ?? [],
    };
  } else if (position?.position && target?.look_at && !riding) {
    chosen = true;
    base = { position: position.position, look_at: target.look_at };
    put = fitted(base, corners());
    position.position = put.position;
    target.look_at = put.look_at;
  }
}

// Return the pixel of this document that shows a node, or a point [m] of viser's world; null
// without one, or behind the camera.
/** @param {string | number[]} place @returns {Page.Pixel | null} */
export function pixelOf(place) {
  const { camera, canvas } = viewer() ?? {};
  if (!camera || !canvas || !node("")) return null;
  const point = typeof place === "string"
    ? node(place)?.getWorldPosition(vector([0, 0, 0]))
    : vector(place).applyMatrix4(root());
  if (!point) return null;
  const { x, y, z } = point.project(camera);
  const { left, top, width, height } = canvas.getBoundingClientRect();
  return z < 1 ? [left + ((1 + x) / 2) * width, top + ((1 - y) / 2) * height] : null;
}

// Fill the picture with arm and gizmo, in the present direction.
export function fit() {
  base = put = fitted(seen(), corners(), true);
  look(put);
}

/** Note that the person has chosen the view of this name. @param {string} view */
export const choose = (view) => (riding = view === "Tool");

// Begin to fit as soon as all shapes are loaded; the rest of the scene is there.
export function begin() {
  if (begun) return;
  begun = true;
  const timer = setInterval(() => {
    if (!viewer()?.cameraControl || !node("") || missing().length) return;
    clearInterval(timer);
    new ResizeObserver(refit).observe(drawing().canvas);
  }, AGAIN);
}
