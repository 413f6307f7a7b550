// Planning and running what the sheet shows.
import { messageOf } from "../server.js";
import { problemsOf } from "./editor.js";
import { scriptOf } from "./poses.js";
import { ScriptRun } from "./run.js";

const PLANNING = "planning";

/**
 * What the sheet shows meanwhile.
 * @typedef {object} Display
 * @property {(words: string, bad?: boolean) => void} report
 * @property {(pose: string | null) => void} mark marks the pose to which the arm moves, by its id
 * @property {() => { name: string, text: string }} script returns the one that is shown; throws an error without one
 * @property {(words: string) => void} refuse reports mistakes of the text, which it shows if it is one
 */

export class Player {
  #page;
  #content;
  #editor;
  #display;
  #plan;
  #run;
  #planning = Promise.resolve(); // the last preview

  // id: of the requests.
  /**
   * @param {Page.Context} page @param {import("./content.js").Content} content
   * @param {import("./editor.js").Editor} editor @param {Display} display @param {import("./plan.js").Plan} plan
   * @param {string} id
   */
  constructor(page, content, editor, display, plan, id) {
    this.#page = page;
    this.#content = content;
    this.#editor = editor;
    this.#display = display;
    this.#plan = plan;
    this.#run = new ScriptRun(page.say, id);
  }

  /** Take an answer; return whether it was for what plays. @param {Page.Answer} answer */
  hear(answer) {
    return this.#run.hear(answer);
  }

  // Give the program that is shown the order `run` or `step`; null only plans it, so that the scene shows its path. The
  // program that the server has is steered.
  /** @param {"run" | "step" | null} order */
  async start(order) {
    const { report, mark } = this.#display;
    const { revocations } = this.#page.store.status ?? {};
    try {
      if (order && this.#plan.isShown && this.#plan.used) return await this.#run.steer(order, revocations);
      // Run soon after Preview: the plan is finished first, and kept.
      await this.#planning;
      if (this.#run.busy) throw new Error("It is running. End it in the bar first.");
      const playing = this.#play(order, revocations);
      if (!order) this.#planning = playing.catch(() => {});
      await playing;
    } catch (error) {
      report(messageOf(error), true);
    } finally {
      mark(null);
    }
  }

  /** @param {"run" | "step" | null} order @param {number | undefined} revocations */
  async #play(order, revocations) {
    const { report, refuse, script, mark } = this.#display;
    const { now } = this.#content;
    const isText = now.text !== null;
    if (isText && (await this.#editor.check())?.problems.length) return refuse("The script is not run: see the lines below.");
    const { text } = script();
    /** The index of the pose of a line; null for another line. @param {number} line */
    const poseAt = (line) => (isText ? null : scriptOf(now).poseAt(line));
    report("Planning …");
    const program = await this.#run.play(text, order, revocations, ({ status, fraction, line, task }) => {
      if (status === PLANNING) return report(`Planning ${Math.round(100 * fraction)} %`);
      const index = poseAt(line);
      if (index !== null) mark(now.poses[index].id);
      report(index === null ? `Line ${line}: ${task}` : `Pose ${index + 1} of ${now.poses.length}`);
    });
    const { status, steps, seconds, why } = program;
    if (status === "ready" && !order) report(`${steps} steps, about ${seconds.toFixed(1)} s.`);
    else report(status === "done" ? "Done." : why.split("\n")[0] || "It was ended.", status !== "done");
    const problems = problemsOf(why);
    if (!problems.length) return;
    const pose = poseAt(problems[0].line);
    refuse(pose === null ? problems[0].text : `Pose ${pose + 1}: ${problems[0].text}`);
    this.#editor.explain(problems);
  }
}
