// The values of a step or a pose, each in a field.
import { write } from "../dom.js";
import { numberBox } from "../instruments/parts.js";
import { button, clamp, html, set } from "../instruments/shape.js";
import { notNumber, numberIn } from "../number.js";
import { showToast } from "../page/words.js";

/** @typedef {Omit<import("./blocks.js").Value, "line" | "column" | "end"> & { line?: number, column?: number, low?: number, high?: number }} Value */

export class Values {
  element = html("div", { class: "values", role: "group" });
  #shape = ""; // which fields there are
  /** @type {{ input: HTMLInputElement | HTMLSelectElement, unit: HTMLElement, why: HTMLElement, text: string, name: string }[]} */
  #fields = [];
  #change;

  /** @param {(i: number, words: string) => void} change called with the index of a value and what was typed for it */
  constructor(change) {
    this.#change = change;
  }

  /** @param {string} title of the step @param {Value[]} values @param {import("./editor.js").Problem[]} problems of the values */
  show(title, values, problems = []) {
    const shape = JSON.stringify(values.map(({ name, options, step }) => [name, options, step]));
    const label = this.#fields.find(({ input }) => input === document.activeElement)?.name;
    if (shape !== this.#shape) this.element.replaceChildren(...values.map((value, i) => this.#add(value, i)));
    if (shape !== this.#shape) this.#fields.find(({ name }) => name === label)?.input.focus();
    this.#shape = shape;
    set(this.element, "aria-label", `Values: ${title}`);
    values.forEach(({ line, column, text, before, step, unit = "", about = "" }, i) => {
      const field = this.#fields[i];
      // What is being typed stays.
      if (field.text !== text) field.input.value = field.text = text;
      set(field.input, "title", about);
      set(field.input, "data-line", line ?? "");
      write(field.unit, step && unit !== field.name ? unit.replace("deg", "°") : "");
      const problem = !before && problems.find((other) => other.line === line && (other.column === column || (!other.column && values.length === 1)));
      write(field.why, (problem && problem.column && problem.text) || "");
      set(field.input, "aria-description", field.why.textContent ?? "");
      set(field.input, "aria-invalid", Boolean(problem));
    });
  }

  /** @param {Value} value @param {number} i */
  #add({ name, options = [], free, step, low = -Infinity, high = Infinity }, i) {
    const box = () => (step ? numberBox({}, step) : html("input", { spellcheck: "false", autocomplete: "off", autocapitalize: "off" }));
    const input = options.length && !free ? html("select", {}, ...options.map((word) => new Option(word))) : box();
    const [unit, why] = [html("span"), html("em")];
    this.#fields[i] = { input, unit, why, text: "", name };
    input.addEventListener("change", () => {
      const words = input.value.trim();
      const value = clamp(numberIn(words), low, high);
      const isWrong = !words || (step && Number.isNaN(value));
      input.value = isWrong ? this.#fields[i].text : step ? String(value) : words;
      if (!isWrong) this.#change(i, input.value);
      else if (step) showToast(notNumber(name, words));
    });
    const words = (free ? options : []).map((word) => button(word, () => this.#change(i, word)));
    return html("div", {}, html("label", {}, html("span", {}, name), input, unit), ...words, why);
  }
}
