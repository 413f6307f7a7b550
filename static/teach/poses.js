// Taught poses as data, and the text of the script that moves through them.
// A pose is {id, joints, gripper, grips, wait, speed, blend, picture}: joint angles [deg], where the
// fingers were [deg, or mm if they slide; null without fingers] and whether they move there, the time
// to wait there [s], the speed to it [%], whether it is passed without a rest, and a data URL.
/**
 * @typedef {object} Pose
 * @property {string} id @property {number[]} joints @property {number | null} gripper @property {boolean} grips
 * @property {number} wait @property {number} speed @property {boolean} blend @property {string} picture
 */
/** @typedef {{ name: string, times: number, poses: Pose[], text: string | null, saved: string | null }} Kept `saved`: the text as it was opened or saved */
/** @typedef {{ joints: number[], gripper: number | null, wait: number, speed: number, blend: boolean }} TaughtPose */
/** @typedef {{ name: string, times: number, poses: TaughtPose[] }} Taught */
export const MAX_POSES = 100;
export const MAX_TIMES = 100;
export const MAX_WAIT = 3600; // s
const MAX_VIAS = 50; // places of one step `via`
const FORMAT = 1;

// Return the pose for the joints and the fingers of a state; arm: the answer `arm`.
/** @param {Api.State} state @param {Api.Arm} arm @param {string} picture */
export function poseOf(state, arm, picture) {
  const degrees = 180 / Math.PI;
  const joints = state.goal.map((q, i) => within(q * degrees, arm.lower[i] * degrees, arm.upper[i] * degrees));
  return made({ joints, gripper: fingersOf(state, arm), grips: Boolean(arm.gripper), picture });
}

/** Return where the fingers of a state are [deg or mm], closed if they hold; null without fingers. @param {Api.State} state @param {Api.Arm} arm */
export function fingersOf(state, arm) {
  if (!arm.gripper) return null;
  const unit = arm.gripper_slides ? 1000 : 180 / Math.PI;
  const [low, high] = arm.gripper.slice(0, 2).sort((a, b) => a - b);
  // Rounded, it could be wider.
  return within((state.held ? arm.gripper[0] : state.gripper_goal) * unit, low * unit, high * unit);
}

/** @param {Partial<Pose> & { joints: number[] }} fields @returns {Pose} */
export const made = (fields) => ({
  id: Math.random().toString(36).slice(2), gripper: null, grips: false, wait: 0, speed: 100, blend: false, picture: "", ...fields,
});

/** Return the pose that the server has read from a script. @param {TaughtPose} pose */
export const read = ({ joints, gripper, wait, speed, blend }) =>
  made({ joints, gripper, grips: gripper !== null, wait, speed: Math.round(speed * 100), blend });

/** Round to a thousandth, but not beyond a limit. @param {number} value @param {number} low @param {number} high */
function within(value, low, high) {
  const rounded = Math.round(value * 1000) / 1000;
  if (rounded > high) return Math.floor(high * 1000) / 1000;
  return (rounded < low ? Math.ceil(low * 1000) / 1000 : rounded) + 0;
}

/** Return why the arm has to rest at the pose `i`; empty if it can pass it with a rounded corner. @param {Pose[]} poses @param {number} i */
export function restsBecause(poses, i) {
  const next = poses[i + 1];
  if (!next) return "The arm rests at the last pose.";
  if (poses[i].wait) return "The arm waits there.";
  if (poses[i].grips) return "The gripper moves there.";
  return next.speed === poses[i].speed ? "" : "The next motion has another speed.";
}

/** Return the name in the text of a script; undefined without one that is plain. @param {string} text */
export const nameIn = (text) => /^name: *(["']?)([^"'\\#]+?)\1 *$/m.exec(text)?.[2].slice(0, 40);

/** Return the text of a script with another name. @param {string} text @param {string} name */
export function renamed(text, name) {
  const row = `name: ${JSON.stringify(name)}\n`;
  return /^name:.*\n/m.test(text) ? text.replace(/^name:.*\n/m, () => row) : row + text;
}

// Return {text, poseAt}: the script, and a function that returns the index of the pose of a line
// that counts from 1; null for a line of no pose.
/** @param {Pick<Kept, "name" | "times" | "poses">} script */
export function scriptOf({ name, times, poses }) {
  const lines = [`name: ${JSON.stringify(name)}`, "steps:"];
  /** @type {(number | null)[]} */
  const owners = [null, null];
  /** @param {string} line @param {number | null} owner */
  const put = (line, owner = null) => {
    lines.push((times > 1 && owner !== null ? "        - " : "  - ") + line);
    owners.push(owner);
  };
  if (times > 1) {
    lines.push("  - repeat:", `      times: ${times}`, "      steps:");
    owners.push(null, null, null);
  }
  const alike = poses.every(({ speed }) => speed === 100);
  for (let i = 0; i < poses.length; i++) {
    // Each repetition begins with the speed of the last pose.
    const before = i ? poses[i - 1].speed : alike ? 100 : null;
    if (poses[i].speed !== before) put(`speed: ${poses[i].speed / 100}`, i);
    const first = i;
    while (poses[i].blend && !restsBecause(poses, i) && i - first < MAX_VIAS - 1) i++;
    const angles = poses.slice(first, i + 1).map(({ joints }) => `[${joints.join(", ")}]`);
    put(first === i ? `joints: ${angles}` : `via: {through: [${angles.map((joints) => `{joints: ${joints}}`).join(", ")}]}`, first);
    if (poses[i].grips) put(`gripper: ${poses[i].gripper}`, i);
    if (poses[i].wait) put(`wait: ${poses[i].wait}`, i);
  }
  return { text: `${lines.join("\n")}\n`, poseAt: (/** @type {number} */ line) => owners[line - 1] ?? null };
}

// Return the content that is kept as `json`. Throws an error if it is none, or of an arm with another number of joints.
/** @param {string} json @param {number} joints @returns {Kept} */
export function restored(json, joints) {
  /** @type {Kept & { format: number }} */
  const { format, name, times, poses, text, saved = null } = JSON.parse(json);
  if (format !== FORMAT || poses.some((pose) => pose.joints.length !== joints)) throw new Error("This is not what the page keeps.");
  return { name, times, poses: poses.map((pose) => made(pose)), text, saved };
}

/** Return `content` as a text to keep. @param {Kept} content */
export const kept = (content) => JSON.stringify({ format: FORMAT, ...content });
