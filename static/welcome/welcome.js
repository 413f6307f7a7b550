// The first steps: a card over the scene with three things to try, each with one click.
import { element, sceneOf, styled, write } from "../dom.js";
import { html } from "../instruments/shape.js";
import { messageOf, readArm, readState, request } from "../server.js";
import { parts } from "../teach/run.js";

const KEPT = "katana450.welcome"; // in the browser's storage, once the card was dismissed
const DONE = "katana450.welcome.done"; // the names of the steps that were done
const SCRIPT = "api/v1/scripts/Pour";
const LOOK_EVERY = 400; // ms
const PULSE_EVERY = 50; // ms
const BEGINS = 5000; // ms within which the server takes up a program
const READY_LOOKS = 5; // until a planned program counts as not run
const ID = "pour"; // id of the requests of the program
const POUR = { name: "Pour", title: "Watch it pour", about: "The arm grasps the cup and empties it", did: "Poured. The cup is back in its place.", not: "It did not pour." };
const WAVE = { name: "Wave", title: "Watch it move", about: "A program turns one joint to and fro", did: "Done. That was a program of three steps.", not: "It did not move." };
const SWING = 20; // degrees to either side, at most
const RADIANS = Math.PI / 180;
const ENDS = ["done", "stopped", "failed", "cancelled", "refused", "blocked"];
const HANDLE = "/target/move";
/** @param {number} ms */
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

export class Welcome {
  #page;
  #card = html("section", { id: "welcome", class: "sheet", "aria-label": "First steps" });
  #says = html("p", { role: "status" });
  #bar = html("progress", { max: "1", "aria-label": "Progress of the program", hidden: "" });
  #pulse = html("i", { id: "pulse", hidden: "" });
  #arm;
  /** @type {number | null} */
  #dragging = null; // timer, while the handle pulses
  /** @type {typeof POUR | null} */
  #program = null; // what the program of the card is, of an arm that can do it
  #isRunning = false;
  #accepted = false; // whether the server has taken the script
  #refusal = ""; // why it has refused the script or the run
  /** @type {Record<string, { button: HTMLButtonElement, mark: HTMLElement }>} */
  #steps = {};

  /** Return the card, which is shown, for the arm of the server. @param {Page.Context} page */
  static async on(page) {
    const style = styled("welcome.css", import.meta.url);
    const arm = await readArm();
    await style;
    return new Welcome(page, arm);
  }

  /** @param {Page.Context} page @param {Api.Arm} arm */
  constructor(page, arm) {
    this.#page = page;
    this.#arm = arm;
    const { status } = page.store;
    if (status?.scripts) this.#program = arm.gripper && arm.tools.grasp ? POUR : WAVE;
    const close = html("button", { type: "button", "aria-label": "Close for good" }, "×");
    close.addEventListener("click", () => this.#dismiss());
    const list = html("ol", {});
    if (arm.default_tool) list.append(this.#step("drag", "Drag the arrows", "Move the tool by its coloured handle", () => this.#drag()));
    else list.append(this.#step("drag", "Turn a joint", "Drag a link of the arm, or a slider of the panel", () => this.#turn()));
    if (this.#program) list.append(this.#step(this.#program.name, this.#program.title, this.#program.about, () => this.#run()));
    list.append(this.#step("part", "Bring your own part", "Choose a file, or drop it on the scene", () => this.#part()));
    this.#card.append(html("h2", {}, "First steps"), close, list, this.#says, this.#bar);
    element("toast", HTMLElement).before(this.#card, this.#pulse);
    page.store.follow((news) => this.#note(news));
    window.addEventListener("placed", () => this.#done("part"));
    for (const name of (page.kept?.getItem(DONE) ?? "").split(",")) if (name in this.#steps) this.#done(name);
    if (status) this.#note(status);
  }

  /** @param {Api.Progress | null | undefined} program @returns {program is Api.Progress} */
  #isOwn(program) {
    return program?.name === this.#program?.name && program?.by === this.#page.store.status?.name;
  }

  show() {
    this.#card.hidden = false;
  }

  /** A browser may refuse to store anything; then the card returns as new with the next visit. @param {string} key @param {string} entry */
  #keep(key, entry) {
    try {
      this.#page.kept?.setItem(key, entry);
    } catch {
      // Nothing to do.
    }
  }

  #dismiss() {
    this.#keep(KEPT, "done");
    this.#still();
    this.#card.hidden = true;
    element("help-button", HTMLElement).focus();
  }

  /** @param {string} name @param {string} title @param {string} about @param {() => void} act */
  #step(name, title, about, act) {
    const mark = html("span", { class: "mark" });
    const button = html("button", { type: "button" }, mark, html("b", {}, title), html("small", {}, about));
    button.addEventListener("click", act);
    this.#steps[name] = { button, mark };
    return html("li", {}, button);
  }

  /** @param {string} name */
  #done(name) {
    const done = (this.#page.kept?.getItem(DONE) ?? "").split(",").filter(Boolean);
    if (!done.includes(name)) this.#keep(DONE, [...done, name].join());
    this.#steps[name].button.classList.add("done");
    write(this.#steps[name].mark, "✓ done: ");
  }

  #drag() {
    write(this.#says, "Drag one of the pulsing arrows in the scene.");
    this.#pulse.hidden = false;
    clearInterval(this.#dragging ?? undefined);
    this.#dragging = setInterval(() => this.#place(), PULSE_EVERY);
    this.#place();
  }

  #turn() {
    write(this.#says, "Drag a link of the arm in the scene, or a slider in the panel.");
  }

  // Put the ring where the camera shows the handle.
  #place() {
    const { scene } = this.#page;
    const pixel = sceneOf(scene)?.pixelOf(HANDLE);
    this.#pulse.hidden = !pixel;
    if (!pixel) return;
    this.#pulse.style.left = `${scene.offsetLeft + pixel[0]}px`;
    this.#pulse.style.top = `${scene.offsetTop + pixel[1]}px`;
  }

  #still() {
    clearInterval(this.#dragging ?? undefined);
    this.#dragging = null;
    this.#pulse.hidden = true;
  }

  /** A drag is the newest change that this person can undo, or was asked for and moves the arm. @param {Page.Status} status */
  #note(status) {
    // The program runs, also after a reload or a stop, for its owner, who alone may end it.
    const runs = status.orders.includes("end") && !status.planning;
    if (runs && status.continues[0] === this.#program?.name) this.#run(true);
    const wanted = this.#arm.default_tool ? "arm (drag)" : "arm (";
    const isDrag = status.mine && (status.undo?.[0] ?? "").startsWith(wanted);
    const moves = this.#dragging !== null && status.mine && status.mood === "moving";
    if (this.#steps.drag.button.classList.contains("done") || !(isDrag || moves)) return;
    this.#still();
    this.#done("drag");
    if (!this.#isRunning) write(this.#says, "The arm follows. STOP is at the top left, and Space presses it.");
  }

  // began: whether it runs already.
  async #run(began = false) {
    if (this.#isRunning) return;
    this.#still();
    this.#isRunning = true;
    [this.#accepted, this.#refusal] = [began, ""];
    try {
      const text = began ? "" : await this.#script();
      for (const part of began ? [] : parts(text)) this.#page.say(part.more ? part : { ...part, id: ID });
      await this.#watch(began);
    } catch (error) {
      write(this.#says, `The program cannot be run: ${messageOf(error)}`);
    }
    this.#bar.hidden = true;
    this.#isRunning = false;
  }

  // Return the text of the program.
  async #script() {
    if (this.#program === WAVE) return this.#wave((await readState())?.q ?? []);
    return (await request(SCRIPT)).text();
  }

  /** Turn the first joint that can turn to both sides of the posture q. @param {number[]} q */
  #wave(q) {
    const { lower, upper, slides } = this.#arm;
    const room = q.map((angle, i) => (slides[i] ? 0 : Math.min(SWING, (upper[i] - angle) / RADIANS - 1, (angle - lower[i]) / RADIANS - 1)));
    const axis = room.findIndex((angle) => angle >= 5);
    if (axis < 0) throw new Error("No joint has room to turn. Press Home first.");
    /** @param {number} angle */
    const by = (angle) => `  - nudge: {axis: ${axis + 1}, by: ${angle}}\n`;
    const angle = Math.floor(room[axis]);
    return `name: ${WAVE.name}\nsteps:\n${by(angle)}${by(-2 * angle)}${by(angle)}`;
  }

  /** Take an answer; return whether it was for the card. @param {Page.Answer} answer */
  hear(answer) {
    if (answer.id !== ID) return false;
    if (answer.is === "refused") this.#refusal = answer.why;
    else this.#accepted = true;
    return true;
  }

  // Run the program, which alone is our own, once it is planned, and follow it to its end.
  /** @param {boolean} resumed whether it runs already */
  async #watch(resumed) {
    write(this.#says, "Planning …");
    const began = performance.now();
    let waits = 0; // looks in a row at which the program was planned and did not run
    let ran = resumed;
    for (; ; await pause(LOOK_EVERY)) {
      const accepted = this.#accepted;
      const state = await readState();
      if (!state && !this.#refusal) continue;
      const { program, stopped } = state ?? { program: null, stopped: null };
      const own = accepted && this.#isOwn(program) ? program : null;
      waits = own?.status === "ready" ? waits + 1 : 0;
      const over = !own || stopped || waits > READY_LOOKS || ENDS.includes(own.status);
      if (over && !ran && !stopped && !this.#refusal && performance.now() - began < BEGINS) continue;
      if (over || this.#refusal) return this.#end(ran ? own : null, stopped, own);
      const planning = own.status === "planning";
      if (!ran && (planning || own.status === "ready")) {
        ran = true;
        this.#page.say({ do: "steer", order: "run", id: ID });
      }
      const words = planning
        ? `Planning ${Math.round(100 * own.fraction)} %`
        : `Step ${own.step} of ${own.steps}: ${own.task || own.status}`;
      write(this.#says, words);
      this.#bar.hidden = false;
      this.#bar.value = planning ? own.fraction : own.step / Math.max(own.steps, 1);
    }
  }

  // Say how the program has ended. `ran`: its progress, if it was run; `stopped`: why the arm is stopped.
  /** @param {Api.Progress | null} ran @param {string | null} stopped @param {Api.Progress | null} own */
  #end(ran, stopped, own) {
    if (!this.#program) return;
    const worked = ran?.status === "done";
    if (worked) this.#done(this.#program.name);
    // In the words of the page a person who pressed STOP is "You".
    const reason = this.#refusal || (stopped && (this.#page.store.status?.stopped || stopped)) || own?.why || own?.status || "";
    write(this.#says, worked ? this.#program.did : `${this.#program.not} ${reason}`);
  }

  #part() {
    this.#still();
    element("object-file", HTMLElement).click();
  }
}
