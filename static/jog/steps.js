// Steps and gripper in the Jog sheet: one press moves the target by one step. Loaded with the sheet.
import { element, first } from "../dom.js";
import { radio } from "../instruments/parts.js";
import { button, html } from "../instruments/shape.js";
import { armWithStyle } from "../page/ready.js";

const SIZES = [0, 0.1, 1, 10]; // mm or degrees; 0 to hold
const RADIANS = Math.PI / 180;
// Name and unit of each step of the tool; only an arm with six freedoms has the yaw, and one with an arm angle the elbow.
const AXES = [["x", "mm"], ["y", "mm"], ["z", "mm"], ["Pitch", "°"], ["Roll", "°"], ["Yaw", "°"], ["Elbow", "°"]];
const ELBOW = 6; // its place in AXES
/** @typedef {Record<string, [axis: number, sign: number]>} Moves */
const GRIPPER_KEYS = /** @type {Record<string, "open" | "closed">} */ ({ KeyO: "open", KeyC: "closed" });

export class Steps {
  #say;
  #size = 0; // mm or degrees; 0 to hold
  /** @type {"base" | "tool" | "joints"} */
  #frame = "base";
  #arm; // the description of the arm
  #gripped = [false, false];
  #grid = html("div", { id: "steps", hidden: "" });
  #gripper = html("fieldset", { id: "gripper" }, html("legend", {}, "Gripper"));

  /** Return the steps in the sheet `root`, once the description of the arm is there. @param {HTMLElement} root @param {Page.Say} say */
  static async in(root, say) {
    return new Steps(root, say, await armWithStyle("steps.css", import.meta.url));
  }

  /** @param {HTMLElement} root @param {Page.Say} say @param {Api.Arm} arm */
  constructor(root, say, arm) {
    this.#say = say;
    this.#arm = arm;
    this.freedoms = arm.freedoms ?? 0; // number of numbers in a jog or a step of the tool
    this.turnsElbow = arm.turns_elbow ?? false; // whether the elbow moves while the tool rests
    const sizes = SIZES.map((size) => radio("step", size, size ? `${size}` : "Hold", !size));
    const legend = html("legend", {}, "Step, mm or °");
    const pads = first("#pads", HTMLElement, root);
    first(".choice", HTMLElement, root).append(radio("frame", "joints", "Joints", false));
    pads.before(html("fieldset", { class: "choice" }, legend, ...sizes));
    pads.after(this.#grid);
    if (arm.gripper) {
      for (const [code, to] of Object.entries(GRIPPER_KEYS)) {
        const words = arm.suction_cup ? ["Off", "On"] : ["Open", "Close"];
        this.#gripper.append(button([words[to === "open" ? 0 : 1], html("kbd", {}, code.slice(3))], () => this.#grip(to)));
      }
      pads.before(this.#gripper);
    }
    root.addEventListener("change", ({ target }) => target instanceof HTMLInputElement && this.#choose(target));
    if (arm.joints_only) first("[value=joints]", HTMLInputElement, root).click();
  }

  // Whether a press moves by one step, so that holding moves nothing.
  get on() {
    return this.#size > 0;
  }

  /** Move by one step along `axis`, in the direction `sign`. @param {number} axis @param {number} sign */
  step(axis, sign) {
    if (this.#frame === "joints") {
      const by = this.#arm.slides[axis] ? this.#size / 1000 : this.#size * RADIANS;
      return this.#say({ do: "nudge", axis: axis + 1, by: sign * by });
    }
    if (axis === ELBOW) {
      if (this.turnsElbow) this.#say({ do: "turn_elbow", by: sign * this.#size * RADIANS });
      return;
    }
    /** @type {number[]} */
    const by = new Array(this.freedoms).fill(0);
    if (axis >= this.freedoms) return;
    // With six freedoms the turns are about x, y and z: roll, pitch and yaw.
    const place = this.freedoms === 6 ? [0, 1, 2, 4, 3, 5][axis] : axis;
    by[place] = sign * (axis < 3 ? this.#size / 1000 : this.#size * RADIANS);
    this.#say({ do: "step_tool", by, frame: this.#frame });
  }

  /** Return whether the arm has the motion of a place in AXES. @param {number} axis */
  moves(axis) {
    return axis === ELBOW ? this.turnsElbow : axis < 5 || this.freedoms === 6;
  }

  /** Return whether the key was handled. moves: {code: [axis, sign]} of the keys that move. @param {KeyboardEvent} event @param {Moves} moves */
  key(event, moves) {
    const pressed = event.type === "keydown" && !event.repeat;
    if (event.code in GRIPPER_KEYS && this.#arm.gripper) {
      if (pressed) this.#grip(GRIPPER_KEYS[event.code]);
    } else if (this.on && event.code in moves) {
      if (pressed && this.#frame !== "joints") this.step(...moves[event.code]);
    } else return false;
    return true;
  }

  /** Take the gamepad's buttons for the gripper; a button that stays pressed counts once. @param {boolean} open @param {boolean} closed */
  grip(open, closed) {
    if (open && !this.#gripped[0]) this.#grip("open");
    if (closed && !this.#gripped[1]) this.#grip("closed");
    this.#gripped = [open, closed];
  }

  /** @param {"open" | "closed"} to */
  #grip(to) {
    if (!this.#arm.gripper) return;
    const [closed, open] = this.#arm.gripper;
    this.#say({ do: "gripper", angle: to === "open" ? open : closed });
  }

  /** @param {HTMLInputElement} choice */
  #choose({ name, value }) {
    if (name === "frame") this.#frame = value === "joints" || value === "tool" ? value : "base";
    else if (name === "step") this.#size = Number(value);
    else return;
    // Joints move by steps only.
    const joints = this.#frame === "joints";
    const hold = first("#jog [name=step][value='0']", HTMLInputElement);
    if (joints && !this.on) {
      first("#jog [name=step][value='1']", HTMLInputElement).checked = true;
      this.#size = 1;
    }
    hold.toggleAttribute("disabled", joints);
    element("pads", HTMLElement).hidden = this.on;
    this.#grid.hidden = !this.on;
    if (this.on) this.#draw();
  }

  #draw() {
    const columns = this.#frame === "joints"
      ? this.#arm.joints.map((_, i) => [this.#arm.links[i].label, this.#arm.slides[i] ? "mm" : "°"])
      : AXES.slice(0, this.turnsElbow ? AXES.length : this.freedoms);
    this.#grid.replaceChildren(
      ...columns.map(([name, unit], axis) => {
        /** @param {number} sign */
        const step = (sign) => {
          const words = `${name} ${sign > 0 ? "plus" : "minus"} ${this.#size} ${unit}`;
          return button(sign > 0 ? "+" : "−", () => this.step(axis, sign), { "aria-label": words });
        };
        return html("div", {}, step(1), html("b", {}, name), step(-1));
      }),
    );
  }
}
