// Hold to move: keys, pads, gamepad and SpaceMouse, added up to five rates, six with a yaw, or seven with the elbow. An input that is released,
// unplugged or in a hidden tab counts as zero, and without new messages the arm comes to rest.
import { byId, first, write } from "./dom.js";
import { clamp } from "./instruments/shape.js";
import { messageOf } from "./server.js";

/** @typedef {"plane" | "lift"} Pad */
const EVERY = 40; // ms
const LINEAR = 0.25; // m/s at full deflection
const ANGULAR = 1.2; // rad/s
const DEAD = 0.12; // fraction of a stick's travel that counts as zero
const MOUSE_FULL = 350; // value of a SpaceMouse at full deflection
const MOUSE_FRESH = 150; // ms for which a report is valid; it reports all the time while held
const MOUSE_RESTS = 1000; // ms without a report after which it is at rest
/** x, y, z, pitch, roll, yaw, elbow @type {import("./jog/steps.js").Moves} */
const KEYS = {
  KeyW: [0, 1], KeyS: [0, -1], KeyA: [1, 1], KeyD: [1, -1], KeyR: [2, 1], KeyF: [2, -1],
  KeyI: [3, 1], KeyK: [3, -1], KeyJ: [4, -1], KeyL: [4, 1],
  KeyQ: [5, 1], KeyE: [5, -1], KeyG: [6, -1], KeyH: [6, 1],
};

const none = () => [0, 0, 0, 0, 0, 0, 0];
/** @returns {NodeListOf<HTMLButtonElement>} */
const holdButtons = () => document.querySelectorAll("[data-hold]");
/** Codes of the keys that are held, and of those whose buttons are held. @type {Set<string>} */
const keys = new Set();
/** @type {Record<Pad, number[]>} */
const pads = { plane: none(), lift: none() };
let mouse = { rates: none(), at: -Infinity };
// Whether gamepad and SpaceMouse have to return to rest before they count.
const parked = { pad: true, mouse: false };
let open = false;
/** @type {import("./jog/steps.js").Steps | null} */
let steps = null; // steps and gripper, loaded when the sheet is first opened
let loading = false;
let moving = false;
/** @type {Page.Say} */
let say = () => {};
let stop = () => {};

export function quiet() {
  keys.clear();
  for (const pad of /** @type {const} */ (["plane", "lift"])) centre(byId(pad), pads[pad]);
  parked.pad = true;
  parked.mouse ||= mouse.rates.some(Boolean);
  mark();
}

/** @param {string} code */
export function release(code) {
  if (!keys.delete(code)) return;
  mark();
  sendJog();
}

// Mark the keys and buttons that are held.
function mark() {
  for (const kbd of document.querySelectorAll("#jog kbd"))
    kbd.classList.toggle("on", keys.has(`Key${kbd.textContent}`));
  for (const button of holdButtons())
    button.classList.toggle("on", keys.has(button.dataset.hold ?? ""));
}

/** Return whether the key moves the arm or its gripper and was handled. @param {KeyboardEvent} event */
export function key(event) {
  if (!open) return false;
  if (event.ctrlKey || event.metaKey || event.altKey) return quiet(), false;
  if (steps?.key(event, KEYS)) return true;
  if (!(event.code in KEYS)) return false;
  // What was held at a STOP counts again only after it was released.
  if (event.type === "keydown" && !event.repeat) keys.add(event.code);
  mark();
  sendJog();
  return true;
}

/** @param {HTMLElement} pad @param {number[]} rates */
function centre(pad, rates) {
  rates.fill(0);
  pad.classList.remove("held");
  first("i", HTMLElement, pad).style.translate = "";
}

// `place` sets the rates for a press so far to the right and down, and returns where the knob of the pad is shown.
/** @param {HTMLElement} pad @param {number[]} rates @param {(rates: number[], right: number, down: number) => Page.Pixel} place */
function listen(pad, rates, place) {
  const knob = first("i", HTMLElement, pad);
  /** @param {PointerEvent} event */
  const drag = (event) => {
    const { left, top, width, height } = pad.getBoundingClientRect();
    const right = clamp((2 * (event.clientX - left)) / width - 1, -1, 1);
    const down = clamp((2 * (event.clientY - top)) / height - 1, -1, 1);
    const [shownRight, shownDown] = place(rates, right, down);
    knob.style.translate =
      `${(shownRight * (width - 38)) / 2}px ${(shownDown * (height - 38)) / 2}px`;
    sendJog();
  };
  pad.addEventListener("pointerdown", (event) => {
    if (event.button) return;
    event.preventDefault();
    pad.setPointerCapture(event.pointerId);
    pad.classList.add("held");
    drag(event);
  });
  pad.addEventListener("pointermove", (event) => pad.classList.contains("held") && drag(event));
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"])
    pad.addEventListener(end, () => {
      centre(pad, rates);
      sendJog();
    });
}

/** @param {number} value */
function bent(value) {
  const size = Math.abs(value);
  return size < DEAD ? 0 : (Math.sign(value) * (size - DEAD)) / (1 - DEAD);
}

let stopHeld = false;
function gamepad() {
  const device = [...(navigator.getGamepads?.() ?? [])].find((candidate) => candidate?.connected);
  write(byId("gamepad"), device ? "Gamepad: hold LB or RB" : "No gamepad");
  if (!device) return none();
  /** @param {number} number */
  const pressed = (number) => device.buttons[number]?.pressed ?? false;
  if (pressed(1) && !stopHeld) stop();
  stopHeld = pressed(1);
  const held = pressed(4) || pressed(5);
  if (!held) parked.pad = false;
  const counts = open && held && !parked.pad;
  steps?.grip(counts && pressed(3), counts && pressed(0));
  if (!counts) return none();
  const [x = 0, y = 0, u = 0, v = 0] = device.axes;
  return [-bent(y), -bent(x), -bent(v), Number(pressed(12)) - Number(pressed(13)), bent(u),
    Number(pressed(14)) - Number(pressed(15)), Number(pressed(7)) - Number(pressed(6))];
}

/** @param {HidReport} message */
function report({ reportId, data }) {
  /** @param {number} offset */
  const number = (offset) => (data.byteLength >= offset + 2 ? data.getInt16(offset, true) / MOUSE_FULL : 0);
  const age = performance.now() - mouse.at;
  const rates = age > MOUSE_FRESH ? none() : mouse.rates;
  if (reportId === 1) {
    // The axes of the device: x to the right, y towards the person, z down.
    [rates[0], rates[1], rates[2]] = [-number(2), -number(0), -number(4)].map(bent);
    if (data.byteLength >= 12)
      [rates[3], rates[4], rates[5]] = [-number(6), -number(8), -number(10)].map(bent);
  } else if (reportId === 2)
    [rates[3], rates[4], rates[5]] = [-number(0), -number(2), -number(4)].map(bent);
  else if (reportId === 3) {
    if (data.getUint8(0) & 1) stop();
    return;
  } else return;
  mouse = { rates, at: performance.now() };
  if (age > MOUSE_RESTS || !rates.some(Boolean)) parked.mouse = false;
  sendJog();
}

async function connect() {
  const filters = [{ vendorId: 0x256f }, { vendorId: 0x046d, usagePage: 1, usage: 8 }];
  for (const device of (await navigator.hid?.requestDevice({ filters })) ?? []) await adopt(device);
}

/** @param {HidDevice} device */
async function adopt(device) {
  if (!device.opened) await device.open();
  device.addEventListener("inputreport", (event) => report(/** @type {HidReport} */ (event)));
  byId("spacemouse").textContent = device.productName || "SpaceMouse";
}

function rates() {
  // Its button for STOP counts also with the sheet closed.
  const pad = gamepad();
  if (!open || steps?.on) return none();
  const sum = none();
  /** @param {number[]} other */
  const add = (other) => other.forEach((value, i) => (sum[i] += value));
  for (const code of keys) sum[KEYS[code][0]] += KEYS[code][1];
  Object.values(pads).forEach(add);
  add(pad);
  if (!parked.mouse && performance.now() - mouse.at < MOUSE_FRESH) add(mouse.rates);
  // A yaw or an elbow that the arm does not have must not end its motion by a jog of zero rates.
  for (const axis of [5, 6]) if (!steps?.moves(axis)) sum[axis] = 0;
  // The elbow moves while the tool rests.
  if (sum.slice(0, 6).some(Boolean)) sum[6] = 0;
  return sum.map((value, i) => clamp(value, -1, 1) * (i < 3 ? LINEAR : ANGULAR));
}

let sentAt = 0;
function sendJog() {
  const now = rates();
  const moves = now.some((value) => value !== 0);
  if (!moves && !moving) return;
  if (moves && moving && performance.now() - sentAt < EVERY / 2) return;
  moving = moves;
  sentAt = performance.now();
  const frame = first("[name=frame]:checked", HTMLInputElement);
  const [x, y, z, pitch, roll, yaw, elbow] = now;
  // With six freedoms a turn about each axis of the frame.
  const sent = steps?.freedoms === 6 ? [x, y, z, roll, pitch, yaw] : [x, y, z, pitch, roll];
  if (elbow) sent.push(elbow);
  say({ do: "jog", rates: sent, frame: frame.value === "tool" ? "tool" : "base" });
}

/** @param {{ say: Page.Say, stop: () => void }} options */
export function begin(options) {
  ({ say, stop } = options);
  listen(byId("plane"), pads.plane, (rates, right, down) => {
    [rates[0], rates[1]] = [-bent(down), -bent(right)];
    return [right, down];
  });
  listen(byId("lift"), pads.lift, (rates, _, down) => {
    rates[2] = -bent(down);
    return [0, down];
  });
  for (const button of holdButtons()) {
    const { hold = "" } = button.dataset;
    button.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      button.setPointerCapture(event.pointerId);
      keys.add(hold);
      mark();
      sendJog();
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"])
      button.addEventListener(end, () => release(hold));
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }
  if (navigator.hid) {
    byId("spacemouse").hidden = false;
    byId("spacemouse").addEventListener("click", () => connect().catch(() => {}));
    navigator.hid.getDevices().then((known) => known.forEach(adopt)).catch(() => {});
  }
  document.addEventListener("visibilitychange", () => document.hidden && quiet());
  byId("jog").addEventListener("change", quiet);
  setInterval(sendJog, EVERY);
}

/** Open or close the sheet. @param {boolean} shown */
export function show(shown) {
  open = shown;
  if (shown) load();
  quiet();
  sendJog();
}

// Without an answer the sheet works as before, and the next opening tries again.
async function load() {
  if (steps || loading) return;
  loading = true;
  try {
    const { Steps } = await import("./jog/steps.js");
    steps = await Steps.in(byId("jog"), say);
    for (const button of holdButtons()) button.hidden = !steps.moves(KEYS[button.dataset.hold ?? ""][0]);
  } catch (error) {
    console.warn(`No steps in the Jog sheet: ${messageOf(error)}`);
  }
  loading = false;
}
