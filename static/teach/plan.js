// The program that the server has: its steps, and the time of its preview that the scene shows.
import { repeating, write } from "../dom.js";
import { html, set } from "../instruments/shape.js";
import { QUIETLY } from "../page/parts.js";
import { request } from "../server.js";

const EVERY = 300; // ms between two looks at the program
const SEND_EVERY = 100; // ms between two times of the preview
const HELD = 1000; // ms after the last press of a person for which the slider stays where they left it
const WELL = ["running", "done"];
const IN_USE = ["planning", "running", "paused", "blocked"];

export class Plan {
  #page;
  #sheet;
  /** @type {Api.ProgramPlan} */
  answer = { is: "program_plan" }; // of the server
  #sender = 0;
  watch = repeating(() => this.read(), EVERY); // looks at the program of the server
  #pressed = -Infinity; // ms, time of the last use of the slider
  #slider = html("input", { type: "range", min: 0, max: 1, step: 0.1, value: 0, "aria-label": "Look at the time of the preview" });
  #time = html("output");
  look = html("label", { id: "teach-look", title: "Shows arm, objects and water at this time, before the program runs" }, "Look at", this.#slider, this.#time);

  /** @param {Pick<Page.Context, "say" | "store">} page @param {import("./teach.js").Teach} sheet */
  constructor(page, sheet) {
    this.#page = page;
    this.#sheet = sheet;
    this.#slider.addEventListener("input", () => {
      this.#pressed = performance.now();
      this.#tell(this.#slider.valueAsNumber, this.answer.seconds ?? 0);
      if (this.#sender) return;
      this.#sender = setTimeout(() => {
        this.#sender = 0;
        this.#page.say({ do: "preview", at: this.#slider.valueAsNumber });
      }, SEND_EVERY);
    });
  }

  // Whether the server has the program that is shown.
  get isShown() {
    return Boolean(this.answer.text) && this.answer.text === this.#sheet.shownText;
  }

  // The program that is planned or runs; null without one.
  get used() {
    const { program } = this.answer;
    return program && IN_USE.includes(program.status) ? program : null;
  }

  // The steps of the program, if it is the one that is shown.
  get steps() {
    return (this.isShown && this.answer.steps) || [];
  }

  // The steps before which it pauses, from 1.
  get breakpoints() {
    return this.answer.program?.breakpoints ?? [];
  }

  async read() {
    const answer = await request("api/v1/program_plan").catch(() => null);
    if (!answer) return;
    this.answer = await answer.json();
    // A program that was continued has overcome what had ended it.
    if (this.isShown && WELL.includes(this.answer.program?.status ?? "")) this.#sheet.editor.explain([]);
    const { program, look } = this.answer;
    // The scene shows no preview of another text, and the bar no longer says what was wrong with it.
    const isWrong = this.isShown === (look === null);
    if (isWrong && !this.used && program?.by === this.#page.store.live?.name) this.#page.say({ do: "preview", at: this.isShown ? 0 : null, id: QUIETLY });
    this.draw();
    this.#sheet.drawPlan();
  }

  draw() {
    const { seconds = 0, look } = this.isShown ? this.answer : /** @type {Partial<Api.ProgramPlan>} */ ({});
    this.#slider.disabled = !seconds;
    if (seconds && performance.now() - this.#pressed <= HELD) return;
    set(this.#slider, "max", Math.ceil(10 * seconds) / 10 || 1);
    this.#slider.value = String(look ?? 0);
    if (seconds) this.#tell(look ?? 0, seconds);
    else write(this.#time, "no preview");
  }

  /** @param {number} time @param {number} end */
  #tell(time, end) {
    const words = `${time.toFixed(1)} s of ${end.toFixed(1)} s`;
    write(this.#time, words);
    set(this.#slider, "aria-valuetext", words);
  }

  /** Run the program from a step, from 1. @param {number} at */
  runFrom(at) {
    this.#page.say({ do: "steer", order: "run", at });
  }

  /** Pause before all these steps; no longer, if it already does. @param {number[]} steps */
  toggle(steps) {
    const others = this.breakpoints.filter((step) => !steps.includes(step));
    const isOn = steps.every((step) => this.breakpoints.includes(step));
    this.#page.say({ do: "breakpoints", steps: isOn ? others : [...others, ...steps] });
    this.read();
  }
}
