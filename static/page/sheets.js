// The sheets of the dock: Jog, Objects, Programs and Episodes.
import { element, sceneOf } from "../dom.js";
import * as Jog from "../jog.js";
import * as Objects from "../objects.js";

const SHEETS = ["jog", "objects", "teach", "episodes"];
// On a high screen Programs or Episodes have room above Jog.
const high = matchMedia("(min-width: 561px) and (min-height: 700px)");
/** @param {string} id @param {string} other */
const haveRoom = (id, other) => high.matches && [id, other].includes("jog") && ![id, other].includes("objects");

export class Sheets {
  #page;
  #parts;

  /** @param {Page.Context} page @param {import("./parts.js").Parts} parts */
  constructor(page, parts) {
    this.#page = page;
    this.#parts = parts;
    for (const id of SHEETS)
      element(`${id}-button`, HTMLButtonElement).addEventListener("click", async () => {
        if (id === "teach") await parts.loadTeach();
        this.open(id, Boolean(element(id, HTMLElement).hidden));
      });
  }

  /** Show or hide a sheet. One that is shown closes those that have no room beside it. @param {string} id */
  open(id, shown = true) {
    for (const other of SHEETS)
      if (other !== id && document.getElementById(other) && !haveRoom(id, other)) this.#show(other, false);
    this.#show(id, shown);
  }

  close() {
    for (const id of SHEETS) if (document.getElementById(id)?.hidden === false) this.#show(id, false);
  }

  /** @param {string} id @param {boolean} shown */
  #show(id, shown) {
    element(id, HTMLElement).hidden = !shown;
    element(`${id}-button`, HTMLButtonElement).setAttribute("aria-expanded", String(shown));
    if (id === "jog") Jog.show(shown);
    if (shown) sceneOf(this.#page.scene)?.fold?.();
    if (id === "teach") this.#parts.teach?.show(shown);
    if (id === "objects") Objects.show(shown);
  }
}
