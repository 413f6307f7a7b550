// The channels of the history: values of a state in display units.
export const DEGREES = 180 / Math.PI;
export const MM = 1000;

/** @typedef {{ label: string, short?: string, of: (state: Api.State) => number | null | undefined }} Channel */
/** @typedef {{ percent: (angle: number) => number, angle: (percent: number) => number }} Fingers */

/** Return the name for people of a link or an object. @param {string} part */
export const spoken = (part) => part.replace(/_link$/, "").replaceAll("_", " ");

/** Return {of, mark} for each joint: factor to display units, and their mark after numbers. @param {Api.Arm} arm */
export function readings(arm) {
  return arm.slides.map((slides) => (slides ? { of: MM, mark: " mm" } : { of: DEGREES, mark: "°" }));
}

// Return {channels, groups}; a group is a list of channel indices. gripper: {percent(angle)} or null.
/** @param {Api.Arm} arm @param {Fingers | null} gripper @param {string[]} fingers names of those with a force */
export function channelsOf(arm, gripper, fingers) {
  /** @type {Channel[]} */
  const channels = [];
  /** @type {Record<string, number[]>} */
  const groups = {};
  /** @param {string} name @param {Channel[]} more */
  const group = (name, ...more) => {
    groups[name] = more.map((channel) => channels.push(channel) - 1);
  };
  const read = readings(arm);
  /** @param {(i: number) => Channel["of"]} of */
  const axes = (of) => arm.joints.map((_, i) => ({ label: `Axis ${i + 1}`, short: `${i + 1}`, of: of(i) }));
  group("angles", ...axes((i) => ({ q }) => q[i] * read[i].of));
  group("speeds", ...axes((i) => ({ qd }) => qd[i] * read[i].of));
  group("errors", ...axes((i) => ({ q, setpoint }) => (setpoint[i] - q[i]) * read[i].of));
  if (arm.joints_only) return { channels, groups };
  group("loads", ...axes((i) => ({ holding }) => holding?.[i]));
  group("tool", ...["x", "y", "z"].map((label, i) => /** @type {Channel} */ ({ label, of: ({ T }) => T && T[i][3] * MM })));
  group("clearance", { label: "Nearest", of: ({ margins }) => (margins?.clearance ?? NaN) * MM });
  group("speed", { label: "Tool", of: ({ tool_speed: speed }) => (speed ?? NaN) * MM });
  if (gripper) {
    group(
      "gripper",
      { label: "Now", of: ({ gripper: angle }) => gripper.percent(angle) },
      { label: "Goal", of: ({ gripper_goal: angle }) => gripper.percent(angle) },
    );
  }
  group("forces", ...fingers.map((name, i) => /** @type {Channel} */ ({ label: spoken(name), of: ({ touch }) => touch?.fingers[i].force })));
  return { channels, groups };
}
