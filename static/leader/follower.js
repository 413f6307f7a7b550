// The rules by which the arm follows a leader, as a machine without port, clock or connection. It is the
// machine of follower.py and posture_history.py in app/katana450/extensions/leader: a test compares both.
// Times in s, angles in rad.
const GAP = 0.2; // without a posture after which the arm rests
const GAP_JUMP = 0.09; // the next posture must be this near then
const SILENCE = 1; // without a valid posture after which the leader is silent
const MAX_SPEED = 12; // rad/s beyond which a posture is an error of the encoder
const MAX_INTERVAL = 0.05; // a longer interval allows no larger jump
const NOISE = 0.01;
const RATE_WINDOW = 0.07;
const REST_TIME = 0.5;
const REST_ANGLE = 0.02;
const NEAR = 0.09; // up to which the arm follows without a planned path
const HELD_BACK = 0.5; // at which an arm that waits before a contact no longer follows
const SERVER_SILENCE = 1; // without a state of the server
const FINGER_NEAR = 0.1; // fraction of the fingers' range within which the jaw has met them
const FINGER_STEP = 0.02; // fraction of the fingers' range
const FINGER_INTERVAL = 0.1;
const ENDED = ["stopped", "failed", "refused", "cancelled"]; // of a program that does not arrive

const distance = (one, other) => Math.max(...one.map((angle, i) => Math.abs(angle - other[i])));

// The accepted postures of the last REST_TIME.
class History {
  #postures = [];
  #begun = 0;

  // Take a posture; return whether it is accepted. One that no hand could have reached is refused.
  add(t, posture) {
    const last = this.#postures.at(-1);
    if (!this.fresh(t)) [this.#postures, this.#begun] = [[], t];
    else {
      const jump = t - last.t > GAP ? GAP_JUMP : NOISE + MAX_SPEED * Math.min(t - last.t, MAX_INTERVAL);
      if (distance(posture.raw, last.raw) > jump) return false;
    }
    this.#postures.push({ t, ...posture });
    while (t - this.#postures[0].t > REST_TIME) this.#postures.shift();
    return true;
  }

  fresh(t) {
    return this.#postures.length > 0 && t - this.newest.t <= SILENCE;
  }

  get newest() {
    return this.#postures.at(-1);
  }

  // Return the rates of the newest posture: the slope of the line through the last ones.
  rates() {
    const used = this.#postures.filter(({ t }) => this.newest.t - t <= RATE_WINDOW);
    const middle = used.reduce((sum, { t }) => sum + t, 0) / used.length;
    const spread = used.reduce((sum, { t }) => sum + (t - middle) ** 2, 0);
    return this.newest.q.map((_, i) => (spread ? used.reduce((sum, { t, q }) => sum + (t - middle) * q[i], 0) / spread : 0));
  }

  atRest(t) {
    if (!this.#postures.length || t - this.newest.t > GAP || t - this.#begun < REST_TIME) return false;
    return this.newest.q.every((_, i) => {
      const angles = this.#postures.map(({ q }) => q[i]);
      return Math.max(...angles) - Math.min(...angles) <= REST_ANGLE;
    });
  }
}

export class Follower {
  phase = "waiting"; // waiting, easing, settling or following
  #history = new History();
  #range; // finger joint closed and open; null without fingers
  #eased = null; // time of the server from which states report the program
  #revocations = 0;
  #first = true;
  #holds = false;
  #finger = null; // time and target of the fingers, once the jaw has met them

  constructor(range) {
    this.#range = range;
  }

  // Return what is to be done at `t`, as objects {act, ...}: say, ease, end, sample, finger, release. posture: null if the
  // leader did not answer. heard: time at which `state` arrived. asked: whether a person asks to begin, or to end.
  step(t, posture, state, heard, asked) {
    const ended = this.phase === "waiting" ? null : this.#ended(t, state, heard);
    if (ended) return this.rest(ended);
    const accepted = posture !== null && this.#history.add(t, posture);
    if (this.phase === "waiting") return asked ? this.#begun(t, state) : this.#released(t, state, heard);
    if (asked) return this.rest("You have ended it.");
    if (this.phase === "easing") return this.#arrived(state);
    if (this.phase === "settling") return this.#settled(t, state);
    return accepted ? this.#followed(t, state) : [];
  }

  // Take note that the program was accepted; states report it from the time `since` of the server.
  eased(since) {
    this.#eased = since;
  }

  // Follow no longer, for the reason `why`.
  rest(why) {
    const ends = this.phase === "easing" ? [{ act: "end" }] : [];
    return [...ends, ...this.refused(why)];
  }

  // Follow no longer, because the server has refused a request for the reason `why`.
  refused(why) {
    this.phase = "waiting";
    return [{ act: "say", text: `${why} The arm rests.` }];
  }

  #begun(t, state) {
    if (!this.#history.fresh(t)) return this.rest("The leader does not answer.");
    if (state.stopped !== null) return this.rest(`The arm is stopped: ${state.stopped} Clear the stop first.`);
    return this.#ease(state, "The arm moves to the posture of the leader. Keep the leader still.");
  }

  // Release the lease once the arm is at rest.
  #released(t, state, heard) {
    if (!this.#holds || state.moving || t - heard > SERVER_SILENCE) return [];
    this.#holds = false;
    return [{ act: "release" }];
  }

  #ease(state, text) {
    [this.phase, this.#eased, this.#revocations] = ["easing", null, state.revocations];
    return [{ act: "say", text }, { act: "ease", q: this.#history.newest.q, revocations: state.revocations }];
  }

  // Return the reason that ends the motion; null if it may continue.
  #ended(t, state, heard) {
    if (!this.#history.fresh(t)) return `The leader has sent no valid posture for ${SILENCE} s.`;
    if (t - heard > SERVER_SILENCE) return "The server does not answer.";
    if (state.stopped !== null) return `The arm was stopped: ${state.stopped}`;
    // The program has a lease of its own, which counts as a revocation when it ends.
    if (this.phase === "easing") return null;
    if (state.revocations !== this.#revocations) return "The arm was stopped or changed its driver.";
    if (state.status === "paused") return "The arm was paused.";
    if (state.status === "blocked" && this.#distance(state) > HELD_BACK) return `The arm is held back: ${state.why}`;
    return null;
  }

  #arrived({ program, sent, setpoint, revocations }) {
    if (this.#eased === null || sent < this.#eased || !program) return [];
    if (ENDED.includes(program.status) || program.why.startsWith("Not run"))
      return this.refused(`The arm did not reach the posture of the leader: ${program.why}`);
    if (program.status !== "done") return [];
    [this.phase, this.#revocations, this.#first, this.#finger] = ["settling", revocations, true, null];
    if (this.#distance({ setpoint }) <= NEAR) return [];
    return [{ act: "say", text: "The leader has moved. Keep it still, and the arm moves there." }];
  }

  #settled(t, state) {
    if (this.#distance(state) <= NEAR) {
      this.phase = "following";
      return [{ act: "say", text: "The arm follows the leader." }];
    }
    return this.#history.atRest(t) ? this.#ease(state, "The arm moves to the posture of the leader.") : [];
  }

  #followed(t, state) {
    const { q, finger } = this.#history.newest;
    const sample = { act: "sample", q, qd: this.#history.rates(), revocations: this.#revocations, first: this.#first };
    [this.#first, this.#holds] = [false, true];
    return [sample, ...this.#gripped(t, finger, state.gripper)];
  }

  // Return the next target of the fingers, which wait until the jaw has met them.
  #gripped(t, target, present) {
    if (target === null || this.#range === null) return [];
    const span = Math.abs(this.#range[1] - this.#range[0]);
    if (this.#finger === null) {
      if (Math.abs(target - present) <= FINGER_NEAR * span) this.#finger = [t, present];
      return [];
    }
    const [then, last] = this.#finger;
    if (t - then < FINGER_INTERVAL || Math.abs(target - last) < FINGER_STEP * span) return [];
    this.#finger = [t, target];
    return [{ act: "finger", angle: target, revocations: this.#revocations }];
  }

  // Return the largest difference of a joint of the leader from the setpoint.
  #distance({ setpoint }) {
    return distance(this.#history.newest.q, setpoint);
  }
}
