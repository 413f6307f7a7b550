// In viser's page, before its own script. It says which page around it this is, tells the gateway
// what is on the screen, keeps the camera over a lost connection, and hands keys to the page.
"use strict";
(() => {
  const TELL_EVERY = 50; // ms
  const page = new URLSearchParams(location.search).get("page");
  const outer = window.parent === window ? null : window.parent;

  // viser's page looks for its server again only while it has the focus; ours always does.
  document.hasFocus = () => true;

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
  let kept = null; //   the same while the scene is being sent anew
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

  function look({ position, look_at, up_direction }) {
    return [
      { type: "SetCameraUpDirectionMessage", position: up_direction, initial: false },
      { type: "SetCameraLookAtMessage", look_at, initial: false },
      { type: "SetCameraPositionMessage", position, initial: false },
    ];
  }

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
      if (data?.type === "send" && data.message.type === "ViewerCameraMessage" && !kept)
        camera = data.message;
      super.postMessage(data, ...rest);
    }

    #hear(data) {
      if (data?.type === "connected") {
        seen = 0;
        kept = camera;
      }
      if (data?.type !== "message_batch" || data.ours) return;
      seen += 1;
      tell((message) => super.postMessage(message));
      if (!kept) return;
      data.messages = data.messages.filter((each) => !(/^SetCamera/.test(each.type) && each.initial));
      if (!data.messages.some((each) => each.type === "ReplayDoneMessage")) return;
      data.messages.push(...look(kept));
      kept = null;
    }
  };

  for (const kind of ["keydown", "keyup"])
    window.addEventListener(kind, (event) => outer?.katana?.key(event), { capture: true });
  window.addEventListener("blur", () => outer?.katana?.blur());
})();
