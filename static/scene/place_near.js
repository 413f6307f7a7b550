// Where the bar of what is selected is shown, and a label beside the pointer.
import { sceneIn } from "../dom.js";

const ABOVE = 60; // px from the pointer to a bar or a label, so that a finger does not cover it
const EDGE = 8; // px between the bar and the edge of the scene
const [RIGHT, BELOW] = [18, 14]; // px from the mouse to a label

// Put a bar above a pixel, inside the scene. It stays there, so that its buttons can be pressed again.
/** @param {HTMLElement} bar @param {HTMLIFrameElement} scene @param {Page.Pixel} pixel */
export function placeNear(bar, scene, [x, y]) {
  const { left, top, width } = sceneIn(scene).drawing().canvas.getBoundingClientRect();
  const { offsetWidth, offsetHeight } = bar;
  const start = Math.max(left + EDGE, Math.min(x - offsetWidth / 2, left + width - offsetWidth - EDGE));
  const above = y - ABOVE - offsetHeight;
  bar.style.left = `${start}px`;
  bar.style.top = `${above < top + EDGE ? y + ABOVE : above}px`;
}

// Put a label beside the mouse, or above a finger, inside the scene.
/** @param {HTMLElement} label @param {HTMLIFrameElement} scene @param {Page.Pixel} pixel @param {boolean} touch */
export function placeBeside(label, scene, [x, y], touch) {
  if (touch) return placeNear(label, scene, [x, y]);
  const { right, bottom } = sceneIn(scene).drawing().canvas.getBoundingClientRect();
  const { offsetWidth, offsetHeight } = label;
  const start = x + RIGHT + offsetWidth > right ? x - BELOW - offsetWidth : x + RIGHT;
  label.style.left = `${start}px`;
  label.style.top = `${Math.min(y + BELOW, bottom - offsetHeight)}px`;
}
