// LeRobot's calibration of an SO-101 leader, and the posture of the arm that its positions mean. As
// calibration.py, layout.py and joint_map.py in app/katana450/extensions/leader.
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
