// All instruments of an arm, with their titles, elements and the values that they show of a state.
import { DEGREES, MM, readings, spoken } from "./channels.js";
import { Command } from "./command.js";
import { Bars, Gauge } from "./gauge.js";
import { Knob } from "./knob.js";
import { Plot } from "./plot.js";
import { signed } from "./shape.js";

/** @typedef {"small" | "wide" | "broad"} Size */
/**
 * @typedef {object} Instrument
 * @property {string} id @property {string} title @property {Size} size @property {boolean} shown
 * @property {HTMLElement} element
 * @property {(state: Api.State, loop: Api.Loop | null) => void} draw
 * @property {Knob} [knob] @property {Plot} [plot]
 */
/** @typedef {import("./channels.js").Fingers} Fingers */
/** @typedef {{ history: import("./history.js").History, groups: Record<string, number[]>, view: import("./plot.js").Span }} Plotted */
const MS = 1000;

/** @param {Api.Arm} arm @param {Fingers | null} gripper @param {Plotted & { say: Page.Say, touch: Api.State["touch"] }} page @returns {Instrument[]} */
export function instruments(arm, gripper, { say, history, groups, view, touch }) {
  return [...knobs(arm, gripper, say), ...gauges(arm), ...(touch ? [grip(touch)] : []), ...plots(arm, gripper, history, groups, view)];
}

/** @param {Api.Arm} arm @param {Fingers | null} gripper @param {Page.Say} say */
function knobs(arm, gripper, say) {
  /**
   * @param {string} id @param {string} title
   * @param {Omit<import("./knob.js").KnobOptions, "title" | "command">} options
   * @param {(value: number) => Api.Act} request @param {(state: Api.State) => [number, number]} of
   * @returns {Instrument}
   */
  const made = (id, title, options, request, of) => {
    const knob = new Knob({ title, ...options, command: new Command(id, request, say) });
    /** @param {Api.State} state */
    const draw = (state) => knob.take(state, ...of(state));
    return { id, title, size: "small", shown: true, element: knob.element, draw, knob };
  };
  const read = readings(arm);
  /** @param {number} value */
  const percent = (value) => `${signed(value, 0)} %`;
  const joints = arm.joints.map((_, i) => {
    const { of, mark } = read[i];
    const options = { low: arm.lower[i] * of, high: arm.upper[i] * of, step: 1, full: 1, text: (/** @type {number} */ value) => `${signed(value, 1)}${mark}` };
    return made(`axis-${i + 1}`, arm.links[i].label, options, (value) => ({ do: "joint", axis: i + 1, value: value / of }), ({ goal, q }) => [goal[i] * of, q[i] * of]);
  });
  const fingers = gripper && !arm.suction_cup && made("gripper", "Gripper", { low: 0, high: 100, step: 2, text: percent }, (value) => ({ do: "gripper", angle: gripper.angle(value) }), (state) =>
    [gripper.percent(state.gripper_goal), gripper.percent(state.gripper)],
  );
  const speed = made("speed", "Speed", { low: 5, high: 100, step: 5, text: percent }, (value) => ({ do: "speed", value: value / 100 }), (state) => [state.speed * 100, state.speed * 100]);
  return [...joints, ...(fingers ? [fingers] : []), speed];
}

/**
 * @param {string} id @param {string} title @param {Omit<import("./gauge.js").GaugeOptions, "title">} options
 * @param {(state: Api.State, loop: Api.Loop | null) => [value: number | null, note?: string]} of
 * @returns {Instrument}
 */
function gauge(id, title, options, of) {
  const made = new Gauge({ title, ...options });
  /** @type {Instrument["draw"]} */
  const draw = (state, loop) => made.show(...of(state, loop));
  return { id, title, size: "small", shown: true, element: made.element, draw };
}

/** @param {number} value */
const one = (value) => signed(value, 1);

/** Return the zones of a value that is bad below `bad`, and warns below `warn`. @param {number} bad @param {number} warn */
const zonesBelow = (bad, warn) => [{ below: bad, tone: "bad" }, { below: warn, tone: "warn" }];

/** @param {Api.Arm} arm @returns {Instrument[]} */
function gauges(arm) {
  const read = readings(arm);
  const rows = arm.joints.map((_, i) => ({ label: `Axis ${i + 1}`, limit: arm.speed[i] * read[i].of }));
  const units = [...new Set(read.map(({ mark }) => `${mark.trim()}/s`))];
  const bars = new Bars({ title: "Joint speeds", rows, text: one, unit: units.join(", ") });
  /** @type {Instrument} */
  const rates = {
    id: "rates", title: "Joint speeds", size: "wide", shown: true, element: bars.element,
    draw: ({ qd }) => bars.show(qd.map((rate, i) => rate * read[i].of)),
  };
  const lateness = {
    low: 0, high: 5, unit: "ms, 99 %", text: (/** @type {number} */ value) => signed(value, 2),
    zones: [{ above: 4, tone: "bad" }, { above: 2, tone: "warn" }],
  };
  const late = gauge("late", "Loop lateness", lateness, (_, loop) => (loop ? [loop.late_p99 * MS, `${loop.lost} lost`] : [null]));
  // The other gauges need a tool, which a mechanism of joints does not have.
  if (arm.joints_only) return [rates, late];
  const [clearance, ...others] = toolGauges(arm);
  return [clearance, rates, ...others, late];
}

/** @param {Api.Arm} arm @returns {Instrument[]} */
function toolGauges(arm) {
  const speed = { low: 0, high: 500, unit: "mm/s", text: (/** @type {number} */ value) => signed(value, 0), zones: [{ above: 450, tone: "warn" }] };
  const singular = { low: 0, high: 0.5, unit: "smallest", text: (/** @type {number} */ value) => signed(value, 3), zones: zonesBelow(0.02, 0.05) };
  const gauges = [
    gauge("clearance", "Clearance", { low: 0, high: 100, unit: "mm", text: one, zones: zonesBelow(6, 20) }, ({ margins }) => {
      const { clearance, parts } = margins ?? {};
      return clearance != null && parts ? [clearance * MM, parts.map(spoken).join(" – ")] : [null, "not checked"];
    }),
    gauge("tool-speed", "Tool speed", speed, (state) => [(state.tool_speed ?? 0) * MM]),
    gauge("limit", "To a limit", { low: 0, high: 90, unit: "°", text: one, zones: zonesBelow(2, 8) }, ({ margins }) =>
      margins ? [margins.limit * DEGREES, `axis ${margins.axis}`] : [null],
    ),
    gauge("singular", "Singular value", singular, ({ margins }) => [margins?.smallest_singular_value ?? null]),
  ];
  // Other arms have a rotation in place of a pitch.
  if (arm.freedoms !== 5) return gauges;
  const pitch = { low: -180, high: 180, origin: 0, unit: "°, + is down", text: one };
  return [...gauges, gauge("pitch", "Tool pitch", pitch, (state) => [(state.pitch ?? 0) * DEGREES])];
}

/** The greatest force of a finger, and what is held. @param {NonNullable<Api.State["touch"]>} touch */
const grip = ({ force_limit: high }) =>
  gauge("touch", "Grip force", { low: 0, high, unit: "N", text: one }, ({ touch, held }) => {
    const forces = touch?.fingers.map(({ force }) => force) ?? [];
    return [Math.max(0, ...forces), held === null ? "empty hand" : `holds ${spoken(held)}`];
  });

/** @param {Api.Arm} arm @param {Fingers | null} gripper @param {Plotted["history"]} history @param {Plotted["groups"]} groups @param {Plotted["view"]} view @returns {Instrument[]} */
function plots(arm, gripper, history, groups, view) {
  /**
   * @param {string} id @param {string} title @param {string} group @param {number} least @param {number} decimals
   * @param {boolean} shown @returns {Instrument}
   */
  const plot = (id, title, group, least, decimals, shown) => {
    const made = new Plot({ title, history, channels: groups[group], view, least, decimals });
    return { id, title, size: "broad", shown, element: made.element, draw: () => made.draw(), plot: made };
  };
  const unit = [...new Set(readings(arm).map(({ mark }) => mark.trim()))].join(", ");
  const joints = [
    plot("joint-angles", `${arm.joints_only ? "Joint values" : "Joint angles"} [${unit}]`, "angles", 2, 1, true),
    plot("joint-speeds", `Joint speeds [${unit}/s]`, "speeds", 2, 1, true),
    plot("tracking", `Tracking error [${unit}]`, "errors", 0.01, 3, true),
  ];
  if (arm.joints_only) return joints;
  return [
    ...joints.slice(0, 2),
    plot("tool-point", "Tool point in {S} [mm]", "tool", 2, 1, true),
    plot("joint-loads", "Weight on the joints [N m]", "loads", 1, 2, true),
    ...joints.slice(2),
    ...(gripper ? [plot("gripper-opening", "Gripper [%]", "gripper", 2, 1, false)] : []),
    ...(groups.forces.length ? [plot("grip-forces", "Forces of the fingers [N]", "forces", 1, 2, false)] : []),
    plot("clearances", "Clearance [mm]", "clearance", 2, 1, false),
    plot("tool-speeds", "Tool speed [mm/s]", "speed", 2, 1, false),
  ];
}
