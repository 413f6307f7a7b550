// The selected part of a recording: its ends, and what can be done with it.
import { messageOf, queryOf, request } from "../server.js";
import { ScriptRun } from "../teach/run.js";
import { keep } from "./api.js";
import { lengthOf, placeOf } from "./axis.js";
import { Work } from "./work.js";

/** @typedef {import("./api.js").Span} Span */
/** @typedef {{ of: string, from: number, to: number }} Part */
export const NOTHING = "Nothing is recorded yet: the arm has not moved.";

export class Selection {
  #page;
  #work; // exports and verifications
  run; // of a recorded motion
  /** @type {[start: number | null, end: number | null]} */
  #ends = [null, null]; // [s since the epoch]; null: that of the recording

  /** @param {Page.Context} page @param {HTMLElement} box that of exports and verifications */
  constructor(page, box) {
    this.#page = page;
    this.run = new ScriptRun(page.say, "run again");
    this.#work = new Work(box);
  }

  /** Select a part of a recording, or all of it. @param {number | null} start @param {number | null} end */
  set(start = null, end = null) {
    this.#ends = [start, end];
  }

  /** Put one end at a time: 0 is the start, 1 the end. They do not cross. @param {0 | 1} which @param {number} t @param {Span[]} spans */
  put(which, t, spans) {
    this.#ends[which] = which ? Math.max(t, this.start(spans)) : Math.min(t, this.end(spans));
  }

  /** @param {Span[]} spans */
  start(spans) {
    return this.#ends[0] ?? spans[0]?.[0] ?? 0;
  }

  /** @param {Span[]} spans */
  end(spans) {
    return this.#ends[1] ?? spans.at(-1)?.[1] ?? 0;
  }

  /** Return the places [s] of both ends on the axis. @param {Span[]} spans */
  places(spans) {
    const [start, end] = this.#ends;
    return [start === null ? 0 : placeOf(spans, start), end === null ? lengthOf(spans) : placeOf(spans, end)];
  }

  /** The recording `of` and the times of the selection; null if nothing is recorded. @param {string} of @param {Span[]} spans @returns {Part | null} */
  partOf(of, spans) {
    if (spans.length) return { of, from: this.start(spans), to: this.end(spans) };
    this.#page.toast(NOTHING);
    return null;
  }

  // Export or save the part as the format `what`, or verify it. `words` says what is done.
  /** @param {Part | null} part @param {string} what @param {string} words */
  process(part, what, words) {
    if (part) this.#work.start(what, part, words);
  }

  /** Keep the part as an episode. @param {Part | null} part @param {string} outcome */
  async keep(part, outcome) {
    const { toast, name } = this.#page;
    if (part) toast(await keep(name, part.from, part.to, outcome));
  }

  /** Drive the arm along the motion of the part, as a program that the bar shows and steers. @param {Part | null} part */
  async runAgain(part) {
    const { toast, store } = this.#page;
    if (!part || this.run.busy) return;
    const { revocations } = store.status ?? {};
    toast("The motion is being made a program.");
    try {
      const script = await request(`api/v1/recording/script?${queryOf(part)}`);
      const { status, why } = await this.run.play(await script.text(), "run", revocations, () => {});
      toast(status === "done" ? "The motion has run again." : `The motion did not run to its end: ${why || status}`);
    } catch (error) {
      toast(`The motion cannot run again: ${messageOf(error)}`);
    }
  }
}
