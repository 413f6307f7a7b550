// The rules by which the arm follows a leader, without port, clock or connection. As follower.py,
// posture_history.py, joint_map.py and layout.py in app/katana450/extensions/leader.
export const SILENCE = 1000; // ms without a valid posture after which the leader is silent
const GAP = 200; // ms without a posture after which the arm rests; the next one must be near
const GAP_JUMP = 0.09; // rad
export const NEAR = 0.09; // rad up to which the arm follows without a planned path
export const HELD_BACK = 0.5; // rad that a leader moves on while the arm waits before a contact
const MAX_SPEED = 0.012; // rad/ms beyond which a posture is an error of the encoder
const MAX_INTERVAL = 50; // ms; a longer interval allows no larger jump
const NOISE = 0.01; // rad
const RATE_WINDOW = 70; // ms
const REST_TIME = 500; // ms
const REST_ANGLE = 0.02; // rad
const LIMIT_MARGIN = 1e-4; // rad
const TURN = 4096; // ticks
/** @type {[string, number, number][]} The SO-101: motor, direction, and angle of the arm's joint [deg] in the middle of its range. */
const AXES = [["shoulder_pan", -1, 0], ["shoulder_lift", 1, -76], ["elbow_flex", 1, 73.8], ["wrist_flex", 1, 2.2], ["wrist_roll", -1, 0]];
const [LOW, HIGH] = [-TURN, 2 * TURN];
const BOUNDS = { id: [0, 253], drive_mode: [0, 1], homing_offset: [-2047, 2047], range_min: [LOW, HIGH], range_max: [LOW, HIGH] };

// Return the calibration of the six motors in LeRobot's JSON `text`. Throws an error with what is wrong in it.
export function calibrationIn(text) {
  const all = parsed(text);
  const found = {};
  for (const name of [...AXES.map(([motor]) => motor), "gripper"]) {
    const motor = (found[name] = all?.[name]);
    if (!motor) throw new Error(`This is not a calibration file of an SO-101 leader: it has no motor ${name}.`);
    for (const [field, [low, high]] of Object.entries(BOUNDS))
      if (!Number.isInteger(motor[field]) || motor[field] < low || motor[field] > high)
        throw new Error(`In the calibration, ${field} of ${name} is not an integer from ${low} to ${high}.`);
    if (motor.range_min >= motor.range_max) throw new Error(`In the calibration, range_min of ${name} is not below range_max.`);
  }
  if (new Set(Object.values(found).map(({ id }) => id)).size < 6) throw new Error("In the calibration, two motors have the same id.");
  return found;
}

function parsed(text) {
  try {
    return JSON.parse(text);
  } catch (cause) {
    throw new Error(`This is not a calibration file of LeRobot: ${cause.message}`, { cause });
  }
}

// Return the posture {raw, q, finger} of the arm `arm` at the positions `ticks` by the ids of the motors.
export function posture(calibration, arm, ticks) {
  const raw = AXES.map(([name, sign, offset]) => {
    const { id, drive_mode, range_min, range_max } = calibration[name];
    const angle = ((ticks.get(id) - (range_min + range_max) / 2) * 2 * Math.PI) / TURN;
    return (drive_mode ? -sign : sign) * angle + (offset * Math.PI) / 180;
  });
  const q = raw.map((angle, i) => Math.min(Math.max(angle, arm.lower[i] + LIMIT_MARGIN), arm.upper[i] - LIMIT_MARGIN));
  if (!arm.gripper) return { raw, q, finger: null };
  const { id, drive_mode, range_min, range_max } = calibration.gripper;
  const part = Math.min(Math.max((ticks.get(id) - range_min) / (range_max - range_min), 0), 1);
  const [closed, opened] = arm.gripper;
  return { raw, q, finger: closed + (drive_mode ? 1 - part : part) * (opened - closed) };
}

export const distance = (one, other) => Math.max(...one.map((angle, i) => Math.abs(angle - other[i])));

// The accepted postures of the last REST_TIME. Times in ms.
export class History {
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

  // Return the rates of the newest posture [rad/s]: the slope of the line through the last ones.
  rates() {
    const used = this.#postures.filter(({ t }) => this.newest.t - t <= RATE_WINDOW);
    const middle = used.reduce((sum, { t }) => sum + t, 0) / used.length;
    const spread = used.reduce((sum, { t }) => sum + (t - middle) ** 2, 0);
    return this.newest.q.map((_, i) => (spread ? (1000 * used.reduce((sum, { t, q }) => sum + (t - middle) * q[i], 0)) / spread : 0));
  }

  atRest(t) {
    if (!this.fresh(t) || t - this.#begun < REST_TIME) return false;
    return this.newest.q.every((_, i) => {
      const angles = this.#postures.map(({ q }) => q[i]);
      return Math.max(...angles) - Math.min(...angles) <= REST_ANGLE;
    });
  }
}
