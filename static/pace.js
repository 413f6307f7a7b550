// Pause or Resume, and Speed: one set of controls in the bar for whatever moves, hand or program.
"use strict";
const Pace = (() => {
  // ms for which the slider keeps a value that the person has just set, and a press meant the order before
  const FRESH = 500;
  /** @type {(id: string) => any} */
  const byId = (id) => document.getElementById(id);
  /** @type {HTMLInputElement} */
  const speed = document.querySelector("#speed input");
  /** @type {HTMLOutputElement} */
  const percent = document.querySelector("#speed output");
  const pause = byId("pause");
  let refusal = "";
  let order = "pause";
  let turned = -FRESH; // time at which the order became another
  let own = false; // whether the order goes to a program of this window
  let set = -FRESH; // time of the last change by the person

  const shown = (value) => {
    percent.value = `${value} %`;
    speed.value = String(value);
    speed.setAttribute("aria-valuetext", percent.value);
  };

  function begin({ say, toast }) {
    pause.addEventListener("click", () => {
      if (refusal) toast(refusal);
      // The second click of two, or one that was meant to pause.
      else if (order === "resume" && performance.now() - turned < FRESH) return;
      else say(own ? { do: "steer", order } : { do: order });
    });
    speed.addEventListener("input", () => {
      set = performance.now();
      shown(speed.value);
      say({ do: "speed", value: Number(speed.value) / 100 });
    });
    // A disabled slider says why.
    byId("speed").addEventListener("pointerdown", () => speed.disabled && toast(refusal));
  }

  // Show `status`; null without a connection.
  function draw(status) {
    refusal = status ? status.pace : "No connection to the arm.";
    const stopped = Boolean(status?.stopped);
    const next = status?.paused ? "resume" : "pause";
    if (next !== order) turned = performance.now();
    order = next;
    own = Boolean(status?.orders.includes("end"));
    const label = order === "resume" ? "Resume" : "Pause";
    const held = refusal || (stopped ? "The arm is stopped: clear the stop first." : "");
    pause.lastElementChild.textContent = label;
    pause.setAttribute("aria-label", label);
    pause.dataset.order = order;
    pause.setAttribute("aria-disabled", String(Boolean(held)));
    pause.title = held;
    speed.disabled = Boolean(refusal);
    byId("speed").title = refusal;
    if (status && performance.now() - set > FRESH) shown(Math.round(100 * status.speed));
  }

  return { begin, draw };
})();
