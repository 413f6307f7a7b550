// The real arm: its mode, what it measures, and the acts of a person. Loaded when a driver reports.
import { first, styled, write } from "../dom.js";
import { button, html, signed } from "../instruments/shape.js";

/** @typedef {Api.ArmAct} Act */
/** @typedef {Page.ArmStatus["acts"]} Acts */
/** @type {Record<Act, string>} */
const NAMES = {
  connect: "Connect", disconnect: "Disconnect", calibrate: "Calibrate…",
  engage: "Engage motors…", release: "Release motors…", unblock: "Unblock",
};
/** What an act does that needs no question. @type {Partial<Record<Act, string>>} */
const SENTENCES = {
  connect: "Connect reads the arm. Nothing moves.",
  unblock: "Unblock lets the motors hold the arm where it is. Nothing moves.",
  disconnect: "Disconnect leaves the motors as they are.",
};
const FOLLOWS = ["holding", "moving"];

/** @param {Acts} acts */
const entriesOf = (acts) => /** @type {[Act, string][]} */ (Object.entries(acts));

export class Card {
  #mode = "";
  #acts = "";
  #about = html("span", {});
  #rested = html("span", { class: "rested", hidden: "" });
  #note = html("p", { role: "status" });
  #facts = html("dl", {});
  #hint = html("p", { class: "hint" });
  #buttons = html("div", { class: "acts", role: "group", "aria-label": "Acts at the arm" });
  #dialog = html("dialog", { "aria-labelledby": "hazard-title", class: "hazard" });

  /** `say` sends a request. @param {HTMLElement} stage @param {{ say: Page.Say }} page */
  constructor(stage, { say }) {
    this.say = say;
    styled("arm.css", import.meta.url);
    const why = html("p", { class: "why" }, "STOP on this page is no emergency stop: keep the hardware stop button, or the switch of the arm, in reach.");
    this.card = html("details", { id: "arm" }, html("summary", {}, html("i"), this.#about, this.#rested), this.#note, this.#facts, this.#buttons, this.#hint, why);
    first("#toast", HTMLElement, stage).before(this.card);
    stage.parentElement?.append(this.#dialog);
  }

  /** Show the arm of a status. @param {Page.Status} status */
  draw({ arm, role, stopped }) {
    this.card.hidden = !arm;
    if (!arm) return;
    const { mode, note, acts, lag, error, age, round_trip: trip, stop } = arm;
    // What a person must do next is seen without a click; a working arm needs no room.
    const follows = FOLLOWS.includes(mode);
    if (!this.#mode || follows !== FOLLOWS.includes(this.#mode)) this.card.open = !follows;
    this.#mode = mode;
    this.card.dataset.mode = mode;
    // As measured, never as simulated, and seen without a click.
    const [seconds, degrees, metres] = stop ?? [0, 0, null];
    const angle = `${signed(degrees)}°`;
    const rested = `${seconds.toFixed(2)} s, ${metres === null ? angle : `${Math.round(1000 * metres)} mm`}`;
    write(this.#about, `Arm ${mode}`);
    this.#rested.hidden = !(stopped && follows && stop);
    write(this.#rested, this.#rested.hidden ? "" : `stopped in ${rested}`);
    write(this.#note, note);
    /** @type {Record<string, string>} */
    const facts = {
      "Behind the setpoint": `${signed(lag)}°`,
      "Tracking error": `${signed(error)}°`,
      "Age of the measurement": `${Math.round(1000 * age)} ms`,
      "Reply time": `${Math.round(1000 * trip)} ms`,
      ...(stop && { "Last stop, measured": metres === null ? rested : `${rested}, ${angle}` }),
    };
    this.#facts.hidden = !follows;
    if (this.#facts.children.length !== Object.keys(facts).length)
      this.#facts.replaceChildren(...Object.keys(facts).map((name) => html("div", {}, html("dt", {}, name), html("dd", {}))));
    Object.values(facts).forEach((value, i) => write(this.#facts.children[i].children[1], value));
    this.#offer(role === "viewer" ? {} : acts);
  }

  /** @param {Acts} acts */
  #offer(acts) {
    const key = JSON.stringify([this.#mode, acts]);
    if (key === this.#acts) return;
    this.#acts = key;
    // A working arm needs no act.
    const first = FOLLOWS.includes(this.#mode) ? null : Object.keys(acts)[0];
    const made = entriesOf(acts).map(([act, hazard]) => {
      const give = () => (hazard ? this.#ask(act, hazard) : this.#give(act));
      return button(NAMES[act], give, { "data-act": act, ...(act === first && { class: "main" }) });
    });
    this.#buttons.replaceChildren(...made);
    write(this.#hint, entriesOf(acts).map(([act]) => SENTENCES[act]).filter(Boolean).join(" "));
    if (this.#dialog.open) this.#dialog.close();
  }

  /** Ask twice: a tick and a button, each of which says what happens. @param {Act} act @param {string} hazard */
  #ask(act, hazard) {
    const tick = html("input", { type: "checkbox" });
    const words = act === "release" ? "I hold the arm by hand." : act === "calibrate" ? "The space is clear, and I have the switch in reach." : "It was calibrated since it was switched on.";
    const give = () => {
      this.#dialog.close();
      this.#give(act, true);
    };
    const go = button(NAMES[act].replace("…", ""), give, { class: "main", disabled: "" });
    const back = button("Cancel", () => this.#dialog.close());
    tick.addEventListener("change", () => (go.disabled = !tick.checked));
    this.#dialog.replaceChildren(html("h1", { id: "hazard-title" }, NAMES[act].replace("…", "")), html("p", {}, hazard), html("label", {}, tick, words), html("div", { class: "acts" }, back, go));
    // Not modal, so that mouse, finger and keys still reach STOP.
    this.#dialog.show();
    back.focus();
  }

  /** @param {Act} act */
  #give(act, confirmed = false) {
    this.say({ do: "operate_arm", act, confirmed });
  }
}
