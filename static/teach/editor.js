// The text of a script, with the numbers of its lines and what the server says about them.
import { button, html } from "../instruments/shape.js";
import { indexAt, numbersOf } from "./blocks.js";

/** @typedef {{ line: number, text: string, column?: number }} Problem */
/** @typedef {{ problems: Problem[], taught: import("./poses.js").Taught | null, blocks: import("./blocks.js").Block[] | null }} Reading */
const AFTER = 400; // ms without typing after which the text is checked
const PLACE = /^line (\d+), column \d+: (.*)$/gm;

export class Editor {
  element = html("div", { id: "teach-editor" });
  #area = html("textarea", {
    id: "teach-text", "aria-label": "Text of the script", "aria-describedby": "teach-problems", spellcheck: "false",
    autocapitalize: "off", autocomplete: "off", wrap: "off", rows: "12", maxlength: "65536",
  });
  #numbers = html("pre", { "aria-hidden": "true" });
  /** @type {Problem[]} */
  problems = [];
  list = html("ol", { id: "teach-problems", role: "status" }); // of the problems
  /** @type {(Reading & { text: string }) | null} */
  reading = null; // the last one, and the text that was read
  #timer = 0;
  #checked = 0;
  #sheet;

  /** @param {import("./teach.js").Teach} sheet */
  constructor(sheet) {
    this.#sheet = sheet;
    this.element.append(html("div", {}, this.#numbers, this.#area));
    this.#area.addEventListener("input", () => {
      this.#count();
      sheet.content.keep({ text: this.text });
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => this.check(), AFTER);
    });
    this.#area.addEventListener("scroll", () => (this.#numbers.scrollTop = this.#area.scrollTop));
  }

  get text() {
    return this.#area.value;
  }

  set text(text) {
    this.#area.value = text;
    this.#area.setSelectionRange(0, 0);
    this.#count();
    this.explain([]);
  }

  /** Return what the server reads in a text, and show its problems. Without an answer return null. @returns {Promise<Reading | null>} */
  async check(text = this.text) {
    clearTimeout(this.#timer);
    const number = (this.#checked += 1);
    const answer = await fetch("api/v1/scripts", { method: "POST", body: text }).catch(() => null);
    /** @type {Reading | null} */
    const reading = answer?.ok ? await answer.json() : null;
    if (number === this.#checked && reading) {
      this.reading = { text, ...reading };
      this.explain(reading.problems);
    }
    return reading;
  }

  /** Show `problems`: {line, text} each. @param {Problem[]} problems */
  explain(problems) {
    // What said that there are some is true no longer.
    if (this.problems.length && !problems.length) this.#sheet.report("");
    this.problems = problems;
    const lines = new Set(problems.map(({ line }) => line));
    [...this.#numbers.children].forEach((row, i) => row.classList.toggle("bad", lines.has(i + 1)));
    const blocks = this.reading?.blocks ?? [];
    const order = numbersOf(blocks);
    const rows = problems.map(({ line, text }) => {
      const i = indexAt(blocks, line);
      const place = `${order[i] ? `Step ${order[i]}, line` : "Line"} ${line}: ${blocks[i]?.title ?? ""}`;
      return html("li", {}, button([html("b", {}, place), text], () => this.#sheet.showPlace(line)));
    });
    this.list.replaceChildren(...rows);
  }

  /** Take the focus, and select a line; 0 selects none. @param {number} line */
  select(line) {
    const lines = this.text.split("\n");
    const start = lines.slice(0, line - 1).reduce((sum, row) => sum + row.length + 1, 0);
    this.#area.focus();
    if (line) this.#area.setSelectionRange(start, start + (lines[line - 1] ?? "").length);
  }

  #count() {
    const count = this.text.split("\n").length;
    if (this.#numbers.childElementCount === count) return;
    this.#numbers.replaceChildren(...Array.from({ length: count }, (_, i) => html("span", {}, `${i + 1}\n`)));
  }
}

/** Return the problems that an error of a program names, with their lines. @param {string} why @returns {Problem[]} */
export function problemsOf(why) {
  return [...why.matchAll(PLACE)].map(([, line, text]) => ({ line: Number(line), text }));
}
