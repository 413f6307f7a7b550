// The first steps: a card over the scene with three things to try, each with one click.
import { html, write } from "../instruments/shape.js";
import { parts } from "../teach/run.js";

const KEPT = "katana450.welcome"; // in the browser's storage, once the card was dismissed
const STYLE = new URL("welcome.css", import.meta.url).href;
const SCRIPT = "api/v1/scripts/Pour";
const LOOK_EVERY = 400; // ms
const PULSE_EVERY = 50; // ms
const BEGINS = 5000; // ms within which the server takes up a program
const READY_LOOKS = 5; // until a planned program counts as not run
const ID = "pour"; // id of the requests of "Watch it pour"
const POUR = "Pour"; // name of its program
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
  #dragging = null; // timer, while the handle pulses
  #pouring = false;
  #accepted = false; // whether the server has taken the script
  #refusal = ""; // why it has refused the script or the run
  #steps = {};

  // page: {say, kept, scene, name}; `name` returns the name of the person. The card is shown at once.
  constructor(page) {
    this.#page = page;
    const style = html("link", { rel: "stylesheet", href: STYLE });
    this.#card.hidden = true;
    for (const kind of ["load", "error"]) style.addEventListener(kind, () => this.show());
    document.head.append(style);
    const close = html("button", { type: "button", "aria-label": "Close for good" }, "×");
    close.addEventListener("click", () => this.#dismiss());
    const list = html("ol", {},
      this.#step("drag", "Drag the arrows", "Move the tool by its coloured handle", () => this.#drag()),
      this.#step("pour", "Watch it pour", "The arm grasps the cup and empties it", () => this.#pour()),
      this.#step("part", "Bring your own part", "Choose a file, or drop it on the scene", () => this.#part()),
    );
    this.#card.append(html("h2", {}, "First steps"), close, list, this.#says, this.#bar);
    byId("toast").before(this.#card, this.#pulse);
    window.addEventListener("status", ({ detail }) => this.#note(detail));
    window.addEventListener("placed", () => this.#done("part"));
  }

  show() {
    this.#card.hidden = false;
  }

  // A browser may refuse to store anything; then the card returns with the next visit.
  #dismiss() {
    try {
      this.#page.kept?.setItem(KEPT, "done");
    } catch {
      // Nothing to do.
    }
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

  // The handle was dragged if the arm moves while this person drives.
  #note(status) {
    if (this.#dragging === null || !status.mine || status.mood !== "moving") return;
    this.#still();
    this.#done("drag");
    write(this.#says, "The arm follows. STOP is at the top left, and Space presses it.");
  }

  async #pour() {
    if (this.#pouring) return;
    this.#still();
    this.#pouring = true;
    [this.#accepted, this.#refusal] = [false, ""];
    try {
      const answer = await fetch(SCRIPT);
      if (!answer.ok) throw new Error(await answer.text());
      const text = await answer.text();
      for (const part of parts(text)) this.#page.say(part.more ? part : { ...part, id: ID });
      await this.#watch();
    } catch (error) {
      write(this.#says, `The program cannot be run: ${error.message}`);
    }
    this.#bar.hidden = true;
    this.#pouring = false;
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
  async #watch() {
    write(this.#says, "Planning …");
    const began = performance.now();
    let waits = 0; // looks in a row at which the program was planned and did not run
    let ran = false;
    for (; ; await pause(LOOK_EVERY)) {
      const accepted = this.#accepted;
      const state = await this.#look();
      if (!state && !this.#refusal) continue;
      const { program, stopped } = state ?? {};
      const own = accepted && program?.name === POUR && program.by === this.#page.name();
      waits = own && program.status === "ready" ? waits + 1 : 0;
      const over = !own || stopped || waits > READY_LOOKS || ENDS.includes(program.status);
      if (over && !ran && !stopped && !this.#refusal && performance.now() - began < BEGINS) continue;
      if (over || this.#refusal) {
        const poured = ran && own && program.status === "done";
        if (poured) this.#done("pour");
        const reason = this.#refusal || stopped || (own && (program.why || program.status)) || "";
        return write(this.#says, poured ? "Poured. The cup is back in its place." : `It did not pour. ${reason}`);
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
