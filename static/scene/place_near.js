// Where the bar of what is selected is shown.
import { sceneIn } from "../dom.js";

export const ABOVE = 60; // px from the pointer to a bar or a label, so that a finger does not cover it
const EDGE = 8; // px between the bar and the edge of the scene

/**
 * Put a bar above a pixel, inside the scene. It stays there, so that its buttons can be pressed again.
 * @param {HTMLElement} bar @param {HTMLIFrameElement} scene @param {Page.Pixel} pixel
 */
export function placeNear(bar, scene, [x, y]) {
  const { offsetLeft, offsetTop } = scene;
  const { left, top, width } = sceneIn(scene).drawing().canvas.getBoundingClientRect();
  const { offsetWidth, offsetHeight } = bar;
  const start = Math.max(left + EDGE, Math.min(x - offsetWidth / 2, left + width - offsetWidth - EDGE));
  const above = y - ABOVE - offsetHeight;
  bar.style.left = `${offsetLeft + start}px`;
  bar.style.top = `${offsetTop + (above < top + EDGE ? y + ABOVE : above)}px`;
}
