// The first frame of the scene: the poster before it, and what waits for it.
import { element, first, write } from "../dom.js";

const TRY_AFTER = 2000; // ms without a drawn scene after which the page checks whether it can be drawn
const REST_AFTER = 100; // ms after the first frame in which the rest of the page waits
const FAILURE =
  "This browser cannot draw the scene: WebGL 2 is off or missing. Turn on hardware acceleration in its settings, or use another browser. STOP and Jog work without it.";
const poster = element("poster", HTMLElement);

export class FirstFrame {
  canDraw = true;
  #drawn = false;
  #end = () => {};
  // Resolved REST_AFTER after the first frame, or TRY_AFTER after the start without one: what can wait takes no time from
  // the drawing of the scene.
  /** @type {Promise<void>} */
  rest = new Promise((done) => (this.#end = done));

  constructor() {
    setTimeout(() => this.#check(), TRY_AFTER);
  }

  // Note that the scene is drawn; return whether it is shown.
  note() {
    if (!this.canDraw) return false;
    this.#drawn = true;
    poster.classList.add("done");
    requestAnimationFrame(() => setTimeout(this.#end, REST_AFTER));
    return true;
  }

  // A second context for drawing takes time, so it is made only if nothing was drawn.
  #check() {
    if (!this.#drawn) this.canDraw = document.createElement("canvas").getContext("webgl2") !== null;
    this.#end();
    if (this.canDraw) return;
    poster.classList.add("failed");
    write(first("p", HTMLElement, poster), FAILURE);
  }
}
