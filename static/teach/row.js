// One pose in the list: its picture, which is also its handle, its numbers and its buttons.
import { write } from "../dom.js";
import { button, drawing, html, set, svg } from "../instruments/shape.js";
import { MAX_WAIT, restsBecause } from "./poses.js";
import { Values } from "./values.js";

/** @typedef {import("./poses.js").Pose} Pose */
/** @typedef {"go" | "up" | "down" | "remove" | "grip" | "blend"} Name */
/** @typedef {keyof typeof SHAPES} Shape */
const SHAPES = {
  go: "M3 10h12M10 4.5 15.5 10 10 15.5",
  up: "M10 16V4M4.5 9.5 10 4l5.5 5.5",
  down: "M10 4v12M4.5 10.5 10 16l5.5-5.5",
  remove: "M4 6h12M8 6V4h4v2M6 6l1 11h6l1-11",
  grip: "M7 17v-4L3.5 9.5V3M13 17v-4l3.5-3.5V3M7 13h6",
  blend: "M3 16c9 0 3-12 14-12",
  copy: "M7 7h9v9H7zM4 13V4h9",
  off: "M10 3v7M6 5.5a6 6 0 1 0 8 0",
  add: "M10 4v12M4 10h12",
};

/** Return a button with a picture. @param {Shape} name @param {() => void} act @param {Node[]} words */
export const drawn = (name, act, ...words) =>
  button([drawing("0 0 20 20", svg("path", { d: SHAPES[name] })), ...words], act, { class: name });

export class Row {
  element = html("li");
  handle = html("div", { class: "handle", title: "Drag to another place" });
  #number = html("b");
  #picture = html("img", { alt: "", draggable: "false", width: "96", height: "72" });
  #buttons;
  #values;
  /** @type {Pose | null} */
  #pose = null;

  /** `fingers`: whether there are any. @param {string} id @param {import("./teach.js").Teach} sheet @param {boolean} fingers */
  constructor(id, sheet, fingers) {
    this.element.dataset.id = id;
    this.#values = new Values((i, words) => {
      const value = Math.round(100 * Number(words)) / 100;
      sheet.content.changePose(id, i ? { wait: value } : { speed: value });
    });
    /** @type {Record<Name, HTMLButtonElement>} */
    this.#buttons = {
      grip: drawn("grip", () => sheet.toggleGrip(id)),
      blend: drawn("blend", () => this.#buttons.blend.ariaDisabled === "false" && sheet.content.changePose(id, { blend: !this.#pose?.blend })),
      go: drawn("go", () => sheet.go(id), html("span", {}, "Go")),
      up: drawn("up", () => sheet.move(id, sheet.content.indexOf(id) - 1)),
      down: drawn("down", () => sheet.move(id, sheet.content.indexOf(id) + 1)),
      remove: drawn("remove", () => sheet.remove(id)),
    };
    if (!fingers) this.#buttons.grip.hidden = true;
    this.handle.append(this.#picture, this.#number);
    this.element.append(this.handle, this.#values.element, html("div", { class: "acts" }, ...Object.values(this.#buttons)));
  }

  /** Show the pose `i` of all; `current`: whether the arm moves to it. @param {Pose[]} poses @param {number} i @param {boolean} current */
  show(poses, i, current) {
    const pose = (this.#pose = poses[i]);
    const name = `pose ${i + 1}`;
    write(this.#number, String(i + 1));
    set(this.element, "aria-label", `Pose ${i + 1}`);
    this.element.ariaCurrent = current ? "step" : null;
    if (this.#picture.getAttribute("src") !== pose.picture) {
      if (pose.picture) this.#picture.src = pose.picture;
      this.#picture.style.visibility = pose.picture ? "" : "hidden";
    }
    this.#values.show(name, [
      { name: "Speed", text: String(pose.speed), unit: "%", step: 5, low: 1, high: 100, about: `Speed to ${name}` },
      { name: "Wait", text: String(pose.wait), unit: "s", step: 0.5, low: 0, high: MAX_WAIT, about: `Wait after ${name}` },
    ]);
    const rests = restsBecause(poses, i);
    this.#label("grip", pose.grips ? `The gripper moves at ${name}` : `The gripper stays at ${name}`, false, pose.grips);
    this.#label("blend", rests ? `Rest at ${name}. ${rests}` : `Pass ${name} without a rest`, Boolean(rests), pose.blend && !rests);
    this.#label("go", `Go to ${name}: the arm moves there, the gripper stays`);
    this.#label("up", `Move ${name} up`, i === 0);
    this.#label("down", `Move ${name} down`, i === poses.length - 1);
    this.#label("remove", `Remove ${name}`);
  }

  /** @param {Name} name @param {string} label @param {boolean | null} pressed */
  #label(name, label, off = false, pressed = null) {
    const button = this.#buttons[name];
    set(button, "aria-label", label);
    set(button, "title", label);
    set(button, "aria-disabled", off);
    if (pressed !== null) set(button, "aria-pressed", pressed);
  }
}
