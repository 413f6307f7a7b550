// viser's page as it is built: its names, elements and messages, none of which viser promises to keep.
// docs/viser.md lists each one with the test that shows it. Loading this file changes nothing.
"use strict";
const Viser = (() => {
  // Parameters of its address that set its camera and its resolution.
  const PARAMETER = /^(initialCamera(Position|LookAt|Up|Fov|Near|Far)|fixedDpr)$/;
  const NUMBER_BOX = "input.mantine-NumberInput-input";
  // Below this width its panel lies over the scene; the box and the handle of that panel, and its content.
  const NARROW = "(max-width: 36em)";
  const PANEL = '.mantine-Paper-root[style*="position: fixed"]';
  const PANEL_HANDLE = `${PANEL} [style*="height: 3.5em"]`;
  const PANEL_CONTENT = `${PANEL} [style*="width: 20em"]`;
  // It draws faintly until the light of the room is loaded. Where drawing takes as long as that it
  // loses count and leaves the picture faint for good. It also starts light, whatever the theme.
  const STEADY = `canvas { opacity: 1 !important }
    html[data-theme=dark]:not([data-mantine-color-scheme=dark]) #root { opacity: 0 }`;
  const [CONNECTED, BATCH, SEND, SERVER] = ["connected", "message_batch", "send", "set_server"];

  const write = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
  const groups = new Map(); // the labels of the rows of buttons, by their ids
  const viewer = () => window.__viserMutable;

  // It looks for its server again only while it has the focus.
  const keepFocus = () => (document.hasFocus = () => true);

  // The policy of its page lets no text become code. It tries that once, for clouds of splats, which
  // are not used here; the console need not show it.
  function forgoCode() {
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
  }

  // Its socket lives in a worker. `server` returns the address for it; `sends` sees each message of the
  // page and returns whether it is sent; `connected` and `hears` come before the page hears the same.
  // Each gets a line: `say` sends a message to the server, `show` gives messages to the page.
  function tap({ server, sends, connected, hears }) {
    const Plain = window.Worker;
    window.Worker = class extends Plain {
      #line = {
        say: (message) => super.postMessage({ type: SEND, message }),
        show: (messages) =>
          this.dispatchEvent(new MessageEvent("message", { data: { type: BATCH, messages, ours: true } })),
      };

      constructor(...args) {
        super(...args);
        // Before viser's own listener, which is set later.
        this.addEventListener("message", ({ data }) => {
          if (data?.type === CONNECTED) {
            groups.clear();
            connected();
          } else if (data?.type === BATCH && !data.ours) {
            for (const { type, uuid, props } of data.messages)
              if (type === "GuiButtonGroupMessage") groups.set(uuid, props.label);
            hears(data.messages, this.#line);
          }
        });
      }

      postMessage(data, ...rest) {
        if (data?.type === SERVER) data = { ...data, server: server(data.server, this.#line) };
        if (data?.type === SEND && !sends(data.message, this.#line)) return;
        super.postMessage(data, ...rest);
      }
    };
  }

  // The view that `message` of the page tells the server; null for another message.
  const viewOf = (message) => (message.type === "ViewerCameraMessage" ? message : null);

  // The {label, value} of the row of buttons that `message` of the page presses; null for another message.
  const choiceOf = ({ uuid, updates }) =>
    groups.has(uuid) ? { label: groups.get(uuid), value: updates.value } : null;

  // The last messages of the server that place and turn the camera; each may be missing.
  const viewsIn = (messages) =>
    ["SetCameraPositionMessage", "SetCameraLookAtMessage"].map((type) =>
      messages.findLast((each) => each.type === type),
    );

  // Messages that make the page look as `viewOf` has told.
  const viewing = ({ position, look_at, up_direction }) => [
    { type: "SetCameraUpDirectionMessage", position: up_direction, initial: false },
    { type: "SetCameraLookAtMessage", look_at, initial: false },
    { type: "SetCameraPositionMessage", position, initial: false },
  ];

  // Whether all that the server had shown before is in `messages` or came earlier.
  const replayed = (messages) => messages.some(({ type }) => type === "ReplayDoneMessage");

  // Change `messages` to a theme: {dark, sky} and the properties of the floor. Return those changed.
  function paint(messages, { sky, dark, ...floor }) {
    return messages.filter((message) => {
      if (message.type === "ThemeConfigurationMessage") message.dark_mode = dark;
      else if (message.name === "/floor" && message.type === "GridMessage") Object.assign(message.props, floor);
      else if (message.type === "BackgroundImageMessage")
        message.rgb_data = Uint8Array.from(atob(sky), (byte) => byte.charCodeAt(0));
      else return false;
      return true;
    });
  }

  // Keep what `messages` of the server say of number controls, by their ids.
  function keepControls(controls, messages) {
    for (const { uuid, props, updates } of messages) {
      if (props && "step" in props) controls.set(uuid, { ...props });
      else if (updates && controls.has(uuid)) Object.assign(controls.get(uuid), updates);
    }
  }

  // The control of a number box: its id, its label, and the number of the box among its boxes.
  function controlOf(box) {
    const row = box.closest(":has(label[for])");
    const label = row?.querySelector("label[for]");
    const index = row ? [...row.querySelectorAll(NUMBER_BOX)].indexOf(box) : 0;
    return { id: label?.htmlFor, label: label?.textContent ?? "", index };
  }

  // Fill a number box; the page does not notice, which compares with what it wrote last by the
  // element's own property.
  const fill = (box, text) => write.call(box, text);

  // Fill a number box as if the text were typed. Emptied first: the page takes what differs from
  // before for a single edit at the caret.
  function type(box, text) {
    for (const part of ["", text]) {
      fill(box, part);
      box.dispatchEvent(new Event("input", { bubbles: true }));
    }
  }

  return {
    PARAMETER, NUMBER_BOX, NARROW, PANEL, PANEL_HANDLE, PANEL_CONTENT, STEADY,
    keepFocus, forgoCode, tap, viewOf, choiceOf, viewsIn, viewing, replayed, paint, keepControls, controlOf, fill, type,
    // {camera, canvas, cameraControl} of three.js once the page draws.
    viewer,
    // The three.js object of a node; "" is viser's world.
    node: (name) => viewer().nodeRefFromName[name],
    // The value that the page shows in a number box.
    shownIn: (box) => box.defaultValue,
  };
})();
