// The bar: STOP, the driver, the status of the arm and the quality of the connection.
"use strict";
(() => {
  const STALE = 1.0; // s, age from which a picture is marked as old
  const NOTE_EVERY = 100; // ms, minimum between two notes that this page is used
  const SLOW = 150; // ms, round trip from which a connection counts as slow
  const QUIET = 300; // ms without a message after which the state is unknown
  const ANSWER = 500; // ms without an answer after which a STOP is repeated by HTTP
  const TOAST = 4000; // ms
  const SIGN_IN = 4401; // close code: the page has to sign in again
  const QUIETLY = "quietly"; // id of requests that are repeated and whose refusals are not shown
  const OPEN = "katana450.instruments.open";
  const WELCOMED = "katana450.welcome";
  const PAST = "katana450.timeline.open";
  const RUMBLE = "katana450.rumble";
  const RUMBLE_RATE = 20; // Hz
  const TRY_AFTER = 2000; // ms without a drawn scene after which the page checks whether it can be drawn
  const REST_AFTER = 100; // ms after the first frame in which the rest of the page waits
  const OFFLINE = "No connection to the arm.";
  const ROUND_TRIP = "Round trip to the arm, and the age of the picture";
  const REPEATED = ["heartbeat", "jog", "servo", "query", "list_people"]; // requests that are sent without a press
  const SIMULATION =
    "pauses after a quarter of a second, because it is simulated. A new command moves it. After five seconds it stops";
  const PRESSED = "button, a, input, select, textarea, summary, [role=button]"; // what Enter acts on by itself
  // What Space types into: text, but neither a number nor the search in a list, which keeps the focus after a choice.
  const TEXT = "textarea, input:is(:not([type]), [type=text]):not([readonly], [inputmode], [aria-haspopup])";

  /** @type {(id: string) => any} */
  const byId = (id) => document.getElementById(id);
  const [body, stopButton, scene] = [document.body, byId("stop"), byId("scene")];
  const page = name();
  const worker = new Worker("static/link.js");
  const say = (message) => {
    worker.postMessage({ say: message });
    // Only now: an error of the drawing must keep no request.
    timeline?.said(message);
  };
  // What viser's page offers; nothing before its scripts have run, or if it could not be loaded.
  const inner = () => scene.contentDocument && scene.contentWindow.katanaScene;
  let status = null;
  let up = false;
  let since = performance.now(); // time of the last loss of the connection
  let silent = 0;
  let trip = null;
  let asking = null;
  let press = null;
  let stopPort = null; // port of STOP alone
  let proven = null; // cause of a stop confirmed on another path
  let people = null;
  let timeline = null;
  let past = null; // what to do with the timeline when the scene is drawn

  // A reloaded page keeps its name; a second tab gets another. A browser may refuse to store it.
  function name() {
    /** @type {any[]} */
    const [entry] = performance.getEntriesByType("navigation");
    const again = entry?.type === "reload";
    const fresh = randomName();
    try {
      const old = again && sessionStorage.getItem("page");
      sessionStorage.setItem("page", old || fresh);
      return old || fresh;
    } catch {
      return fresh;
    }
  }

  function randomName() {
    const bytes = crypto.getRandomValues(new Uint8Array(16));
    return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
  }

  // STOP

  // A press is sent on all paths until one answers, and counts once.
  function stop() {
    press = randomName();
    say({ do: "stop", press, id: press });
    Jog.quiet();
    stopButton.classList.add("asked");
    insist();
    // Last: an error of the drawing must not keep the press from any path.
    timeline?.live();
  }

  function insist() {
    post("", press);
    if (stopPort) post(`//${location.hostname}:${stopPort}/`, press);
    clearTimeout(asking);
    asking = setTimeout(insist, ANSWER);
  }

  // The port of STOP answers with the stage.
  async function post(path, sent) {
    const url = `${path}stop?press=${sent}&page=${page}`;
    try {
      const answer = await fetch(url, { method: "POST", keepalive: true, credentials: "include" });
      if (sent !== press) return;
      if (!answer.ok) return;
      const found = answer.status === 204 ? {} : await answer.json();
      if (found.stop === "confirmed" && status?.stop !== "confirmed") proven = found.why;
      stopped();
    } catch {
      // Sent again.
    }
  }

  function stopped() {
    clearTimeout(asking);
    asking = null;
    draw();
    drawLink();
  }

  // Stop at the press, not at the release. A click without a pointer is the Enter key.
  stopButton.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    stop();
  });
  stopButton.addEventListener("click", (event) => event.detail === 0 && stop());

  // Called for keys in both documents. Space, except in a text, and Esc only stop the arm, whatever has the focus.
  function key(event) {
    const ends = (event.key === " " && !event.target?.matches?.(TEXT)) || event.key === "Escape";
    // Also in a text box, to which the focus may have moved.
    if (event.type === "keyup") Jog.release(event.code);
    if (ends && event.type === "keydown" && !event.repeat) stop();
    if (ends) {
      if (event.key === "Escape") for (const each of document.querySelectorAll("dialog")) each.close();
      if (event.key === "Escape") stage?.clear();
    } else if (event.key === "Enter" && event.repeat && event.target?.closest?.("button")) {
      // A key that stays pressed is one click.
    } else if (event.key === "Enter" && event.type === "keydown" && mayGo() && !event.target?.closest?.(PRESSED)) {
      if (!event.repeat) say({ do: "go" });
    } else if (event.key === "?" && event.type === "keydown" && !typing(event.target)) {
      if (!event.repeat) helpButton.click();
    } else if (typing(event.target) || !(Jog.key(event) || Edit.key(event) || episodes?.key(event))) return;
    event.preventDefault();
    event.stopImmediatePropagation();
  }

  // Whether this window may take the detour that the arm offers.
  function mayGo() {
    return up && status?.detour && status.role !== "viewer" && (status.mine || status.holder === null);
  }

  function typing(target) {
    return target?.matches?.("input:not([type=range], [type=radio], [type=checkbox]), textarea, select");
  }

  // A comma in a number is its point, in every language of the browser.
  window.addEventListener("beforeinput", (event) => {
    const { target, data } = event;
    if (!(target instanceof HTMLInputElement && target.type === "number" && data?.includes(","))) return;
    event.preventDefault();
    document.execCommand("insertText", false, data.replace(",", "."));
  });

  function blur() {
    // The focus may only have moved between the two documents.
    setTimeout(() => document.hasFocus() || Jog.quiet());
  }

  for (const kind of ["keydown", "keyup"]) window.addEventListener(kind, key, { capture: true });
  window.addEventListener("blur", blur);
  let canDraw = true;
  let seen = false;
  /** @type {(value?: any) => void} */
  let loadRest = () => {};
  // Resolved REST_AFTER after the first frame, or TRY_AFTER after the start without one: what can wait takes no
  // time from the drawing of the scene.
  const restMayLoad = new Promise((done) => (loadRest = done));
  const drawn = () => {
    if (!canDraw) return;
    seen = true;
    byId("poster").classList.add("done");
    if (past) showTimeline(true, past);
    past = null;
    requestAnimationFrame(() => setTimeout(loadRest, REST_AFTER));
    restMayLoad.then(takeHold);
  };
  setTimeout(tryDrawing, TRY_AFTER);
  // A second context for drawing takes time, so it is made only if nothing was drawn.
  function tryDrawing() {
    if (!seen) canDraw = document.createElement("canvas").getContext("webgl2") !== null;
    loadRest();
    if (canDraw) return;
    byId("poster").classList.add("failed");
    byId("poster").querySelector("p").textContent =
      "This browser cannot draw the scene: WebGL 2 is off or missing. Turn on hardware acceleration in its settings, or use another browser. STOP and Jog work without it.";
  }
  // A person uses viser's page, which may begin to drive.
  let noted = -Infinity;
  function used() {
    if (performance.now() - noted < NOTE_EVERY) return;
    noted = performance.now();
    worker.postMessage({ used: true });
  }
  const SHEETS = ["jog", "objects", "teach", "episodes"];
  const closeSheets = () => SHEETS.forEach((id) => byId(id)?.hidden === false && show(id, false));
  window.katana = { key, blur, toast, drawn, closeSheets, used, view: null, live: () => timeline?.live() };

  // A window that is closed frees the arm at once. A page that is reloaded returns before that matters.
  window.addEventListener("pagehide", () => navigator.sendBeacon(`leave?page=${page}`));

  // Display

  const time = (seconds, style) => new Date(1000 * seconds).toLocaleTimeString([], style);
  const text = (id, words) => {
    const element = byId(id);
    if (element.textContent !== words) element.textContent = words;
  };

  // The last words of a headline, its `end`, are never cut.
  function head(words, end = "") {
    const [name, kept] = byId("headline").children;
    const cut = [words.slice(0, words.length - end.length).trimEnd(), end];
    [name, kept].forEach((each, i) => each.textContent !== cut[i] && (each.textContent = cut[i]));
  }

  function act(label, request, main) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = button.title = label;
    button.classList.toggle("main", Boolean(main));
    button.addEventListener("click", () => say(request));
    return button;
  }

  function acts() {
    const { mine, holder, role, asked, asking: requests, others } = status;
    if (role === "viewer") return [];
    // Requests are shown only to the driver and to the owner of a driving program, which ends when the arm is given away.
    // They are answered one after the other.
    const [first] = requests;
    /** @type {HTMLElement[]} */
    const buttons = first
      ? [
          act(mine ? `Give to ${first.name}` : "Allow", { do: "give", to: first.number }, true),
          act("Refuse", { do: "decline", to: first.number }),
        ]
      : [];
    if (mine) {
      const more = others.filter(({ number }) => number !== first?.number);
      if (more.length) buttons.push(handOver(more));
      return [...buttons, act("Release", { do: "release_lease" })];
    }
    if (holder === null) return [act("Take", { do: "acquire" }, true)];
    if (requests.length) return buttons;
    const free = [];
    if (asked) free.push(act("Withdraw", { do: "withdraw" }));
    // Nobody asks a program of their own.
    else if (!status.own_program) free.push(act("Request", { do: "ask" }, true));
    if (role === "admin") free.push(act("Take over", { do: "take" }));
    return free;
  }

  function handOver(others) {
    const list = document.createElement("select");
    list.setAttribute("aria-label", "Give to");
    list.add(new Option("Give to …", ""));
    for (const { number, name } of others) list.add(new Option(name, number));
    // On a closed list, a key changes the choice at once; it is sent by Enter.
    let byKeys = false;
    const give = () => list.value && say({ do: "give", to: Number(list.value) });
    list.addEventListener("pointerdown", () => (byKeys = false));
    list.addEventListener("keydown", ({ key }) => {
      if (key === "Enter") give();
      byKeys = true;
    });
    list.addEventListener("change", () => byKeys || give());
    list.addEventListener("blur", () => (list.value = ""));
    return list;
  }

  // Replace the controls in `group`. The focus, and the choice of a list, stay with the same label.
  function keepingFocus(group, controls) {
    /** @type {any} */
    const old = document.activeElement;
    const label = (each) => each.getAttribute("aria-label") ?? each.textContent;
    const same = group.contains(old) && controls.find((each) => label(each) === label(old));
    if ([...(same?.options ?? [])].some(({ value }) => value === old.value)) same.value = old.value;
    group.replaceChildren(...controls);
    if (same) same.focus();
  }

  // Show whether there is a connection for the controls that need one. They keep the focus; a press says why nothing happens.
  function offer(possible) {
    body.classList.toggle("offline", !possible);
    for (const each of document.querySelectorAll("#acts :is(button, select), #orders button, #clear-stop"))
      possible ? each.removeAttribute("aria-disabled") : each.setAttribute("aria-disabled", "true");
  }

  let [drawnActs, drawnOrders] = ["", ""];
  function draw() {
    // A press is complete when the arm's state shows the stop.
    stopButton.classList.toggle("asked", !proven && (asking !== null || status?.stop === "requested"));
    if (!status) return;
    body.dataset.mood = proven ? "stopped" : status.mood;
    body.style.setProperty("--done", status.fraction);
    const since = status.paused_at ? time(status.paused_at, { timeStyle: "short" }) : "";
    if (proven) head("Stopped");
    else if (since) head(`${status.headline}, ${since}`, since);
    else head(status.headline, status.end);
    const at = status.stopped_at ? `${time(status.stopped_at)}:` : "";
    const cause = status.stopped ? [at, status.stopped] : [proven];
    text("why", named([status.taken, status.why, ...cause, status.until, status.cautions].filter(Boolean).join(" ")));
    byId("objects-button").hidden = status.role === "viewer";
    byId("teach-button").hidden = status.role === "viewer" || !status.scripts;
    const clear = byId("clear-stop");
    clear.hidden = !status.stopped || !status.may_clear_stop;
    clear.disabled = status.wait !== "";
    clear.title = status.wait;
    byId("go").hidden = !mayGo();
    const { mine, holder, participants, asking: requests } = status;
    const waiting = requests.length > 1 ? `, ${requests.length - 1} more` : "";
    const request = requests.length ? `${requests[0].name} asks for it${waiting}` : "";
    text("holder", mine ? "You drive" : holder === null ? "Nobody drives" : status.own_program ? "Your program drives" : `${holder} drives`);
    // Programs are included.
    const connected = participants > 1 ? `, ${participants} connected` : "";
    byId("people-help").hidden = status.role !== "admin";
    text("name", request || `${status.name}${status.role === "viewer" ? ", watching" : ""}${connected}`);
    byId("acts").classList.toggle("asked", requests.length > 0);
    const key = JSON.stringify([mine, holder, status.own_program, status.asked, requests, status.others]);
    if (key !== drawnActs) {
      drawnActs = key;
      keepingFocus(byId("acts"), acts());
    }
    const orders = [status.planning, ...status.orders, ...status.continues].join();
    if (orders !== drawnOrders) {
      drawnOrders = orders;
      const [name, step, steps] = status.continues;
      const words = { end: status.planning ? "Cancel" : "End", continue: `Continue ${name}` };
      const made = (order) => {
        const button = act(words[order], { do: "steer", order }, order === "continue");
        if (order === "continue") button.title = `Continue ${name} at step ${step} of ${steps}`;
        return button;
      };
      keepingFocus(byId("orders"), status.orders.map(made));
    }
    Pace.draw(up ? status : null);
    More.draw(status.name);
    const simulated = status.silence_profile === "simulation";
    text("on-silence", simulated ? SIMULATION : "stops after a quarter of a second");
    offer(up);
    if (!up) unknown();
  }

  // Without a connection the state of the arm is unknown, and its driver too.
  function unknown() {
    if (!status) return;
    body.dataset.mood = proven ? "stopped" : "starting";
    byId("go").hidden = true;
    offer(false);
    text("holder", "Driver unknown");
    Pace.draw(null);
    head(proven ? "Stopped" : "No connection");
    text("why", proven ?? "");
  }

  function drawLink() {
    const age = up ? Math.max(status?.age ?? 0, silent / 1000 - 0.2) : (performance.now() - since) / 1000;
    const lost = !up;
    const bad = !lost && (silent > QUIET || age >= STALE);
    const line = byId("link");
    line.className = lost ? "lost" : bad || age >= 0.4 || trip > SLOW ? "slow" : "";
    const old = age >= 0.3 ? `, ${age.toFixed(1)} s old` : "";
    line.lastElementChild.textContent = lost ? "Offline" : trip === null ? "" : `${Math.round(trip)} ms${old}`;
    line.title = `${ROUND_TRIP}: ${line.textContent.trim()}`;
    body.classList.toggle("stale", lost || bad);
    const banner = byId("banner");
    const missing = status?.problem;
    banner.hidden = !(lost || bad || missing) || !status;
    banner.className = lost ? "lost" : "";
    // Beside the panel, whose head says which arm it is.
    if (!banner.hidden) banner.style.width = `${inner()?.viewer()?.canvas?.clientWidth ?? scene.clientWidth}px`;
    const stale = "The picture is old.";
    let words = "The picture is old, although the connection is fast: this device may draw too slowly.";
    if (!lost && !bad) words = missing;
    else if (proven) words = `The arm has confirmed the stop on another path. ${stale}`;
    else if (lost) words = `${OFFLINE} ${asking ? "Your STOP is sent as soon as it is back." : `${stale} Reconnecting.`}`;
    else if (silent > QUIET) words = `The arm does not answer. ${stale}`;
    else if (trip > SLOW) words = `The connection is slow. ${stale}`;
    if (!banner.hidden && banner.textContent !== words) banner.textContent = words;
  }

  // Name the joints in a sentence that numbers them: "axis 2 (shoulder)".
  function named(words) {
    const labels = stage?.jointLabels ?? [];
    // An axis that is in the way is a line in space, not a joint.
    return words.replace(/\baxis (\d+)\b(?! is in the way)/gi, (axis, number) => {
      const name = labels[number - 1]?.replace(/^\d+ /, "") ?? "";
      return /^[a-z]/i.test(name) && !words.includes(name) ? `${axis} (${name})` : axis;
    });
  }

  let toastTimer = null;
  function toast(words) {
    text("toast", named(words));
    byId("toast").classList.add("shown");
    clearTimeout(toastTimer);
    toastTimer = setTimeout(() => byId("toast").classList.remove("shown"), TOAST);
  }

  worker.onmessage = ({ data }) => {
    panel?.hear(data);
    if (data.heard?.is === "state") rumble?.take(data.heard);
    if (data.link === "up") [up, silent] = [true, 0];
    else if (data.link === "down") {
      if (up) since = performance.now();
      up = false;
      trip = null;
      unknown();
      Jog.quiet();
      stage?.drop();
      if (data.code === SIGN_IN) enter().catch(() => {});
    } else if (data.trip !== undefined) trip = trip === null ? data.trip : 0.8 * trip + 0.2 * data.trip;
    else if (data.silent !== undefined) silent = data.silent;
    else if (data.unsaid === "stop") insist();
    else if (data.unsaid) REPEATED.includes(data.unsaid) || toast(OFFLINE);
    else if (data.heard?.is === "stopped") stopped();
    else if (data.heard?.is === "people") people.heard(data.heard);
    else if (data.heard && (More.hear(data.heard) || welcome?.hear(data.heard) || teach?.hear(data.heard) || timeline?.hear(data.heard))) return drawLink();
    else if (data.heard?.is === "refused" && data.heard.id !== QUIETLY) {
      toast(data.heard.why);
      stage?.refused(data.heard);
    }
    else if (data.heard?.is === "status") {
      // The message has only the changes.
      const stood = status?.stopped;
      status = { ...status, ...data.heard };
      // What is held when the stop is cleared must not move the arm, also where other people stopped and cleared it.
      if (stood || status.stopped) Jog.quiet();
      byId("gate").hidden = true;
      proven = null;
      draw();
      window.dispatchEvent(new CustomEvent("status", { detail: status }));
    }
    drawLink();
  };
  setInterval(drawLink, 200);

  // The rest of the bar

  // What is cut there is whole in a message.
  byId("mode").addEventListener("click", () => toast(byId("mode").innerText.replaceAll("\n", " ")));
  byId("go").addEventListener("click", () => say({ do: "go" }));
  byId("clear-stop").addEventListener("click", () => say({ do: "clear_stop" }));
  // Below the bar and not modal, so that mouse and finger can press STOP.
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
    if (shown) inner()?.fold?.();
    if (id === "teach") teach.show(shown);
  }
  // The sheets lie in the same corner. On a high screen Teach or Episodes have room above Jog.
  const high = matchMedia("(min-width: 561px) and (min-height: 700px)");
  for (const id of SHEETS)
    byId(`${id}-button`).addEventListener("click", async () => {
      if (id === "teach") await loadTeach();
      open(id, byId(id).hidden);
    });
  function open(id, shown) {
    for (const other of SHEETS)
      if (other !== id && byId(other) && !(high.matches && [id, other].includes("jog") && ![id, other].includes("objects"))) show(other, false);
    show(id, shown);
  }
  // The sheet of taught poses, loaded on first use.
  let teach = null;
  let loading = null; // one sheet, also after two clicks
  async function loadTeach() {
    const options = { say, kept, scene, status: () => status };
    loading ??= import("./teach/teach.js").then(({ Teach }) => Teach.in(byId("stage"), options));
    teach = await loading;
  }
  // Open a script, by its name, as text in the sheet of taught poses.
  async function editScript(name) {
    if (status?.role === "viewer") return toast("You may watch, not drive.");
    if (byId("teach-button").hidden) return toast(OFFLINE);
    await loadTeach();
    open("teach", true);
    teach.open(name, true);
  }
  const kept = storage();
  Pace.begin({ say, toast });
  More.begin({ say, toast, kept, view: () => window.katana.view });
  Jog.begin({ say, stop });
  Objects.begin({ say });
  Edit.begin({ say, toast, connected: () => up, scene: () => stage, replay: (file) => showTimeline(true, (there) => there.open(file)) });
  // What a pointer does in the scene; loaded when the scene is drawn.
  let stage = null;
  async function takeHold() {
    const { Stage } = await import("./scene/stage.js");
    stage ??= new Stage(byId("stage"), scene, { say, toast, status: () => (up ? status : null), edit: editScript });
  }
  // REC and the episodes, loaded when the server records.
  let episodes = null;
  window.addEventListener("status", async ({ detail }) => {
    if (!episodes && !detail.episodes) return;
    await restMayLoad;
    const { Episodes } = await import("./episodes/episodes.js");
    episodes ??= new Episodes(byId("stage"), { page, toast });
    episodes.draw(status);
  });
  // The real arm, loaded when a driver reports on it.
  let arm = null;
  window.addEventListener("status", async ({ detail }) => {
    if (!arm && !detail.arm) return;
    const { Arm } = await import("./arm/arm.js");
    arm ??= new Arm(byId("stage"), { say });
    arm.draw(status);
  });
  // What was recorded, loaded on first use. `then` uses the timeline once it is shown.
  async function showTimeline(shown, then) {
    byId("timeline-button").setAttribute("aria-expanded", String(shown));
    kept?.setItem(PAST, shown ? "yes" : "no");
    const { Timeline } = await import("./timeline/timeline.js");
    const fold = () => showTimeline(false);
    timeline ??= new Timeline(byId("timeline"), { page, scene, stage: byId("stage"), say, toast, status: () => status, fold });
    await timeline.show(shown);
    then?.(timeline);
  }
  byId("timeline-button").addEventListener("click", () => {
    byId("more").close();
    showTimeline(byId("timeline").hidden);
  });
  // Who is connected, for admins; loaded on first use.
  byId("people-button").addEventListener("click", async () => {
    help.close();
    people ??= new (await import("./people/people.js")).People(say);
    people.show();
  });

  // The rates at which parts of the page want states [Hz]; the highest counts.
  const rates = {};
  function see(part, hz) {
    rates[part] = hz;
    worker.postMessage({ watch: Math.max(...Object.values(rates)) });
  }

  // The vibration of gamepad and phone, loaded on first use.
  let rumble = null;
  async function vibrate(on) {
    byId("rumble-button").setAttribute("aria-pressed", String(on));
    kept?.setItem(RUMBLE, on ? "yes" : "no");
    rumble = on ? new (await import("./touch/rumble.js")).Rumble() : null;
    see("rumble", on ? RUMBLE_RATE : 0);
  }
  byId("rumble-button").addEventListener("click", () => vibrate(!rumble));
  if (kept?.getItem(RUMBLE) === "yes") vibrate(true);

  // The instruments, which are loaded on first use

  let panel = null;

  // A browser may refuse to store anything.
  function storage() {
    try {
      return window.localStorage;
    } catch {
      return null;
    }
  }

  // The first steps: at each visit until they are dismissed, and from the help.
  let welcome = null;
  let loadingWelcome = null; // one card, also after two requests
  async function showWelcome() {
    const options = { say, kept, scene, status: () => status };
    loadingWelcome ??= import("./welcome/welcome.js").then(({ Welcome }) => Welcome.on(options));
    welcome = await loadingWelcome.catch(() => null);
    if (welcome) welcome.show();
    else loadingWelcome = null; // The server did not answer: asked again, they load again.
  }
  byId("welcome-button").addEventListener("click", () => {
    help.close();
    showWelcome();
  });

  async function showInstruments(shown) {
    const button = byId("instruments-button");
    button.setAttribute("aria-expanded", String(shown));
    kept?.setItem(OPEN, shown ? "yes" : "no");
    if (shown && !panel) {
      const { Panel } = await import("./instruments/panel.js");
      const watch = (hz) => see("panel", hz);
      panel = new Panel(byId("instruments"), { say, watch, kept, quietly: QUIETLY });
    }
    panel?.show(button.getAttribute("aria-expanded") === "true");
  }
  byId("instruments-button").addEventListener("click", () =>
    showInstruments(byId("instruments-button").getAttribute("aria-expanded") !== "true"),
  );

  // Sign-in

  // An access link has its token behind the #, which browsers do not send. It is sent once, by POST.
  async function enter() {
    const token = location.hash.slice(1);
    if (token) history.replaceState(null, "", location.pathname + location.search);
    const answer = await fetch("enter", { method: "POST", body: JSON.stringify({ token }) });
    stopPort = answer.headers.get("X-Stop-Port") ?? stopPort;
    byId("gate").hidden = answer.ok;
    // 403: an admin has disconnected this person, whose STOP still works.
    byId("gate").classList.toggle("out", answer.status === 403);
    if (answer.status === 403 || (token && !answer.ok)) byId("gate-why").textContent = await answer.text();
    return answer.ok;
  }

  // The parameters for viser's page, which loads meanwhile; resolved when the person has signed in.
  /** @type {(parameters: URLSearchParams) => void} */
  let resolve;
  window.katana.entered = new Promise((done) => (resolve = done));

  enter().then((mayEnter) => {
    if (!mayEnter) return;
    // Pass on no other parameters: some parameters of viser's page could harm the server.
    const query = [...new URLSearchParams(location.search)].filter(([key]) => Viser.PARAMETER.test(key));
    resolve(new URLSearchParams([["page", page], ...query]));
    const { protocol, host } = location;
    worker.postMessage({ open: `${protocol.replace("http", "ws")}//${host}/control?page=${page}` });
    if (kept?.getItem(OPEN) === "yes") showInstruments(true);
    // A link to a moment, or the timeline as it was; shown with the scene.
    const moment = new URLSearchParams(location.search).get("moment");
    if (moment || kept?.getItem(PAST) === "yes") past = (there) => moment && there.goTo(moment);
    window.addEventListener("status", ({ detail }) => {
      restMayLoad.then(() => canDraw && detail.role !== "viewer" && !kept?.getItem(WELCOMED) && showWelcome());
    }, { once: true });
  });
})();
