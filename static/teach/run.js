// A script on its way to the arm: the text is sent and planned, then it runs.
import { readState } from "../server.js";

const EVERY = 300; // ms between two looks at the progress
const LONG = 400; // characters of a part of plain text; a request has at most 1024 bytes
const SHORT = 200; // the same for any text
const TAKEN = 5000; // ms within which the server answers
const ENDS = ["done", "stopped", "failed", "cancelled", "refused"];
/** @param {number} ms */
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Return the requests that send `text`. fields: of each request. @param {string} text @param {Partial<Api.Program>} fields @returns {Api.Program[]} */
export function parts(text, fields = {}) {
  // eslint-disable-next-line no-control-regex
  const size = /^[\x00-\x7f]*$/.test(text) ? LONG : SHORT;
  const pieces = text.match(new RegExp(`[^]{1,${size}}`, "gu")) ?? [""];
  return pieces.map((piece, i) => ({ do: "program", text: piece, more: i < pieces.length - 1, ...fields }));
}

export class ScriptRun {
  #say;
  #id;
  /** @type {((answer: Page.Answer) => void)[]} */
  #waiting = []; // of answers: functions that take each one
  busy = false;

  /** id: of all its requests. @param {Page.Say} say @param {string} id */
  constructor(say, id) {
    this.#say = say;
    this.#id = id;
  }

  /** Take an answer; return whether it was for this run. @param {Page.Answer} answer */
  hear(answer) {
    if (answer.id !== this.#id) return false;
    this.#waiting.shift()?.(answer);
    return true;
  }

  // Send `text` and give the order `run` or `step`; null only plans it. Return the last progress of the program.
  // Throws an error with the reason for a refusal. `shows` gets each progress.
  // revocations: of the status at the press; after a stop the requests are refused.
  /** @param {string} text @param {Api.ProgramOrder | null} order @param {number | undefined} revocations @param {(program: Api.Progress) => void} [shows] */
  async play(text, order, revocations, shows) {
    this.busy = true;
    try {
      const fields = { revocations, id: this.#id };
      await this.#ask(parts(text, fields));
      try {
        if (order) await this.#ask([{ do: "steer", order, ...fields }]);
      } catch (error) {
        // The planning may have failed already, and has the reason.
        const program = (await readState())?.program;
        if (program?.status === "refused") return program;
        throw error;
      }
      return await this.follow(shows, order === null);
    } finally {
      [this.busy, this.#waiting] = [false, []];
    }
  }

  /** @param {Api.Act[]} requests */
  async #ask(requests) {
    /** @type {Promise<Page.Answer>[]} */
    const answers = requests.map(() => new Promise((resolve) => this.#waiting.push(resolve)));
    requests.forEach((request) => this.#say(request));
    const late = pause(TAKEN).then(() => {
      throw new Error("The server does not answer.");
    });
    for (const answer of await Promise.race([Promise.all(answers), late])) if (answer.is === "refused") throw new Error(answer.why);
  }

  // Return the last progress of the program that runs. One that a stop or another command has kept from running stays
  // planned, with a reason; `planned`: one that is not to run, too. Throws an error if the server was started again.
  /** @param {(program: Api.Progress) => void} [shows] */
  async follow(shows, planned = false) {
    for (this.busy = true; this.busy; await pause(EVERY)) {
      const state = await readState();
      if (!state) continue;
      const { program } = state;
      this.busy = program !== null;
      if (!program) break;
      shows?.(program);
      const kept = planned || program.why.startsWith("Not run");
      if (!ENDS.includes(program.status) && !(kept && program.status === "ready")) continue;
      this.busy = false;
      return program;
    }
    throw new Error("The server was started again, and has no program.");
  }
}
