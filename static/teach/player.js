// Planning and running what the sheet shows.
import { addressed } from "../page/words.js";
import { problemsOf } from "./editor.js";
import { scriptOf } from "./poses.js";
import { ScriptRun } from "./run.js";

export class Player {
  #page;
  #sheet;
  run;
  #planning = Promise.resolve(); // the last preview

  /** @param {Page.Context} page @param {import("./teach.js").Teach} sheet @param {string} id of the requests */
  constructor(page, sheet, id) {
    this.#page = page;
    this.#sheet = sheet;
    this.run = new ScriptRun(page.say, id);
  }

  // Give the program that is shown the order `run` or `step`; null only plans it, so that the scene shows its path. The
  // program that the server has is steered.
  /** @param {"run" | "step" | null} order */
  async start(order) {
    const { plan } = this.#sheet;
    const { revocations } = this.#page.store.status ?? {};
    await this.#sheet.attempt(async () => {
      if (order && plan.isShown && plan.used) return this.#page.say({ do: "steer", order, revocations });
      // Run soon after Preview: the plan is finished first, and kept.
      await this.#planning;
      if (this.run.busy) throw new Error("It is running. End it in the bar first.");
      const playing = this.#play(order, revocations);
      if (!order) this.#planning = playing.catch(() => {});
      await playing;
    });
    this.#sheet.mark(null);
  }

  /** @param {"run" | "step" | null} order @param {number | undefined} revocations */
  async #play(order, revocations) {
    const sheet = this.#sheet;
    const { now } = sheet.content;
    const isText = now.text !== null;
    const refusal = order ? "The script is not run: see the mistakes below." : "The script is not previewed: see the mistakes below.";
    if (isText && (await sheet.editor.check())?.problems.length) return sheet.report(refusal, true);
    const { text } = sheet.script();
    /** The index of the pose of a line; null for another line. @param {number} line */
    const poseAt = (line) => (isText ? null : scriptOf(now).poseAt(line));
    sheet.report("Planning …");
    const program = await this.run.play(text, order, revocations, ({ status, fraction, line, step, steps, task }) => {
      if (status === "planning") return sheet.report(`Planning ${Math.round(100 * fraction)} %`);
      const index = poseAt(line);
      if (index !== null) sheet.mark(now.poses[index].id);
      sheet.report(index === null ? `Step ${step} of ${steps}: ${task}.` : `Pose ${index + 1} of ${now.poses.length}`);
    });
    const { status, steps, seconds, why } = program;
    if (status === "ready" && !order) sheet.report(`${steps} steps, about ${seconds.toFixed(1)} s.`);
    else sheet.report(status === "done" ? "Done." : addressed(why.split("\n")[0], this.#page.store.status?.name ?? "") || "It was ended.", status !== "done");
    const problems = problemsOf(why);
    if (!problems.length) return;
    sheet.editor.explain(problems);
    if (isText && status === "refused") return sheet.report(refusal, true);
    const pose = poseAt(problems[0].line);
    sheet.report(pose === null ? problems[0].text : `Pose ${pose + 1}: ${problems[0].text}`, true);
  }
}
