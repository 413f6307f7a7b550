// The timeline: what the server has recorded, or a file, shown in this window alone at any moment.
import { html, svg } from "../instruments/shape.js";
import { keep } from "../more/keep.js";
import { ScriptRun } from "../teach/run.js";
import * as api from "./api.js";
import { atPlace, lengthOf, placeOf } from "./axis.js";
import { Plot } from "./plot.js";
import { Work } from "./work.js";

const RING = "ring";
const REFRESH = 3000; // ms between two looks at what was recorded meanwhile
const [STEP, LONG_STEP] = [0.1, 1]; // s of the arrow keys, and with Shift
const NEAR = 0.15; // s, within which a mark is at a moment
const SPEEDS = [0.25, 0.5, 1, 2, 4];
// Nodes of the present that are hidden while the past is shown, beside the links that move.
const PRESENT = /^\/(ghost|cup|basin|water|velocity|(target|handles|objects|path|branch)\/[^/]+)$/;
// Requests that do not concern what is seen.
const QUIET = /^(stop|rename|ask|withdraw|decline|give|acquire|take|release_lease|query|heartbeat|list_people|kick|breakpoints|speed)$/;
const EXPORTS = [["csv", "CSV table"], ["parquet", "Parquet table"], ["rosbag2", "ROS 2 bag"], ["html", "HTML page"], ["mp4", "MP4 film"]];
const ICONS = { play: "M5.5 3.2v13.6L16.5 10z", pause: "M5 3.5h3.4v13H5zM11.6 3.5H15v13h-3.4z" };

const icon = (d) => svg("svg", { viewBox: "0 0 20 20", "aria-hidden": "true" }, svg("path", { d }));
const option = (value, words) => html("option", { value }, words);

export class Timeline {
  #page; // {scene, stage, page, toast, kept, status}
  #box;
  #part = {}; // elements by name
  #plot;
  #work; // exports and verifications
  #run; // of a recorded motion
  #of = RING; // the recording
  #names = new Map([[RING, "Last minutes"]]);
  #spans = [];
  #marks = [];
  #t = null; // the moment that is shown [s since the epoch]; null while the window is live
  #playing = null; // time of the last frame [ms]
  #ends = [null, null]; // begin and end of the selection; null: that of the recording
  #second = null; // {of, begin, mine}: second run, its start, and that of the first one
  #busy = false; // whether a moment is requested
  #timer = 0;
  #failed = false; // whether the last look at the recording failed
  #use; // what a chosen file is opened for
  #veiled = false; // whether the present is hidden

  constructor(box, page) {
    this.#box = box;
    this.#page = page;
    this.#run = new ScriptRun(page.say, "run again");
    document.head.append(html("link", { rel: "stylesheet", href: new URL("timeline.css", import.meta.url).href }));
    this.#build();
    this.#plot = new Plot(this.#part.plot);
    this.#work = new Work(this.#part.work);
    let stopped = Boolean(page.status()?.stopped);
    const follow = (status) => {
      if (status?.stopped && !stopped) this.live();
      stopped = Boolean(status?.stopped);
      // Scripts do not move a robot that has only joints.
      this.#part.again.hidden = !status?.scripts;
    };
    follow(page.status());
    window.addEventListener("status", ({ detail }) => follow(detail));
  }

  get shown() {
    return !this.#box.hidden;
  }

  // Show the timeline or fold it away.
  async show(shown) {
    this.#box.hidden = !shown;
    clearInterval(this.#timer);
    if (!shown) return this.live();
    this.#timer = setInterval(() => document.hidden || this.#refresh(), REFRESH);
    await this.#refresh();
  }

  // Show a moment, such as that of a link: the name of a recording and the time, with an @ between.
  async goTo(moment) {
    const [of, t] = moment.split("@");
    await this.#choose(of);
    const [start, end] = [this.#spans[0]?.[0], this.#spans.at(-1)?.[1]];
    if (this.#of !== of || !(t >= start && t <= end)) this.#page.toast("The server no longer has that moment.");
    else this.#seek(Number(t));
  }

  // Open a file that was chosen or dropped.
  async open(file, use = (name) => this.#choose(name)) {
    this.#page.toast(`Opening ${file.name} …`);
    try {
      const { name, note } = await api.open(file);
      this.#names.set(name, file.name);
      this.#list();
      await use(name);
      this.#page.toast(note || `${file.name} is open.`);
    } catch (error) {
      this.#page.toast(error.message);
      this.#list();
    }
  }

  // Show the present again, for instance because the person acts.
  live() {
    this.#play(false);
    if (this.#t === null) return;
    this.#t = null;
    this.#veiled = false;
    this.#katana?.veil(null);
    this.#part.past.hidden = true;
    api.hide(this.#page.page).catch(() => {});
    this.#draw();
  }

  // A request of this window, which moves what is seen.
  said(message) {
    if (!QUIET.test(message.do)) this.live();
  }

  #build() {
    const range = (name, label) => html("input", { type: "range", class: name, min: "0", max: "1", step: "any", "aria-label": label });
    const button = (label, act, ...content) => {
      const made = html("button", { type: "button", title: label, "aria-label": label }, ...(content.length ? content : [label]));
      made.addEventListener("click", act);
      return made;
    };
    const part = (this.#part = {
      plot: html("div", { class: "plot", hidden: "" }),
      work: html("div", { class: "work", hidden: "" }),
      exports: html("select", { "aria-label": "Export the selection" }, option("", "Export…"), ...EXPORTS.map(([name, words]) => option(name, words))),
      play: button("Play", () => this.#play(this.#playing === null), icon(ICONS.play)),
      clock: html("output", { class: "clock" }, "Live"),
      marks: html("div", { class: "marks" }),
      begin: range("end", "Start of the selection"),
      end: range("end", "End of the selection"),
      now: range("now", "Moment that is shown"),
      speed: html("select", { "aria-label": "Speed of playing back" }, ...SPEEDS.map((each) => option(each, `${each}×`))),
      of: html("select", { "aria-label": "Recording" }),
      second: html("select", { "aria-label": "Second run" }),
      events: html("select", { "aria-label": "Events" }),
      file: html("input", { type: "file", accept: ".mcap", hidden: "", "aria-label": "File of a recording" }),
      again: button("Run again the selected motion", () => this.#again(), "Run again"),
      at: html("time", { "aria-live": "off" }),
      past: html("div", { id: "past", hidden: "" }),
    });
    part.speed.value = "1";
    part.past.append(html("p", { role: "status" }, "Playing back ", part.at, ", arm is elsewhere"), button("Back to live", () => this.live()));
    part.past.lastElementChild.className = "main";
    this.#page.stage.append(part.past);
    const fold = button("Fold the timeline away", () => this.#page.fold(), "×");
    fold.className = "fold";
    const track = html("div", { class: "track" }, part.marks, part.now, part.begin, part.end);
    this.#box.replaceChildren(
      part.plot,
      part.work,
      html("div", { class: "row" }, part.play, part.clock, track, part.speed, part.events, part.of, part.second,
        button("Save selection", () => this.#save(), "Save", html("span", {}, " selection")),
        part.exports,
        part.again,
        button("Verify the selection: simulate it again and compare every tick", () => this.#start("verify", "Verify"), "Verify"),
        button("Copy link to this moment", () => this.#copy(), "Copy link"),
        fold, part.file),
    );
    this.#list();
    this.#listen();
  }

  #listen() {
    const { now, begin, end, of, second, events, exports, file } = this.#part;
    exports.addEventListener("change", () => {
      const words = exports.selectedOptions[0].text;
      this.#start(exports.value, `Export as ${words}`);
      exports.value = "";
    });
    events.addEventListener("change", () => {
      this.#seek(Number(events.value));
      events.value = "";
    });
    now.addEventListener("input", () => this.#seek(atPlace(this.#spans, Number(now.value))));
    now.addEventListener("keydown", (event) => this.#key(event));
    [begin, end].forEach((each, i) => each.addEventListener("input", () => this.#select(i, Number(each.value))));
    of.addEventListener("change", () => (of.value === "file" ? this.#ask((name) => this.#choose(name)) : this.#choose(of.value)));
    second.addEventListener("change", () => (second.value === "file" ? this.#ask((name) => this.#compare(name)) : this.#compare(second.value)));
    file.addEventListener("change", () => {
      const [first] = file.files;
      file.value = "";
      if (first) this.open(first, this.#use);
    });
  }

  #ask(use) {
    this.#use = use;
    this.#list();
    this.#part.file.click();
  }

  #key(event) {
    const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
    if (way) {
      const place = (this.#t === null ? lengthOf(this.#spans) : placeOf(this.#spans, this.#t)) + way * (event.shiftKey ? LONG_STEP : STEP);
      this.#seek(atPlace(this.#spans, place));
    } else if (event.key === "Home") this.#seek(this.#spans[0]?.[0] ?? 0);
    else if (event.key === "End") this.#of === RING ? this.live() : this.#seek(this.#spans.at(-1)?.[1] ?? 0);
    else if (event.key === "Enter") event.repeat || this.#play(this.#playing === null);
    else return;
    event.preventDefault();
  }

  async #refresh() {
    try {
      const of = this.#of;
      const { spans, marks } = await api.timeline(of);
      if (of !== this.#of) return;
      [this.#spans, this.#marks] = [spans, marks];
      this.#failed = false;
    } catch (error) {
      // Once, not each time.
      if (!this.#failed) this.#page.toast(error.message);
      this.#failed = true;
    }
    this.#drawMarks();
    this.#draw();
  }

  async #choose(of) {
    this.live();
    this.#compare("");
    [this.#of, this.#ends, this.#spans, this.#marks, this.#failed] = [of, [null, null], [], [], false];
    await this.#refresh();
    if (this.#failed && of !== RING) return this.#choose(RING); // the server no longer has it
    this.#list();
    if (of !== RING && this.#spans.length) this.#seek(this.#spans[0][0]);
  }

  async #compare(choice) {
    this.#second = null;
    this.#plot.draw(null);
    if (choice) {
      try {
        const of = choice === "here" ? this.#of : choice;
        const { spans } = await api.timeline(of);
        const begin = choice === "here" ? (this.#t ?? spans[0][0]) : spans[0][0];
        this.#second = { of, begin, spans, mine: this.#ends[0] ?? this.#spans[0][0] };
        this.#plot.draw(await api.difference({ of: this.#of, t: this.#second.mine, second: of, t2: begin }));
        this.#seek(this.#second.mine);
      } catch (error) {
        this.#page.toast(error.message);
      }
    } else if (this.#t !== null) this.#request();
    this.#list();
  }

  // Fill the lists of recordings.
  #list() {
    const { of, second } = this.#part;
    const may = this.#page.status()?.role !== "viewer";
    const opened = [...this.#names].filter(([name]) => name !== RING).map(([name, words]) => option(name, words));
    const file = () => (may ? [option("file", "Open a file…")] : []);
    of.replaceChildren(option(RING, this.#names.get(RING)), ...opened, ...file());
    of.value = this.#of;
    second.replaceChildren(option("", "Compare…"), option("here", "from here on"), ...opened.map((each) => each.cloneNode(true)), ...file());
    second.value = this.#second ? (this.#names.has(this.#second.of) && this.#second.of !== this.#of ? this.#second.of : "here") : "";
  }

  #seek(t) {
    if (!this.#spans.length) return this.#page.toast("Nothing is recorded yet: the arm has not moved.");
    this.#t = t;
    this.#part.past.hidden = false;
    this.#draw();
    this.#request();
  }

  // Request the moment; the newest one, if several are wanted while one is on its way.
  async #request() {
    if (this.#busy) return;
    this.#busy = true;
    let asked = null;
    try {
      while (this.#t !== null && this.#t !== asked) {
        asked = this.#t;
        const query = { page: this.#page.page, of: this.#of, t: asked };
        const { of, begin, spans, mine } = this.#second ?? {};
        if (of) Object.assign(query, { second: of, t2: atPlace(spans, placeOf(spans, begin) + placeOf(this.#spans, asked) - placeOf(this.#spans, mine)) });
        const { moving } = await api.show(query);
        if (this.#t !== null && !this.#veiled) this.#katana?.veil((name) => PRESENT.test(name) || moving.includes(name));
        this.#veiled = this.#t !== null;
      }
    } catch (error) {
      this.live();
      this.#page.toast(error.message);
    } finally {
      this.#busy = false;
      // What came after the window became live is hidden again.
      if (this.#t === null) api.hide(this.#page.page).catch(() => {});
    }
  }

  #play(plays) {
    if (plays && this.#t === null) this.#seek(this.#ends[0] ?? this.#spans[0]?.[0] ?? 0);
    if (plays === (this.#playing !== null) || (plays && this.#t === null)) return;
    this.#playing = plays ? performance.now() : null;
    const words = plays ? "Pause" : "Play";
    this.#part.play.replaceChildren(icon(plays ? ICONS.pause : ICONS.play));
    for (const name of ["title", "aria-label"]) this.#part.play.setAttribute(name, words);
    if (plays) requestAnimationFrame((now) => this.#frame(now));
  }

  #frame(now) {
    if (this.#playing === null || !this.#spans.length) return this.#play(false);
    const place = placeOf(this.#spans, this.#t) + ((now - this.#playing) / 1000) * Number(this.#part.speed.value);
    this.#playing = now;
    const end = this.#ends[1] ?? this.#spans.at(-1)[1];
    const t = Math.min(atPlace(this.#spans, place), end);
    this.#seek(t);
    if (t >= end) this.#play(false);
    else requestAnimationFrame((next) => this.#frame(next));
  }

  #select(which, place) {
    const t = atPlace(this.#spans, place);
    const other = this.#ends[1 - which] ?? this.#spans.at(which ? 0 : -1)?.[which ? 0 : 1];
    this.#ends[which] = which ? Math.max(t, other) : Math.min(t, other);
    this.#draw();
  }

  // The recording and the times of the selection; null if nothing is recorded.
  #selection() {
    if (this.#spans.length) return { of: this.#of, from: this.#ends[0] ?? this.#spans[0][0], to: this.#ends[1] ?? this.#spans.at(-1)[1] };
    this.#page.toast("Nothing is recorded yet: the arm has not moved.");
    return null;
  }

  #save() {
    const selection = this.#selection();
    if (selection) keep(this.#page.toast, selection);
  }

  #start(what, words) {
    const selection = this.#selection();
    if (selection) this.#work.start(what, selection, words);
  }

  // Drive the arm along the selected motion, as a program that the bar shows and steers.
  async #again() {
    const { toast, status } = this.#page;
    const { revocations } = status() ?? {};
    const selection = this.#selection();
    if (!selection || this.#run.busy) return;
    this.live();
    toast("The motion is being made a program.");
    try {
      const answer = await fetch(`api/v1/recording/script?${new URLSearchParams(selection)}`);
      if (!answer.ok) throw new Error(await answer.text());
      const { status: end, why } = await this.#run.play(await answer.text(), "run", revocations, () => {});
      toast(end === "done" ? "The motion has run again." : `The motion did not run to its end: ${why || end}`);
    } catch (error) {
      toast(`The motion cannot run again: ${error.message}`);
    }
  }

  // Take an answer; return whether it was for the motion that runs again.
  hear(answer) {
    return this.#run.hear(answer);
  }

  async #copy() {
    const t = this.#t ?? this.#spans.at(-1)?.[1];
    if (t === undefined) return this.#page.toast("Nothing is recorded yet: the arm has not moved.");
    const link = `${location.origin}${location.pathname}?moment=${this.#of}@${t.toFixed(3)}`;
    try {
      await navigator.clipboard.writeText(link);
      this.#page.toast("The link is copied. It shows this moment as long as the server has it.");
    } catch {
      this.#page.toast(`This browser does not allow the page to copy: ${link}`);
    }
  }

  get #katana() {
    return this.#page.scene.contentWindow?.katanaScene;
  }

  #words(t) {
    /** @type {Intl.DateTimeFormatOptions} */
    const style = { hour: "2-digit", minute: "2-digit", second: "2-digit" };
    const at = new Date(1000 * t);
    const today = at.toDateString() === new Date().toDateString();
    return today ? at.toLocaleTimeString([], style) : at.toLocaleString([], { day: "numeric", month: "short", ...style });
  }

  #draw() {
    const { now, begin, end, clock, at, marks } = this.#part;
    const length = lengthOf(this.#spans);
    const place = this.#t === null ? length : placeOf(this.#spans, this.#t);
    const ends = [this.#ends[0] === null ? 0 : placeOf(this.#spans, this.#ends[0]), this.#ends[1] === null ? length : placeOf(this.#spans, this.#ends[1])];
    [now, begin, end].forEach((each, i) => {
      each.max = String(length);
      each.value = String([place, ...ends][i]);
      each.disabled = !this.#spans.length;
      const t = i ? (this.#ends[i - 1] ?? atPlace(this.#spans, ends[i - 1])) : this.#t;
      const there = i || t === null ? [] : this.#marks.filter(([when]) => Math.abs(when - t) <= NEAR).map(([, , text]) => text);
      each.setAttribute("aria-valuetext", t === null ? "Live" : [this.#words(t), ...there].join(", "));
    });
    const words = this.#t === null ? "Live" : this.#words(this.#t);
    if (clock.textContent !== words) clock.textContent = words;
    if (at.textContent !== words) at.textContent = words;
    const percent = (x) => `${length ? (100 * x) / length : 0}%`;
    marks.style.setProperty("--begin", percent(ends[0]));
    marks.style.setProperty("--end", percent(ends[1]));
    if (this.#second) this.#plot.mark(place - placeOf(this.#spans, this.#second.mine));
  }

  #drawMarks() {
    const length = lengthOf(this.#spans) || 1;
    const shown = this.#marks.map(([t, kind, words]) => {
      const made = html("i", { class: kind, title: `${this.#words(t)} ${words}` });
      made.style.left = `${(100 * placeOf(this.#spans, t)) / length}%`;
      // What lies under a mark is its moment.
      made.addEventListener("click", () => this.#seek(t));
      return made;
    });
    this.#part.marks.replaceChildren(...shown);
    const { events } = this.#part;
    // An open list keeps its place.
    if (document.activeElement === events && events.options.length === this.#marks.length + 1) return;
    events.replaceChildren(option("", "Events"), ...this.#marks.toReversed().map(([t, , words]) => option(t, `${this.#words(t)} ${words}`)));
  }
}
