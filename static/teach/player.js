// Playing what was taught: all poses or the next one, or the text of a script or its next step.
import { messageOf } from "../server.js";
import { problemsOf } from "./editor.js";
import { scriptOf } from "./poses.js";
import { ScriptRun } from "./run.js";

const PLANNING = "planning";

/**
 * What the sheet shows meanwhile.
 * @typedef {object} Display
 * @property {(words: string, bad?: boolean) => void} report @property {(busy: boolean) => void} occupy
 * @property {(pose: string | null) => void} mark marks the pose to which the arm moves, by its id
 */

export class Player {
  #page;
  #content;
  #editor;
  #display;
  #run;
  /** @type {string | null} */
  #next = null; // id of the pose of the next step

  // id: of the requests.
  /**
   * @param {Page.Context} page @param {import("./content.js").Content} content
   * @param {import("./editor.js").Editor} editor @param {Display} display @param {string} id
   */
  constructor(page, content, editor, display, id) {
    this.#page = page;
    this.#content = content;
    this.#editor = editor;
    this.#display = display;
    this.#run = new ScriptRun(page.say, id);
  }

  /** Take an answer; return whether it was for what plays. @param {Page.Answer} answer */
  hear(answer) {
    return this.#run.hear(answer);
  }

  // The index of the pose of the next step.
  get next() {
    return Math.max(this.#content.indexOf(this.#next), 0);
  }

  // Play all, or with `single` the next pose; of a text, its next step.
  async start(single = false) {
    const { revocations } = this.#page.store.status ?? {};
    const isText = this.#content.now.text !== null;
    try {
      if (this.#run.busy) {
        if (!single || !isText) throw new Error("It is playing. End it in the bar first.");
        return await this.#run.step(revocations);
      }
      if (isText) await this.#playText(single, revocations);
      else await this.#playPoses(single, revocations);
    } catch (error) {
      this.#display.report(messageOf(error), true);
    }
    this.#display.mark(null);
  }

  /** @param {boolean} single @param {number | undefined} revocations */
  async #playPoses(single, revocations) {
    const { now } = this.#content;
    const all = now.poses;
    if (!all.length) throw new Error("There is no pose yet. Move the arm and add a pose.");
    const { next } = this;
    const first = single ? next : 0;
    const poses = single ? [{ ...all[next], blend: false }] : all;
    const { text, poseAt } = scriptOf({ ...now, times: single ? 1 : now.times, poses });
    /** @param {number} line */
    const indexAt = (line) => {
      const pose = poseAt(line);
      return pose === null ? null : first + pose;
    };
    const program = await this.#play(text, "run", revocations, ({ status, line }) => {
      const index = status === PLANNING || line === null ? null : indexAt(line);
      if (index !== null) this.#display.mark(all[index].id);
      return index === null ? "" : `Pose ${index + 1} of ${all.length}`;
    });
    if (single && program.status === "done") {
      this.#next = all[(next + 1) % all.length].id;
      this.#display.report(`The arm is at pose ${next + 1}.`);
    }
    const [worst] = problemsOf(program.why);
    if (worst) this.#display.report(`Pose ${(indexAt(worst.line) ?? 0) + 1}: ${worst.text}`, true);
  }

  /** @param {boolean} single @param {number | undefined} revocations */
  async #playText(single, revocations) {
    const reading = await this.#editor.check();
    if (reading?.problems.length) throw new Error("The script is not run: see the lines below.");
    const { text } = this.#editor;
    const program = await this.#play(text, single ? "step" : "run", revocations, ({ line, task }) => `Line ${line}: ${task}`);
    const problems = problemsOf(program.why);
    if (problems.length) this.#editor.explain(problems);
  }

  // Play `text` to its end and return its last progress. `where` returns words for a progress.
  /**
   * @param {string} text @param {Api.ProgramOrder} order @param {number | undefined} revocations
   * @param {(program: Api.Progress) => string} where
   */
  async #play(text, order, revocations, where) {
    const { report, occupy } = this.#display;
    report("Planning …");
    occupy(true);
    try {
      const program = await this.#run.play(text, order, revocations, (progress) => {
        const words = where(progress);
        const { status, fraction } = progress;
        report(status === PLANNING ? `Planning ${Math.round(100 * fraction)} %` : words || "Playing");
      });
      const good = program.status === "done";
      report(good ? "Done." : program.why.split("\n")[0] || "It was ended.", !good);
      return program;
    } finally {
      occupy(false);
    }
  }
}
