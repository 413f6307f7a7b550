// Number boxes of viser's panel. viser sends each keystroke, so the arm would move to 5, 50 and 500.
// Here typed text is a draft, which viser gets on Enter or when the box is left.
"use strict";
const Fields = (() => {
  const UNFINISHED = /^-?\.?$/;
  const STEPS = { ArrowUp: 1, ArrowDown: -1 };

  const controls = new Map(); // the range and step of each control, by its id
  let box = null; // the box that has the focus
  let sending = false;
  /** @type {(words: string) => void} */
  let tell = () => {};

  const isBox = (target) => target instanceof Element && target.matches(Viser.NUMBER_BOX);
  const stopped = () => window.parent.document.body.dataset.mood === "stopped";

  const changed = (field) => field.value !== Viser.shownIn(field);

  // Return the draft of a box with a point for the comma of a number, such as 12,5.
  const draft = (field) => field.value.trim().replace(/^([-+]?\d*),(\d*)$/, "$1.$2");

  function range(field) {
    const { id, label, index } = Viser.controlOf(field);
    const { min = null, max = null, step = 1 } = controls.get(id) ?? {};
    const [low, high] = [min, max].map((end) => (Array.isArray(end) ? end[index] : end));
    return { label, low: low ?? -Infinity, high: high ?? Infinity, step };
  }

  // Return why the draft cannot be sent; empty if it can.
  function objection(field) {
    const { low, high } = range(field);
    const value = draft(field) === "" ? NaN : Number(draft(field));
    if (!Number.isFinite(value)) return "is not a number";
    return value < low || value > high ? `is not between ${low} and ${high}` : "";
  }

  function mark(field, invalid) {
    if (invalid) field.setAttribute("aria-invalid", "true");
    else field.removeAttribute("aria-invalid");
  }

  function restore(field) {
    field.value = Viser.shownIn(field);
    mark(field, false);
  }

  function commit(field) {
    if (!changed(field)) return mark(field, false);
    const why = objection(field);
    mark(field, why);
    if (why) return tell(`${range(field).label}: ${field.value || "nothing"} ${why}. It was not sent.`);
    sending = true;
    Viser.type(field, draft(field));
    sending = false;
  }

  function leave(field) {
    box = null;
    // A value typed before a stop must not be sent after Clear stop, which was clicked to leave the box.
    if (!stopped()) commit(field);
    if (stopped() || field.getAttribute("aria-invalid")) restore(field);
  }

  function step(field, sign) {
    const { low, high, step } = range(field);
    const from = Number(objection(field) ? Viser.shownIn(field) : draft(field));
    const decimals = Math.max(...[from, step].map((x) => String(x).split(".")[1]?.length ?? 0));
    const next = Math.min(high, Math.max(low, from + sign * step));
    Viser.fill(field, String(Number(next.toFixed(decimals))));
    mark(field, false);
  }

  const on = (kind, listen) => window.addEventListener(kind, listen, { capture: true });

  on("input", (event) => {
    if (sending || !isBox(event.target)) return;
    event.stopImmediatePropagation();
    mark(event.target, !UNFINISHED.test(draft(event.target)) && objection(event.target));
  });
  on("change", (event) => {
    if (!isBox(event.target)) return;
    event.stopImmediatePropagation();
    // Assistive technology can set a value without the focus.
    if (event.target !== box) commit(event.target);
  });
  on("focusin", ({ target }) => isBox(target) && (box = target));
  // When the window loses the focus, the box keeps it, and the draft remains.
  on("focusout", ({ target }) => isBox(target) && document.activeElement !== target && leave(target));
  // The buttons beside the box start from the typed value. A click in the scene does not move the focus.
  on("pointerdown", ({ target }) => box && target !== box && !stopped() && commit(box));
  on("keydown", (event) => {
    if (!isBox(event.target)) return;
    if (event.key === "Enter") commit(event.target);
    // Both keys also stop the arm.
    else if (event.key === "Escape" || event.key === " ") restore(event.target);
    else if (event.key in STEPS) {
      event.preventDefault();
      event.stopImmediatePropagation();
      step(event.target, STEPS[event.key]);
    }
  });

  // A draft of before a stop, or of before its end, must not be sent by a later click, also where another person clears it.
  function heed() {
    let before = stopped();
    new MutationObserver(() => {
      if (stopped() === before) return;
      before = !before;
      if (box) restore(box);
    }).observe(window.parent.document.body, { attributeFilter: ["data-mood"] });
  }

  return {
    // Store the ranges and steps of the controls from messages of the server.
    hear: (messages) => Viser.keepControls(controls, messages),
    // `say` shows a sentence to the person.
    begin(say) {
      tell = say;
      if (window.parent !== window) heed();
    },
  };
})();
