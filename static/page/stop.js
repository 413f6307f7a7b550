// STOP: a press is sent on all paths until one answers, and counts once.
import { element } from "../dom.js";
import { randomName } from "./page_name.js";

const ANSWER = 500; // ms without an answer after which a STOP is repeated by HTTP

export class StopPress {
  #page;
  #changed;
  #press = "";
  #timer = 0;
  /** @type {string | null} */
  port = null; // port of STOP alone
  unanswered = false; // whether a press has no answer yet

  /** `changed` is called when a press is answered. @param {Page.Context} page @param {() => void} changed */
  constructor(page, changed) {
    this.#page = page;
    this.#changed = changed;
  }

  send() {
    this.#press = randomName();
    this.#page.say({ do: "stop", press: this.#press, id: this.#press });
    this.repeat();
    element("stop", HTMLButtonElement).classList.add("asked");
  }

  repeat() {
    this.unanswered = true;
    this.#post("");
    if (this.port) this.#post(`//${location.hostname}:${this.port}/`);
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.repeat(), ANSWER);
  }

  // Note that the last press is answered.
  answered() {
    clearTimeout(this.#timer);
    this.unanswered = false;
    this.#changed();
  }

  /** The port of STOP answers with the stage. @param {string} path */
  async #post(path) {
    const { store, name } = this.#page;
    const press = this.#press;
    try {
      const answer = await fetch(`${path}stop?press=${press}&page=${name}`, { method: "POST", keepalive: true, credentials: "include" });
      if (press !== this.#press || !answer.ok) return;
      /** @type {{ stop?: string, why?: string }} */
      const { stop, why } = answer.status === 204 ? {} : await answer.json();
      if (stop === "confirmed" && store.status?.stop !== "confirmed") store.proven = why ?? "";
      this.answered();
    } catch {
      // Sent again.
    }
  }
}
