// Pause or Resume, and Speed: one set of controls in the bar for whatever moves, hand or program.
"use strict";
const Pace = (() => {
  const FRESH = 500; // ms for which the slider keeps a value that the person has just set
  /** @type {(id: string) => any} */
  const byId = (id) => document.getElementById(id);
  /** @type {HTMLInputElement} */
  const speed = document.querySelector("#speed input");
  /** @type {HTMLOutputElement} */
  const percent = document.querySelector("#speed output");
  const pause = byId("pause");
  let refusal = "";
  let order = "pause";
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
    order = status?.paused ? "resume" : "pause";
    own = Boolean(status?.orders.length);
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
