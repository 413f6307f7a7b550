// The timeline: what the server has recorded, or a file, shown in this window alone at any moment.
import { element, onChoice, onPick, sceneOf, styled, write } from "../dom.js";
import { html } from "../instruments/shape.js";
import { addressed } from "../page/words.js";
import { messageOf } from "../server.js";
import * as api from "./api.js";
import { atPlace, attemptAt, bars, lengthOf, placeOf } from "./axis.js";
import { Controls, timeInWords } from "./controls.js";
import { NOTHING, Selection } from "./selection.js";

/** @typedef {{ of: string, begin: number, spans: api.Span[], mine: number }} SecondRun */
const REFRESH = 3000; // ms between two looks at what was recorded meanwhile
const [STEP, LONG_STEP] = [0.1, 1]; // s of the arrow keys, and with Shift
const NEAR = 0.15; // s, within which a mark is at a moment
// Nodes of the present that are hidden while the past is shown, beside the links that move.
const PRESENT = /^\/(ghost|cup|basin|water|velocity|(target|handles|objects|path|branch)\/[^/]+)$/;
const RECORDED = "/playback/0/arm";
const [LOOK, LONG_LOAD] = [30, 3000]; // ms between two looks at whether it is drawn, and until the present goes without it
const CONTINUE = "continuation"; // id of the request
// Requests that do not concern what is seen, or only once they are done.
const QUIET = /^(stop|rename|continue_from|ask|withdraw|decline|give|acquire|take|release_lease|query|heartbeat|breakpoints|speed)$/;
/** @type {Record<string, number>} */
const ARROWS = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 };

export class Timeline {
  #page;
  #box;
  #part;
  #selection;
  #of = api.RING; // the recording
  #names = new Map([[api.RING, "Last minutes"]]);
  /** @type {api.Span[]} */
  #spans = [];
  /** @type {api.Mark[]} */
  #marks = [];
  /** @type {api.Attempt[]} */
  #attempts = [];
  /** @type {api.Attempt | undefined} */
  #attempt; // the one that is shown, or under way
  /** @type {import("./attempts.js").Attempts | null} */
  #tree = null;
  /** @type {number | null} */
  #t = null; // the moment that is shown [s since the epoch]; null while the window is live
  /** @type {number | null} */
  #playing = null; // time of the last frame [ms]
  /** @type {SecondRun | null} */
  #second = null; // second run, its start, and that of the first one
  #from = 0; // the moment [s] from which the arm is to continue
  #busy = false; // whether a moment is requested
  #timer = 0;
  #failed = false; // whether the last look at the recording failed
  #hidden = false; // whether the present is hidden
  #pinned = false; // whether the controls are shown without a pointer or focus on the line
  #news = 0; // looks at what was recorded that are due, because the status has changed

  /** `fold` folds the timeline away. @param {HTMLElement} box @param {Page.Context} page @param {() => void} fold */
  constructor(box, page, fold) {
    this.#box = box;
    this.#page = page;
    styled("timeline.css", import.meta.url);
    this.#part = new Controls(box, {
      fold,
      play: () => this.#play(this.#playing === null),
      live: () => this.live(),
      restore: () => this.#restore(),
      tree: () => this.#openTree(),
      again: () => this.#again(),
      save: () => this.#selection.process(this.#selected(), "recording", "Export"),
      verify: () => this.#selection.process(this.#selected(), "verify", "Verify"),
    });
    page.stage.append(this.#part.past);
    this.#selection = new Selection(page, this.#part.work);
    this.#list();
    this.#listen();
    /** @param {Page.Status | null} status @param {Page.Status | null} before */
    const follow = (status, before) => {
      this.#news = 2;
      box.classList.toggle("rec", Boolean(status?.episodes?.running));
      if (status?.stopped && !before?.stopped) this.live();
      // Scripts do not move a robot that has only joints.
      this.#part.again.hidden = !status?.scripts;
    };
    follow(page.store.status, null);
    page.store.follow(follow);
  }

  get open() {
    return this.#box.classList.contains("open");
  }

  /** @param {boolean} open */
  #grow(open) {
    this.#box.classList.toggle("open", open);
    element("timeline-button", HTMLElement).setAttribute("aria-expanded", String(open));
  }

  /** Show the line, `open` with its controls, or fold it away. @param {boolean} shown @param {boolean} open */
  async show(shown, open) {
    this.#box.hidden = !shown;
    this.#pinned = open;
    this.#grow(open);
    clearInterval(this.#timer);
    if (!open) this.live();
    if (!shown) return;
    this.#timer = setInterval(() => document.hidden || (this.#news && this.#refresh()), REFRESH);
    await this.#refresh();
  }

  /** Open a file that was chosen or dropped. @param {File} file */
  async replay(file) {
    this.#page.toast(`Opening ${file.name} …`);
    try {
      const { name, note } = await api.open(file);
      this.#names.set(name, file.name);
      this.#list();
      await this.#choose(name);
      this.#page.toast(note || `${file.name} is open.`);
    } catch (error) {
      this.#page.toast(messageOf(error));
      this.#list();
    }
  }

  // Show the present again, for instance because the person acts.
  live() {
    this.#play(false);
    if (this.#t === null) return;
    this.#t = this.#page.past = null;
    this.#hidden = false;
    sceneOf(this.#page.scene)?.hideNodes(null);
    this.#part.showPast(false);
    this.#grow(this.#pinned);
    api.hide(this.#page.name).catch(() => {});
    this.#draw();
  }

  // Let the arm continue from the moment that is shown.
  #restore() {
    this.#from = this.#t ?? 0;
    this.#page.say({ do: "continue_from", of: this.#of, t: this.#from, revocations: this.#page.store.status?.revocations, id: CONTINUE });
  }

  /** A request of this window, which moves what is seen. @param {Api.Act} request */
  said(request) {
    if (!QUIET.test(request.do)) this.live();
  }

  /** Take an answer; return whether it was for the timeline, and is no refusal that the page shows. @param {Page.Answer} answer */
  hear(answer) {
    if (answer.id !== CONTINUE || answer.is === "refused") return this.#selection.run.hear(answer);
    this.live();
    this.#page.toast(`The arm continues from ${timeInWords(this.#from)}. Objects, speed and tool are as they were then.`);
    return true;
  }

  #listen() {
    const { now, begin, end, of, second, events, exports, keep, file } = this.#part;
    onPick(exports, (what) => this.#selection.process(this.#selected(), what, `Export as ${exports.selectedOptions[0].text}`));
    onPick(keep, (outcome) => this.#selection.keep(this.#selected(), outcome));
    onPick(events, (t) => this.#seek(Number(t)));
    now.addEventListener("input", () => this.#seek(atPlace(this.#spans, Number(now.value))));
    now.addEventListener("keydown", (event) => this.#key(event));
    begin.addEventListener("input", () => this.#select(0, Number(begin.value)));
    end.addEventListener("input", () => this.#select(1, Number(end.value)));
    of.addEventListener("change", () => {
      if (of.value !== "file") return this.#choose(of.value);
      this.#list();
      file.click();
    });
    second.addEventListener("change", () => this.#compare(second.value));
    onChoice(file, ([chosen]) => this.replay(chosen));
    // A finger opens the thin line first; a pointer is over it then, and the line has grown.
    this.#box.addEventListener("click", () => {
      if (!this.open && matchMedia("(hover: none)").matches) this.show(true, true);
    });
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const sign = ARROWS[event.key];
    if (sign) {
      const place = (this.#t === null ? lengthOf(this.#spans) : placeOf(this.#spans, this.#t)) + sign * (event.shiftKey ? LONG_STEP : STEP);
      this.#seek(atPlace(this.#spans, place));
    } else if (event.key === "Home") this.#seek(this.#spans[0]?.[0] ?? 0);
    else if (event.key === "End") this.#of === api.RING ? this.live() : this.#seek(this.#spans.at(-1)?.[1] ?? 0);
    else if (event.key === "Enter") event.repeat || this.#play(this.#playing === null);
    else return;
    event.preventDefault();
  }

  async #refresh() {
    this.#news -= 1;
    try {
      const of = this.#of;
      const { spans, marks, attempts } = await api.timeline(of);
      if (of !== this.#of) return;
      [this.#spans, this.#attempts, this.#attempt] = [spans, attempts, undefined];
      const { name = "" } = this.#page.store.status ?? {};
      this.#marks = marks.map(([t, kind, words]) => [t, kind, addressed(words, name)]);
      this.#failed = false;
    } catch (error) {
      // Once, not each time, and to a person who looks at it.
      if (!this.#failed && this.open) this.#page.toast(messageOf(error));
      this.#failed = true;
    }
    this.#draw();
  }

  /** @param {string} of @returns {Promise<void>} */
  async #choose(of) {
    this.live();
    this.#compare("");
    this.#selection.set();
    [this.#of, this.#spans, this.#marks, this.#attempts, this.#failed] = [of, [], [], [], false];
    await this.#refresh();
    if (this.#failed && of !== api.RING) return this.#choose(api.RING); // the server no longer has it
    this.#list();
    if (of !== api.RING && this.#spans.length) this.#seek(this.#spans[0][0]);
  }

  /** @param {string} choice @param {number | null} t that of the second run at its start */
  async #compare(choice, t = this.#t) {
    this.#second = null;
    if (choice) {
      try {
        const of = choice === "here" ? this.#of : choice;
        const { spans } = await api.timeline(of);
        const begin = choice === "here" ? (t ?? spans[0][0]) : spans[0][0];
        const mine = this.#selection.start(this.#spans);
        this.#second = { of, begin, spans, mine };
        this.#seek(mine);
      } catch (error) {
        this.#page.toast(messageOf(error));
      }
    } else if (this.#t !== null) this.#request();
    this.#list();
  }

  // Fill the lists of recordings.
  #list() {
    const { of, second, keep } = this.#part;
    keep.hidden = this.#of !== api.RING;
    const may = this.#page.store.status?.role !== "viewer";
    const opened = () => [...this.#names].filter(([name]) => name !== api.RING).map(([name, words]) => new Option(words, name));
    const file = may ? [new Option("Open a file…", "file")] : [];
    of.replaceChildren(new Option(this.#names.get(api.RING), api.RING), ...opened(), ...file);
    of.value = this.#of;
    second.replaceChildren(new Option("Compare…", ""), new Option("from here on", "here"), ...opened());
    second.value = this.#second ? (this.#names.has(this.#second.of) && this.#second.of !== this.#of ? this.#second.of : "here") : "";
  }

  /** @param {number} t */
  #seek(t) {
    if (!this.#spans.length) return this.#page.toast(NOTHING);
    this.#t = t;
    this.#part.showPast(true);
    this.#grow(true);
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
        const { moving } = await api.show({ page: this.#page.name, of: this.#of, t: asked, ...this.#secondAt(asked) });
        this.#page.past = this.#t === null ? null : { of: this.#of, t: asked };
        const scene = sceneOf(this.#page.scene);
        const end = performance.now() + LONG_LOAD;
        while (!this.#hidden && scene?.missing([RECORDED]).length && performance.now() < end) await new Promise((next) => setTimeout(next, LOOK));
        if (this.#t !== null && !this.#hidden) scene?.hideNodes((name) => PRESENT.test(name) || moving.includes(name));
        this.#hidden = this.#t !== null;
      }
    } catch (error) {
      this.live();
      this.#page.toast(messageOf(error));
    } finally {
      this.#busy = false;
      // What came after the window became live is hidden again.
      if (this.#t === null) api.hide(this.#page.name).catch(() => {});
    }
  }

  // Return the query for the moment of the second run that belongs to the time `t` of the first; empty without one.
  /** @param {number} t @returns {Record<string, string | number>} */
  #secondAt(t) {
    if (!this.#second) return {};
    const { of, begin, spans, mine } = this.#second;
    return { second: of, t2: atPlace(spans, placeOf(spans, begin) + placeOf(this.#spans, t) - placeOf(this.#spans, mine)) };
  }

  /** @param {boolean} plays */
  #play(plays) {
    if (plays && (this.#t ?? Infinity) >= this.#selection.end(this.#spans)) this.#seek(this.#selection.start(this.#spans));
    if (plays === (this.#playing !== null) || (plays && this.#t === null)) return;
    this.#playing = plays ? performance.now() : null;
    this.#part.showPlaying(plays);
    if (plays) requestAnimationFrame((now) => this.#frame(now));
  }

  /** @param {number} now */
  #frame(now) {
    if (this.#playing === null || this.#t === null || !this.#spans.length) return this.#play(false);
    const place = placeOf(this.#spans, this.#t) + ((now - this.#playing) / 1000) * Number(this.#part.speed.value);
    this.#playing = now;
    const end = this.#selection.end(this.#spans);
    const t = Math.min(atPlace(this.#spans, place), end);
    this.#seek(t);
    if (t >= end) this.#play(false);
    else requestAnimationFrame((next) => this.#frame(next));
  }

  /** @param {0 | 1} which @param {number} place */
  #select(which, place) {
    this.#selection.put(which, atPlace(this.#spans, place), this.#spans);
    this.#draw();
  }

  #selected() {
    return this.#selection.partOf(this.#of, this.#spans);
  }

  #again() {
    const part = this.#selected();
    if (part) this.live();
    this.#selection.runAgain(part);
  }

  async #openTree() {
    const { Attempts } = await import("./attempts.js");
    this.#tree ??= new Attempts(this.#part.tree, this.#page, { selection: this.#selection, seek: (t) => this.#seek(t), beside: (t) => this.#compare("here", t), change: () => this.#refresh() });
    this.#part.tree.hidden = !this.#part.tree.hidden;
    this.#attempt = undefined;
    this.#draw();
  }

  #draw() {
    const attempt = attemptAt(this.#attempts, this.#t ?? Infinity);
    if (attempt !== this.#attempt || !attempt) {
      this.#attempt = attempt;
      this.#drawMarks();
    }
    const { now, begin, end, clock, moment, marks } = this.#part;
    const length = lengthOf(this.#spans);
    const place = this.#t === null ? length : placeOf(this.#spans, this.#t);
    const ends = this.#selection.places(this.#spans);
    [now, begin, end].forEach((control, i) => {
      control.max = String(length);
      control.value = String([place, ...ends][i]);
      control.disabled = !this.#spans.length;
      control.setAttribute("aria-valuetext", i ? timeInWords(atPlace(this.#spans, ends[i - 1])) : this.#momentInWords());
    });
    const words = this.#t === null ? "Live" : timeInWords(this.#t);
    write(clock, words);
    write(moment, words);
    /** @param {number} x */
    const percent = (x) => `${length ? (100 * x) / length : 0}%`;
    marks.style.setProperty("--begin", percent(ends[0]));
    marks.style.setProperty("--end", percent(ends[1]));
  }

  // Return the moment that is shown, and the events at it, in words.
  #momentInWords() {
    const t = this.#t;
    if (t === null) return "Live";
    const events = this.#marks.filter(([mark]) => Math.abs(mark - t) <= NEAR).map(([, , words]) => words);
    return [timeInWords(t), ...events].join(", ");
  }

  #drawMarks() {
    const length = lengthOf(this.#spans) || 1;
    const shown = this.#marks.map(([t, kind, words]) => {
      const mark = html("i", { class: kind, title: `${timeInWords(t)} ${words}` });
      mark.style.left = `${(100 * placeOf(this.#spans, t)) / length}%`;
      // What lies under a mark is its moment.
      mark.addEventListener("click", () => this.#seek(t));
      return mark;
    });
    const { events, legend } = this.#part;
    this.#part.marks.replaceChildren(...bars(this.#marks, this.#spans, this.#attempts, this.#attempt), ...shown);
    this.#part.attempts.hidden = this.#attempts.length < 2;
    this.#part.tree.hidden ||= this.#part.attempts.hidden;
    this.#part.attempts.setAttribute("aria-expanded", String(!this.#part.tree.hidden));
    if (this.#attempt && !this.#part.tree.hidden) this.#tree?.draw(this.#of, this.#spans, this.#attempts, this.#attempt);
    for (const entry of legend.children) entry.toggleAttribute("hidden", !this.#marks.some(([, kind]) => kind === entry.getAttribute("data-kind")));
    // An open list keeps its place.
    if (document.activeElement === events && events.options.length === this.#marks.length + 1) return;
    events.replaceChildren(new Option("Events", ""), ...this.#marks.toReversed().map(([t, , words]) => new Option(`${timeInWords(t)} ${words}`, String(t))));
  }
}
