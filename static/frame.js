// In viser's page, before its own script. It says which page around it this is, tells the gateway
// what is on the screen, keeps camera and theme over a lost connection, and hands keys to the page.
"use strict";
(() => {
  const TELL_EVERY = 50; // ms
  const AGAIN = 100; // ms
  const TRIES = 30;
  const THEME = "katana450.theme";
  const page = new URLSearchParams(location.search).get("page");
  const outer = window.parent === window ? null : window.parent;

  // viser's page looks for its server again only while it has the focus; ours always does.
  document.hasFocus = () => true;

  // viser draws faintly until the light of the room is loaded. Where drawing takes as long as that it
  // loses count and leaves the picture faint for good.
  const clear = new CSSStyleSheet();
  clear.replaceSync(`canvas { opacity: 1 !important }
    input[aria-invalid=true] { border-color: #c47500 !important; outline: 2px solid #c47500; }`);
  document.adoptedStyleSheets.push(clear);

  // The policy of this page lets no text become code. viser tries that once, for clouds of splats,
  // which are not used here; nobody need hear of it.
  const refusal = new EvalError("No text becomes code here.");
  const Code = window.Function;
  window.Function = function () {
    throw refusal;
  };
  window.Function.prototype = Code.prototype;
  window.addEventListener(
    "unhandledrejection",
    (event) => event.reason === refusal && event.preventDefault(),
  );

  let camera = null; // where this person last looked from
  let kept = null; //   the same, from when the line is back until viser looks from there again
  let tries = 0;
  let replayed = false;
  let themes = null; // the id of the buttons for it
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
    const data = { type: "message_batch", messages, ours: true };
    worker.dispatchEvent(new MessageEvent("message", { data }));
  }

  // viser starts light likewise. What was chosen in this tab counts, else the system's choice; the
  // page around goes along.
  const system = matchMedia("(prefers-color-scheme: dark)");
  const theme = () => sessionStorage.getItem(THEME) ?? (system.matches ? "Dark" : "Light");
  const around = () => outer?.katana?.theme(theme().toLowerCase());
  around();

  const same = (a, b) =>
    ["position", "look_at"].every((key) => a[key].every((x, i) => Math.abs(x - b[key][i]) < 1e-3));

  const Plain = window.Worker;
  window.Worker = class extends Plain {
    constructor(...args) {
      super(...args);
      // Before viser's own listener, which is set later.
      this.addEventListener("message", (event) => this.#hear(event.data));
    }

    postMessage(data, ...rest) {
      if (data?.type === "set_server" && page)
        data = { ...data, server: `${data.server}?page=${page}` };
      if (data?.type === "send" && data.message.type === "ViewerCameraMessage") this.#looks(data.message);
      if (data?.type === "set_server") system.onchange = () => this.#dress();
      if (data?.type === "send" && themes && data.message.uuid === themes) {
        sessionStorage.setItem(THEME, data.message.updates.value);
        around();
      }
      super.postMessage(data, ...rest);
    }

    #looks(message) {
      if (kept && (same(kept, message) || tries >= TRIES)) kept = null;
      if (!kept) camera = message;
      else if (tries > 0) {
        tries += 1;
        setTimeout(() => kept && look(this), AGAIN);
      }
    }

    #dress() {
      around();
      if (!replayed || !themes) return;
      const message = { type: "GuiUpdateMessage", uuid: themes, updates: { value: theme() } };
      super.postMessage({ type: "send", message });
    }

    #hear(data) {
      if (data?.type === "connected") {
        seen = 0;
        replayed = false;
        themes = null;
        kept = camera;
        tries = 0;
      }
      if (data?.type !== "message_batch" || data.ours) return;
      Fields.hear(data.messages);
      seen += 1;
      tell((message) => super.postMessage(message));
      const ready = data.messages.some(({ type }) => type === "ReplayDoneMessage");
      replayed ||= ready;
      // While the arm is still being started, the panel comes later.
      const buttons = data.messages.find(({ type, props }) => type === "GuiButtonGroupMessage" && props.label === "Theme");
      themes = buttons?.uuid ?? themes;
      if ((ready || buttons) && theme() === "Dark") this.#dress();
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
