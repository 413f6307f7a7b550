// What of a state is kept over time, in the units people read.
const DEGREES = 180 / Math.PI;
const MM = 1000;

// {channels, groups}: each group is a list of numbers of channels. gripper: {percent(angle)} or null.
export function channelsOf(arm, gripper) {
  const channels = [];
  const groups = {};
  const group = (name, ...more) => {
    groups[name] = more.map((channel) => channels.push(channel) - 1);
  };
  const axes = (unit, of) => arm.joints.map((_, i) => ({ label: `Axis ${i + 1}`, short: `${i + 1}`, unit, of: of(i) }));
  group("angles", ...axes("deg", (i) => ({ q }) => q[i] * DEGREES));
  group("speeds", ...axes("deg/s", (i) => ({ qd }) => qd[i] * DEGREES));
  group("errors", ...axes("deg", (i) => ({ q, setpoint }) => (setpoint[i] - q[i]) * DEGREES));
  group("loads", ...axes("N m", (i) => ({ holding }) => holding?.[i]));
  group("tool", ...["x", "y", "z"].map((label, i) => ({ label, unit: "mm", of: ({ T }) => T[i][3] * MM })));
  group("clearance", { label: "Nearest", unit: "mm", of: ({ margins }) => (margins.clearance ?? NaN) * MM });
  group("speed", { label: "Tool", unit: "mm/s", of: ({ tool_speed: speed }) => speed * MM });
  if (gripper)
    group(
      "gripper",
      { label: "Now", unit: "%", of: ({ gripper: angle }) => gripper.percent(angle) },
      { label: "Goal", unit: "%", of: ({ gripper_goal: angle }) => gripper.percent(angle) },
    );
  return { channels, groups };
}
