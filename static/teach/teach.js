// The Teach sheet: poses of the arm that are recorded, ordered, played and saved as a script.
import { html, set, write } from "../instruments/shape.js";
import { Content } from "./content.js";
import { Editor, problemsOf } from "./editor.js";
import { draggable } from "./order.js";
import { MAX_POSES, MAX_TIMES, fingersOf, isPicture, poseOf, read, scriptOf } from "./poses.js";
import { Row } from "./row.js";
import { ScriptRun } from "./run.js";

const STYLE = new URL("teach.css", import.meta.url).href;
const ID = "teach"; // id of the requests
const PICTURE = [96, 72]; // px
const FILLED = 1.35; // size of a picture, relative to the arm in it
const [FOOT, HEAD, HANDLE] = [[0, 0, 0], [0, 0, 0.5], "/target/move"]; // places round the arm
const RADIANS = Math.PI / 180;
const FILE = ".yaml";
const PLANNING = "planning";

const button = (words, act, fields = {}) => {
  const made = html("button", { type: "button", ...fields }, words);
  made.addEventListener("click", act);
  return made;
};

export class Teach {
  #page;
  #arm;
  #rows = new Map(); // by the ids of the poses
  #content;
  #run;
  #editor = new Editor((text) => this.#content.keepText(text));
  #current = null; // id of the pose to which the arm moves
  #next = null; // id of the pose of the next step
  #sheet = html("section", { id: "teach", class: "sheet", "aria-label": "Teach: record poses and play them", hidden: "" });
  #list = html("ol", { "aria-label": "Poses" });
  #empty = html("p", { class: "empty" }, "Move the arm, then press Add pose. Each pose keeps the joints and the gripper.");
  #says = html("p", { id: "teach-says", role: "status" });
  #add = button("Add pose", () => this.#record(), { class: "main" });
  #play = button("Play", () => this.#start(), { id: "teach-play" });
  #step = button("Step", () => this.#start(true), { id: "teach-step" });
  #undo = button("↶", () => this.#content.undo(), { "aria-label": "Undo in Teach", title: "Undo in Teach" });
  #redo = button("↷", () => this.#content.redo(), { "aria-label": "Redo in Teach", title: "Redo in Teach" });
  #times = html("input", { type: "number", min: "1", max: MAX_TIMES, step: "1", inputmode: "numeric" });
  #name = html("input", { maxlength: "40", spellcheck: "false", autocomplete: "off" });
  #open = html("select", { "aria-label": "Open a script" });
  #file = html("input", { type: "file", accept: ".yaml,.yml", "aria-label": "File of a script", hidden: "" });
  #keep = button("Save", () => this.#save(), { hidden: "", title: "Save in the folder of the server" });
  #text = button("Edit as text", () => this.#toggleText(), { "aria-pressed": "false" });

  // Return the sheet once it is styled and the arm is known. page: {say, kept, scene, status}; `status` returns
  // the newest status of the server.
  static async in(stage, page) {
    const style = html("link", { rel: "stylesheet", href: STYLE });
    const styled = new Promise((resolve) => ["load", "error"].forEach((kind) => style.addEventListener(kind, resolve)));
    document.head.append(style);
    const answer = await fetch("api/v1/arm");
    if (!answer.ok) throw new Error(await answer.text());
    const arm = await answer.json();
    await styled;
    return new Teach(stage, page, arm);
  }

  constructor(stage, page, arm) {
    this.#page = page;
    this.#arm = arm;
    this.#run = new ScriptRun(page.say, ID);
    this.#content = new Content(page.kept, arm, () => this.#draw());
    const actions = html("div", { class: "bar" }, this.#add, this.#play, this.#step, this.#undo, this.#redo);
    const loop = html("label", {}, "Loop", this.#times, "times");
    const named = html("label", { class: "wide" }, "Name", this.#name);
    const files = html("div", { class: "bar" }, button("Download", () => this.#download()), this.#keep, this.#open, this.#text);
    const rest = html("div", { class: "rest" }, html("div", { class: "bar" }, named, loop), files, this.#file);
    this.#sheet.append(actions, this.#says, html("div", { class: "scrolled" }, this.#empty, this.#list, this.#editor.element), rest);
    stage.querySelector("#toast").before(this.#sheet);
    this.#times.addEventListener("change", () => {
      const times = Math.min(Math.max(Math.round(this.#times.valueAsNumber) || 1, 1), MAX_TIMES);
      this.#content.change({ times });
    });
    this.#name.addEventListener("change", () => this.#content.change({ name: this.#name.value.trim() || "My script" }));
    this.#open.addEventListener("change", () => this.#choose());
    this.#file.addEventListener("change", () => this.#take());
    this.#sheet.addEventListener("keydown", (event) => this.#key(event));
    if (this.#content.now.text !== null) this.#editor.text = this.#content.now.text;
    this.#draw();
    if (this.#content.broken) this.#say("What this browser had kept cannot be read, so the list is empty.");
  }

  show(shown) {
    this.#sheet.hidden = !shown;
    if (shown) this.#listScripts();
  }

  // Take an answer; return whether it was for the sheet.
  hear(answer) {
    if (answer.id === `${ID} go`) {
      if (answer.is === "refused") this.#say(answer.why, true);
      return true;
    }
    return this.#run.hear(answer);
  }

  #say(words, bad = false) {
    write(this.#says, words);
    this.#says.classList.toggle("bad", bad);
    this.#says.title = words;
  }

  get #poses() {
    return this.#content.now.poses;
  }

  get #isText() {
    return this.#content.now.text !== null;
  }

  // Ctrl-Z and Ctrl-Y, except in a box, which has its own.
  #key(event) {
    const key = event.key.toLowerCase();
    if (!(event.ctrlKey || event.metaKey) || !["z", "y"].includes(key) || event.target.matches("input, textarea")) return;
    event.preventDefault();
    if (key === "y" || event.shiftKey) this.#content.redo();
    else this.#content.undo();
  }

  // Poses

  async #state() {
    const answer = await fetch("api/v1/state");
    if (!answer.ok) throw new Error("There is no connection to the arm.");
    return answer.json();
  }

  async #record() {
    try {
      if (this.#poses.length >= MAX_POSES) throw new Error(`A script here has at most ${MAX_POSES} poses. Save it first.`);
      const state = await this.#state();
      const pose = poseOf(state, this.#arm, this.#picture());
      this.#content.change({ poses: [...this.#poses, pose] });
      this.#rows.get(pose.id).element.scrollIntoView({ block: "nearest" });
      this.#say(`Pose ${this.#poses.length} is recorded.`);
    } catch (error) {
      this.#say(error.message, true);
    }
  }

  // Return a small picture of the arm; empty if the scene is not drawn.
  #picture() {
    const { scene } = this.#page;
    const pixels = [FOOT, HEAD, HANDLE].map((place) => scene.contentWindow.katanaScene?.pixelOf(place)).filter(Boolean);
    if (pixels.length < 2) return "";
    const spans = [0, 1].map((axis) => {
      const all = pixels.map((each) => each[axis]);
      return [Math.min(...all), Math.max(...all)];
    });
    const [x, y] = spans.map(([low, high]) => (low + high) / 2);
    const [wide, high] = spans.map(([low, high]) => FILLED * (high - low));
    const picture = Viser.thumbnail(scene, x, y, Math.max(high, (wide * PICTURE[1]) / PICTURE[0]), ...PICTURE);
    return isPicture(picture) ? picture : "";
  }

  #rowOf(pose) {
    const acts = {
      put: (id, fields) => this.#content.changePose(id, fields),
      go: (id) => this.#go(id),
      move: (id, by) => this.#move(id, this.#indexOf(id) + by),
      remove: (id) => this.#remove(id),
      toggleGrip: (id) => this.#toggleGrip(id),
    };
    const row = new Row(pose.id, acts, Boolean(this.#arm.gripper));
    draggable(row.element, row.handle, (element, to) => this.#move(element.dataset.id, to));
    return row;
  }

  #indexOf(id) {
    return this.#poses.findIndex((pose) => pose.id === id);
  }

  #move(id, to) {
    const from = this.#indexOf(id);
    if (to === from || to < 0 || to >= this.#poses.length) return;
    const poses = [...this.#poses];
    poses.splice(to, 0, ...poses.splice(from, 1));
    this.#content.change({ poses });
    this.#say(`Pose ${from + 1} is now pose ${to + 1}.`);
  }

  #remove(id) {
    const index = this.#indexOf(id);
    this.#content.change({ poses: this.#poses.filter((pose) => pose.id !== id) });
    this.#say(`Pose ${index + 1} is removed.`);
    // The focus stays in the list.
    const near = this.#poses[Math.min(index, this.#poses.length - 1)];
    const heir = near ? this.#rows.get(near.id).element.querySelector(".remove") : this.#add;
    heir.focus();
  }

  // A pose that was read from a script without a gripper takes the present place of the fingers.
  async #toggleGrip(id) {
    const pose = this.#poses[this.#indexOf(id)];
    try {
      const gripper = pose.gripper ?? fingersOf(await this.#state(), this.#arm);
      this.#content.changePose(id, { grips: !pose.grips, gripper });
    } catch (error) {
      this.#say(error.message, true);
    }
  }

  // The arm moves there by a command, like from its sliders.
  #go(id) {
    const index = this.#indexOf(id);
    const q = this.#poses[index].joints.map((angle) => angle * RADIANS);
    this.#say(`To pose ${index + 1}.`);
    this.#page.say({ do: "joints", q, revocations: this.#page.status()?.revocations, id: `${ID} go` });
  }

  // Playing

  // Play all, or with `single` the next pose; of a text, its next step.
  async #start(single = false) {
    const { revocations } = this.#page.status() ?? {};
    try {
      if (this.#run.busy) {
        if (!single || !this.#isText) throw new Error("It is playing. End it in the bar first.");
        return await this.#run.step(revocations);
      }
      if (this.#isText) await this.#playText(single, revocations);
      else await this.#playPoses(single, revocations);
    } catch (error) {
      this.#say(error.message, true);
    }
    this.#mark(null);
  }

  async #playPoses(single, revocations) {
    const all = this.#poses;
    if (!all.length) throw new Error("There is no pose yet. Move the arm and add a pose.");
    const next = Math.max(this.#indexOf(this.#next), 0);
    const first = single ? next : 0;
    const poses = single ? [{ ...all[next], blend: false }] : all;
    const { text, poseAt } = scriptOf({ ...this.#content.now, times: single ? 1 : this.#content.now.times, poses });
    const at = (line) => (poseAt(line) === null ? null : first + poseAt(line));
    const program = await this.#playing(text, "run", revocations, ({ status, line }) => {
      const index = status === PLANNING ? null : at(line);
      if (index !== null) this.#mark(all[index].id);
      return index === null ? "" : `Pose ${index + 1} of ${all.length}`;
    });
    const done = program.status === "done";
    if (single && done) this.#next = all[(next + 1) % all.length].id;
    if (single && done) this.#say(`The arm is at pose ${next + 1}.`);
    const { problems } = problemsOf(program.why);
    const [worst] = problems;
    if (worst) this.#say(`Pose ${(at(worst.line) ?? 0) + 1}: ${worst.text}`, true);
  }

  async #playText(single, revocations) {
    const found = await this.#editor.check();
    if (found?.problems.length) throw new Error("The script is not run: see the lines below.");
    const { text } = this.#editor;
    const order = single ? "step" : "run";
    const program = await this.#playing(text, order, revocations, ({ line, task }) => `Line ${line}: ${task}`);
    const { problems } = problemsOf(program.why);
    if (problems.length) this.#editor.explain(problems);
  }

  // Play `text` to its end and return its last progress. `where` returns words for a progress.
  async #playing(text, order, revocations, where) {
    this.#say("Planning …");
    this.#play.setAttribute("aria-disabled", "true");
    try {
      const program = await this.#run.play(text, order, revocations, (progress) => {
        const words = where(progress);
        const { status, fraction } = progress;
        this.#say(status === PLANNING ? `Planning ${Math.round(100 * fraction)} %` : words || "Playing");
      });
      const good = program.status === "done";
      this.#say(good ? "Done." : program.why.split("\n")[0] || "It was ended.", !good);
      return program;
    } finally {
      this.#play.removeAttribute("aria-disabled");
    }
  }

  #mark(id) {
    if (id === this.#current) return;
    this.#current = id;
    this.#draw();
    if (id) this.#rows.get(id)?.element.scrollIntoView({ block: "nearest" });
  }

  // Texts and files

  async #toggleText() {
    if (!this.#isText) {
      this.#editor.text = scriptOf(this.#content.now).text;
      this.#content.change({ text: this.#editor.text });
      this.#say("Space types a blank in the text; Esc stops the arm.");
      return this.#editor.focus();
    }
    const found = await this.#editor.check();
    if (!found) return this.#say("There is no connection to the arm.", true);
    if (!found.taught) {
      const why = found.problems.length ? "The text has errors: see the lines below." : "It has steps that are no poses, so it stays text.";
      return this.#say(why, true);
    }
    this.#takeTaught(found.taught);
  }

  #takeTaught({ name, times, poses }) {
    // Pictures belong to the angles.
    const known = new Map(this.#poses.map((pose) => [pose.joints.join(), pose]));
    const taken = poses.slice(0, MAX_POSES).map((each) => {
      const pose = read(each);
      const old = known.get(pose.joints.join());
      return old ? { ...pose, picture: old.picture, gripper: pose.gripper ?? old.gripper } : pose;
    });
    this.#content.change({ name, times: Math.min(times, MAX_TIMES), poses: taken, text: null });
    this.#say(poses.length > MAX_POSES ? `Only the first ${MAX_POSES} poses are shown.` : "");
  }

  get #script() {
    return this.#isText ? this.#editor.text : scriptOf(this.#content.now).text;
  }

  #checkSomething() {
    if (!this.#isText && !this.#poses.length) throw new Error("There is no pose yet. Move the arm and add a pose.");
  }

  #download() {
    try {
      this.#checkSomething();
    } catch (error) {
      return this.#say(error.message, true);
    }
    const link = html("a", { download: `${this.#content.now.name}${FILE}` });
    link.href = URL.createObjectURL(new Blob([this.#script], { type: "application/yaml" }));
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href));
    this.#say(`Saved as ${link.download}.`);
  }

  async #save() {
    try {
      this.#checkSomething();
      const { name } = this.#content.now;
      const answer = await fetch(`api/v1/scripts/${encodeURIComponent(name)}`, { method: "POST", body: this.#script });
      if (!answer.ok) throw new Error(await answer.text());
      this.#say(`Saved as ${name}. It is under Script in the tab Programs.`);
      await this.#listScripts();
    } catch (error) {
      this.#say(error.message, true);
    }
  }

  async #listScripts() {
    const answer = await fetch("api/v1/scripts").catch(() => null);
    if (!answer?.ok) return;
    const { names, saves } = await answer.json();
    this.#keep.hidden = !saves;
    this.#open.replaceChildren(new Option("Open …", ""), new Option("A file …", FILE), ...names.map((name) => new Option(name)));
  }

  async #choose() {
    const name = this.#open.value;
    this.#open.value = "";
    if (!name) return;
    if (name === FILE) return this.#file.click();
    await this.open(name, false);
  }

  // Show the script of this name, of the library or of the folder of the server: as text, or as poses if it has only these.
  async open(name, asText) {
    const answer = await fetch(`api/v1/scripts/${encodeURIComponent(name)}`).catch(() => null);
    if (answer?.ok) await this.#load(await answer.text(), name, asText);
    else this.#say(answer ? await answer.text() : "There is no connection to the arm.", true);
  }

  async #take() {
    const [file] = this.#file.files;
    this.#file.value = "";
    if (file) await this.#load(await file.text(), file.name.replace(/\.ya?ml$/i, ""));
  }

  // Show a script as poses if it has only these, otherwise and with `asText` as text.
  async #load(text, name, asText = false) {
    this.#editor.text = text;
    this.#content.change({ text, name: name.slice(0, 40) });
    const found = await this.#editor.check();
    if (found?.taught && !asText) this.#takeTaught(found.taught);
    else if (found?.problems.length) this.#say("The text has errors: see the lines below.");
    else this.#say(asText ? `${name} is shown as text.` : "It has steps that are no poses, so it is shown as text.");
  }

  // Display

  #draw() {
    const { name, times, poses, text } = this.#content.now;
    /** @type {any} */
    const focused = document.activeElement;
    for (const [id, row] of this.#rows)
      if (!poses.some((pose) => pose.id === id)) {
        row.element.remove();
        this.#rows.delete(id);
      }
    const next = Math.max(this.#indexOf(this.#next), 0);
    poses.forEach((pose, i) => {
      if (!this.#rows.has(pose.id)) this.#rows.set(pose.id, this.#rowOf(pose));
      const row = this.#rows.get(pose.id);
      row.show(poses, i, pose.id === this.#current, i === next && poses.length > 1);
      if (this.#list.children[i] !== row.element) this.#list.insertBefore(row.element, this.#list.children[i] ?? null);
    });
    // A row that was moved in the document has lost the focus.
    if (this.#list.contains(focused) && focused !== document.activeElement) focused.focus();
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
    if (this.#times !== focused || this.#times.valueAsNumber !== times) this.#times.value = times;
    if (this.#name !== focused || this.#name.value.trim() !== name) this.#name.value = name;
    set(this.#undo, "aria-disabled", !this.#content.undoable);
    set(this.#redo, "aria-disabled", !this.#content.redoable);
  }
}
