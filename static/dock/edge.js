// The inner edge of the dock: it is dragged, or moved by the arrow keys. Where dock and panel leave the scene too little, the
// panel is folded while the dock is open.
import { element, styled } from "../dom.js";
import { PANEL_FOLD } from "../viser/names.js";

/** Movements to the right, px @type {Record<string, number>} */
const STEPS = { ArrowLeft: -16, ArrowRight: 16 };
const [LEAST, PANEL] = [560, 324]; // px, widths of the scene and of viser's panel
const SETTLED = 200; // ms

/** `name` is the one of the kept width. @param {Page.Context} page @param {string} name */
export async function begin({ kept, scene }, name) {
  const [desk, dock, edge] = ["desk", "dock", "dock-edge"].map((id) => element(id, HTMLElement));
  let [first, start] = [0, 0]; // width of the dock and place of the pointer when a drag begins, px

  // Show `width` after a movement to the right. The picture keeps its size until the end: each change of its size clears it.
  /** @param {number} width @param {number} right */
  function show(width, right) {
    scene.style.flex ||= `0 0 ${scene.clientWidth}px`;
    dock.style.setProperty("--width", `${dock.dataset.side === "left" ? width + right : width - right}px`);
  }
  function end() {
    if (!scene.style.flex) return;
    scene.style.flex = "";
    kept.setItem(name, `${dock.offsetWidth}px`);
  }

  edge.addEventListener("pointerdown", (event) => {
    if (event.button) return;
    event.preventDefault();
    edge.setPointerCapture(event.pointerId);
    [first, start] = [dock.offsetWidth, event.clientX];
  });
  edge.addEventListener("pointermove", ({ pointerId, clientX }) => edge.hasPointerCapture(pointerId) && show(first, clientX - start));
  edge.addEventListener("keydown", (event) => {
    if (!(event.key in STEPS)) return;
    event.preventDefault();
    show(dock.offsetWidth, STEPS[event.key]);
  });
  for (const kind of ["lostpointercapture", "keyup", "blur"]) edge.addEventListener(kind, end);
  const sized = new ResizeObserver(() => {
    edge.setAttribute("aria-valuenow", ((100 * dock.offsetWidth) / desk.offsetWidth).toFixed());
    const isNarrow = dock.offsetWidth > 0 && desk.offsetWidth - dock.offsetWidth < LEAST + PANEL;
    const fold = scene.contentDocument?.querySelector(PANEL_FOLD);
    if (!fold || isNarrow === desk.classList.contains("narrow")) return;
    desk.classList.toggle("narrow", isNarrow);
    // A person may have folded it, or unfolded it meanwhile.
    if (fold.ariaExpanded !== String(isNarrow)) return;
    const focused = /** @type {HTMLElement} */ (document.activeElement);
    /** @type {HTMLElement} */ (fold).click();
    // viser takes the focus.
    setTimeout(() => focused.focus(), SETTLED);
  });
  for (const part of [desk, dock]) sized.observe(part);
  await styled("edge.css", import.meta.url);
  edge.hidden = false;
}
