// The first steps: a card over the scene with three things to try, each with one click.
import { html, write } from "../instruments/shape.js";
import { parts } from "../teach/run.js";

const KEPT = "katana450.welcome"; // in the browser's storage, once the card was dismissed
const DONE = "katana450.welcome.done"; // the names of the steps that were done
const STYLE = new URL("welcome.css", import.meta.url).href;
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
/** @type {(id: string) => any} */
const byId = (id) => document.getElementById(id);
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

export class Welcome {
  #page;
  #card = html("section", { id: "welcome", class: "sheet", "aria-label": "First steps" });
  #says = html("p", { role: "status" });
  #bar = html("progress", { max: "1", "aria-label": "Progress of the program", hidden: "" });
  #pulse = html("i", { id: "pulse", hidden: "" });
  #arm;
  #dragging = null; // timer, while the handle pulses
  #program = null; // what the program of the card is, of an arm that can do it
  #isRunning = false;
  #accepted = false; // whether the server has taken the script
  #refusal = ""; // why it has refused the script or the run
  #steps = {};

  // Return the card, which is shown, for the arm of the server. page: {say, kept, scene, status}; `status` returns
  // the newest status of the server.
  static async on(page) {
    const style = html("link", { rel: "stylesheet", href: STYLE });
    const styled = new Promise((resolve) => ["load", "error"].forEach((kind) => style.addEventListener(kind, resolve)));
    document.head.append(style);
    const answer = await fetch("api/v1/arm");
    if (!answer.ok) throw new Error(await answer.text());
    const arm = await answer.json();
    await styled;
    return new Welcome(page, arm);
  }

  constructor(page, arm) {
    this.#page = page;
    this.#arm = arm;
    if (page.status()?.scripts) this.#program = arm.gripper && arm.tools.grasp ? POUR : WAVE;
    const close = html("button", { type: "button", "aria-label": "Close for good" }, "×");
    close.addEventListener("click", () => this.#dismiss());
    const list = html("ol", {});
    if (arm.default_tool) list.append(this.#step("drag", "Drag the arrows", "Move the tool by its coloured handle", () => this.#drag()));
    else list.append(this.#step("drag", "Turn a joint", "Drag a link of the arm, or a slider of the panel", () => this.#turn()));
    if (this.#program) list.append(this.#step(this.#program.name, this.#program.title, this.#program.about, () => this.#run()));
    list.append(this.#step("part", "Bring your own part", "Choose a file, or drop it on the scene", () => this.#part()));
    this.#card.append(html("h2", {}, "First steps"), close, list, this.#says, this.#bar);
    byId("toast").before(this.#card, this.#pulse);
    window.addEventListener("status", ({ detail }) => this.#note(detail));
    window.addEventListener("placed", () => this.#done("part"));
    for (const name of (page.kept?.getItem(DONE) ?? "").split(",")) if (name in this.#steps) this.#done(name);
    if (page.status()) this.#note(page.status());
  }

  #isOwn(program) {
    return program?.name === this.#program?.name && program.by === this.#page.status()?.name;
  }

  show() {
    this.#card.hidden = false;
  }

  // A browser may refuse to store anything; then the card returns as new with the next visit.
  #keep(key, value) {
    try {
      this.#page.kept?.setItem(key, value);
    } catch {
      // Nothing to do.
    }
  }

  #dismiss() {
    this.#keep(KEPT, "done");
    this.#still();
    this.#card.hidden = true;
    byId("help-button").focus();
  }

  #step(name, title, about, act) {
    const mark = html("span", { class: "mark" });
    const button = html("button", { type: "button" }, mark, html("b", {}, title), html("small", {}, about));
    button.addEventListener("click", act);
    this.#steps[name] = { button, mark };
    return html("li", {}, button);
  }

  #done(name) {
    const done = (this.#page.kept?.getItem(DONE) ?? "").split(",").filter(Boolean);
    if (!done.includes(name)) this.#keep(DONE, [...done, name].join());
    this.#steps[name].button.classList.add("done");
    write(this.#steps[name].mark, "✓ done: ");
  }

  #drag() {
    write(this.#says, "Drag one of the pulsing arrows in the scene.");
    this.#pulse.hidden = false;
    clearInterval(this.#dragging);
    this.#dragging = setInterval(() => this.#place(), PULSE_EVERY);
    this.#place();
  }

  #turn() {
    write(this.#says, "Drag a link of the arm in the scene, or a slider in the panel.");
  }

  // Put the ring where the camera shows the handle.
  #place() {
    const { scene } = this.#page;
    const pixel = scene.contentDocument?.defaultView.katanaScene?.pixelOf(HANDLE);
    this.#pulse.hidden = !pixel;
    if (!pixel) return;
    this.#pulse.style.left = `${scene.offsetLeft + pixel[0]}px`;
    this.#pulse.style.top = `${scene.offsetTop + pixel[1]}px`;
  }

  #still() {
    clearInterval(this.#dragging);
    this.#dragging = null;
    this.#pulse.hidden = true;
  }

  // A drag is the newest change that this person can undo, or was asked for and moves the arm.
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
      write(this.#says, `The program cannot be run: ${error.message}`);
    }
    this.#bar.hidden = true;
    this.#isRunning = false;
  }

  // Return the text of the program.
  async #script() {
    if (this.#program === WAVE) return this.#wave((await this.#look())?.q);
    const answer = await fetch(SCRIPT);
    if (!answer.ok) throw new Error(await answer.text());
    return answer.text();
  }

  // Turn the first joint that can turn to both sides of the posture q.
  #wave(q) {
    const { lower, upper, slides } = this.#arm;
    const room = (q ?? []).map((at, i) => (slides[i] ? 0 : Math.min(SWING, (upper[i] - at) / RADIANS - 1, (at - lower[i]) / RADIANS - 1)));
    const axis = room.findIndex((angle) => angle >= 5);
    if (axis < 0) throw new Error("No joint has room to turn. Press Home first.");
    const by = (angle) => `  - nudge: {axis: ${axis + 1}, by: ${angle}}\n`;
    const angle = Math.floor(room[axis]);
    return `name: ${WAVE.name}\nsteps:\n${by(angle)}${by(-2 * angle)}${by(angle)}`;
  }

  // Take an answer; return whether it was for the card.
  hear(answer) {
    if (answer.id !== ID) return false;
    if (answer.is === "refused") this.#refusal = answer.why;
    else this.#accepted = true;
    return true;
  }

  // The state; null if it could not be fetched.
  async #look() {
    try {
      const answer = await fetch("api/v1/state");
      return answer.ok ? await answer.json() : null;
    } catch {
      return null;
    }
  }

  // Run the program, which alone is our own, once it is planned, and follow it to its end.
  async #watch(resumed) {
    write(this.#says, "Planning …");
    const began = performance.now();
    let waits = 0; // looks in a row at which the program was planned and did not run
    let ran = resumed;
    for (; ; await pause(LOOK_EVERY)) {
      const accepted = this.#accepted;
      const state = await this.#look();
      if (!state && !this.#refusal) continue;
      const { program, stopped } = state ?? {};
      const own = accepted && this.#isOwn(program);
      waits = own && program.status === "ready" ? waits + 1 : 0;
      const over = !own || stopped || waits > READY_LOOKS || ENDS.includes(program.status);
      if (over && !ran && !stopped && !this.#refusal && performance.now() - began < BEGINS) continue;
      if (over || this.#refusal) {
        const worked = ran && own && program.status === "done";
        if (worked) this.#done(this.#program.name);
        // In the words of the page a person who pressed STOP is "You".
        const reason = this.#refusal || (stopped && (this.#page.status()?.stopped || stopped)) || (own && (program.why || program.status)) || "";
        return write(this.#says, worked ? this.#program.did : `${this.#program.not} ${reason}`);
      }
      const planning = program.status === "planning";
      if (!ran && (planning || program.status === "ready")) {
        ran = true;
        this.#page.say({ do: "steer", order: "run", id: ID });
      }
      const words = planning
        ? `Planning ${Math.round(100 * program.fraction)} %`
        : `Step ${program.step} of ${program.steps}: ${program.task || program.status}`;
      write(this.#says, words);
      this.#bar.hidden = false;
      this.#bar.value = planning ? program.fraction : program.step / Math.max(program.steps, 1);
    }
  }

  #part() {
    this.#still();
    byId("object-file").click();
  }
}
