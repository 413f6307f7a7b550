// Steps and gripper in the Jog sheet: one press moves the target by one step. Loaded with the sheet.
import { html } from "../instruments/shape.js";

const SIZES = [0, 0.1, 1, 10]; // mm or degrees; 0 to hold
const RADIANS = Math.PI / 180;
const EDGE = 0.5; // fraction of a stick's travel that counts as a press
// Name and unit of each step of the tool; only an arm with six freedoms has the last.
const AXES = [["x", "mm"], ["y", "mm"], ["z", "mm"], ["Pitch", "°"], ["Roll", "°"], ["Yaw", "°"]];
const GRIPPER_KEYS = { KeyO: "open", KeyC: "closed" };
const STYLE = new URL("steps.css", import.meta.url).href;

export class Steps {
  #say;
  #size = 0; // mm or degrees; 0 to hold
  #frame = "base";
  #arm = null; // the description of the arm
  #held = [0, 0, 0, 0, 0, 0]; // signs of the gamepad's sticks
  #gripped = [false, false];
  #grid = html("div", { id: "steps", hidden: "" });
  #gripper = html("fieldset", { id: "gripper" }, html("legend", {}, "Gripper"));

  // Return the steps in the sheet `root`, once the description of the arm is there.
  static async in(root, say) {
    const style = html("link", { rel: "stylesheet", href: STYLE });
    const styled = new Promise((resolve) => ["load", "error"].forEach((kind) => style.addEventListener(kind, resolve)));
    document.head.append(style);
    const answer = await fetch("api/v1/arm");
    if (!answer.ok) throw new Error(await answer.text());
    const arm = await answer.json();
    await styled;
    return new Steps(root, say, arm);
  }

  constructor(root, say, arm) {
    this.#say = say;
    this.#arm = arm;
    const sizes = SIZES.map((size) => radio("step", size, size ? `${size}` : "Hold", !size));
    const legend = html("legend", {}, "Step, mm or °");
    root.querySelector(".choice").append(radio("frame", "joints", "Joints", false));
    root.querySelector("#pads").before(html("fieldset", { class: "choice" }, legend, ...sizes));
    root.querySelector("#pads").after(this.#grid);
    if (arm.gripper) {
      for (const [code, to] of Object.entries(GRIPPER_KEYS)) {
        const button = html("button", { type: "button" }, to === "open" ? "Open" : "Close", html("kbd", {}, code.slice(3)));
        button.addEventListener("click", () => this.#grip(to));
        this.#gripper.append(button);
      }
      root.querySelector("#pads").before(this.#gripper);
    }
    root.addEventListener("change", ({ target }) => this.#choose(target));
    if (arm.freedoms === 6) for (const yaw of root.querySelectorAll("[data-hold^=yaw]")) yaw.hidden = false;
    if (arm.joints_only) root.querySelector("[value=joints]").click();
  }

  // Whether a press moves by one step, so that holding moves nothing.
  get on() {
    return this.#size > 0;
  }

  // Move by one step along `axis`, in the direction `sign`.
  step(axis, sign) {
    if (this.#frame === "joints") {
      const by = this.#arm.slides[axis] ? this.#size / 1000 : this.#size * RADIANS;
      return this.#say({ do: "nudge", axis: axis + 1, by: sign * by });
    }
    const by = new Array(this.freedoms).fill(0);
    if (axis >= this.freedoms) return;
    // With six freedoms the turns are about x, y and z: roll, pitch and yaw.
    const place = this.freedoms === 6 ? [0, 1, 2, 4, 3, 5][axis] : axis;
    by[place] = sign * (axis < 3 ? this.#size / 1000 : this.#size * RADIANS);
    this.#say({ do: "step_tool", by, frame: this.#frame });
  }

  // Number of numbers in a jog or a step of the tool.
  get freedoms() {
    return this.#arm.freedoms;
  }

  // Return whether the key was handled. moves: {code: [axis, sign]} of the keys that move.
  key(event, moves) {
    const pressed = event.type === "keydown" && !event.repeat;
    if (event.code in GRIPPER_KEYS && this.#arm.gripper) {
      if (pressed) this.#grip(GRIPPER_KEYS[event.code]);
    } else if (this.on && event.code in moves) {
      if (pressed && this.#frame !== "joints") this.step(...moves[event.code]);
    } else return false;
    return true;
  }

  // Take the sticks of a gamepad: one step each time that one leaves its middle.
  deflect(rates) {
    const signs = rates.map((rate) => (Math.abs(rate) > EDGE ? Math.sign(rate) : 0));
    signs.forEach((sign, axis) => sign && sign !== this.#held[axis] && this.#frame !== "joints" && this.step(axis, sign));
    this.#held = signs;
  }

  // Take the gamepad's buttons for the gripper; a button that stays pressed counts once.
  grip(open, closed) {
    if (open && !this.#gripped[0]) this.#grip("open");
    if (closed && !this.#gripped[1]) this.#grip("closed");
    this.#gripped = [open, closed];
  }

  #grip(to) {
    if (!this.#arm.gripper) return;
    const [closed, open] = this.#arm.gripper;
    this.#say({ do: "gripper", angle: to === "open" ? open : closed });
  }

  #choose({ name, value }) {
    if (name === "frame") this.#frame = value;
    else if (name === "step") this.#size = Number(value);
    else return;
    // Joints move by steps only.
    const joints = this.#frame === "joints";
    const hold = document.querySelector("#jog [name=step][value='0']");
    if (joints && !this.on) {
      /** @type {HTMLInputElement} */
      const one = document.querySelector("#jog [name=step][value='1']");
      one.checked = true;
      this.#size = 1;
    }
    hold.toggleAttribute("disabled", joints);
    document.getElementById("pads").hidden = this.on;
    this.#grid.hidden = !this.on;
    if (this.on) this.#draw();
  }

  #draw() {
    const columns = this.#frame === "joints"
      ? this.#arm.joints.map((_, i) => [this.#arm.links[i].label, this.#arm.slides[i] ? "mm" : "°"])
      : AXES.slice(0, this.freedoms);
    this.#grid.replaceChildren(
      ...columns.map(([name, unit], axis) => {
        const button = (sign) => {
          const words = `${name} ${sign > 0 ? "plus" : "minus"} ${this.#size} ${unit}`;
          const made = html("button", { type: "button", "aria-label": words }, sign > 0 ? "+" : "−");
          made.addEventListener("click", () => this.step(axis, sign));
          return made;
        };
        return html("div", {}, button(1), html("b", {}, name), button(-1));
      }),
    );
  }
}

function radio(name, value, label, checked) {
  const input = html("input", { type: "radio", name, value });
  input.checked = checked;
  return html("label", {}, input, html("span", {}, label));
}
