// In viser's page, before its own script. It says which page around it this is, tells the gateway
// what is on the screen, keeps the camera over a lost connection, gives the scene its theme, and hands
// keys to the page.
"use strict";
(() => {
  const TELL_EVERY = 50; // ms
  const AGAIN = 100; // ms
  const TRIES = 30;
  // Of each theme: what the floor's message holds, and the file of the sky.
  const ROOMS = JSON.parse(document.currentScript.dataset.rooms);
  const page = new URLSearchParams(location.search).get("page");
  const outer = window.parent === window ? null : window.parent;

  // viser's page looks for its server again only while it has the focus; ours always does.
  document.hasFocus = () => true;

  // viser draws faintly until the light of the room is loaded. Where drawing takes as long as that it
  // loses count and leaves the picture faint for good. It also starts light, whatever the theme.
  const clear = new CSSStyleSheet();
  clear.replaceSync(`canvas { opacity: 1 !important }
    html[data-theme=dark] { color-scheme: dark; background: #14181d }
    html[data-theme=dark]:not([data-mantine-color-scheme=dark]) #root { opacity: 0 }
    input[aria-invalid=true] { border-color: #c47500 !important; outline: 2px solid #c47500; }`);
  document.adoptedStyleSheets.push(clear);

  // The policy of this page lets no text become code. viser tries that once, for clouds of splats,
  // which are not used here; nobody need hear of it.
  const refusal = new EvalError("No text becomes code here.");
  const Code = window.Function;
  const NoCode = function () {
    throw refusal;
  };
  NoCode.prototype = Code.prototype;
  window.Function = /** @type {any} */ (NoCode);
  window.addEventListener(
    "unhandledrejection",
    (event) => event.reason === refusal && event.preventDefault(),
  );

  let camera = null; // where this person last looked from
  let kept = null; //   the same, from when the line is back until viser looks from there again
  let tries = 0;
  const groups = new Map(); // the labels of the rows of buttons, by their ids
  const room = new Map(); //   the last message of each kind that the theme decides on
  let seen = 0;
  let told = 0;
  let telling = false;

  function tell(say) {
    if (telling) return;
    telling = true;
    const soon = () => {
      const count = seen;
      setTimeout(() => {
        telling = false;
        told = performance.now();
        say({ type: "send", message: { type: "Seen", count } });
        if (seen > count) tell(say);
      }, Math.max(0, told + TELL_EVERY - performance.now()));
    };
    // After the frame is drawn; a page that nobody sees draws none.
    if (document.hidden) soon();
    else requestAnimationFrame(soon);
  }

  // viser starts anew from its first view whenever the line is back; told often enough, it looks
  // where the person had looked.
  function look(worker) {
    const { position, look_at, up_direction } = kept;
    const messages = [
      { type: "SetCameraUpDirectionMessage", position: up_direction, initial: false },
      { type: "SetCameraLookAtMessage", look_at, initial: false },
      { type: "SetCameraPositionMessage", position, initial: false },
    ];
    say(worker, messages);
  }

  // The server gives every window the light theme. Each is changed to its own here, before viser sees
  // it: no answer of the server has to be waited for, which a slow page would miss.
  function dress(messages) {
    const { sky, dark, ...floor } = ROOMS[Theme.name()];
    for (const message of messages) {
      if (message.type === "ThemeConfigurationMessage") message.dark_mode = dark;
      else if (message.name === "/floor" && message.type === "GridMessage") Object.assign(message.props, floor);
      else if (message.type === "BackgroundImageMessage")
        message.rgb_data = Uint8Array.from(atob(sky), (byte) => byte.charCodeAt(0));
      else continue;
      room.set(message.type, message);
    }
  }

  const say = (worker, messages) =>
    worker.dispatchEvent(new MessageEvent("message", { data: { type: "message_batch", messages, ours: true } }));

  const same = (a, b) =>
    ["position", "look_at"].every((key) => a[key].every((x, i) => Math.abs(x - b[key][i]) < 1e-3));

  const Plain = window.Worker;
  window.Worker = class extends Plain {
    constructor(url, options) {
      super(url, options);
      // Before viser's own listener, which is set later.
      this.addEventListener("message", (event) => this.#hear(event.data));
    }

    postMessage(data, ...rest) {
      if (data?.type === "set_server") {
        if (page) data = { ...data, server: `${data.server}?page=${page}` };
        Theme.follow(() => this.#redress());
      }
      if (data?.type === "send" && data.message.type === "ViewerCameraMessage") this.#looks(data.message);
      const group = data?.type === "send" && groups.get(data.message.uuid);
      if (group === "Theme") return Theme.choose(data.message.updates.value);
      if (group === "View") Fit.choose(data.message.updates.value);
      super.postMessage(data, ...rest);
    }

    #redress() {
      const messages = [...room.values()].map((message) => structuredClone(message));
      dress(messages);
      say(this, messages);
    }

    #looks(message) {
      if (kept && (same(kept, message) || tries >= TRIES)) kept = null;
      if (!kept) camera = message;
      else if (tries > 0) {
        tries += 1;
        setTimeout(() => kept && look(this), AGAIN);
      }
    }

    #hear(data) {
      if (data?.type === "connected") {
        seen = 0;
        groups.clear();
        kept = camera;
        tries = 0;
      }
      if (data?.type !== "message_batch" || data.ours) return;
      Fields.hear(data.messages);
      seen += 1;
      tell((message) => super.postMessage(message));
      const ready = data.messages.some(({ type }) => type === "ReplayDoneMessage");
      dress(data.messages);
      for (const { type, uuid, props } of data.messages)
        if (type === "GuiButtonGroupMessage") groups.set(uuid, props.label);
      Fit.hear(data.messages);
      if (ready) Fit.begin();
      if (!kept || tries > 0 || !ready) return;
      tries = 1;
      setTimeout(() => kept && look(this), AGAIN);
    }
  };

  Fields.begin((words) => outer?.katana?.toast(words));
  for (const kind of ["keydown", "keyup"])
    window.addEventListener(kind, (event) => outer?.katana?.key(event), { capture: true });
  window.addEventListener("blur", () => outer?.katana?.blur());
})();
