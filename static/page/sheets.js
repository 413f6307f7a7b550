// The sheets of the dock: Jog, Objects, Programs and Episodes.
import { element, first, sceneOf } from "../dom.js";
import * as Jog from "../jog.js";
import * as Objects from "../objects.js";
import { phone } from "./parts.js";

const OPEN = "katana450.sheets.open"; // ids
const SIDE = "katana450.sheets.side"; // left or right
const WIDTH = "katana450.sheets.width"; // in CSS; empty for the first one
const SHEETS = ["jog", "objects", "teach", "episodes"];
// Where the sheets are beside the scene, they are open again at the next visit. On a phone they would hide most of it.
const beside = matchMedia("(min-width: 561px) and (min-height: 501px)");
// On a high screen Programs or Episodes have room above Jog.
const high = matchMedia("(min-width: 561px) and (min-height: 700px)");
/** @param {string} id */
const buttonOf = (id) => element(`${id}-button`, HTMLButtonElement);
/** @param {string} id */
const isShown = (id) => document.getElementById(id)?.hidden === false;
/** @param {string} id @param {string} other */
const haveRoom = (id, other) => high.matches && [id, other].includes("jog") && ![id, other].includes("objects");

export class Sheets {
  #page;
  #parts;
  /** Ids of the sheets to show when the server offers them. @type {Set<string>} */
  #waiting = new Set();

  /** @param {Page.Context} page @param {import("./parts.js").Parts} parts */
  constructor(page, parts) {
    this.#page = page;
    this.#parts = parts;
    const { kept } = page;
    const [dock, side] = [element("dock", HTMLElement), first("#side select", HTMLSelectElement)];
    side.value = dock.dataset.side = kept.getItem(SIDE) ?? "right";
    side.addEventListener("change", () => kept.setItem(SIDE, (dock.dataset.side = side.value)));
    dock.style.setProperty("--width", kept.getItem(WIDTH));
    for (const id of SHEETS)
      buttonOf(id).addEventListener("click", async () => {
        this.#waiting.clear();
        await this.#open(id, !isShown(id));
        if (beside.matches) kept.setItem(OPEN, SHEETS.filter(isShown).join(" "));
      });
  }

  /** Show what was open at the last visit, as soon as the server offers it. The edge of the dock waits for `rest`. @param {Promise<void>} rest */
  async begin(rest) {
    const open = this.#page.kept.getItem(OPEN)?.split(" ") ?? [];
    if (beside.matches) this.#waiting = new Set(SHEETS.filter((id) => open.includes(id)));
    const show = () => {
      for (const id of this.#waiting) if (!buttonOf(id).hidden && this.#waiting.delete(id)) this.#open(id);
    };
    show();
    new MutationObserver(show).observe(first("nav", HTMLElement), { subtree: true, attributeFilter: ["hidden"] });
    await rest;
    const edge = await import("../dock/edge.js");
    edge.begin(this.#page, WIDTH);
  }

  /** Show or hide a sheet. One that is shown closes those that have no room beside it. @param {string} id */
  async #open(id, shown = true) {
    if (id === "teach") await this.#parts.loadTeach();
    for (const other of SHEETS)
      if (other !== id && document.getElementById(other) && !haveRoom(id, other)) this.#show(other, false);
    this.#show(id, shown);
  }

  close() {
    for (const id of SHEETS.filter(isShown)) this.#show(id, false);
  }

  /** @param {string} id @param {boolean} shown */
  #show(id, shown) {
    element(id, HTMLElement).hidden = !shown;
    buttonOf(id).setAttribute("aria-expanded", String(shown));
    if (id === "jog") Jog.show(shown);
    if (shown) sceneOf(this.#page.scene)?.fold?.();
    if (shown && phone.matches) this.#parts.showInstruments(false);
    if (id === "teach") this.#parts.teach?.show(shown);
    if (id === "objects") Objects.show(shown);
  }
}
