// Pause or Resume, and Speed: one set of controls in the bar for whatever moves, hand or program.
import { element, first, write } from "./dom.js";

// ms for which the slider keeps a value that the person has just set, and a press meant the order before
const FRESH = 500;
const box = element("speed", HTMLElement);
const speed = first("input", HTMLInputElement, box);
const percent = first("output", HTMLOutputElement, box);
const pause = element("pause", HTMLButtonElement);
let refusal = "";
/** @type {"pause" | "resume"} */
let order = "pause";
let turned = -FRESH; // time at which the order became another
let own = false; // whether the order goes to a program of this window
let set = -FRESH; // time of the last change by the person

/** @param {number} value */
const show = (value) => {
  percent.value = `${value} %`;
  speed.value = String(value);
  speed.setAttribute("aria-valuetext", percent.value);
};

/** @param {Pick<Page.Context, "say" | "toast">} page */
export function begin({ say, toast }) {
  pause.addEventListener("click", () => {
    if (refusal) toast(refusal);
    // The second click of two, or one that was meant to pause.
    else if (order === "resume" && performance.now() - turned < FRESH) return;
    else say(own ? { do: "steer", order } : { do: order });
  });
  speed.addEventListener("input", () => {
    set = performance.now();
    show(speed.valueAsNumber);
    say({ do: "speed", value: speed.valueAsNumber / 100 });
  });
  // A disabled slider says why.
  box.addEventListener("pointerdown", () => speed.disabled && toast(refusal));
}

/** Show `status`; null without a connection. @param {Page.Status | null} status */
export function draw(status) {
  refusal = status ? status.pace : "No connection to the arm.";
  const stopped = Boolean(status?.stopped);
  const next = status?.paused ? "resume" : "pause";
  if (next !== order) turned = performance.now();
  order = next;
  own = Boolean(status?.orders.includes("end"));
  const label = order === "resume" ? "Resume" : "Pause";
  const held = refusal || (stopped ? "The arm is stopped: clear the stop first." : "");
  write(first(":scope > :last-child", Element, pause), label);
  pause.setAttribute("aria-label", label);
  pause.dataset.order = order;
  pause.setAttribute("aria-disabled", String(Boolean(held)));
  pause.title = held;
  speed.disabled = Boolean(refusal);
  box.title = refusal || (status?.step_speed ? "A step of the program has set this speed. Yours returns at the end." : "");
  write(first("span", HTMLElement, box), status?.step_speed ? "Step" : "Speed");
  if (status && performance.now() - set > FRESH) show(Math.round(100 * status.speed));
}
