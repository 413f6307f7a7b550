// viser's panel on a narrow screen. viser lays it over the scene. Here it is a sheet at the lower edge
// with three heights, at first folded to its handle. The scene gets the height that it leaves.
import { NARROW, PANEL, PANEL_CONTENT, PANEL_GROUND, PANEL_HANDLE } from "./viser/names.js";

const sheet = new CSSStyleSheet();
// --sheet is the height of the sheet, and --room the part of it that the scene leaves free.
sheet.replaceSync(`@media ${NARROW} {
  :has(> ${PANEL}) { flex-direction: column; background: ${PANEL_GROUND}; }
  :has(> ${PANEL}) > :not(${PANEL}) { min-height: 0; }
  ${PANEL} {
    position: relative !important; flex: none; width: 100% !important; height: var(--sheet, 3.5rem);
    box-shadow: 0 -1px #8886 !important; min-height: 0 !important; max-height: none !important; margin-top: calc(var(--room, 3.5rem) - var(--sheet, 3.5rem)) !important;
  }
  ${PANEL_CONTENT} { width: 100% !important; }
  ${PANEL_HANDLE} { position: sticky !important; top: 0; z-index: 2; background: ${PANEL_GROUND}; }
  ${PANEL_HANDLE} > button { z-index: 1; }
  html:not([data-sheet]) :is(${PANEL_CONTENT} > :nth-child(n + 2), ${PANEL_HANDLE} > button:not(#k450-sheet)) { visibility: hidden; }
}`);
document.adoptedStyleSheets.push(sheet);

const narrow = matchMedia(NARROW);
function load() {
  if (!narrow.matches) return;
  narrow.removeEventListener("change", load);
  import("./sheet/heights.js").then(({ fold }) => Object.assign(window.katanaScene ?? {}, { fold })).catch(() => setTimeout(load, 1000));
}
narrow.addEventListener("change", load);
load();
