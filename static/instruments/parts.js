// Parts of instruments: buttons that stay pressed, and round scales.
import { numberIn } from "../number.js";
import { button, html, set } from "./shape.js";

/** @typedef {import("./shape.js").Attributes} Attributes */
/** Return a button that stays pressed until the next click. @param {Node | string | (Node | string)[]} content @param {(on: boolean) => void} change @param {Attributes} attributes */
export function toggle(content, change, attributes = {}) {
  const control = button(content, () => {
    const on = control.getAttribute("aria-pressed") !== "true";
    set(control, "aria-pressed", on);
    change(on);
  }, { "aria-pressed": false, ...attributes });
  return control;
}

/** Return a box for a number, which arrow keys change by `step`. @param {Attributes} attributes */
export function numberBox(attributes = {}, step = 1) {
  const box = html("input", { type: "text", inputmode: "decimal", autocomplete: "off", ...attributes });
  box.addEventListener("keydown", (event) => {
    const sign = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!sign) return;
    event.preventDefault();
    box.value = String(Number((numberIn(box.value) + sign * step).toFixed(6)));
    box.dispatchEvent(new Event("change"));
  });
  return box;
}

/** Return a labelled choice of a group; `act` is called when a person makes it. @param {string} name @param {string | number} value @param {string} label @param {boolean} checked */
export function radio(name, value, label, checked, act = () => {}) {
  const input = html("input", { type: "radio", name, value });
  input.checked = checked;
  input.addEventListener("change", act);
  return html("label", {}, input, html("span", {}, label));
}

/** Return the point on a dial at `degrees`, clockwise from the top. @param {number} radius @param {number} degrees */
export function onDial(radius, degrees) {
  const angle = (degrees * Math.PI) / 180;
  return [radius * Math.sin(angle), -radius * Math.cos(angle)];
}

/** @param {number} radius @param {number} from @param {number} to */
export function arc(radius, from, to) {
  const [low, high] = from < to ? [from, to] : [to, from];
  const [x0, y0] = onDial(radius, low);
  const [x1, y1] = onDial(radius, Math.min(high, low + 359.9));
  const large = high - low > 180 ? 1 : 0;
  /** @param {number} value */
  const round = (value) => value.toFixed(2);
  return `M${round(x0)} ${round(y0)}A${radius} ${radius} 0 ${large} 1 ${round(x1)} ${round(y1)}`;
}
