// The Teach sheet: poses of the arm that are recorded, ordered, played and saved as a script.
import { first, matches, sceneOf, styled, write } from "../dom.js";
import { button, html, set } from "../instruments/shape.js";
import { messageOf, readArm, readState } from "../server.js";
import { thumbnail } from "../viser/pictures.js";
import { Content } from "./content.js";
import { Editor } from "./editor.js";
import { draggable } from "./order.js";
import { Player } from "./player.js";
import { MAX_POSES, MAX_TIMES, fingersOf, isPicture, poseOf, read, scriptOf } from "./poses.js";
import { Row } from "./row.js";
import { Scripts } from "./scripts.js";

/** @typedef {import("./poses.js").Pose} Pose */
const ID = "teach"; // id of the requests
const [WIDTH, HEIGHT] = [96, 72]; // px of a picture
const FILLED = 1.35; // size of a picture, relative to the arm in it
const AROUND = [[0, 0, 0], [0, 0, 0.5], "/target/move"]; // places round the arm
const RADIANS = Math.PI / 180;
const EMPTY = "There is no pose yet. Move the arm and add a pose.";

export class Teach {
  #page;
  #arm;
  /** @type {Map<string, Row>} */
  #rows = new Map(); // by the ids of the poses
  #content;
  #player;
  #scripts = new Scripts({
    script: () => this.#script(),
    load: (text, name, asText) => this.#load(text, name, asText),
    report: (words, bad) => this.#report(words, bad),
  });
  #editor = new Editor((text) => this.#content.keepText(text));
  /** @type {string | null} */
  #current = null; // id of the pose to which the arm moves
  #sheet = html("section", { id: "teach", class: "sheet", "aria-label": "Teach: record poses and play them", hidden: "" });
  #list = html("ol", { "aria-label": "Poses" });
  #empty = html("p", { class: "empty" }, "Move the arm, then press Add pose. Each pose keeps the joints and the gripper.");
  #says = html("p", { id: "teach-says", role: "status" });
  #add = button("Add pose", () => this.#record(), { class: "main" });
  #play = button("Play", () => this.#player.start(), { id: "teach-play" });
  #step = button("Step", () => this.#player.start(true), { id: "teach-step" });
  #undo = button("↶", () => this.#content.undo(), { "aria-label": "Undo in Teach", title: "Undo in Teach" });
  #redo = button("↷", () => this.#content.redo(), { "aria-label": "Redo in Teach", title: "Redo in Teach" });
  #times = html("input", { type: "number", min: "1", max: MAX_TIMES, step: "1", inputmode: "numeric" });
  #name = html("input", { maxlength: "40", spellcheck: "false", autocomplete: "off" });
  #text = button("Edit as text", () => this.#toggleText(), { "aria-pressed": "false" });

  /** Return the sheet once it is styled and the arm is known. @param {Page.Context} page */
  static async in(page) {
    const style = styled("teach.css", import.meta.url);
    const arm = await readArm();
    await style;
    return new Teach(page, arm);
  }

  /** @param {Page.Context} page @param {Api.Arm} arm */
  constructor(page, arm) {
    this.#page = page;
    this.#arm = arm;
    this.#content = new Content(page.kept, arm, () => this.#draw());
    const display = {
      report: (/** @type {string} */ words, bad = false) => this.#report(words, bad),
      occupy: (/** @type {boolean} */ busy) => set(this.#play, "aria-disabled", busy),
      mark: (/** @type {string | null} */ pose) => this.#mark(pose),
    };
    this.#player = new Player(page, this.#content, this.#editor, display, ID);
    const actions = html("div", { class: "bar" }, this.#add, this.#play, this.#step, this.#undo, this.#redo);
    const loop = html("label", {}, "Loop", this.#times, "times");
    const named = html("label", { class: "wide" }, "Name", this.#name);
    const files = html("div", { class: "bar" }, ...this.#scripts.controls, this.#text);
    const rest = html("div", { class: "rest" }, html("div", { class: "bar" }, named, loop), files);
    this.#sheet.append(actions, this.#says, html("div", { class: "scrolled" }, this.#empty, this.#list, this.#editor.element), rest);
    first("#toast", HTMLElement, page.stage).before(this.#sheet);
    this.#times.addEventListener("change", () => {
      const times = Math.min(Math.max(Math.round(this.#times.valueAsNumber) || 1, 1), MAX_TIMES);
      this.#content.change({ times });
    });
    this.#name.addEventListener("change", () => this.#content.change({ name: this.#name.value.trim() || "My script" }));
    this.#sheet.addEventListener("keydown", (event) => this.#key(event));
    if (this.#content.now.text !== null) this.#editor.text = this.#content.now.text;
    this.#draw();
    if (this.#content.broken) this.#report("What this browser had kept cannot be read, so the list is empty.");
  }

  /** @param {boolean} shown */
  show(shown) {
    this.#sheet.hidden = !shown;
    if (shown) this.#scripts.list();
  }

  /** Show the script of this name of the server, with `asText` as text. @param {string} name @param {boolean} asText */
  open(name, asText) {
    return this.#scripts.open(name, asText);
  }

  /** Take an answer; return whether it was for the sheet. @param {Page.Answer} answer */
  hear(answer) {
    if (answer.id !== `${ID} go`) return this.#player.hear(answer);
    if (answer.is === "refused") this.#report(answer.why, true);
    return true;
  }

  /** @param {string} words */
  #report(words, bad = false) {
    write(this.#says, words);
    this.#says.classList.toggle("bad", bad);
    this.#says.title = words;
  }

  get #poses() {
    return this.#content.now.poses;
  }

  /** Ctrl-Z and Ctrl-Y, except in a box, which has its own. @param {KeyboardEvent} event */
  #key(event) {
    const key = event.key.toLowerCase();
    if (!(event.ctrlKey || event.metaKey) || !["z", "y"].includes(key) || matches(event.target, "input, textarea")) return;
    event.preventDefault();
    if (key === "y" || event.shiftKey) this.#content.redo();
    else this.#content.undo();
  }

  // Poses

  async #state() {
    const state = await readState();
    if (!state) throw new Error("There is no connection to the arm.");
    return state;
  }

  async #record() {
    try {
      if (this.#poses.length >= MAX_POSES) throw new Error(`A script here has at most ${MAX_POSES} poses. Save it first.`);
      const state = await this.#state();
      const pose = poseOf(state, this.#arm, this.#picture());
      this.#content.change({ poses: [...this.#poses, pose] });
      this.#rows.get(pose.id)?.element.scrollIntoView({ block: "nearest" });
      this.#report(`Pose ${this.#poses.length} is recorded.`);
    } catch (error) {
      this.#report(messageOf(error), true);
    }
  }

  // Return a small picture of the arm; empty if the scene is not drawn.
  #picture() {
    const { scene } = this.#page;
    const pixels = AROUND.flatMap((place) => {
      const pixel = sceneOf(scene)?.pixelOf(place);
      return pixel ? [pixel] : [];
    });
    if (pixels.length < 2) return "";
    const [[left, right], [top, bottom]] = [0, 1].map((axis) => {
      const all = pixels.map((pixel) => pixel[axis]);
      return [Math.min(...all), Math.max(...all)];
    });
    const high = FILLED * Math.max(bottom - top, ((right - left) * HEIGHT) / WIDTH);
    const picture = thumbnail(scene, (left + right) / 2, (top + bottom) / 2, high, WIDTH, HEIGHT);
    return isPicture(picture) ? picture : "";
  }

  /** @param {Pose} pose */
  #rowOf(pose) {
    /** @type {import("./row.js").Acts} */
    const acts = {
      put: (id, fields) => this.#content.changePose(id, fields),
      go: (id) => this.#go(id),
      move: (id, by) => this.#move(id, this.#content.indexOf(id) + by),
      remove: (id) => this.#remove(id),
      toggleGrip: (id) => this.#toggleGrip(id),
    };
    const row = new Row(pose.id, acts, Boolean(this.#arm.gripper));
    draggable(row.element, row.handle, (element, to) => this.#move(element.dataset.id ?? "", to));
    return row;
  }

  /** @param {string} id @param {number} to */
  #move(id, to) {
    const from = this.#content.indexOf(id);
    if (to === from || to < 0 || to >= this.#poses.length) return;
    const poses = [...this.#poses];
    poses.splice(to, 0, ...poses.splice(from, 1));
    this.#content.change({ poses });
    this.#report(`Pose ${from + 1} is now pose ${to + 1}.`);
  }

  /** @param {string} id */
  #remove(id) {
    const index = this.#content.indexOf(id);
    this.#content.change({ poses: this.#poses.filter((pose) => pose.id !== id) });
    this.#report(`Pose ${index + 1} is removed.`);
    // The focus stays in the list.
    const near = this.#rows.get(this.#poses[Math.min(index, this.#poses.length - 1)]?.id);
    const nextFocus = near ? first(".remove", HTMLElement, near.element) : this.#add;
    nextFocus.focus();
  }

  /** A pose that was read from a script without a gripper takes the present place of the fingers. @param {string} id */
  async #toggleGrip(id) {
    const pose = this.#poses[this.#content.indexOf(id)];
    try {
      const gripper = pose.gripper ?? fingersOf(await this.#state(), this.#arm);
      this.#content.changePose(id, { grips: !pose.grips, gripper });
    } catch (error) {
      this.#report(messageOf(error), true);
    }
  }

  /** The arm moves there by a command, like from its sliders. @param {string} id */
  #go(id) {
    const index = this.#content.indexOf(id);
    const q = this.#poses[index].joints.map((angle) => angle * RADIANS);
    this.#report(`To pose ${index + 1}.`);
    this.#page.say({ do: "joints", q, revocations: this.#page.store.status?.revocations, id: `${ID} go` });
  }

  /** @param {string | null} id */
  #mark(id) {
    if (id === this.#current) return;
    this.#current = id;
    this.#draw();
    if (id) this.#rows.get(id)?.element.scrollIntoView({ block: "nearest" });
  }

  // Texts

  async #toggleText() {
    if (this.#content.now.text === null) {
      this.#editor.text = scriptOf(this.#content.now).text;
      this.#content.change({ text: this.#editor.text });
      this.#report("Space types a blank in the text; Esc stops the arm.");
      return this.#editor.focus();
    }
    const reading = await this.#editor.check();
    if (!reading) return this.#report("There is no connection to the arm.", true);
    if (reading.taught) return this.#takeTaught(reading.taught);
    const why = reading.problems.length ? "The text has errors: see the lines below." : "It has steps that are no poses, so it stays text.";
    this.#report(why, true);
  }

  /** @param {import("./poses.js").Taught} taught */
  #takeTaught({ name, times, poses }) {
    // Pictures belong to the angles.
    const known = new Map(this.#poses.map((pose) => [pose.joints.join(), pose]));
    const taken = poses.slice(0, MAX_POSES).map((taught) => {
      const pose = read(taught);
      const old = known.get(pose.joints.join());
      return old ? { ...pose, picture: old.picture, gripper: pose.gripper ?? old.gripper } : pose;
    });
    this.#content.change({ name, times: Math.min(times, MAX_TIMES), poses: taken, text: null });
    this.#report(poses.length > MAX_POSES ? `Only the first ${MAX_POSES} poses are shown.` : "");
  }

  // Return the name and the text of what the sheet shows.
  #script() {
    const { now } = this.#content;
    if (now.text !== null) return { name: now.name, text: this.#editor.text };
    if (!now.poses.length) throw new Error(EMPTY);
    return { name: now.name, text: scriptOf(now).text };
  }

  // Show a script as poses if it has only these, otherwise and with `asText` as text.
  /** @param {string} text @param {string} name @param {boolean} asText */
  async #load(text, name, asText) {
    this.#editor.text = text;
    this.#content.change({ text, name: name.slice(0, 40) });
    const reading = await this.#editor.check();
    if (reading?.taught && !asText) this.#takeTaught(reading.taught);
    else if (reading?.problems.length) this.#report("The text has errors: see the lines below.");
    else this.#report(asText ? `${name} is shown as text.` : "It has steps that are no poses, so it is shown as text.");
  }

  // Display

  #draw() {
    const { name, times, poses, text } = this.#content.now;
    const focused = document.activeElement;
    this.#drawRows(poses);
    // A row that was moved in the document has lost the focus.
    if (focused instanceof HTMLElement && this.#list.contains(focused) && focused !== document.activeElement) focused.focus();
    if (text !== null && text !== this.#editor.text) this.#editor.text = text;
    const isText = text !== null;
    this.#sheet.classList.toggle("text", isText);
    this.#list.hidden = isText;
    this.#empty.hidden = isText || poses.length > 0;
    this.#editor.element.hidden = !isText;
    this.#add.hidden = isText;
    this.#times.disabled = isText;
    set(this.#text, "aria-pressed", isText);
    write(this.#text, isText ? "Edit as poses" : "Edit as text");
    if (this.#times !== focused || this.#times.valueAsNumber !== times) this.#times.value = String(times);
    if (this.#name !== focused || this.#name.value.trim() !== name) this.#name.value = name;
    set(this.#undo, "aria-disabled", !this.#content.undoable);
    set(this.#redo, "aria-disabled", !this.#content.redoable);
  }

  /** @param {Pose[]} poses */
  #drawRows(poses) {
    for (const [id, row] of this.#rows)
      if (!poses.some((pose) => pose.id === id)) {
        row.element.remove();
        this.#rows.delete(id);
      }
    const next = this.#player?.next ?? 0;
    poses.forEach((pose, i) => {
      const row = this.#rows.get(pose.id) ?? this.#rowOf(pose);
      this.#rows.set(pose.id, row);
      row.show(poses, i, pose.id === this.#current, i === next && poses.length > 1);
      if (this.#list.children[i] !== row.element) this.#list.insertBefore(row.element, this.#list.children[i] ?? null);
    });
  }
}
