// A leader arm at this device's USB port drives the arm, joint to joint. The arm first moves to the
// leader's posture on a planned path. Everything unexpected ends this, and only a press begins again.
import { html } from "../instruments/shape.js";
import { Bus, HOMING_OFFSET, POSITION, TORQUE_ENABLE } from "./bus.js";
import { calibrationIn, distance, HELD_BACK, History, NEAR, posture, SILENCE } from "./follower.js";

const EVERY = 12; // ms between two readings of the leader
const LOOK = 150; // ms between two looks at the progress of the program
const ANSWER = 1000; // ms without an answer to a sample after which the server is silent
const TAKEN = 5000; // ms within which the server takes the program
const ENDS = ["stopped", "failed", "refused", "cancelled"]; // of a program that does not arrive
const FINGER_NEAR = 0.1; // fraction of the fingers' range within which the jaw has met them
const FINGER_STEP = 0.02; // fraction of the fingers' range
const FINGER_EVERY = 100; // ms
const KEPT = "katana450.leader.calibration";
const [EASE, FOLLOW] = ["leader-ease", "leader"]; // ids of the requests
const NEEDED = "Choose the calibration file of LeRobot first.";
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

export class Leader {
  #say;
  #arm; // the description of the arm
  #calibration = null;
  #bus = null;
  #history = new History();
  #phase = "off"; // off, waiting, easing, settling or following
  #taken = 0; // number of the requests for the program that were answered
  #revocations = 0;
  #finger = null; // the fingers' last target and its time, once the jaw has met them
  #answered = 0;
  #held = null; // posture of the leader when the arm began to wait before a contact
  #file = html("input", { type: "file", accept: ".json", hidden: "", "aria-label": "Calibration of the leader" });
  #button = html("button", { type: "button" });
  #words = html("span", { role: "status" });

  // root: element for the controls. arm: the description of the arm.
  constructor(root, say, arm) {
    [this.#say, this.#arm] = [say, arm];
    root.replaceChildren(this.#button, html("button", { type: "button", id: "leader-file" }, "Calibration…"), this.#file, this.#words);
    root.querySelector("#leader-file").addEventListener("click", () => this.#file.click());
    this.#file.addEventListener("change", async (event) => {
      event.stopPropagation();
      const [file] = this.#file.files;
      this.#file.value = "";
      if (file) this.#calibrate(await file.text(), true);
    });
    this.#button.addEventListener("click", () => this.press());
    window.addEventListener("status", ({ detail }) => this.#see(detail));
    // The timers of a hidden page are slow.
    document.addEventListener("visibilitychange", () => document.hidden && this.#rest("The page was hidden."));
    const kept = storage()?.getItem(KEPT);
    if (kept) this.#calibrate(kept, false);
    else this.#show(NEEDED);
  }

  // Take an answer of the server; return whether it was for the leader.
  hear(answer) {
    if (answer.id === EASE) this.#taken += 1;
    else if (answer.id === FOLLOW) this.#answered = performance.now();
    else return false;
    if (answer.is === "refused" && this.#phase === (answer.id === EASE ? "easing" : "following")) this.#rest(answer.why);
    return true;
  }

  // Connect, begin or end, as the button says.
  async press() {
    if (this.#phase !== "off" && this.#phase !== "waiting") return this.#rest("You have ended it.");
    if (!this.#calibration) {
      this.#show(NEEDED);
      return this.#file.click();
    }
    try {
      if (this.#phase === "off") await this.#connect();
      else if (!this.#history.fresh(performance.now())) this.#show("The leader does not answer.");
      else await this.#ease();
    } catch (error) {
      this.#rest(error.message);
    }
  }

  // keep: whether the person has chosen it now. A connected leader was compared with another one.
  #calibrate(text, keep) {
    try {
      this.#calibration = calibrationIn(text);
      this.#bus?.close();
      if (keep) storage()?.setItem(KEPT, text);
      this.#show("The calibration is kept in this browser.");
    } catch (error) {
      this.#show(error.message);
    }
  }

  async #connect() {
    const { serial } = /** @type {any} */ (navigator);
    const port = await serial.requestPort();
    const bus = await Bus.on(port);
    try {
      for (const [name, { id, homing_offset }] of Object.entries(this.#calibration)) {
        const found = await bus.read(id, HOMING_OFFSET);
        if (found !== homing_offset)
          throw new Error(`The homing offset of ${name} is ${found} in the motor and ${homing_offset} in the calibration file. Choose the file of this leader.`);
        await bus.write(id, TORQUE_ENABLE, 0);
      }
    } catch (error) {
      await bus.close();
      throw error;
    }
    [this.#bus, this.#phase] = [bus, "waiting"];
    this.#show("Connected. The arm moves to the posture of the leader first. Keep the leader still.");
    this.#read();
  }

  // Read the leader until its port is lost.
  async #read() {
    const ids = Object.values(this.#calibration).map(({ id }) => id);
    for (let due = performance.now(); !this.#bus.lost; due = Math.max(due + EVERY, performance.now())) {
      const ticks = await this.#bus.readAll(ids, POSITION);
      const t = performance.now();
      if (!["off", "waiting"].includes(this.#phase) && !this.#history.fresh(t))
        this.#rest(`The leader has sent no valid posture for ${SILENCE / 1000} s.`);
      if (ticks && this.#history.add(t, posture(this.#calibration, this.#arm, ticks)) && this.#phase === "following") this.#follow(t);
      await pause(Math.max(due + EVERY - performance.now(), 0));
    }
    this.#rest(this.#bus.lost, "off");
    await this.#bus.close();
  }

  // Move to the leader's posture on a planned path until both are near each other, then follow.
  async #ease() {
    this.#phase = "easing";
    while (this.#phase === "easing") {
      this.#show("The arm moves to the posture of the leader. Keep the leader still.");
      const state = await this.#arrived();
      if (!state) return;
      [this.#revocations, this.#phase] = [state.revocations, "settling"];
      const far = () => distance(this.#history.newest.q, state.setpoint) > NEAR;
      if (far()) this.#show("The leader has moved. Keep it still, and the arm moves there.");
      while (far() && !this.#history.atRest(performance.now())) {
        await pause(EVERY);
        if (this.#phase !== "settling") return;
      }
      if (!far()) return this.#begin(state.gripper);
      this.#phase = "easing";
    }
  }

  // Run the program that moves to the leader's posture. Return the state at its end; nothing if it was ended.
  async #arrived() {
    const angles = this.#history.newest.q.map((angle) => ((angle * 180) / Math.PI).toFixed(4));
    const text = `name: Leader\nsteps:\n  - joints: [${angles.join(", ")}]\n`;
    const { revocations } = await latestState();
    const due = performance.now() + TAKEN;
    this.#taken = 0;
    // Both at once, so that an order to end it can't come between.
    this.#say({ do: "program", text, revocations, id: EASE });
    this.#say({ do: "steer", order: "run", revocations, id: EASE });
    while (this.#phase === "easing") {
      await pause(LOOK);
      const taken = this.#taken > 1;
      if (!taken && performance.now() > due) return this.#rest("The server does not answer.");
      const now = taken ? await latestState() : null;
      const { status, why } = now?.program ?? {};
      if (this.#phase !== "easing") return;
      if (now?.stopped) return this.#rest(`The arm was stopped: ${now.stopped}`);
      if (ENDS.includes(status) || why?.startsWith("Not run")) return this.#rest(`The arm did not reach the posture of the leader: ${why}`);
      if (status === "done") return now;
    }
  }

  #begin(finger) {
    this.#phase = "following";
    this.#answered = performance.now();
    this.#finger = { met: false, to: finger, at: 0 };
    this.#show("The arm follows the leader.");
  }

  #follow(t) {
    if (t - this.#answered > ANSWER) return this.#rest("The server does not answer.");
    const { q, finger } = this.#history.newest;
    if (this.#held && distance(q, this.#held) > HELD_BACK) return this.#rest("The arm is held back by a contact.");
    const fields = { revocations: this.#revocations, id: FOLLOW };
    this.#say({ do: "servo", q, qd: this.#history.rates(), ...fields });
    if (finger === null) return;
    const span = Math.abs(this.#arm.gripper[1] - this.#arm.gripper[0]);
    const far = Math.abs(finger - this.#finger.to) / span;
    this.#finger.met ||= far < FINGER_NEAR;
    if (!this.#finger.met || far < FINGER_STEP || t - this.#finger.at < FINGER_EVERY) return;
    this.#finger = { met: true, to: finger, at: t };
    this.#say({ do: "gripper", angle: finger, ...fields });
  }

  // Take the status of the bar.
  #see(status) {
    if (this.#phase === "off" || this.#phase === "waiting") return;
    this.#held = status.mood === "blocked" ? (this.#held ?? this.#history.newest.q) : null;
    if (status.stopped) this.#rest(`The arm was stopped: ${status.stopped}`);
    else if (this.#phase === "easing") return;
    else if (status.revocations !== this.#revocations) this.#rest("The arm was stopped or changed its driver.");
    else if (status.paused_at) this.#rest("The arm was paused.");
  }

  // Send no more, so that the arm comes to rest by itself.
  #rest(why, phase = this.#bus && !this.#bus.lost ? "waiting" : "off") {
    if (this.#phase === "easing") this.#say({ do: "steer", order: "end", id: FOLLOW });
    const moved = !["off", "waiting"].includes(this.#phase);
    this.#phase = phase;
    this.#show(moved ? `${why} The arm rests.` : why);
  }

  #show(words) {
    const labels = { off: "Connect a leader arm", waiting: "Follow the leader" };
    this.#button.textContent = labels[this.#phase] ?? "End following";
    this.#words.textContent = words;
  }
}

async function latestState() {
  const answer = await fetch("api/v1/state");
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}

// A browser may refuse to store anything.
function storage() {
  try {
    return window.localStorage;
  } catch {
    return null;
  }
}
