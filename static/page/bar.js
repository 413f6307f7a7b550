// The bar: the status of the arm in words, who drives, and the buttons for it.
import { element, write } from "../dom.js";
import { button } from "../instruments/shape.js";
import * as Pace from "../pace.js";
import { leaseControls, replaceKeepingFocus } from "./lease.js";
import { clock } from "./words.js";

const SIMULATION =
  "pauses after a quarter of a second, because it is simulated. A new command moves it. After five seconds it stops";
const { body } = document;
const headline = element("headline", HTMLElement);
const [orders, lease] = [element("orders", HTMLElement), element("acts", HTMLElement)];
const clear = element("clear-stop", HTMLButtonElement);
const stopButton = element("stop", HTMLButtonElement);
/** @param {string} id @param {string} words */
const text = (id, words) => write(element(id, HTMLElement), words);
/** @param {string} id @param {boolean} hidden */
const hide = (id, hidden) => (element(id, HTMLElement).hidden = hidden);
/** @param {number} seconds */
const time = (seconds) => clock(new Date(1000 * seconds));

/** The last words of a headline, its `end`, are never cut. @param {string} words */
function head(words, end = "") {
  const cut = [words.slice(0, words.length - end.length).trimEnd(), end];
  cut.forEach((part, i) => write(headline.children[i], part));
}

/** Show whether there is a connection for the controls that need one. They keep the focus; a press says why nothing happens. @param {boolean} possible */
function offer(possible) {
  body.classList.toggle("offline", !possible);
  for (const control of document.querySelectorAll("#acts :is(button, select), #orders button, #clear-stop"))
    possible ? control.removeAttribute("aria-disabled") : control.setAttribute("aria-disabled", "true");
}

export class Bar {
  #page;
  #stop;
  #named;
  #lease = ""; // what the drawn buttons of the lease depend on
  #orders = ""; // the same for those of a program

  // `named` names the joints in a sentence.
  /** @param {Page.Context} page @param {import("./stop.js").StopPress} stop @param {(words: string) => string} named */
  constructor(page, stop, named) {
    this.#page = page;
    this.#stop = stop;
    this.#named = named;
    clear.addEventListener("click", () => page.say({ do: "clear_stop" }));
    const mode = element("mode", HTMLElement);
    // What is cut there is whole in a message.
    mode.addEventListener("click", () => page.toast(mode.innerText.replaceAll("\n", " ")));
  }

  draw() {
    const { store } = this.#page;
    const { status, proven } = store;
    // A press is complete when the arm's state shows the stop.
    stopButton.classList.toggle("asked", !proven && (this.#stop.unanswered || status?.stop === "requested"));
    if (!status) return;
    body.dataset.mood = proven ? "stopped" : status.mood;
    body.style.setProperty("--done", String(status.fraction));
    this.#drawWords(status, proven);
    hide("objects-button", status.role === "viewer");
    hide("teach-button", status.role === "viewer" || !status.scripts);
    clear.hidden = !status.stopped || !status.may_clear_stop;
    clear.disabled = status.wait !== "";
    clear.title = status.wait;
    this.#drawLease(status);
    this.#drawOrders(status);
    Pace.draw(store.live);
    const simulated = status.silence_profile === "simulation";
    text("on-silence", simulated ? SIMULATION : "stops after a quarter of a second");
    offer(store.up);
    if (!store.up) this.drawUnknown();
  }

  /** @param {Page.Status} status @param {string | null} proven */
  #drawWords(status, proven) {
    if (proven) head("Stopped");
    else head(status.headline, status.end);
    const moment = status.stopped_at ? `${time(status.stopped_at)}:` : "";
    const cause = status.stopped ? [moment, status.stopped] : [proven];
    const words = [status.why, ...cause, status.until, status.cautions].filter(Boolean).join(" ");
    text("why", this.#named(words).replace(`started by ${status.name} `, "started by you "));
  }

  /** @param {Page.Status} status */
  #drawLease(status) {
    const { mine, holder, participants, asking: requests } = status;
    const waiting = requests.length > 1 ? `, ${requests.length - 1} more` : "";
    const request = requests.length ? `${requests[0].name} asks for it${waiting}` : "";
    text("holder", mine ? "You drive" : holder === null ? "Nobody drives" : status.own_program ? "Your program drives" : `${holder} drives`);
    // Programs are included.
    const connected = participants > 1 ? `, ${participants} connected` : "";
    text("name", request || `${status.name}${status.role === "viewer" ? ", watching" : ""}${connected}`);
    lease.classList.toggle("asked", requests.length > 0);
    const key = JSON.stringify([mine, holder, status.own_program, status.asked, requests, status.others]);
    if (key === this.#lease) return;
    this.#lease = key;
    replaceKeepingFocus(lease, leaseControls(status, this.#page.say));
  }

  /** @param {Page.Status} status */
  #drawOrders(status) {
    // A button that is replaced while somebody presses it loses the press, so progress alone replaces none.
    const place = status.orders.includes("continue") ? status.continues : [];
    const key = [status.planning, ...status.orders, ...place].join();
    if (key === this.#orders) return;
    this.#orders = key;
    const [name, step, steps] = status.continues;
    const controls = status.orders.map((order) => {
      const resumes = order === "continue";
      const other = order === "rewind" ? "Rewind" : order === "keep" ? "Keep as correction" : status.planning ? "Cancel" : "End";
      const act = order === "keep" ? () => import("../timeline/api.js").then(({ keepSince }) => keepSince(this.#page, status.driven_since ?? 0)) : () => this.#page.say({ do: "steer", order });
      const control = button(resumes ? `Continue ${name}` : other, act);
      if (resumes) Object.assign(control, { className: "main" }, steps && { title: `Continue ${name} at step ${step} of ${steps}` });
      if (order === "rewind") control.title = "Set arm and objects back to where you took over";
      return control;
    });
    replaceKeepingFocus(orders, controls);
  }

  // Without a connection the state of the arm is unknown, and its driver too.
  drawUnknown() {
    const { status, proven } = this.#page.store;
    if (!status) return;
    body.dataset.mood = proven ? "stopped" : "starting";
    offer(false);
    text("holder", "Driver unknown");
    text("name", status.name);
    Pace.draw(null);
    head(proven ? "Stopped" : "No connection");
    text("why", proven ?? "");
  }
}
