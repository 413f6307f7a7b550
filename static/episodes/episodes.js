// Episodes: REC, the judgement of attempts, and their list. Loaded when the server records.
import { element, styled, write } from "../dom.js";
import { numberBox } from "../instruments/parts.js";
import { button, html } from "../instruments/shape.js";
import { numberIn } from "../number.js";
import { messageOf, request } from "../server.js";

/** @typedef {Page.Outcome} Outcome */
/** @typedef {"success" | "failure" | "discard" | "rerecord"} Act */
/**
 * An episode of the list, and the answer to a request.
 * @typedef {object} Episode
 * @property {number} number @property {Outcome} outcome @property {number} start @property {number} end
 * @property {number} recorded @property {number} bytes @property {string} task @property {string} note
 * @property {string} file @property {number} missing_ticks
 */
/** @type {Record<Outcome, string>} */
const OUTCOMES = { success: "Success", failure: "Failure", unjudged: "Not judged", unfinished: "Unfinished" };
/** Name and key of each button below REC. @type {Record<Act, [label: string, letter: string]>} */
const ACTS = { success: ["Success", "Y"], failure: ["Failure", "N"], discard: ["Discard", "X"], rerecord: ["Re-record", "B"] };
const MEGA = 1e6; // bytes
const entriesOfActs = /** @type {[Act, [string, string]][]} */ (Object.entries(ACTS));
const opener = element("episodes-button", HTMLButtonElement);
/** @param {number} seconds */
const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}`;
/** @param {number} bytes */
const size = (bytes) => (bytes < MEGA ? `${Math.round(bytes / 1000)} kB` : `${(bytes / MEGA).toFixed(1)} MB`);
const touch = matchMedia("(any-pointer: coarse)").matches;
/** A length with what the disk did not take of it: ticks of 10 ms. @param {number} seconds @param {number} ticks */
const extent = (seconds, ticks) => `${seconds.toFixed(1)} s${ticks ? `, ${(ticks / 100).toFixed(1)} s of it missing` : ""}`;
/** The name of a key, where there may be one. @param {string} words @param {string} letter */
const by = (words, letter) => (touch ? words : `${words}${letter}`);
/** @param {string} letter */
const key = (letter) => html("kbd", { "aria-hidden": true }, letter);

/** @param {string} act @returns {act is Outcome} */
const isOutcome = (act) => act in OUTCOMES;

export class Episodes {
  /** @type {Page.EpisodesState | null} */
  #state = null; // state of the server
  #may = false; // whether this person may record
  /** @type {string | null} */
  #notice = null; // newest notice of the server
  #listed = -1; // revision of the list that is shown
  /** @type {Set<number>} */
  #open = new Set(); // numbers of the episodes whose fields are shown
  #task = html("input", { maxlength: 200, placeholder: "What is to be done", autocomplete: "off" });
  #rec = button("", () => this.#act("rec"), { class: "rec" });
  #says = html("p", {});
  #acts = html("div", { class: "acts", role: "group", "aria-label": "How did it go?" });
  #list = html("ol", {});
  #about = html("p", { class: "about" });

  /** @param {Page.Context} page */
  constructor(page) {
    this.page = page.name;
    this.toast = page.toast;
    styled("episodes.css", import.meta.url);
    for (const [act, [label, letter]] of entriesOfActs) {
      this.#acts.append(button([label, key(letter)], () => this.#act(act), { "data-act": act, "aria-keyshortcuts": letter }));
    }
    this.#task.addEventListener("keydown", (event) => {
      if (event.key !== "Enter") return;
      // The letters on the buttons are keys from now on, and Enter does not also press the button.
      event.preventDefault();
      this.#rec.focus();
      this.#act("rec");
    });
    this.#list.addEventListener("focusout", () => setTimeout(() => this.#fill()));
    const task = html("label", { class: "task" }, "Task", this.#task);
    this.sheet = html("section", { id: "episodes", class: "sheet", "aria-label": "Episodes", hidden: "" }, task, this.#rec, this.#says, this.#acts, this.#list, this.#about);
    element("jog", HTMLElement).before(this.sheet);
    new MutationObserver(() => this.#fill()).observe(this.sheet, { attributeFilter: ["hidden"] });
    // Not when it is open again after a reload: Space, which stops, would type a blank.
    opener.addEventListener("click", () => this.#focus());
  }

  #focus() {
    // On a touch screen this would open its keyboard.
    if (!this.sheet.hidden && this.#may && matchMedia("(hover: hover)").matches) (this.#task.value ? this.#rec : this.#task).focus();
  }

  /** Show the state in a status. @param {Page.Status} status */
  draw({ episodes: state, role }) {
    const before = this.#state;
    if (!state && before?.running) this.toast("The recording is interrupted. It begins again in a few seconds.");
    this.#state = state ?? null;
    this.#may = role !== "viewer";
    opener.hidden = !state;
    if (!state) return;
    const { running, saving, last, problem } = state;
    opener.classList.toggle("on", Boolean(running));
    const parts = running ? [`REC ${clock(running.seconds)}`, size(running.bytes)] : ["REC", ""];
    [...opener.children].forEach((span, i) => write(span, parts[i]));
    this.#task.labels?.forEach((label) => (label.hidden = !this.#may));
    for (const control of [this.#rec, this.#acts]) control.hidden = !this.#may;
    if (document.activeElement !== this.#task && before?.task !== state.task) this.#task.value = state.task;
    this.#rec.replaceChildren(saving ? "Saving…" : running ? `End episode ${running.number}, ${clock(running.seconds)}` : "Start an episode", key("T"));
    this.#rec.disabled = Boolean(saving);
    this.#rec.classList.toggle("on", Boolean(running));
    for (const act of this.#acts.querySelectorAll("button")) {
      act.hidden = !(running || saving || last);
      const { act: name = "" } = act.dataset;
      if (isOutcome(name)) act.setAttribute("aria-pressed", String(!running && !saving && last?.outcome === name));
    }
    const left = running?.left != null ? ` It ends by itself in ${clock(running.left)}: an episode has at most an hour.` : "";
    const one = last && `Episode ${last.number}, ${extent(last.seconds, last.missing_ticks)}: `;
    const now = saving ? "Saving…" : running ? `Recording episode ${running.number}, by ${running.by}.${left}` : last && last.outcome === "unjudged" ? `${one}how did it go?` : last ? `${one}${OUTCOMES[last.outcome].toLowerCase()}.` : "No episode is kept.";
    write(this.#says, problem || now);
    this.#says.classList.toggle("bad", Boolean(problem));
    this.#tell(before);
    this.#fill();
  }

  /** Say what has changed, also by other people. @param {Page.EpisodesState | null} before */
  #tell(before) {
    if (!this.#state) return;
    const { running, problem, notice } = this.#state;
    const said = this.#notice;
    this.#notice = notice;
    if (problem && problem !== before?.problem) this.toast(problem);
    // Not what happened before this page was loaded.
    else if (said !== null && notice && notice !== said) this.toast(notice);
    else if (running?.left != null && before?.running?.left == null) this.toast(this.#says.textContent);
    else if (running && before && running.number !== before.running?.number) this.toast(`Recording episode ${running.number}, by ${running.by}.`);
  }

  /** Return whether the key was handled. @param {KeyboardEvent} event */
  key(event) {
    if (!this.#state || !this.#may || event.ctrlKey || event.metaKey || event.altKey) return false;
    // The letter on the key, which is elsewhere on other keyboards.
    const letter = /^[a-z]$/i.test(event.key) ? event.key.toUpperCase() : event.code.slice(3);
    const { running, saving, last } = this.#state;
    const judged = last && !["unjudged", "unfinished"].includes(last.outcome);
    const act = letter === "T" ? "rec" : entriesOfActs.find(([, [, own]]) => own === letter)?.[0];
    const asks = running || saving || (last && (!judged || !this.sheet.hidden));
    if (!act || (act !== "rec" && !asks)) return false;
    if (event.type === "keydown" && !event.repeat) this.#act(act);
    return true;
  }

  /** @param {Act | "rec"} act */
  async #act(act) {
    const { running = null, saving = null, last: before = null } = this.#state ?? {};
    if (act === "rec" && saving) return;
    // The episode that is seen: another person may have ended it, or judged another one.
    const seen = { number: running?.number ?? saving ?? before?.number };
    const body =
      act === "rec" ? (running ? { do: "stop", ...seen } : { do: "start", task: this.#task.value })
      : isOutcome(act) ? { do: "judge", outcome: act, ...seen }
      : { do: act, ...seen };
    const done = await this.#ask(body);
    if (!done) return;
    // The next key may come before the next state.
    const { number, outcome, start, end, missing_ticks } = done;
    const last = { number, outcome, seconds: end - start, missing_ticks };
    if (this.#state) this.#state = { ...this.#state, ...(end && act !== "discard" && { running: null, last }) };
    const name = `Episode ${number}`;
    if (act === "rec" && running) this.toast(by(`${name} has ended${missing_ticks ? `: ${extent(end - start, missing_ticks)}` : ""}.`, " Y: success, N: failure, X: discard"));
    else if (isOutcome(act)) this.toast(`${name}: ${act}.`);
    else if (act === "discard") this.toast(`${name} is discarded. The list restores it.`);
  }

  /** Send `body`; return the episode, or null after a refusal, which is shown. @param {object} body @returns {Promise<Episode | null>} */
  async #ask(body) {
    try {
      return await (await request(`api/v1/episodes?page=${this.page}`, { method: "POST", body: JSON.stringify(body) })).json();
    } catch (error) {
      this.toast(messageOf(error));
    }
    this.#listed = -1;
    this.#fill();
    return null;
  }

  // Show the list, if it has changed and nobody types in it.
  async #fill() {
    const { revision } = this.#state ?? {};
    if (this.sheet.hidden || revision === this.#listed || document.activeElement?.matches("#episodes ol :is(input, select)")) return;
    this.#listed = revision ?? -1;
    const answer = await fetch("api/v1/episodes");
    if (!answer.ok) return (this.#listed = -1);
    /** @type {{ episodes: Episode[], discarded: Episode[], unreadable: string[], folder: string }} */
    const { episodes, discarded, unreadable, folder } = await answer.json();
    /** @type {HTMLElement | null | undefined} */
    const focused = document.activeElement?.closest("#episodes ol [data-key]");
    const kept = focused?.dataset.key;
    this.#list.replaceChildren(...episodes.reverse().map((episode) => this.#row(episode)), ...discarded.reverse().map((episode) => this.#gone(episode)));
    /** @type {HTMLElement | null} */ (this.#list.querySelector(`[data-key="${kept}"]`))?.focus();
    const wrong = unreadable.length ? ` ${unreadable.join(" ")}` : "";
    // People who may only watch do not learn where the files are.
    write(this.#about, `${episodes.length} kept, ${discarded.length} discarded${folder && `, in ${folder}`}.${wrong}`);
  }

  /** @param {Episode} episode */
  #row(episode) {
    const { number, outcome, start, end, bytes, task, note, file } = episode;
    const length = extent(end - start, episode.missing_ticks);
    const summary = html("summary", { "data-key": number }, html("b", {}, `${number}`), html("span", {}, length), html("i", { class: outcome }, OUTCOMES[outcome]), html("span", {}, task));
    const row = html("details", this.#open.has(number) ? { open: "" } : {}, summary);
    row.addEventListener("toggle", () => this.#open[row.open ? "add" : "delete"](number));
    row.addEventListener("toggle", () => row.contains(document.activeElement) && row.scrollIntoView({ block: "nearest" }));
    if (!this.#may) return html("li", {}, row);
    /** @param {string} label @param {HTMLInputElement} input @param {(value: string) => void} change */
    const field = (label, input, change) => {
      input.addEventListener("change", () => change(input.value));
      return html("label", {}, label, input);
    };
    /** @param {object} body */
    const ask = (body) => this.#ask({ ...body, number });
    /** @param {number} value */
    const seconds = (value) => numberBox({ value: value.toFixed(1) }, 0.1);
    const select = html("select", {}, ...Object.entries(OUTCOMES).slice(0, outcome === "unfinished" ? 4 : 3).map(([value, words]) => html("option", { value, ...(value === outcome && { selected: "" }) }, words)));
    select.addEventListener("change", () => ask({ do: "judge", outcome: select.value }));
    const discard = button("Discard", () => ask({ do: "discard" }), { "data-key": `${number} kept` });
    row.append(
      html("label", {}, "Outcome", select),
      field("Task", html("input", { maxlength: 200, value: task }), (value) => ask({ do: "describe", task: value })),
      field("Note", html("input", { maxlength: 500, value: note }), (value) => ask({ do: "describe", note: value })),
      field("From, s", seconds(start), (value) => ask({ do: "trim", start: numberIn(value), end })),
      field("To, s", seconds(end), (value) => ask({ do: "trim", start, end: numberIn(value) })),
      html("div", {}, discard, html("a", { "data-key": `${number} file`, href: `api/v1/episodes/${number}`, download: file }, `Download, ${size(bytes)}`)),
    );
    return html("li", {}, row);
  }

  /** @param {Episode} episode */
  #gone({ number, task }) {
    const back = button("Restore", () => this.#ask({ do: "restore", number }), { "data-key": `${number} kept`, "aria-label": `Restore episode ${number}` });
    return html("li", { class: "gone" }, html("b", {}, `${number}`), html("span", {}, `discarded ${task}`), ...(this.#may ? [back] : []));
  }
}
