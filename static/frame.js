// Runs in viser's page before viser's own script. It names the surrounding page, reports the frames on
// the screen to the gateway, keeps the camera over a lost connection, sets the theme of the scene and
// passes keys to the page.
"use strict";
(() => {
  const REPORT_EVERY = 50; // ms
  const AGAIN = 100; // ms
  const TRIES = 100; // attempts to restore the camera
  const STEADY = 1000; // ms for which viser must keep the restored camera
  // The properties of the floor and the file of the sky, for each theme.
  const ROOMS = JSON.parse(document.currentScript.dataset.rooms);
  const outer = window.parent === window ? null : window.parent;

  document.documentElement.dataset.loading = "";
  Viser.keepFocus();
  Viser.forgoCode();
  let scene = null; // the line of the first messages
  Viser.hold(() => {
    if (scene) report(scene);
    outer?.katana?.drawn();
  });
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(`${Viser.STEADY} ${Viser.HELD}
    html[data-theme=dark] { color-scheme: dark; background: #14181d }
    @media ${Viser.NARROW}, (max-height: 500px) { ${Viser.SOFTWARE_NOTICE} { display: none } }
    html[data-used] ${Viser.HINT} { visibility: hidden !important }
    input[aria-invalid=true] { border-color: #c47500 !important; outline: 2px solid #c47500; }`);
  document.adoptedStyleSheets.push(sheet);

  let camera = null; // this person's last view
  let kept = null; //   the view to restore after a reconnection; null when done
  let tries = 0;
  let there = null; //  ms, since when viser has the kept view; null while it has another
  const room = new Map(); //   the last message of each type that depends on the theme
  let loaded = false; // whether the panel of this connection has arrived
  let seen = 0;
  let reported = 0;
  let reporting = false;

  function report(line) {
    if (reporting) return;
    reporting = true;
    const soon = () => {
      const count = seen;
      setTimeout(() => {
        reporting = false;
        reported = performance.now();
        line.say({ type: "Seen", count });
        if (seen > count) report(line);
      }, Math.max(0, reported + REPORT_EVERY - performance.now()));
    };
    // Report after the frame is drawn. A hidden page draws none.
    if (document.hidden) soon();
    else requestAnimationFrame(soon);
  }

  // viser sets its first view after a reconnection, and again when it has drawn the scene, which on a
  // slow page is after our camera is set. Therefore the camera is set until it stays.
  function restore(line) {
    if (kept && performance.now() - (there ?? Infinity) > STEADY) kept = null;
    if (kept && there === null && (tries += 1) > TRIES) kept = null;
    if (!kept) return;
    if (there === null) line.show(Viser.viewing(kept));
    setTimeout(() => restore(line), AGAIN);
  }

  // A person who turns the camera meanwhile keeps that view.
  for (const kind of ["pointerdown", "wheel"])
    window.addEventListener(
      kind,
      ({ target }) => {
        if (tries && target instanceof HTMLCanvasElement) kept = null;
      },
      { capture: true, passive: true },
    );

  // viser's own settings fold away slowly. They are shown again when a person asks for them.
  for (const kind of ["pointerdown", "keydown"])
    window.addEventListener(kind, () => loaded && delete document.documentElement.dataset.loading, { capture: true });

  // The hint of a control goes when the control is used, and may return when the pointer has left it.
  let used = null;
  for (const kind of ["pointerdown", "keydown"])
    window.addEventListener(kind, ({ target }) => {
      used = Viser.rowOf(target);
      document.documentElement.dataset.used = "";
    }, { capture: true });
  window.addEventListener("pointerover", ({ target, buttons }) => {
    if (!buttons && Viser.rowOf(target) !== used) delete document.documentElement.dataset.used;
  });

  // The server sends every window the light theme. It is changed to the window's theme here, before
  // viser gets it. This needs no answer of the server, which a slow page would miss.
  function dress(messages) {
    for (const message of Viser.paint(messages, ROOMS[Theme.name()])) room.set(message.type, message);
  }

  function redress(line) {
    const messages = [...room.values()].map((message) => structuredClone(message));
    dress(messages);
    line.show(messages);
  }

  const same = (a, b) =>
    ["position", "look_at"].every((key) => a[key].every((x, i) => Math.abs(x - b[key][i]) < 1e-3));

  function looks(view) {
    if (outer?.katana) {
      outer.katana.view = view;
      outer.katana.turned?.();
    }
    if (!kept) camera = view;
    else there = same(kept, view) ? (there ?? performance.now()) : null;
  }

  Viser.tap({
    server(address, line) {
      Theme.follow(() => redress(line));
      const page = new URLSearchParams(location.search).get("page");
      return page ? `${address}?page=${page}` : address;
    },
    sends(message) {
      // The time of its making [s]: our server does not execute what arrives late, and takes this out for viser.
      message.made = performance.now() / 1000;
      outer?.katana?.used();
      const view = Viser.viewOf(message);
      if (view) looks(view);
      const choice = Viser.choiceOf(message);
      // What is seen may be the past: it cannot be dragged, and a control of the panel shows the present.
      if (Viser.isVeiled() && Viser.handles(message)) return false;
      if (Viser.isVeiled() && Viser.controls(message) && !/^(View|Theme)$/.test(choice?.label)) outer?.katana?.live();
      if (choice?.label === "View") Fit.choose(choice.value);
      if (choice?.label !== "Theme") return true;
      Theme.choose(choice.value);
      return false;
    },
    connected() {
      outer?.katana?.live?.();
      document.documentElement.dataset.loading = "";
      loaded = false;
      seen = 0;
      kept = camera;
      tries = 0;
      there = null;
    },
    hears(messages, line) {
      Fields.hear(messages);
      seen += 1;
      // The server sends the panel when the scene is drawn.
      scene = line;
      if (Viser.isDrawn() || document.hidden) report(line);
      const ready = Viser.replayed(messages);
      dress(messages);
      Fit.hear(messages);
      if (Viser.controlsIn(messages)) loaded = true;
      if (ready) Fit.begin();
      if (!kept || tries > 0 || !ready) return;
      tries = 1;
      setTimeout(() => restore(line), AGAIN);
    },
  });

  // This page loads at once. Its parameters come from the surrounding page, when the person has signed in there.
  async function entered() {
    if (!outer) return;
    if (!outer.katana) await new Promise((done) => outer.addEventListener("DOMContentLoaded", done));
    history.replaceState(null, "", `?${await outer.katana.entered}`);
  }

  window.katanaScene = { ...Viser, ...Fit };
  Viser.start(entered());
  Fields.begin((words) => outer?.katana?.toast(words));
  for (const kind of ["keydown", "keyup"])
    window.addEventListener(kind, (event) => outer?.katana?.key(event), { capture: true });
  window.addEventListener("blur", () => outer?.katana?.blur());
})();
