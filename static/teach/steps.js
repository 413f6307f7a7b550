// The steps of the script that is shown, as blocks that are edited in place; of the program that the server has also
// their times, marks and breakpoints.
import { write } from "../dom.js";
import { button, html, set } from "../instruments/shape.js";
import { duplicated, indexAt, inserted, isOnly, moved, numbersOf, placeBeside, placesOf, removed, replaced, toggled } from "./blocks.js";
import { draggable } from "./order.js";
import { scriptOf } from "./poses.js";
import { drawn } from "./row.js";
import { Values } from "./values.js";

const COMMON = ["wait", "gripper", "place", "grasp", "line"]; // first in the menu
const CURRENT = ["shown", "now", "ended here"]; // marks
const LOCKED = "This step shares its line with others. Move it in the text.";
const NEEDED = "Its list needs one step. Insert another one first, or change the step around it.";

/** @typedef {import("./blocks.js").Block} Block */
/** @typedef {import("./blocks.js").Edit} Edit */
/** @typedef {"up" | "down" | "copy" | "off" | "add" | "remove"} Name */
/** @typedef {{ element: HTMLElement, pause: HTMLButtonElement, run: HTMLButtonElement, number: HTMLElement, name: HTMLButtonElement, note: HTMLElement, steps: number[] }} Row */

export class Steps {
  #sheet;
  /** @type {Row[]} */
  #rows = [];
  /** @type {Block[]} */
  #blocks = []; // of the newest text that has some
  /** @type {string | null} */
  #asked = null; // the text that the server was asked to read
  line = 0; // a line of the block that is open
  #column = Infinity; // a column behind its start
  #edits = Promise.resolve(); // the last one
  #list = html("ol", { class: "steps", "aria-label": "Steps" });
  #menu = html("div", { class: "menu", role: "group", hidden: "" });
  #values = new Values((i, words) => this.#replace(i, words));
  #buttons;
  #acts;
  element = html("div", {}, this.#list);

  /** @param {import("./teach.js").Teach} sheet */
  constructor(sheet) {
    this.#sheet = sheet;
    /** @param {number} by */
    const move = (by) => (/** @type {string} */ text, /** @type {Block} */ own, /** @type {number} */ i) => {
      const { places, here } = placesOf(this.#blocks, i);
      return places[here + by] && moved(text, own, places[here + by]);
    };
    /** @type {Record<Name, HTMLButtonElement>} */
    this.#buttons = {
      up: drawn("up", () => this.#edit("up", move(-1))),
      down: drawn("down", () => this.#edit("down", move(1))),
      copy: drawn("copy", () => this.#edit("copy", duplicated)),
      off: drawn("off", () => this.#edit("off", toggled)),
      add: drawn("add", () => {
        this.#open(Boolean(this.#menu.hidden));
        this.#menu.scrollIntoView({ block: "nearest" });
      }),
      remove: drawn("remove", () => this.#edit("remove", removed)),
    };
    this.#acts = html("div", { class: "edit" }, this.#values.element, html("div", { class: "acts" }, ...Object.values(this.#buttons)), this.#menu);
  }

  /** Open the block at a place, and mark it. @param {number} line */
  select(line, column = Infinity) {
    [this.line, this.#column] = [line, column];
    this.#open(false);
    this.draw();
    this.#rows[this.#opened]?.element.scrollIntoView({ block: "nearest" });
    /** @type {HTMLElement | null} */ (this.#acts.querySelector(`[aria-invalid=true][data-line="${line}"]`))?.focus();
  }

  get #opened() {
    return indexAt(this.#blocks, this.line, this.#column);
  }

  get #isCurrent() {
    return this.#sheet.editor.reading?.text === this.#sheet.shownText;
  }

  /** Read the blocks of the script that is shown; return whether there are some. */
  async #fresh() {
    const text = this.#sheet.shownText;
    if (text !== null && !this.#isCurrent) {
      const reading = await this.#sheet.editor.check((this.#asked = text));
      if (!reading) this.#sheet.report("The server does not answer.", true);
    }
    this.draw();
    return this.#isCurrent && this.#sheet.editor.reading?.blocks !== null;
  }

  // Change the text, after the changes before this one, which the server may still read.
  /** @param {(text: string) => void} change */
  #later(change) {
    this.#edits = this.#edits.then(async () => {
      const isFresh = await this.#fresh();
      const text = this.#sheet.shownText;
      if (isFresh && text !== null) change(text);
    });
  }

  // Edit the block that is open.
  /** @param {Name} name @param {(text: string, own: Block, i: number) => Edit | undefined} act */
  #edit(name, act) {
    this.#later((text) => {
      const i = this.#opened;
      const control = this.#buttons[name];
      const edit = i >= 0 && control.ariaDisabled !== "true" && act(text, this.#blocks[i], i);
      if (edit) this.#take(edit, `${control.ariaLabel}.`);
    });
  }

  /** Write other words for a value of the block that is open. @param {number} i @param {string} words */
  #replace(i, words) {
    const { line, column } = this.#blocks[this.#opened];
    this.#later((text) => {
      const value = this.#blocks.find((block) => block.line === line && block.column === column)?.values?.[i];
      if (!value || value.text === words) return;
      this.#sheet.content.change({ text: replaced(text, value, words) });
      this.#sheet.report(`${value.name}: ${words}.`);
    });
  }

  /** @param {Edit} edit @param {string} words */
  #take({ text, line }, words) {
    [this.line, this.#column] = [line, Infinity];
    this.#open(false);
    this.#sheet.content.change({ text });
    this.#sheet.report(words);
  }

  /** @param {string} step */
  async #insert(step) {
    const own = (await this.#fresh()) ? this.#blocks[this.#opened] : null;
    const edit = inserted(this.#sheet.shownText ?? scriptOf({ ...this.#sheet.content.now, times: 1 }).text, own ?? null, step);
    this.#take(edit, `Inserted: ${step.split(":")[0]}.`);
    this.#buttons.add.focus();
  }

  /** Open or close the menu of steps. @param {boolean} on */
  #open(on) {
    this.#menu.hidden = !on;
    set(this.#buttons.add, "aria-expanded", on);
    const examples = Object.entries(this.#sheet.scripts.examples).sort(([a], [b]) => COMMON.indexOf(b) - COMMON.indexOf(a));
    if (!on || this.#menu.childElementCount || !examples.length) return;
    const pose = button("present pose", async () => this.#insert(await this.#sheet.pose()), { title: "joints: the angles of the present goal" });
    const others = examples.map(([word, step]) => button(word.replaceAll("_", " "), () => this.#insert(step), { title: step, translate: "no" }));
    this.#menu.append(pose, ...others);
  }

  draw() {
    const text = this.#sheet.shownText;
    const { reading } = this.#sheet.editor;
    if (text !== null && !this.#isCurrent && this.#asked !== text) this.#fresh();
    if (text === null) this.#blocks = [];
    else if (this.#isCurrent && reading?.blocks) this.#blocks = reading.blocks;
    // Of a text that cannot be read the last blocks are shown.
    const isLost = text !== null && this.#isCurrent && !reading?.blocks;
    this.#list.inert = isLost;
    this.#list.classList.toggle("lost", isLost);
    set(this.#list, "aria-label", isLost ? "Steps before the mistake in the text" : "Steps");
    /** @type {Map<string, number[]>} */
    const numbers = new Map();
    this.#sheet.plan.steps.forEach(({ line, column }, i) => {
      const place = `${line}:${column}`;
      numbers.set(place, [...(numbers.get(place) ?? []), i + 1]);
    });
    // An edit takes the plan away; the room of its buttons stays, so that the list does not jump.
    if (text === null || numbers.size) this.#list.classList.toggle("planned", numbers.size > 0);
    const wrong = new Set(this.#sheet.editor.problems.map(({ line }) => indexAt(this.#blocks, line)));
    while (this.#rows.length > this.#blocks.length) this.#rows.pop()?.element.remove();
    while (this.#rows.length < this.#blocks.length) this.#list.append(this.#add(this.#rows.length).element);
    const order = numbers.size ? [] : numbersOf(this.#blocks);
    this.#blocks.forEach((block, i) => this.#show(i, block, numbers.get(`${block.line}:${block.column}`) ?? [], wrong.has(i), order[i]));
    this.#drawActs(text);
  }

  // Put the buttons into the row of the block that is open; the menu alone where there is no step yet.
  /** @param {string | null} text */
  #drawActs(text) {
    const i = this.#opened;
    const focused = document.activeElement;
    this.#rows.forEach(({ name }, other) => set(name, "aria-expanded", other === i));
    const isFirst = text === null;
    if (isFirst) this.#open(true);
    const target = isFirst ? this.element : this.#rows[i]?.element;
    set(this.#acts, "class", isFirst ? "edit first" : "edit");
    if (!target) return this.#acts.remove();
    if (this.#acts.parentElement !== target) {
      const hadFocus = this.#acts.contains(focused);
      target.append(this.#acts);
      if (hadFocus && focused instanceof HTMLElement) focused.focus();
    }
    set(this.#menu, "aria-label", isFirst ? "Insert the first step" : `Insert after: ${this.#blocks[i].title}`);
    if (isFirst) return;
    this.#label(this.#blocks[i], i);
    this.#values.show(this.#blocks[i].title, this.#blocks[i].values ?? [], this.#sheet.editor.problems);
  }

  /** @param {Block} block @param {number} i */
  #label({ title, enabled, indent }, i) {
    const locked = indent === null && LOCKED;
    const needed = locked || (isOnly(this.#blocks, i) && NEEDED);
    const { places, here } = placesOf(this.#blocks, i);
    /** @type {Record<Name, [string, string | boolean]>} */
    const labels = {
      up: ["Move up", needed || here <= 0],
      down: ["Move down", needed || here === places.length - 1],
      copy: ["Duplicate", locked],
      off: [enabled ? "Disable" : "Enable", needed],
      add: ["Insert after", locked],
      remove: ["Remove", needed],
    };
    for (const [name, control] of /** @type {[Name, HTMLButtonElement][]} */ (Object.entries(this.#buttons))) {
      const [words, off] = labels[name];
      set(control, "aria-label", `${words}: ${title}`);
      set(control, "title", typeof off === "string" ? off : `${words}: ${title}`);
      set(control, "aria-disabled", Boolean(off));
    }
    set(this.#buttons.off, "aria-pressed", !enabled);
  }

  /** @param {number} i @returns {Row} */
  #add(i) {
    const pause = button("", () => this.#sheet.plan.toggle(this.#rows[i].steps), { class: "pause", title: "Pause before this step" });
    const run = button("▶", () => this.#sheet.plan.runFrom(this.#rows[i].steps[0]), { title: "Run from this step" });
    const [number, note] = [html("b", { title: "Drag to another place" }), html("span")];
    const name = button("", () => this.select(name.ariaExpanded === "true" ? 0 : this.#blocks[i].line, this.#blocks[i].column), { class: "name" });
    const element = html("li", {}, pause, run, number, name, note);
    draggable(element, number, (from, _, over, after) => this.#drop(from, over, after));
    this.#rows.push({ element, pause, run, number, name, note, steps: [] });
    return this.#rows[i];
  }

  /** @param {HTMLElement} row @param {HTMLElement} target @param {boolean} after */
  #drop(row, target, after) {
    const [from, over] = [row, target].map((one) => this.#rows.findIndex(({ element }) => element === one));
    const [own, text] = [this.#blocks[from], this.#sheet.shownText];
    if (text === null || !this.#isCurrent || own.indent === null) return;
    if (isOnly(this.#blocks, from)) return this.#sheet.report(NEEDED, true);
    const place = placeBeside(this.#blocks, from, over, after);
    if (place) this.#take(moved(text, own, place), `Move: ${own.title}.`);
  }

  /** @param {number} i @param {Block} block @param {number[]} numbers its steps in the plan @param {boolean} isWrong @param {number} [order] its place without a plan */
  #show(i, { title, depth, enabled, indent }, numbers, isWrong, order) {
    const row = this.#rows[i];
    const { element, pause, run, number, name, note } = row;
    const planned = numbers.map((step) => this.#sheet.plan.steps[step - 1]);
    const round = planned.findIndex(({ mark }) => CURRENT.includes(mark));
    const isAlike = planned.every(({ mark }) => mark === planned[0].mark);
    const mark = planned[round]?.mark ?? planned.find((step) => step.mark === "next")?.mark ?? (isAlike ? planned[0]?.mark : "");
    const seconds = planned.reduce((sum, step) => sum + (step.mark === "skipped" ? 0 : step.seconds), 0);
    row.steps = numbers;
    if (round >= 0 && !element.ariaCurrent) element.scrollIntoView({ block: "nearest" });
    element.ariaCurrent = round >= 0 ? "step" : null;
    set(element, "class", [mark, enabled ? "" : "off", isWrong ? "wrong" : ""].filter(Boolean).join(" "));
    set(element, "aria-level", depth + 1);
    element.style.setProperty("--depth", String(Math.min(depth, 6)));
    const isOne = numbers.length === 1;
    set(pause, "aria-label", isOne ? `Pause before step ${numbers[0]}` : `Pause each time before: ${title}`);
    set(pause, "aria-pressed", numbers.length > 0 && numbers.every((step) => this.#sheet.plan.breakpoints.includes(step)));
    set(run, "aria-label", isOne ? `Run from step ${numbers[0]}` : `Run from: ${title}`);
    pause.hidden = run.hidden = !numbers.length;
    number.classList.toggle("grip", indent !== null);
    write(number, String(numbers[0] || order || ""));
    write(name, title);
    const times = round >= 0 && !isOne ? `${round + 1} of ${numbers.length}` : "";
    const words = [isWrong ? "mistake" : "", enabled ? "" : "disabled", mark ?? "", times, seconds ? `${seconds.toFixed(1)} s` : ""];
    write(note, words.filter(Boolean).join(" "));
  }
}
