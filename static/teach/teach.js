// The sheet of programs: one program at a time, as poses that are recorded and ordered, as its steps, or as text. It is
// previewed, run and saved.
import { element, first, write } from "../dom.js";
import { numberBox } from "../instruments/parts.js";
import { button, clamp, html, set } from "../instruments/shape.js";
import { armWithStyle } from "../page/ready.js";
import { numberIn } from "../number.js";
import { messageOf, readState } from "../server.js";
import { thumbnail } from "../viser/pictures.js";
import { Content, NEW } from "./content.js";
import { Editor } from "./editor.js";
import { draggable } from "./order.js";
import { Plan } from "./plan.js";
import { Player } from "./player.js";
import { MAX_POSES, MAX_TIMES, fingersOf, nameIn, poseOf, read, renamed, scriptOf } from "./poses.js";
import { Row } from "./row.js";
import { Scripts } from "./scripts.js";
import { Steps } from "./steps.js";

/** @typedef {import("./poses.js").Pose} Pose */
const ID = "teach"; // id of the requests
const [WIDTH, HEIGHT] = [96, 72]; // px of a picture
const RADIANS = Math.PI / 180;
const TEACH = "Move the arm, then press Add pose. Or choose a program above.";
const NO_STEP = "There is no step yet. Insert the first one, or add poses.";
const ERRORS = "The script has mistakes: see below.";
/** @typedef {"poses" | "steps" | "text"} View */

export class Teach {
  #page;
  #arm;
  /** @type {Map<string, Row>} */
  #rows = new Map(); // by the ids of the poses
  content;
  #player;
  scripts = new Scripts(this);
  editor = new Editor(this);
  /** @type {string | null} */
  #current = null; // id of the pose to which the arm moves
  #sheet = html("section", { id: "teach", class: "sheet", "aria-label": "Programs: record, preview and run", hidden: "" });
  #list = html("ol", { "aria-label": "Poses" });
  #empty = html("p", { class: "empty" });
  #says = html("p", { id: "teach-says", role: "status" });
  #add = button("Add pose", () => this.#record(), { class: "add" });
  #play = button("Run", () => this.#player.start("run"), { id: "teach-play", class: "main" });
  #step = button("Step", () => this.#player.start("step"), { id: "teach-step" });
  #undo = button("↶", () => this.content.undo(), { "aria-label": "Undo in Programs", title: "Undo in Programs" });
  #redo = button("↷", () => this.content.redo(), { "aria-label": "Redo in Programs", title: "Redo in Programs" });
  #times = numberBox({ inputmode: "numeric" });
  #loop = html("label", {}, "Loop", this.#times, "times");
  #name = html("input", { maxlength: "40", spellcheck: "false", autocomplete: "off" });
  #views = {
    poses: button("Poses", () => this.#view === "poses" || this.#toPoses()),
    steps: button("Steps", () => this.#see("steps")),
    text: button("Text", () => this.#view === "text" || this.#toText()),
  };
  /** @type {View} */
  #view = "poses";
  plan;
  #steps = new Steps(this);
  #other = html("p", { id: "teach-other", hidden: "" });

  /** Return the sheet once it is styled and the arm is known. @param {Page.Context} page */
  static async in(page) {
    return new Teach(page, await armWithStyle("teach.css", import.meta.url));
  }

  /** @param {Page.Context} page @param {Api.Arm} arm */
  constructor(page, arm) {
    this.#page = page;
    this.#arm = arm;
    this.content = new Content(page.kept, arm, () => this.#draw());
    this.plan = new Plan(page, this);
    this.#player = new Player(page, this, ID);
    const preview = button("Preview", () => this.#player.start(null), { title: "Plan it: show the path of the tool, and times and breakpoints of the steps" });
    const actions = html("div", { class: "bar" }, this.#play, this.#step, preview, html("div", { class: "history" }, this.#undo, this.#redo));
    const views = html("div", { class: "bar views", role: "group", "aria-label": "Show as" }, ...Object.values(this.#views), this.#add);
    const named = html("label", { class: "wide" }, "Name", this.#name);
    const files = html("div", { class: "bar" }, ...this.scripts.controls);
    const rest = html("div", { class: "rest" }, html("div", { class: "bar" }, named, this.#loop), files);
    const scrolled = html("div", { class: "scrolled" }, this.#empty, this.#list, this.#steps.element, this.editor.element);
    this.#sheet.append(this.scripts.open, actions, this.#says, this.#other, this.plan.look, views, scrolled, this.editor.list, rest);
    element("dock", HTMLElement).prepend(this.#sheet);
    this.#times.addEventListener("change", () => this.content.change({ times: clamp(Math.round(numberIn(this.#times.value)) || 1, 1, MAX_TIMES) }));
    this.#name.addEventListener("change", () => {
      const [name, { text }] = [this.#name.value.trim() || NEW.name, this.content.now];
      this.content.change({ name, text: text === null ? null : renamed(text, name) });
    });
    if (this.content.now.text !== null) [this.editor.text, this.#view] = [this.content.now.text, "steps"];
    this.#draw();
    if (this.content.broken) this.report("What this browser had kept cannot be read, so the list is empty.");
  }

  /** @param {boolean} shown */
  show(shown) {
    this.#sheet.hidden = !shown;
    if (shown) this.scripts.list();
    this.plan.watch(shown);
  }

  /** Take an answer; return whether it was for the sheet. @param {Page.Answer} answer */
  hear(answer) {
    if (answer.id !== `${ID} go`) return this.#player.run.hear(answer);
    if (answer.is === "refused") this.report(answer.why, true);
    return true;
  }

  /** @param {string} words */
  report(words, bad = false) {
    write(this.#says, words);
    this.#says.classList.toggle("bad", bad);
  }

  /** Report why an act fails. @param {() => unknown} act */
  async attempt(act) {
    try {
      await act();
    } catch (error) {
      this.report(messageOf(error), true);
    }
  }

  // Poses

  async #state() {
    const state = await readState();
    if (!state) throw new Error("There is no connection to the arm.");
    return state;
  }

  #record() {
    return this.attempt(async () => {
      if (this.content.now.poses.length >= MAX_POSES) throw new Error(`A script here has at most ${MAX_POSES} poses. Save it first.`);
      const pose = poseOf(await this.#state(), this.#arm, thumbnail(this.#page.scene, WIDTH, HEIGHT));
      this.content.change({ poses: [...this.content.now.poses, pose] });
      this.#rows.get(pose.id)?.element.scrollIntoView({ block: "nearest" });
      this.report(`Pose ${this.content.now.poses.length} is recorded.`);
    });
  }

  /** @param {Pose} pose */
  #rowOf(pose) {
    const row = new Row(pose.id, this, Boolean(this.#arm.gripper));
    draggable(row.element, row.handle, (element, to) => this.move(element.dataset.id ?? "", to));
    return row;
  }

  /** @param {string} id @param {number} to */
  move(id, to) {
    const from = this.content.indexOf(id);
    if (to === from || to < 0 || to >= this.content.now.poses.length) return;
    const poses = [...this.content.now.poses];
    poses.splice(to, 0, ...poses.splice(from, 1));
    this.content.change({ poses });
    this.report(`Pose ${from + 1} is now pose ${to + 1}.`);
  }

  /** @param {string} id */
  remove(id) {
    const index = this.content.indexOf(id);
    this.content.change({ poses: this.content.now.poses.filter((pose) => pose.id !== id) });
    this.report(`Pose ${index + 1} is removed.`);
    // The focus stays in the list.
    const near = this.#rows.get(this.content.now.poses[Math.min(index, this.content.now.poses.length - 1)]?.id);
    const nextFocus = near ? first(".remove", HTMLElement, near.element) : this.#add;
    nextFocus.focus();
  }

  /** A pose that was read from a script without a gripper takes the present place of the fingers. @param {string} id */
  toggleGrip(id) {
    const pose = this.content.now.poses[this.content.indexOf(id)];
    return this.attempt(async () => {
      const gripper = pose.gripper ?? fingersOf(await this.#state(), this.#arm);
      this.content.changePose(id, { grips: !pose.grips, gripper });
    });
  }

  /** The arm moves there by a command, like from its sliders. @param {string} id */
  go(id) {
    const index = this.content.indexOf(id);
    const q = this.content.now.poses[index].joints.map((angle) => angle * RADIANS);
    this.report(`To pose ${index + 1}.`);
    this.#page.say({ do: "joints", q, revocations: this.#page.store.status?.revocations, id: `${ID} go` });
  }

  /** Mark the pose to which the arm moves. @param {string | null} id */
  mark(id) {
    if (id === this.#current) return;
    this.#current = id;
    this.#draw();
    if (id) this.#rows.get(id)?.element.scrollIntoView({ block: "nearest" });
  }

  // Texts

  #toText(line = this.#steps.line) {
    if (this.content.now.text === null) {
      this.editor.text = scriptOf(this.content.now).text;
      this.content.change({ text: this.editor.text });
      this.report("Space types a blank in the text; Esc stops the arm.");
    }
    this.#see("text");
    this.editor.select(line);
  }

  /** Show a place with a mistake: its step where steps are shown, and its line in the text. @param {number} line */
  showPlace(line) {
    this.#steps.select(line);
    if (this.#view !== "steps" || !this.editor.reading?.blocks) this.#toText(line);
  }

  async #toPoses() {
    if (this.content.now.text === null) return this.#see("poses");
    const reading = await this.editor.check();
    if (!reading) return this.report("There is no connection to the arm.", true);
    if (reading.taught) return this.#takeTaught(reading.taught);
    if (reading.problems.length) this.#see("text");
    this.report(reading.problems.length ? ERRORS : "It has steps that are no poses.", true);
  }

  /** @param {import("./poses.js").Taught} taught */
  #takeTaught({ name, times, poses }) {
    // Pictures belong to the angles.
    const known = new Map(this.content.now.poses.map((pose) => [pose.joints.join(), pose]));
    const taken = poses.slice(0, MAX_POSES).map((taught) => {
      const pose = read(taught);
      const old = known.get(pose.joints.join());
      return old ? { ...pose, picture: old.picture, gripper: pose.gripper ?? old.gripper } : pose;
    });
    this.#view = "poses";
    this.content.change({ name, times: Math.min(times, MAX_TIMES), poses: taken, text: null });
    this.report(poses.length > MAX_POSES ? `Only the first ${MAX_POSES} poses are shown.` : "");
  }

  // Return the name and the text of what the sheet shows. Throws an error if there is nothing.
  script() {
    const text = this.shownText;
    if (text === null) throw new Error("There is no pose yet. Move the arm and add a pose.");
    return { name: this.content.now.name, text };
  }

  // The text of what the sheet shows; null without one.
  get shownText() {
    const { now } = this.content;
    if (now.text !== null) return this.editor.text;
    return now.poses.length ? scriptOf(now).text : null;
  }

  // Return the step that moves to the present pose.
  async pose() {
    return `joints: [${poseOf(await this.#state(), this.#arm, "").joints.join(", ")}]`;
  }

  // Whether what the sheet shows differs from what was opened or saved.
  get #isEdited() {
    return this.shownText !== this.content.now.saved;
  }

  // Return how to get back the edits that the next program replaces; empty without some.
  #wayBack() {
    return this.#isEdited ? ` Undo brings back your edits of ${this.content.now.name}.` : "";
  }

  // Show an empty list of poses.
  begin() {
    const wayBack = this.#wayBack();
    this.#view = "poses";
    this.content.change(NEW);
    this.report(`New poses.${wayBack}`);
  }

  /** Show a script: as poses if it has only these, otherwise its steps, or its text if this has errors. @param {string} text @param {string} name */
  async load(text, name) {
    const wayBack = this.#wayBack();
    this.editor.text = text;
    const reading = await this.editor.check();
    const opened = { text: this.editor.text, name: nameIn(text) ?? name.slice(0, 40) };
    if (reading?.taught) this.#takeTaught({ ...reading.taught, name: opened.name });
    else {
      this.#view = reading?.problems.length && !reading.blocks ? "text" : "steps";
      this.content.change(opened);
    }
    this.content.keep({ saved: this.shownText });
    if ((reading?.taught?.poses.length ?? 0) <= MAX_POSES) this.report(reading?.problems.length ? ERRORS : `${name} is opened.${wayBack}`);
  }

  // Display

  /** @param {View} view */
  #see(view) {
    this.#view = view;
    this.#draw();
  }

  // Show the steps of the program of the server, or that it has another one.
  drawPlan() {
    const isSteps = this.#view === "steps";
    if (isSteps) this.#steps.draw();
    this.#empty.hidden = isSteps ? this.shownText !== null : this.#view === "text" || this.content.now.poses.length > 0;
    write(this.#empty, isSteps ? NO_STEP : TEACH);
    const { isShown, used, answer } = this.plan;
    const isOther = used !== null && !isShown;
    if (isOther && this.#other.hidden) {
      const words = `${used.by} ${used.status === "planning" ? "plans" : "runs"} ${used.name || "a script"}. `;
      this.#other.replaceChildren(words, button("Show it", () => this.load(answer.text ?? "", used.name)));
    }
    this.#other.hidden = !isOther;
  }

  #draw() {
    const { name, times, poses, text } = this.content.now;
    // Undo and redo change which views there are.
    if (this.#view === (text === null ? "text" : "poses")) this.#view = text === null ? "poses" : "text";
    const focused = document.activeElement;
    this.#drawRows(poses);
    // A row that was moved in the document has lost the focus.
    if (focused instanceof HTMLElement && this.#list.contains(focused) && focused !== document.activeElement) focused.focus();
    if (text !== null && text !== this.editor.text) this.editor.text = text;
    this.#list.hidden = this.#view !== "poses";
    this.#steps.element.hidden = this.#view !== "steps";
    this.editor.list.hidden = this.#view === "poses";
    this.editor.element.hidden = this.#view !== "text";
    this.#add.hidden = this.#view !== "poses";
    // A pose may be several steps, and Go moves to one of them.
    this.#step.hidden = this.#view === "poses";
    write(this.scripts.shown, this.#isEdited ? `${name}, edited` : name);
    this.plan.draw();
    this.drawPlan();
    this.#loop.hidden = text !== null;
    for (const [view, control] of Object.entries(this.#views)) set(control, "aria-pressed", view === this.#view);
    if (this.#times !== focused || numberIn(this.#times.value) !== times) this.#times.value = String(times);
    if (this.#name !== focused || this.#name.value.trim() !== name) this.#name.value = name;
    set(this.#undo, "aria-disabled", !this.content.past.length);
    set(this.#redo, "aria-disabled", !this.content.future.length);
  }

  /** @param {Pose[]} poses */
  #drawRows(poses) {
    for (const [id, row] of this.#rows)
      if (!poses.some((pose) => pose.id === id)) {
        row.element.remove();
        this.#rows.delete(id);
      }
    poses.forEach((pose, i) => {
      const row = this.#rows.get(pose.id) ?? this.#rowOf(pose);
      this.#rows.set(pose.id, row);
      row.show(poses, i, pose.id === this.#current);
      if (this.#list.children[i] !== row.element) this.#list.insertBefore(row.element, this.#list.children[i] ?? null);
    });
  }
}
