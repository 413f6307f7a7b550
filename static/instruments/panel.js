// The instrument panel: it queries states while it is open, stores them for a time and shows them.
import { repeating, styled, write } from "../dom.js";
import { Board } from "./board.js";
import { instruments } from "./catalogue.js";
import { channelsOf } from "./channels.js";
import { History } from "./history.js";
import { radio, toggle } from "./parts.js";
import { html } from "./shape.js";

const HZ = 30;
const LOOK_EVERY = 1000; // ms; the control loop reports its lateness at this interval
const SPANS = { 10: "10 s", 30: "30 s", 120: "2 min" };
const OLD = 1.0; // s, age from which values are marked as old

/** @typedef {{ say: Page.Say, watch: (hz: number) => void, kept: Page.Kept, quietly: string }} Connection */

export class Panel {
  #root;
  #connection;
  /** @type {import("./plot.js").Span} */
  #view = { span: 30, end: null };
  /** @type {History | null} */
  #history = null;
  /** @type {Board | null} */
  #board = null;
  /** @type {Api.Arm | null} */
  #arm = null;
  /** @type {Api.State | null} */
  #state = null;
  /** @type {Api.Loop | null} */
  #loop = null;
  #fresh = false;
  #heard = -Infinity;
  #took = 0;
  #watch = repeating(() => this.#ask(), LOOK_EVERY);
  #frame = 0;
  #age = html("span", { class: "age", title: "Maximum age of the values" });
  #body = html("div", { class: "body" }, html("p", { class: "note" }, "Waiting for the arm."));

  /** @param {HTMLElement} root @param {Connection} connection */
  constructor(root, connection) {
    this.#root = root;
    this.#connection = connection;
    styled("instruments.css", import.meta.url);
    root.append(this.#toolbar(), this.#body);
  }

  /** @param {boolean} shown */
  show(shown) {
    this.#root.hidden = !shown;
    this.#connection.watch(shown ? HZ : 0);
    this.#watch(shown);
    cancelAnimationFrame(this.#frame);
    if (shown) this.#draw();
    else this.#spring();
  }

  /** Handle each event of the page's connection. @param {Page.LinkEvent} message */
  hear({ heard, took, link }) {
    if (link === "down") this.#spring();
    if (heard?.is === "arm") this.#arm = heard;
    else if (heard?.is === "loop") this.#loop = heard;
    else if (heard?.is === "state") {
      [this.#state, this.#took, this.#heard, this.#fresh] = [heard, took ?? 0, performance.now(), true];
      this.#history?.take(heard);
    } else if (heard?.is === "done" || heard?.is === "refused")
      this.#board?.instruments.find(({ id }) => id === heard.id)?.knob?.answered(heard);
    if (this.#arm && this.#state && !this.#board) this.#build(this.#arm, this.#state);
  }

  #ask() {
    const { say, quietly } = this.#connection;
    if (!this.#arm) say({ do: "query", at: "arm", id: quietly });
    say({ do: "query", at: "loop", id: quietly });
  }

  /** @param {Api.Arm} arm @param {Api.State} state */
  #build(arm, { touch }) {
    const [closed, open] = arm.gripper ?? [0, 0];
    /** @type {import("./channels.js").Fingers | null} */
    const gripper = arm.gripper && {
      percent: (angle) => (100 * (angle - closed)) / (open - closed),
      angle: (percent) => closed + (percent / 100) * (open - closed),
    };
    const { channels, groups } = channelsOf(arm, gripper, touch?.fingers.map(({ finger }) => finger) ?? []);
    this.#history = new History(channels);
    const parts = { say: this.#connection.say, history: this.#history, groups, view: this.#view, touch };
    this.#board = new Board(instruments(arm, gripper, parts), this.#connection.kept);
    this.#body.replaceChildren(this.#board.list, this.#board.grid);
  }

  #spring() {
    for (const { knob } of this.#board?.instruments ?? []) knob?.spring();
  }

  #draw() {
    this.#frame = requestAnimationFrame(() => this.#draw());
    const age = (this.#took + performance.now() - this.#heard) / 1000;
    write(this.#age, age === Infinity ? "" : age < OLD ? "Live" : `${age.toFixed(1)} s old`);
    this.#root.classList.toggle("old", age >= OLD);
    if (!this.#board || !this.#state) return;
    for (const { plot, draw } of this.#board.visible)
      if (plot || this.#fresh) draw(this.#state, this.#loop);
    this.#fresh = false;
  }

  #toolbar() {
    const spans = Object.entries(SPANS).map(([span, label]) => radio("span", span, label, Number(span) === this.#view.span, () => this.#look({ span: Number(span) })));
    const pause = toggle("Freeze", (on) => this.#look({ end: on ? (this.#history?.newest ?? null) : null }), {
      title: "Stop the plots; new values are still stored",
    });
    const choose = toggle("Choose", (on) => this.#board?.list.toggleAttribute("hidden", !on), { title: "Show and hide instruments" });
    return html(
      "div",
      { class: "toolbar", role: "group", "aria-label": "Plots and cards" },
      html("fieldset", { class: "choice", "aria-label": "Time that plots show" }, ...spans),
      pause, this.#age, choose,
    );
  }

  /** @param {Partial<import("./plot.js").Span>} news */
  #look(news) {
    Object.assign(this.#view, news);
    for (const { plot } of this.#board?.instruments ?? []) plot?.refresh();
  }
}
