// The parts of the page that are loaded when they are first used.
import { element, onClick } from "../dom.js";

const OPEN = "katana450.instruments.open";
const WELCOMED = "katana450.welcome";
const PAST = "katana450.timeline.open";
export const phone = matchMedia("(max-width: 560px)");
export const QUIETLY = "quietly"; // id of requests that are repeated and whose refusals are not shown
// Cards over the scene that only some servers have, by the field of the status that they show.
const CARDS = { arm: () => import("../arm/arm.js"), cameras: () => import("../cameras/cameras.js") };

export class Parts {
  #page;
  #frame;
  #watch;
  /** @type {import("../scene/stage.js").Stage | null} */
  stage = null; // what a pointer does in the scene
  /** @type {import("../episodes/episodes.js").Episodes | null} */
  episodes = null;
  /** @type {import("../teach/teach.js").Teach | null} */
  teach = null;
  /** @type {import("../timeline/timeline.js").Timeline | null} */
  timeline = null;
  /** @type {import("../instruments/panel.js").Panel | null} */
  panel = null;
  /** @type {import("../welcome/welcome.js").Welcome | null} */
  welcome = null;
  /** @type {Record<string, { draw(status: Page.Status): void }>} */
  #cards = {};
  /** @type {Promise<import("../teach/teach.js").Teach> | null} */
  #teachLoads = null; // one sheet, also after two clicks
  /** @type {Promise<import("../welcome/welcome.js").Welcome> | null} */
  #welcomeLoads = null; // one card, also after two requests

  /** `watch` asks for states at a rate [Hz]. @param {Page.Context} page @param {import("./first_frame.js").FirstFrame} frame @param {(hz: number) => void} watch */
  constructor(page, frame, watch) {
    this.#page = page;
    this.#frame = frame;
    this.#watch = watch;
    page.store.follow((status) => this.#drawEpisodes(status));
    page.store.follow((status) => this.#drawCard("arm", status));
    page.store.follow((status) => this.#drawCard("cameras", status));
    onClick("timeline-button", () => {
      element("more", HTMLDialogElement).close();
      this.showTimeline(true, !this.timeline?.open);
    });
    const help = element("help", HTMLDialogElement);
    onClick("welcome-button", () => {
      help.close();
      this.#showWelcome();
    });
    const instruments = element("instruments-button", HTMLButtonElement);
    onClick("instruments-button", () => this.showInstruments(instruments.ariaExpanded !== "true"));
  }

  // Show what was open when the person was here last, now that they have signed in.
  begin() {
    const { kept, store } = this.#page;
    if (kept.getItem(OPEN) === "yes") this.showInstruments(true);
    let isFirst = true;
    store.follow(async ({ role }) => {
      if (!isFirst) return;
      isFirst = false;
      await this.#frame.rest;
      if (this.#frame.canDraw && role !== "viewer" && !kept.getItem(WELCOMED)) this.#showWelcome();
    });
  }

  // The scene is drawn.
  async enterScene() {
    await this.#frame.rest;
    const { Stage } = await import("../scene/stage.js");
    this.stage ??= new Stage(this.#page);
  }

  async loadTeach() {
    this.#teachLoads ??= import("../teach/teach.js").then(({ Teach }) => Teach.in(this.#page));
    return (this.teach = await this.#teachLoads);
  }

  /** REC, the episodes and the line of what was recorded, when the server records. @param {Page.Status} status */
  async #drawEpisodes(status) {
    if (!this.episodes && !status.episodes) return;
    await this.#frame.rest;
    const { Episodes } = await import("../episodes/episodes.js");
    if (!this.episodes && this.#page.kept.getItem(PAST) !== "no") this.showTimeline(true, false);
    this.episodes ??= new Episodes(this.#page);
    this.episodes.draw(this.#page.store.status ?? status);
  }

  /** A card, when the status has its field. @param {keyof typeof CARDS} name @param {Page.Status} status */
  async #drawCard(name, status) {
    if (!this.#cards[name] && !status[name]) return;
    const { Card } = await CARDS[name]();
    this.#cards[name] ??= new Card(this.#page.stage, this.#page);
    this.#cards[name].draw(this.#page.store.status ?? status);
  }

  /** Show the line of what was recorded, `open` with its controls, or fold it away. @param {boolean} shown @param {boolean} open */
  async showTimeline(shown, open) {
    this.#page.kept.setItem(PAST, shown ? "yes" : "no");
    const { Timeline } = await import("../timeline/timeline.js");
    this.timeline ??= new Timeline(element("timeline", HTMLElement), this.#page, () => this.showTimeline(false, false));
    await this.timeline.show(shown, open);
  }

  /** Open the file of a recording in the timeline. @param {File} file */
  async replay(file) {
    await this.showTimeline(true, true);
    this.timeline?.replay(file);
  }

  // The first steps: at each visit until they are dismissed, and from the help.
  async #showWelcome() {
    this.#welcomeLoads ??= import("../welcome/welcome.js").then(({ Welcome }) => Welcome.on(this.#page));
    this.welcome = await this.#welcomeLoads.catch(() => null);
    if (this.welcome) this.welcome.show();
    else this.#welcomeLoads = null; // The server did not answer: asked again, they load again.
  }

  /** @param {boolean} shown */
  async showInstruments(shown) {
    const { say, kept } = this.#page;
    const button = element("instruments-button", HTMLButtonElement);
    button.ariaExpanded = String(shown);
    kept.setItem(OPEN, shown ? "yes" : "no");
    // On a phone there is no room for a sheet below them.
    if (shown && phone.matches) window.katana?.closeSheets();
    if (shown && !this.panel) {
      const { Panel } = await import("../instruments/panel.js");
      this.panel ??= new Panel(element("instruments", HTMLElement), { say, watch: this.#watch, kept, quietly: QUIETLY });
    }
    this.panel?.show(button.ariaExpanded === "true");
  }
}
