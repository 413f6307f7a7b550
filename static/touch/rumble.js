// What the gripper feels, as vibration of gamepads and of the phone. Loaded when a person turns it on.

/** @typedef {{ duration: number, weak: number, strong: number }} Pulse */
const NEAR = 0.012; // m of clearance from which a moving arm is near a contact
const MIN_CLEARANCE = 0.005; // m at which it stops
const NEAR_LIMIT = 0.05; // rad from a joint limit
const FAINT = 0.1; // strength below which nothing is felt
const AGAIN = 200; // ms between two pulses of what lasts
const TICK = { duration: 30, strong: 0 }; // a contact or a limit is near
const TOUCH = { duration: 60, weak: 0.6, strong: 0 }; // a finger touches
const SLIP = { duration: 400, weak: 1, strong: 1 };
const SQUEEZE = 140; // ms for which a new force is felt
const STEP = 0.04; // fraction of the greatest force that is felt

export class Rumble {
  /** @type {Api.State | null} */
  #last = null;
  #force = 0; // fraction of the greatest force that was felt last
  #pulsed = -Infinity;

  /** Take a state, and play what is new in it on all devices. @param {Api.State} state */
  take(state, now = performance.now()) {
    const force = strength(state);
    // Small steps of a force add up until they are felt.
    if (!this.#last || force < this.#force) this.#force = force;
    const pulse = this.#last && felt(this.#last, state, this.#force);
    this.#last = state;
    if (!pulse || (pulse.duration === TICK.duration && now - this.#pulsed < AGAIN)) return;
    [this.#force, this.#pulsed] = [force, now];
    play(pulse);
  }
}

// Return the pulse {duration, weak, strong} between two states; null if nothing is felt. The weak motor
// tells of contacts and limits, the strong one of a grip whose force was `old` when it was felt last.
/** @param {Api.State} before @param {Api.State} state @param {number} old @returns {Pulse | null} */
function felt(before, state, old) {
  /** @param {Api.State} state @param {string} reason */
  const has = ({ findings }, reason) => findings.some((finding) => finding.reason === reason);
  if (["sliding", "slipped"].some((reason) => has(state, reason) && !has(before, reason))) return SLIP;
  const force = strength(state);
  if (force > old + STEP) return { duration: SQUEEZE, weak: 0.2, strong: Math.min(1, 0.2 + 0.8 * force) };
  if (state.touching.length > before.touching.length) return TOUCH;
  const weak = nearness(state);
  return weak > FAINT ? { ...TICK, weak } : null;
}

/** Return the force of the grip as a fraction of the greatest one. @param {Api.State} state */
function strength({ touch }) {
  return touch ? Math.max(...touch.fingers.map(({ force }) => force)) / touch.force_limit : 0;
}

/** Return how near a contact or a joint limit is, from 0 to 1, while the arm moves or is blocked by it. @param {Api.State} state */
function nearness({ moving, findings, margins }) {
  if (findings.some(({ reason }) => reason === "contact")) return 1;
  if (!moving || !margins) return 0;
  const contact = margins.clearance === null ? 0 : (NEAR - margins.clearance) / (NEAR - MIN_CLEARANCE);
  return Math.min(1, Math.max(0, contact, 1 - margins.limit / NEAR_LIMIT));
}

/** @param {Pulse} pulse */
function play({ duration, weak, strong }) {
  /** @type {(Page.VibratingGamepad | null)[]} */
  const pads = navigator.getGamepads?.() ?? [];
  for (const pad of pads) {
    if (!pad?.connected) continue;
    const effect = { duration, weakMagnitude: weak, strongMagnitude: strong };
    // An unplugged gamepad rejects the effect.
    if (pad.vibrationActuator) pad.vibrationActuator.playEffect("dual-rumble", effect).catch(() => {});
    else pad.hapticActuators?.[0]?.pulse(Math.max(weak, strong), duration);
  }
  navigator.vibrate?.(Math.ceil(duration * Math.max(weak, strong)));
}
