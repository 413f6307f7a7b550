// In viser's page, before its own script. It says which page around it this is, tells the gateway
// what is on the screen, keeps the camera over a lost connection, gives the scene its theme, and hands
// keys to the page.
"use strict";
(() => {
  const TELL_EVERY = 50; // ms
  const AGAIN = 100; // ms
  const TRIES = 100; // to bring the camera back
  const STEADY = 1000; // ms that viser has to look there before it is done
  // Of each theme: what the floor's message holds, and the file of the sky.
  const ROOMS = JSON.parse(document.currentScript.dataset.rooms);
  const page = new URLSearchParams(location.search).get("page");
  const outer = window.parent === window ? null : window.parent;

  Viser.keepFocus();
  Viser.forgoCode();
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(`${Viser.STEADY}
    html[data-theme=dark] { color-scheme: dark; background: #14181d }
    input[aria-invalid=true] { border-color: #c47500 !important; outline: 2px solid #c47500; }`);
  document.adoptedStyleSheets.push(sheet);

  let camera = null; // where this person last looked from
  let kept = null; //   the same, from when the line is back until viser looks from there again
  let tries = 0;
  let there = null; //  when viser began to look there, ms; null while it looks elsewhere
  const room = new Map(); //   the last message of each kind that the theme decides on
  let seen = 0;
  let told = 0;
  let telling = false;

  function tell(line) {
    if (telling) return;
    telling = true;
    const soon = () => {
      const count = seen;
      setTimeout(() => {
        telling = false;
        told = performance.now();
        line.say({ type: "Seen", count });
        if (seen > count) tell(line);
      }, Math.max(0, told + TELL_EVERY - performance.now()));
    };
    // After the frame is drawn; a page that nobody sees draws none.
    if (document.hidden) soon();
    else requestAnimationFrame(soon);
  }

  // viser starts from its first view whenever the line is back, and once more when it has drawn the
  // scene, which on a slow page comes later than our camera. So the camera is set until it stays.
  function restore(line) {
    if (kept && performance.now() - (there ?? Infinity) > STEADY) kept = null;
    if (kept && there === null && (tries += 1) > TRIES) kept = null;
    if (!kept) return;
    if (there === null) line.show(Viser.viewing(kept));
    setTimeout(() => restore(line), AGAIN);
  }

  // A person who turns the camera meanwhile has it.
  for (const kind of ["pointerdown", "wheel"])
    window.addEventListener(kind, ({ target }) => tries && target?.tagName === "CANVAS" && (kept = null), {
      capture: true,
      passive: true,
    });

  // The server gives every window the light theme. Each is changed to its own here, before viser sees
  // it: no answer of the server has to be waited for, which a slow page would miss.
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
    if (!kept) camera = view;
    else there = same(kept, view) ? (there ?? performance.now()) : null;
  }

  Viser.tap({
    server(address, line) {
      Theme.follow(() => redress(line));
      return page ? `${address}?page=${page}` : address;
    },
    sends(message) {
      const view = Viser.viewOf(message);
      if (view) looks(view);
      const choice = Viser.choiceOf(message);
      if (choice?.label === "View") Fit.choose(choice.value);
      if (choice?.label !== "Theme") return true;
      Theme.choose(choice.value);
      return false;
    },
    connected() {
      seen = 0;
      kept = camera;
      tries = 0;
      there = null;
    },
    hears(messages, line) {
      Fields.hear(messages);
      seen += 1;
      tell(line);
      const ready = Viser.replayed(messages);
      dress(messages);
      Fit.hear(messages);
      if (ready) Fit.begin();
      if (!kept || tries > 0 || !ready) return;
      tries = 1;
      setTimeout(() => restore(line), AGAIN);
    },
  });

  Fields.begin((words) => outer?.katana?.toast(words));
  for (const kind of ["keydown", "keyup"])
    window.addEventListener(kind, (event) => outer?.katana?.key(event), { capture: true });
  window.addEventListener("blur", () => outer?.katana?.blur());
})();
