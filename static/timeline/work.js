// Long work of the server on a recording, an export or a verification: its progress, and the result.
import { write } from "../dom.js";
import { button, html } from "../instruments/shape.js";
import { messageOf, queryOf } from "../server.js";
import { answered } from "./api.js";

const JOBS = "api/v1/recording/jobs";
const LOOK = 400; // ms between two looks at the progress

/** @typedef {{ status: string, fraction: number | null, words: string }} JobStatus */

export class Work {
  #box;
  /** @type {Promise<{ job: string }> | null} */
  #begun = null; // promise of the job that is shown
  /** @type {Promise<void>} */
  #closed = Promise.resolve(); // until the last one that was closed is cancelled
  #doing = ""; // what it does, in words
  #words = html("p", { role: "status" });
  #bar = html("progress", { max: "1" });
  #end = button("", () => this.#close());

  /** @param {HTMLElement} box */
  constructor(box) {
    this.#box = box;
    box.replaceChildren(this.#words, this.#bar, this.#end);
  }

  // Begin the work `what`, a format or "verify", on the part `selection`. `doing` says it in words.
  /** @param {string} what @param {import("./selection.js").Part} selection @param {string} doing */
  async start(what, selection, doing) {
    this.#close();
    const query = queryOf({ ...selection, do: what });
    /** @type {Promise<{ job: string }>} */
    const begun = this.#closed.then(() => answered(`${JOBS}?${query}`, { method: "POST" }));
    [this.#begun, this.#doing] = [begun, doing];
    this.#show(doing, null);
    try {
      await this.#follow(begun, (await begun).job);
    } catch (error) {
      if (this.#begun === begun) this.#show(`${doing}: ${messageOf(error)}`);
    }
  }

  /** @param {Promise<{ job: string }>} begun @param {string} job */
  async #follow(begun, job) {
    while (this.#begun === begun) {
      /** @type {JobStatus} */
      const { status, fraction, words } = await answered(`${JOBS}/${job}`);
      if (this.#begun !== begun) return;
      if (status !== "working") return this.#finish(job, status, words);
      this.#show(this.#doing, fraction);
      await new Promise((next) => setTimeout(next, LOOK));
    }
  }

  /** @param {string} job @param {string} status @param {string} words */
  #finish(job, status, words) {
    if (status === "done" && this.#doing.startsWith("Export")) {
      html("a", { href: `${JOBS}/${job}/file`, download: "" }).click();
      this.#show(`Exported ${words}`);
    } else this.#show(`${this.#doing}: ${words}`);
  }

  // Show `words`, and the fraction that is done: null for an unknown one, undefined at the end.
  /** @param {string} words @param {number | null} [fraction] */
  #show(words, fraction) {
    const percent = fraction ? ` ${Math.round(100 * fraction)} %` : "";
    const text = fraction === undefined ? words : `${words} …${percent}`;
    write(this.#words, text);
    this.#bar.hidden = fraction === undefined;
    if (fraction) this.#bar.value = fraction;
    else this.#bar.removeAttribute("value");
    write(this.#end, fraction === undefined ? "Close" : "Cancel");
    this.#box.hidden = false;
  }

  // Hide the row. A job that works is cancelled, and what it has made is removed.
  #close() {
    const begun = this.#begun;
    this.#begun = null;
    this.#box.hidden = true;
    if (!begun) return;
    this.#closed = begun.then(({ job }) => answered(`${JOBS}/${job}/cancel`, { method: "POST" })).catch(() => {});
  }
}
