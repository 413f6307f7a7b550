// The heights of the sheet on a phone: its handle is dragged, tapped, or moved by the arrow keys. Loaded by sheet.js into
// viser's page.
import { PANEL, PANEL_HANDLE } from "../viser/names.js";

// Name and height of each; the scene leaves at most half of the page. Above the sheet at full height
// there is room for the buttons and messages that the surrounding page lays over the scene.
const HEIGHTS = [["folded", "3.5rem"], ["half height", "50vh"], ["full height", "max(50vh, 100vh - 120px)"]];
const [HALF, ABOVE] = [0.5, 120]; // fraction of the page, and px, as above
const TAP = 6; // px, movement up to which a touch is a tap
const COAST = 120; // ms for which the finger's speed counts as if it moved on
const QUICK = 150; // ms
/** @type {Record<string, number>} */
const STEPS = { ArrowUp: 1, ArrowDown: -1 };

const outer = window.parent === window ? null : window.parent;
const { style, dataset } = document.documentElement;
/** @returns {HTMLElement | null} */
const panel = () => document.querySelector(PANEL);
const button = document.createElement("button");
button.id = "k450-sheet";
button.type = "button";
button.textContent = "Controls";

const look = new CSSStyleSheet();
look.replaceSync(`
  #k450-sheet {
    position: absolute; inset: 0; z-index: 0; padding: 0.6em 0 0; border: 0; font: inherit; font-size: 0.9em; color: inherit;
    background: none; cursor: grab; touch-action: none;
  }
  #k450-sheet::before {
    content: ""; position: absolute; top: 0.5em; left: 50%; width: 2.8em; height: 0.3em; margin-left: -1.4em; border-radius: 0.2em;
    background: currentcolor; opacity: 0.35;
  }
  #k450-sheet:focus-visible { outline: 3px solid #4b96ea; outline-offset: -3px; }
`);
document.adoptedStyleSheets.push(look);

let height = 0; // index of the present one
/** @type {{ id: number, y: number, from: number, at: number, speed: number, tall: number } | null} */
let drag = null; // of the finger that moves the handle
let dragged = false; // whether the last touch was more than a tap

/** @param {string} sheet @param {string} room */
function size(sheet, room) {
  style.setProperty("--sheet", sheet);
  style.setProperty("--room", room);
}

/** @param {number} next */
function choose(next) {
  const before = panel()?.offsetHeight ?? 0;
  height = Math.max(0, Math.min(HEIGHTS.length - 1, next));
  const [name, tall] = HEIGHTS[height];
  if (height) dataset.sheet = name;
  else delete dataset.sheet;
  outer?.document.body.toggleAttribute("data-raised", height > 0);
  size(tall, HEIGHTS[Math.min(height, 1)][1]);
  button.setAttribute("aria-label", `Controls, ${name}`);
  button.setAttribute("aria-expanded", String(height > 0));
  const change = (panel()?.offsetHeight ?? 0) - before;
  if (!change || matchMedia("(prefers-reduced-motion: reduce)").matches) return;
  panel()?.animate([{ translate: `0 ${change}px` }, { translate: "none" }], { duration: QUICK, easing: "ease-out" });
}

const highest = () => Math.max(HALF * innerHeight, innerHeight - ABOVE);

/** Return the index of the height that is nearest to `tall` px. @param {number} tall */
function nearest(tall) {
  const heights = [button.offsetHeight, HALF * innerHeight, highest()];
  const away = heights.map((height) => Math.abs(height - tall));
  return away.indexOf(Math.min(...away));
}

/** One sheet at a time: raising this one closes those of the surrounding page. @param {number} next */
function raise(next) {
  if (next > 0) outer?.katana?.closeSheets();
  choose(next);
}

button.addEventListener("pointerdown", (event) => {
  if (drag || event.button) return;
  button.setPointerCapture(event.pointerId);
  dragged = false;
  drag = { id: event.pointerId, y: event.clientY, from: panel()?.offsetHeight ?? 0, at: event.timeStamp, speed: 0, tall: 0 };
});
button.addEventListener("pointermove", (event) => {
  if (event.pointerId !== drag?.id) return;
  const up = drag.y - event.clientY;
  if (!dragged && Math.abs(up) < TAP) return;
  const tall = Math.max(button.offsetHeight, Math.min(highest(), drag.from + up));
  if (dragged && event.timeStamp > drag.at) drag.speed = (tall - drag.tall) / (event.timeStamp - drag.at);
  Object.assign(drag, { tall, at: event.timeStamp });
  dragged = true;
  dataset.sheet = "dragged";
  // The picture keeps its size until the end: each change of its size clears it.
  size(`${tall}px`, HEIGHTS[0][1]);
});
button.addEventListener("pointerup", (event) => {
  if (event.pointerId !== drag?.id) return;
  const still = event.timeStamp - drag.at > COAST;
  const aim = drag.tall + (still ? 0 : drag.speed * COAST);
  drag = null;
  if (dragged) raise(nearest(aim));
});
button.addEventListener("pointercancel", (event) => {
  if (event.pointerId !== drag?.id) return;
  drag = null;
  choose(height);
});
button.addEventListener("click", (event) => {
  // viser would fold the panel by itself.
  event.stopPropagation();
  if (dragged && event.detail) return;
  raise((height + 1) % HEIGHTS.length);
});
button.addEventListener("keydown", (event) => {
  if (!(event.key in STEPS)) return;
  event.preventDefault();
  event.stopPropagation();
  raise(height + STEPS[event.key]);
});

// viser makes another panel whenever the page becomes narrow.
function place() {
  const handle = document.querySelector(PANEL_HANDLE);
  if (handle && button.parentElement !== handle) handle.prepend(button);
}
choose(0);
place();
new MutationObserver(place).observe(document.documentElement, { childList: true, subtree: true });
// Fold the sheet, because the surrounding page opens one of its own.
export const fold = () => choose(0);
