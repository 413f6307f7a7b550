// A leader arm at this device's USB port drives the arm, joint to joint. The arm first moves to the
// leader's posture on a planned path. Everything unexpected ends this, and only a press begins again.
import { html } from "../instruments/shape.js";
import { Bus, HOMING_OFFSET, POSITION, TORQUE_ENABLE } from "./bus.js";
import { calibrationIn, posture } from "./calibration.js";
import { Follower } from "./follower.js";

const EVERY = 12; // ms between two readings of the leader
const STATE_RATE = 25; // Hz
const EXPECTED = ["program", "run", "first"]; // requests whose answers count
const KEPT = "katana450.leader.calibration";
const LABELS = { off: "Connect a leader arm", waiting: "Follow the leader" };
const NEEDED = "Choose the calibration file of LeRobot first.";
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

export class Leader {
  #say;
  #watch; // sets the rate of states [Hz]
  #arm; // the description of the arm
  #calibration = null;
  #bus = null; // the connected leader
  #follower = null; // the rules of the connected leader
  #state = null; // the newest state of the server, and the time at which it came [s]
  #asked = false; // whether the person has pressed the button since the last reading
  #eases = 0; // number of planned motions, which is a part of the ids of their requests
  #revocations = 0; // number of the state in which the newest of them was decided
  #taken = false; // whether the server has accepted it, in no state so far
  #file = html("input", { type: "file", accept: ".json", hidden: "", "aria-label": "Calibration of the leader" });
  #button = html("button", { type: "button" });
  #words = html("span", { role: "status" });

  // root: element for the controls. say: sends a request. watch: sets the rate of states. arm: the description of the arm.
  constructor(root, say, watch, arm) {
    [this.#say, this.#watch, this.#arm] = [say, watch, arm];
    root.replaceChildren(this.#button, html("button", { type: "button", id: "leader-file" }, "Calibration…"), this.#file, this.#words);
    root.querySelector("#leader-file").addEventListener("click", () => this.#file.click());
    this.#file.addEventListener("change", async (event) => {
      event.stopPropagation();
      const [file] = this.#file.files;
      this.#file.value = "";
      if (file) this.#calibrate(await file.text(), true);
    });
    this.#button.addEventListener("click", () => this.press());
    // The timers of a hidden page are slow.
    document.addEventListener("visibilitychange", () => document.hidden && this.#rest("The page was hidden."));
    const kept = storage()?.getItem(KEPT);
    if (kept) this.#calibrate(kept, false);
    else this.#show(NEEDED);
  }

  // Take a message of the server; return whether it was for the leader alone.
  hear(message) {
    if (message.is === "state") {
      if (this.#taken) this.#follower?.eased(message.sent);
      [this.#state, this.#taken] = [{ ...message, heard: performance.now() / 1000 }, false];
      return false;
    }
    const [name, number, request] = String(message.id).split(" ");
    if (name !== "leader") return false;
    // What the answers to later samples and to the order to end say is in the states, with its reason.
    if (Number(number) !== this.#eases || !this.#follows || !EXPECTED.includes(request)) return true;
    if (message.is === "refused") this.#perform(this.#follower.refused(message.why));
    else if (request === "program") this.#run();
    else if (request === "run") this.#taken = true;
    return true;
  }

  // Connect, begin or end, as the button says.
  async press() {
    if (this.#bus && this.#state) this.#asked = true;
    // A press must not count later, when the server is back.
    else if (this.#bus) this.#show("The server does not answer.");
    else if (this.#calibration) await this.#connect().catch((error) => this.#show(error.message));
    else {
      this.#show(NEEDED);
      this.#file.click();
    }
  }

  get #follows() {
    return this.#follower !== null && this.#follower.phase !== "waiting";
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
    const [bus, calibration] = [await Bus.on(port), this.#calibration];
    try {
      for (const [name, { id, homing_offset }] of Object.entries(calibration)) {
        const found = await bus.read(id, HOMING_OFFSET);
        if (found !== homing_offset)
          throw new Error(`The homing offset of ${name} is ${found} in the motor and ${homing_offset} in the calibration file. Choose the file of this leader.`);
        await bus.write(id, TORQUE_ENABLE, 0);
      }
    } catch (error) {
      await bus.close();
      throw error;
    }
    [this.#bus, this.#follower, this.#state, this.#asked] = [bus, new Follower(this.#arm.gripper), null, false];
    this.#watch(STATE_RATE);
    this.#show("Connected. Follow the leader first moves the arm to its posture. Keep it still meanwhile.");
    this.#read(bus, calibration);
  }

  // Read the leader until its port is lost.
  async #read(bus, calibration) {
    const ids = Object.values(calibration).map(({ id }) => id);
    for (let due = performance.now(); !bus.lost; due = Math.max(due + EVERY, performance.now())) {
      const ticks = await bus.readAll(ids, POSITION);
      if (!bus.lost) this.#step(ticks && posture(calibration, this.#arm, ticks));
      await pause(Math.max(due + EVERY - performance.now(), 0));
    }
    const moved = this.#follows;
    this.#rest(bus.lost);
    this.#watch(0);
    [this.#bus, this.#follower] = [null, null];
    this.#show(moved ? this.#words.textContent : bus.lost);
    await bus.close();
  }

  #step(found) {
    if (!this.#state) return;
    const asked = this.#asked;
    this.#asked = false;
    this.#perform(this.#follower.step(performance.now() / 1000, found, this.#state, this.#state.heard, asked));
  }

  // Follow no longer, so that the arm comes to rest by itself.
  #rest(why) {
    if (this.#follows) this.#perform(this.#follower.rest(why));
  }

  #perform(actions) {
    for (const { act, text, first, ...fields } of actions) {
      if (act === "say") this.#show(text);
      else if (act === "ease") this.#ease(fields);
      else if (act === "end") this.#say({ do: "steer", order: "end", id: this.#id("end") });
      else if (act === "sample") this.#say({ do: "servo", ...fields, id: this.#id(first ? "first" : "sample") });
      else if (act === "finger") this.#say({ do: "gripper", ...fields, id: this.#id("sample") });
      // After "release" the window keeps its lease, as after every other motion.
    }
  }

  // Send a program that moves the arm to `q` on a planned path.
  #ease({ q, revocations }) {
    [this.#eases, this.#taken, this.#revocations] = [this.#eases + 1, false, revocations];
    const angles = q.map((angle) => ((angle * 180) / Math.PI).toFixed(4));
    const text = `name: Leader\nsteps:\n  - joints: [${angles.join(", ")}]\n`;
    this.#say({ do: "program", text, revocations, id: this.#id("program") });
  }

  // Run the program. Only once it is accepted: the order would run another program of this window.
  #run() {
    this.#say({ do: "steer", order: "run", revocations: this.#revocations, id: this.#id("run") });
  }

  #id(request) {
    return `leader ${this.#eases} ${request}`;
  }

  #show(words) {
    this.#button.textContent = LABELS[this.#follower?.phase ?? "off"] ?? "End following";
    this.#words.textContent = words;
  }
}

// A browser may refuse to store anything.
function storage() {
  try {
    return window.localStorage;
  } catch {
    return null;
  }
}
