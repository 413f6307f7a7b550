// The first steps: a card over the scene with three things to try, each with one click.
import { element, repeating, sceneOf, write } from "../dom.js";
import { button, html } from "../instruments/shape.js";
import { armWithStyle } from "../page/ready.js";
import { messageOf, request } from "../server.js";
import { ScriptRun } from "../teach/run.js";

const KEPT = "katana450.welcome"; // in the browser's storage, once the card was dismissed
const DONE = "katana450.welcome.done"; // the names of the steps that were done
const SCRIPTS = "api/v1/scripts/";
const PULSE_EVERY = 50; // ms
const ID = "pour"; // id of the requests of the program
const POUR = { name: "Pour", title: "Watch it pour", about: "The arm grasps the cup and empties it", did: "Poured. The cup is back in its place.", not: "It did not pour." };
const WAVE = { name: "Wave", title: "Watch it move", about: "A program turns one joint to and fro", did: "Done. That was a program of {} steps.", not: "It did not move." };
const CIRCLE = { name: "Small circle", title: "Watch it move", about: "The arm draws a circle in the air", did: "Done. That was a program of {} steps.", not: "It did not move." };
const TO_AND_FRO = `name: ${WAVE.name}\nsteps:\n  - nudge: {axis: 1, by: 20}\n  - nudge: {axis: 1, by: -20}\n`; // degrees or mm
const HANDLE = "/target/move";

export class Welcome {
  #page;
  #card = html("section", { id: "welcome", class: "sheet", "aria-label": "First steps" });
  #says = html("p", { role: "status" }, "Try them in any order. STOP, at the top left, works at any time.");
  #blocked = false; // whether a pause or a stop keeps the program from running
  #pulse = html("i", { id: "pulse", hidden: "" });
  #arm;
  #watch = repeating(() => this.#place(), PULSE_EVERY);
  /** @type {typeof POUR | null} */
  #program = null; // what the program of the card is, of an arm that can do it
  #run; // of the program
  /** @type {Record<string, { button: HTMLButtonElement, mark: HTMLElement }>} */
  #steps = {};

  /** Return the card, which is shown, for the arm of the server. @param {Page.Context} page */
  static async on(page) {
    return new Welcome(page, await armWithStyle("welcome.css", import.meta.url));
  }

  /** @param {Page.Context} page @param {Api.Arm} arm */
  constructor(page, arm) {
    this.#page = page;
    this.#arm = arm;
    this.#run = new ScriptRun(page.say, ID);
    const { status } = page.store;
    if (status?.scripts) this.#program = arm.gripper && arm.tools.grasp ? POUR : arm.tools.gripper_frame_link ? CIRCLE : WAVE;
    const close = button("×", () => this.#dismiss(), { "aria-label": "Close for good" });
    const list = html("ol", {});
    if (arm.default_tool) list.append(this.#step("drag", "Drag the arrows", "Move the tool by its coloured handle", () => this.#drag()));
    else list.append(this.#step("drag", "Turn a joint", "Drag a link of the arm, or a slider of the panel", () => write(this.#says, "Drag a link of the arm in the scene, or a slider in the panel.")));
    if (this.#program) list.append(this.#step(this.#program.name, this.#program.title, this.#program.about, () => this.#play()));
    list.append(this.#step("part", "Bring your own part", "Choose a file, or drop it on the scene", () => this.#part()));
    this.#card.append(html("h2", {}, "First steps"), close, list, this.#says);
    element("toast", HTMLElement).before(this.#card, this.#pulse);
    page.store.follow((news) => this.#note(news));
    window.addEventListener("placed", () => this.#done("part"));
    for (const name of (page.kept.getItem(DONE) ?? "").split(",")) if (name in this.#steps) this.#done(name);
    if (status) this.#note(status);
  }

  show() {
    this.#card.hidden = false;
  }

  #dismiss() {
    this.#page.kept.setItem(KEPT, "done");
    this.#still();
    this.#card.hidden = true;
    element("help-button", HTMLElement).focus();
  }

  /** @param {string} name @param {string} title @param {string} about @param {() => void} act */
  #step(name, title, about, act) {
    const mark = html("span", { class: "mark" });
    const tries = button([mark, html("b", {}, title), html("small", {}, about)], act);
    this.#steps[name] = { button: tries, mark };
    return html("li", {}, tries);
  }

  /** @param {string} name */
  #done(name) {
    const done = (this.#page.kept.getItem(DONE) ?? "").split(",").filter(Boolean);
    if (!done.includes(name)) this.#page.kept.setItem(DONE, [...done, name].join());
    this.#steps[name].button.classList.add("done");
    write(this.#steps[name].mark, "✓ done: ");
  }

  #drag() {
    write(this.#says, "Drag one of the pulsing arrows in the scene.");
    this.#watch(true);
  }

  // Put the ring where the camera shows the handle.
  #place() {
    const { scene } = this.#page;
    const pixel = sceneOf(scene)?.pixelOf(HANDLE);
    this.#pulse.hidden = !pixel;
    if (!pixel) return;
    this.#pulse.style.left = `${pixel[0]}px`;
    this.#pulse.style.top = `${pixel[1]}px`;
  }

  #still() {
    this.#blocked = false;
    this.#watch(false);
    this.#pulse.hidden = true;
  }

  /** A drag is the newest change that this person can undo, or was asked for and moves the arm. @param {Page.Status} status */
  #note(status) {
    if (this.#blocked && !status.paused && !status.stopped) {
      this.#blocked = false;
      write(this.#says, "");
    }
    // The program runs, also after a reload or a stop, for its owner, who alone may end it.
    const runs = status.orders.includes("end") && !status.planning;
    if (runs && status.continues[0] === this.#program?.name) this.#play(true);
    const wanted = this.#arm.default_tool ? "arm (drag)" : "arm (";
    const isDrag = status.mine && (status.undo?.[0] ?? "").startsWith(wanted);
    const moves = !this.#pulse.hidden && status.mine && status.mood === "moving";
    if (this.#steps.drag.button.classList.contains("done") || !(isDrag || moves)) return;
    this.#still();
    this.#done("drag");
    if (!this.#run.busy) write(this.#says, "The arm follows. STOP is at the top left, and Space presses it.");
  }

  // Run the program to its end, which the bar follows step by step. `began`: whether it runs already.
  async #play(began = false) {
    if (this.#run.busy || !this.#program) return;
    this.#still();
    write(this.#says, "");
    const { name, did, not } = this.#program;
    try {
      const { revocations } = this.#page.store.status ?? {};
      const program = began ? await this.#run.follow() : await this.#run.play(await this.#script(), "run", revocations);
      if (program.status !== "done") throw new Error(program.why || program.status);
      this.#done(name);
      write(this.#says, did.replace("{}", String(program.steps)));
    } catch (error) {
      write(this.#says, `${not} ${messageOf(error)}`);
      const { paused, stopped } = this.#page.store.status ?? {};
      this.#blocked = Boolean(paused || stopped);
    }
  }

  // Return the text of the program.
  async #script() {
    return this.#program === WAVE ? TO_AND_FRO : (await request(SCRIPTS + this.#program?.name)).text();
  }

  /** Take an answer; return whether it was for the card. @param {Page.Answer} answer */
  hear(answer) {
    return this.#run.hear(answer);
  }

  #part() {
    this.#still();
    element("object-file", HTMLElement).click();
  }
}
