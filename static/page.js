// The bar: STOP, who drives, what the arm does, how good the line is.
"use strict";
(() => {
  const STALE = 1.0; // s after which a picture must not pass for the present
  const SLOW = 150; // ms of a round trip
  const QUIET = 1000; // ms without a word after which the line counts as bad
  const ANSWER = 250; // ms that a STOP may take before it is sent another way too
  const TOAST = 4000; // ms
  const NOT_YOU = 4401;
  const QUIETLY = "quietly"; // the id of what is asked again until it is had
  const OPEN = "katana450.instruments.open";
  const ORDERS = { pause: "Pause", resume: "Resume", end: "End" };

  /** @type {(id: string) => any} */
  const byId = (id) => document.getElementById(id);
  const [body, stopButton, scene] = [document.body, byId("stop"), byId("scene")];
  /** @type {HTMLInputElement} */
  const speedInput = document.querySelector("#speed input");
  /** @type {HTMLOutputElement} */
  const speedOutput = document.querySelector("#speed output");
  const page = name();
  const worker = new Worker("static/link.js");
  const say = (message) => worker.postMessage({ say: message });
  let status = null;
  let up = false;
  let since = performance.now(); // when the line was last lost
  let silent = 0;
  let trip = null;
  let asking = null;
  let press = null;

  // A page that is loaded anew is the same page; a second tab is another.
  function name() {
    /** @type {any[]} */
    const [entry] = performance.getEntriesByType("navigation");
    const again = entry?.type === "reload";
    const old = again && sessionStorage.getItem("page");
    const fresh = unheardOf();
    sessionStorage.setItem("page", old || fresh);
    return old || fresh;
  }

  function unheardOf() {
    const bytes = crypto.getRandomValues(new Uint8Array(16));
    return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
  }

  // STOP

  // A press is told until it is heard, and counts once: on a thin line the last telling may come
  // after the stop was cleared.
  function stop() {
    press = unheardOf();
    say({ do: "stop", press });
    Jog.quiet();
    stopButton.classList.add("asked");
    clearTimeout(asking);
    asking = setTimeout(insist, ANSWER);
  }

  function insist() {
    fetch(`stop?press=${press}&page=${page}`, { method: "POST", keepalive: true }).then(
      ({ ok }) => ok && stopped(),
      () => {},
    );
    asking = setTimeout(insist, 2 * ANSWER);
  }

  function stopped() {
    clearTimeout(asking);
    asking = null;
    draw();
  }

  // At once, not when the finger is lifted; a click without a pointer is the Enter key.
  stopButton.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    stop();
  });
  stopButton.addEventListener("click", (event) => event.detail === 0 && stop());

  // In both documents. Space and Esc do nothing but stop, wherever the focus is.
  function key(event) {
    const ends = event.key === " " || event.key === "Escape";
    if (ends && event.type === "keydown" && !event.repeat) stop();
    if (ends) {
      if (byId("help").open && event.key === "Escape" && event.type === "keydown") byId("help").close();
    } else if (typing(event.target) || !Jog.key(event)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
  }

  function typing(target) {
    return target?.matches?.("input:not([type=range], [type=radio], [type=checkbox]), textarea, select");
  }

  function blur() {
    // The focus may only have gone from one of the two documents to the other.
    setTimeout(() => document.hasFocus() || Jog.quiet());
  }

  for (const kind of ["keydown", "keyup"]) window.addEventListener(kind, key, { capture: true });
  window.addEventListener("blur", blur);
  window.katana = { key, blur, toast };

  // What is shown

  const text = (id, words) => {
    const element = byId(id);
    if (element.textContent !== words) element.textContent = words;
  };

  function act(label, request, main) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = label;
    button.classList.toggle("main", Boolean(main));
    button.addEventListener("click", () => say(request));
    return button;
  }

  function acts() {
    const { mine, holder, role, asked, asking: wanting, others } = status;
    if (role === "viewer") return [];
    // Only who drives is shown requests: in person, or by a program, which ends when the arm is given away.
    const whom = (name) => (wanting.length > 1 ? ` ${name}` : "");
    const buttons = wanting.flatMap(({ number, name }) => [
      act(mine ? `Give to ${name}` : `Allow${whom(name)}`, { do: "give", to: number }, true),
      act(`Refuse${whom(name)}`, { do: "decline", to: number }),
    ]);
    if (mine) {
      const more = others.filter(({ number }) => !wanting.some((each) => each.number === number));
      if (more.length) buttons.push(handOver(more));
      return [...buttons, act("Let go", { do: "release_lease" })];
    }
    if (holder === null) return [act("Take", { do: "acquire" }, true)];
    if (wanting.length) return buttons;
    const free = [asked ? act("Ask no more", { do: "withdraw" }) : act("Request", { do: "ask" }, true)];
    if (role === "admin") free.push(act("Take over", { do: "take" }));
    return free;
  }

  function handOver(others) {
    const list = document.createElement("select");
    list.setAttribute("aria-label", "Hand over to");
    list.add(new Option("Hand over to …", ""));
    for (const { number, name } of others) list.add(new Option(name, number));
    list.addEventListener("change", () => list.value && say({ do: "give", to: Number(list.value) }));
    return list;
  }

  let [drawnActs, drawnOrders] = ["", ""];
  function draw() {
    if (!status) return;
    body.dataset.mood = status.mood;
    text("headline", status.headline);
    text("why", [status.taken, status.why, status.stopped, status.until].filter(Boolean).join(" "));
    // A press is done once the arm itself has shown that it is stopped.
    stopButton.classList.toggle("asked", asking !== null || status.stop === "requested");
    byId("objects-button").hidden = status.role === "viewer";
    byId("clear-stop").hidden = !status.stopped || !status.may_clear_stop;
    const { mine, holder, windows, asking: wanting } = status;
    const wants = wanting.length ? `${wanting.map(({ name }) => name).join(", ")} asks for it` : "";
    text("holder", mine ? "You drive" : holder === null ? "Nobody drives" : `${holder} drives`);
    // Programs count too.
    const connected = windows > 1 ? `, ${windows} connected` : "";
    text("name", wants || `${status.name}${status.role === "viewer" ? ", watching" : ""}${connected}`);
    const key = JSON.stringify([mine, holder, status.asked, wanting, status.others]);
    if (key !== drawnActs) {
      drawnActs = key;
      byId("acts").replaceChildren(...acts());
    }
    const orders = [status.planning, ...status.orders].join();
    if (orders !== drawnOrders) {
      drawnOrders = orders;
      const label = (order) => (order === "end" && status.planning ? "Cancel" : ORDERS[order]);
      const made = (order) => act(label(order), { do: "steer", order }, order !== "end");
      byId("orders").replaceChildren(...status.orders.map(made));
    }
    const percent = String(Math.round(100 * status.speed));
    if (document.activeElement !== speedInput) speedInput.value = percent;
    speedOutput.value = `${percent} %`;
  }

  // What the arm does now cannot be told from here.
  function unknown() {
    if (!status) return;
    body.dataset.mood = "starting";
    text("headline", "Out of touch");
    text("why", "");
  }

  function drawLink() {
    const age = up ? Math.max(status?.age ?? 0, silent / 1000 - 0.2) : (performance.now() - since) / 1000;
    const lost = !up;
    const bad = !lost && (silent > QUIET || age >= STALE);
    const line = byId("link");
    line.className = lost ? "lost" : bad || age >= 0.4 || trip > SLOW ? "slow" : "";
    const old = age >= 0.3 ? `, ${age.toFixed(1)} s old` : "";
    line.lastElementChild.textContent = lost ? "No line" : trip === null ? "" : `${Math.round(trip)} ms${old}`;
    body.classList.toggle("stale", lost || bad);
    const banner = byId("banner");
    banner.hidden = !(lost || bad) || (lost && !status);
    banner.className = lost ? "lost" : "";
    const words = lost
      ? asking !== null
        ? "No line to the arm: your STOP goes out as soon as it is back."
        : "No line to the arm: what you see is old. Trying to get it back."
      : silent > QUIET
        ? "Nothing heard from the arm: what you see is old."
        : trip > SLOW
          ? "The line is slow: what you see is old."
          : "The line is quick, but what you see is old: this device may draw too slowly.";
    if (!banner.hidden && banner.textContent !== words) banner.textContent = words;
  }

  let toastTimer = null;
  function toast(words) {
    text("toast", words);
    byId("toast").classList.add("shown");
    clearTimeout(toastTimer);
    toastTimer = setTimeout(() => byId("toast").classList.remove("shown"), TOAST);
  }

  worker.onmessage = ({ data }) => {
    panel?.hear(data);
    if (data.link === "up") [up, silent] = [true, 0];
    else if (data.link === "down") {
      if (up) since = performance.now();
      up = false;
      trip = null;
      unknown();
      Jog.quiet();
      if (data.code === NOT_YOU) enter().catch(() => {});
    } else if (data.trip !== undefined) trip = trip === null ? data.trip : 0.8 * trip + 0.2 * data.trip;
    else if (data.silent !== undefined) silent = data.silent;
    else if (data.unsaid === "stop") insist();
    else if (data.heard?.is === "stopped") stopped();
    else if (data.heard?.is === "refused" && data.heard.id !== QUIETLY) toast(data.heard.why);
    else if (data.heard?.is === "status") {
      // Only what is new of it.
      status = { ...status, ...data.heard };
      draw();
    }
    drawLink();
  };
  setInterval(drawLink, 200);

  // The rest of the bar

  byId("clear-stop").addEventListener("click", () => say({ do: "clear_stop" }));
  // Below the bar and not modal: STOP must be there for a mouse and a finger too.
  const [help, helpButton] = [byId("help"), byId("help-button")];
  helpButton.addEventListener("click", () => {
    if (help.open) return help.close();
    help.show();
    helpButton.setAttribute("aria-expanded", "true");
  });
  help.addEventListener("close", () => helpButton.setAttribute("aria-expanded", "false"));
  function show(id, shown) {
    byId(id).hidden = !shown;
    byId(`${id}-button`).setAttribute("aria-expanded", String(shown));
    if (id === "jog") Jog.show(shown);
  }
  // Both lie in the same corner.
  for (const [id, other] of [["jog", "objects"], ["objects", "jog"]])
    byId(`${id}-button`).addEventListener("click", () => {
      show(other, false);
      show(id, byId(id).hidden);
    });
  speedInput.addEventListener("input", () => {
    speedOutput.value = `${speedInput.value} %`;
    say({ do: "speed", value: Number(speedInput.value) / 100 });
  });
  Jog.begin({ say, stop });
  Objects.begin({ say });

  // The instruments, which come when they are first wanted.

  const kept = storage();
  let panel = null;

  // A browser may refuse to keep anything.
  function storage() {
    try {
      return window.localStorage;
    } catch {
      return null;
    }
  }

  async function showInstruments(shown) {
    const button = byId("instruments-button");
    button.setAttribute("aria-expanded", String(shown));
    kept?.setItem(OPEN, shown ? "yes" : "no");
    if (shown && !panel) {
      const { Panel } = await import("./instruments/panel.js");
      const watch = (hz) => worker.postMessage({ watch: hz });
      panel = new Panel(byId("instruments"), { say, watch, kept, quietly: QUIETLY });
    }
    panel?.show(button.getAttribute("aria-expanded") === "true");
  }
  byId("instruments-button").addEventListener("click", () =>
    showInstruments(byId("instruments-button").getAttribute("aria-expanded") !== "true"),
  );

  // Coming in

  // A link carries its token behind the #, which browsers send to nobody; it goes by POST, once.
  async function enter() {
    const token = location.hash.slice(1);
    if (token) history.replaceState(null, "", location.pathname + location.search);
    const answer = await fetch("enter", { method: "POST", body: JSON.stringify({ token }) });
    byId("gate").hidden = answer.ok;
    if (token && !answer.ok) byId("gate-why").textContent = await answer.text();
    return answer.ok;
  }

  enter().then((mayEnter) => {
    if (!mayEnter) return;
    // Nothing else of the address: viser's page obeys some of its parameters to the server's harm.
    const query = [...new URLSearchParams(location.search)].filter(([key]) => Viser.PARAMETER.test(key));
    scene.src = `viser/?${new URLSearchParams([["page", page], ...query])}`;
    const { protocol, host } = location;
    worker.postMessage({ open: `${protocol.replace("http", "ws")}//${host}/control?page=${page}` });
    if (kept?.getItem(OPEN) === "yes") showInstruments(true);
  });
})();
