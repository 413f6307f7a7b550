// The program that the server has: the time of its preview that the scene shows, and its steps, each with a button
// that pauses before it and one that runs from it.
import { write } from "../dom.js";
import { button, html, set } from "../instruments/shape.js";
import { request } from "../server.js";

const EVERY = 300; // ms between two looks at the program
const SEND_EVERY = 100; // ms between two times of the preview
const HELD = 1000; // ms after the last press of a person for which the slider stays where they left it
const IN_USE = ["planning", "running", "paused", "blocked"];

/** @typedef {{ element: HTMLElement, pause: HTMLButtonElement, name: HTMLElement, note: HTMLElement }} Row */

export class Plan {
  #say;
  #script;
  #changed;
  /** @type {Api.ProgramPlan} */
  answer = { is: "program_plan" }; // of the server
  #timer = 0;
  #sender = 0;
  #pressed = -Infinity; // ms, time of the last use of the slider
  #slider = html("input", { type: "range", min: 0, max: 1, step: 0.1, value: 0, "aria-label": "Look at the time of the preview" });
  #time = html("output");
  look = html("label", { id: "teach-look", title: "Shows arm, objects and water at this time, before the program runs" }, "Look at", this.#slider, this.#time);
  list = html("ol", { class: "steps", "aria-label": "Steps" });
  /** @type {Row[]} */
  #rows = [];

  // script: returns the text of what the sheet shows, or null; `changed` is called after each look.
  /** @param {Page.Say} say @param {() => string | null} script @param {() => void} changed */
  constructor(say, script, changed) {
    this.#say = say;
    this.#script = script;
    this.#changed = changed;
    this.#slider.addEventListener("input", () => {
      this.#pressed = performance.now();
      this.#tell(this.#slider.valueAsNumber, this.answer.seconds ?? 0);
      if (this.#sender) return;
      this.#sender = setTimeout(() => {
        this.#sender = 0;
        this.#say({ do: "preview", at: this.#slider.valueAsNumber });
      }, SEND_EVERY);
    });
  }

  // Whether the server has the program that is shown.
  get isShown() {
    return Boolean(this.answer.text) && this.answer.text === this.#script();
  }

  // The program that is planned or runs; null without one.
  get used() {
    const { program } = this.answer;
    return program && IN_USE.includes(program.status) ? program : null;
  }

  /** Look at the program of the server from now on, or no longer. @param {boolean} on */
  watch(on) {
    clearInterval(this.#timer);
    if (!on) return;
    this.#timer = setInterval(() => this.read(), EVERY);
    this.read();
  }

  async read() {
    const answer = await request("api/v1/program_plan").catch(() => null);
    if (!answer) return;
    this.answer = await answer.json();
    this.draw();
    this.#changed();
  }

  draw() {
    const { seconds = 0, look = 0, steps = [], program } = this.isShown ? this.answer : /** @type {Partial<Api.ProgramPlan>} */ ({});
    this.look.hidden = !seconds;
    if (seconds && performance.now() - this.#pressed > HELD) {
      set(this.#slider, "max", Math.ceil(10 * seconds) / 10);
      this.#slider.value = String(look);
      this.#tell(look, seconds);
    }
    while (this.#rows.length > steps.length) this.#rows.pop()?.element.remove();
    while (this.#rows.length < steps.length) this.list.append(this.#add(this.#rows.length + 1).element);
    steps.forEach((step, i) => this.#show(this.#rows[i], step, program?.breakpoints.includes(i + 1) ?? false));
  }

  /** @param {number} time @param {number} end */
  #tell(time, end) {
    const words = `${time.toFixed(1)} s of ${end.toFixed(1)} s`;
    write(this.#time, words);
    set(this.#slider, "aria-valuetext", words);
  }

  /** @param {number} number @returns {Row} */
  #add(number) {
    const pause = button("", () => this.#toggle(number), { class: "pause", "aria-label": `Pause before step ${number}`, title: "Pause before this step" });
    const run = button("▶", () => this.#say({ do: "steer", order: "run", at: number }), { "aria-label": `Run from step ${number}`, title: "Run from this step" });
    const [name, note] = [html("span"), html("span")];
    const element = html("li", {}, pause, run, html("b", {}, String(number)), name, note);
    this.#rows.push({ element, pause, name, note });
    return this.#rows[number - 1];
  }

  /** @param {number} number */
  #toggle(number) {
    const before = this.answer.program?.breakpoints ?? [];
    this.#say({ do: "breakpoints", steps: before.includes(number) ? before.filter((step) => step !== number) : [...before, number] });
    this.read();
  }

  /** @param {Row} row @param {Api.ProgramStep} step @param {boolean} pauses */
  #show({ element, pause, name, note }, { name: title, seconds, mark }, pauses) {
    const isCurrent = ["shown", "now", "ended here"].includes(mark);
    if (isCurrent && !element.ariaCurrent) element.scrollIntoView({ block: "nearest" });
    if (isCurrent) set(element, "aria-current", "step");
    else element.removeAttribute("aria-current");
    set(element, "class", mark);
    set(pause, "aria-pressed", pauses);
    write(name, title);
    write(note, [mark, seconds && mark !== "skipped" ? `${seconds.toFixed(1)} s` : ""].filter(Boolean).join(" "));
  }
}
