// The structure of viser's page: its names, elements and messages, which are private parts of viser.
// docs/viser.md lists each one with its test. Loading this file changes nothing.
"use strict";
const Viser = (() => {
  // Parameters of the page's address that set camera and resolution.
  const PARAMETER = /^(initialCamera(Position|LookAt|Up|Fov|Near|Far)|fixedDpr)$/;
  const NUMBER_BOX = "input.mantine-NumberInput-input";
  // Below this width the panel lies over the scene. Selectors of the panel's box, handle and content,
  // and its colour.
  const NARROW = "(max-width: 36em)";
  const PANEL = '.mantine-Paper-root[style*="position: fixed"]';
  const PANEL_HANDLE = `${PANEL} [style*="height: 3.5em"]`;
  const PANEL_CONTENT = `${PANEL} [style*="width: 20em"]`;
  const PANEL_GROUND = "var(--mantine-color-body)";
  // The tabs of the panel, and their row.
  const [TAB, TABS] = ["[role=tab]", "[role=tablist]"];
  // The hint of a control, which lies over other ones.
  const HINT = "[role=tooltip]";
  // Its notice that it draws by software, which on a phone would cover the robot, and which nobody can change there.
  const SOFTWARE_NOTICE = ".mantine-Notification-root[style*=orange]";
  // viser draws faintly until the light of the room is loaded. If drawing takes as long as that, viser
  // miscounts and the picture stays faint. It also starts with the light theme. Without controls from
  // the server, as before each connection, its panel shows settings for developers.
  const STEADY = `canvas { opacity: 1 !important }
    html[data-theme=dark]:not([data-mantine-color-scheme=dark]) #root { opacity: 0 }
    html[data-loading] .mantine-Stack-root:has(> .mantine-TextInput-root) { visibility: hidden }`;
  const [CONNECTED, CLOSED, BATCH, SEND, SERVER, RETRY] = ["connected", "closed", "message_batch", "send", "set_server", "retry"];
  // The worker gives up an attempt to connect after 5 s, and reports it as closed. [ms]
  const ATTEMPT = 6000;

  const write = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
  const groups = new Map(); // labels of the rows of buttons, by id
  const shown = new Map(); // whether the server shows a node, by name
  const written = new Set(); // names of labels, for which viser loads no node: it draws all of them together
  let veiled = null; // returns whether this page hides the node of a name
  let page = null; // the page's worker
  const viewer = () => window.__viserMutable;

  // viser's page reconnects only while it has the focus.
  const keepFocus = () => (document.hasFocus = () => true);

  // The policy of the page forbids to run text as code. viser tries it once, for clouds of splats,
  // which are not used here. This function keeps the error off the console.
  function forgoCode() {
    const refusal = new EvalError("Running text as code is not allowed.");
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

  // Start viser's program as soon as the decoder of its messages, which it expects, is compiled, the
  // document is there, and `ready` is resolved.
  async function start(ready) {
    const decoder = WebAssembly.compileStreaming(fetch("zstd.wasm"));
    if (document.readyState === "loading")
      await new Promise((done) => document.addEventListener("DOMContentLoaded", done));
    await ready;
    window.__viserZstdWasm = await decoder;
    // By a name that the check of types does not look up: the server makes this file.
    const program = "../viser/program.js";
    await import(program);
  }

  // Draw nothing before the whole scene is there, then call `drawn`. viser draws each step on the way, compiles programs
  // for it, and eases its panel into its place; the surrounding page covers all of it.
  const HELD = "html[data-held] * { transition: none !important }";
  const HOLD = 5000; // ms after the first messages until which the scene is waited for
  let held = false;
  let since = null; // time of the first messages
  function hold(drawn = () => {}) {
    const { documentElement } = document;
    documentElement.dataset.held = "";
    const before = Object.getOwnPropertyDescriptor(window, "__viserMutable");
    let mine;
    Object.defineProperty(window, "__viserMutable", {
      configurable: true,
      get: () => mine,
      set(value) {
        mine = value;
        held = true;
        before?.set?.(value);
        const { gl } = value.scene.__r3f.root.getState();
        const render = gl.render;
        gl.render = (scene, camera) => {
          if (held && scene === value.scene && gl.getRenderTarget() === null) {
            if (!isWhole()) return;
            held = false;
            delete documentElement.dataset.held;
            queueMicrotask(drawn);
          }
          render.call(gl, scene, camera);
        };
      },
    });
  }

  // Whether all that the server shows, and the light of the room, is loaded.
  function isWhole() {
    if (since === null) return false;
    if (performance.now() - since > HOLD) return true;
    const { firstMessageBatch, messageQueue } = viewer();
    return !firstMessageBatch && !messageQueue.length && !missing().length;
  }

  // Return the names of visible nodes that are not loaded.
  function missing() {
    const nodes = viewer().nodeRefFromName;
    const hidden = [...shown].filter(([, visible]) => !visible).map(([name]) => name);
    const isHidden = (name) => hidden.some((each) => name === each || name.startsWith(`${each}/`));
    return [...shown.keys()].filter((name) => !nodes[name] && !written.has(name) && !isHidden(name));
  }

  // viser's socket is in a worker. `server` returns the address for it. `sends` gets each message of
  // the page and returns whether it is sent. `connected` and `hears` are called before the page gets
  // the same event. A line has `say`, which sends to the server, and `show`, which shows to the page.
  function tap({ server, sends, connected, hears }) {
    const Plain = window.Worker;
    window.Worker = class extends Plain {
      #tried = -Infinity; // time of an attempt to connect that has not ended
      #line = {
        say: (message) => super.postMessage({ type: SEND, message }),
        show: (messages) =>
          this.dispatchEvent(new MessageEvent("message", { data: { type: BATCH, messages, ours: true } })),
      };

      constructor(url, options) {
        super(url, options);
        page = this;
        // This listener runs before viser's own, which is set later.
        this.addEventListener("message", ({ data }) => {
          if (data?.type === CLOSED || data?.type === CONNECTED) this.#tried = -Infinity;
          if (data?.type === CONNECTED) {
            groups.clear();
            connected();
          } else if (data?.type === BATCH && !data.ours) {
            for (const message of data.messages) {
              const { type, uuid, props, name, visible } = message;
              if (type === "GuiButtonGroupMessage") groups.set(uuid, props.label);
              if (type === "LabelMessage") written.add(name);
              if (type !== "SetSceneNodeVisibilityMessage") continue;
              shown.set(name, visible);
              if (veiled?.(name)) message.visible = false;
            }
            since ??= performance.now();
            hears(data.messages, this.#line);
          }
        });
      }

      postMessage(data, ...rest) {
        // viser tries again each second, and each attempt ends the one before. A server that takes longer to answer,
        // because it or the line is slow, would never be reached.
        if (data?.type === RETRY && performance.now() - this.#tried < ATTEMPT) return;
        if (data?.type === RETRY || data?.type === SERVER) this.#tried = performance.now();
        if (data?.type === SERVER) data = { ...data, server: server(data.server, this.#line) };
        if (data?.type === SEND && !sends(data.message, this.#line)) return;
        super.postMessage(data, ...rest);
      }
    };
  }

  // Return the view in `message` of the page; null for another message.
  const viewOf = (message) => (message.type === "ViewerCameraMessage" ? message : null);

  // Return {label, value} of the button that `message` of the page presses; null for another message.
  const choiceOf = ({ uuid, updates }) =>
    groups.has(uuid) ? { label: groups.get(uuid), value: updates.value } : null;

  // Press the button `value` of the row `label`, which need not be shown.
  function press(label, value) {
    for (const [uuid, name] of groups)
      if (name === label) page.postMessage({ type: SEND, message: { type: "GuiUpdateMessage", uuid, updates: { value } } });
  }

  // Show a node in this page, or show it as the server does.
  function reveal(name, visible = shown.get(name) ?? false) {
    const messages = [{ type: "SetSceneNodeVisibilityMessage", name, visible }];
    page.dispatchEvent(new MessageEvent("message", { data: { type: BATCH, messages, ours: true } }));
  }

  // Hide the nodes for whose names `hides` returns true in this page alone; null shows them as the server does.
  function veil(hides) {
    const found = hides ?? veiled;
    veiled = hides;
    for (const name of shown.keys()) if (found?.(name)) reveal(name, hides ? false : undefined);
  }

  // Whether `message` of the page uses a control of the panel.
  const controls = ({ type }) => type === "GuiUpdateMessage";

  // Whether `message` of the page drags or clicks something in the scene.
  const handles = ({ type }) => /^(TransformControls|SceneNodeClick|SceneNodeDrag|ScenePointer)/.test(type);

  // Return the server's last messages that place and turn the camera; each may be missing.
  const viewsIn = (messages) =>
    ["SetCameraPositionMessage", "SetCameraLookAtMessage"].map((type) =>
      messages.findLast((each) => each.type === type),
    );

  // Return messages that give the page's camera a view of `viewOf`.
  const viewing = ({ position, look_at, up_direction }) => [
    { type: "SetCameraUpDirectionMessage", position: up_direction, initial: false },
    { type: "SetCameraLookAtMessage", look_at, initial: false },
    { type: "SetCameraPositionMessage", position, initial: false },
  ];

  // Return whether the server's whole scene has arrived with `messages`.
  const replayed = (messages) => messages.some(({ type }) => type === "ReplayDoneMessage");

  // Return whether `messages` contain controls of the panel, without which viser shows its own settings.
  const controlsIn = (messages) => messages.some(({ type }) => /^Gui(?!Set|Update|Remove)/.test(type));

  // Change `messages` to a theme {dark, sky, properties of the floor}. Return the changed messages.
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

  // Store the properties of number controls from `messages` of the server, by id.
  function keepControls(controls, messages) {
    for (const { uuid, props, updates } of messages) {
      if (props && "step" in props) controls.set(uuid, { ...props });
      else if (updates && controls.has(uuid)) Object.assign(controls.get(uuid), updates);
    }
  }

  // Return the row of the control in which `element` is, or a larger part of the page outside of them.
  const rowOf = (element) => element.closest?.(":has(label[for])");

  // Return id and label of the control of a number box, and the index of the box in it.
  function controlOf(box) {
    const row = rowOf(box);
    const label = row?.querySelector("label[for]");
    const index = row ? [...row.querySelectorAll(NUMBER_BOX)].indexOf(box) : 0;
    return { id: label?.htmlFor, label: label?.textContent ?? "", index };
  }

  // Fill a number box without the page's notice. The page compares the value with its own last one by
  // the element's own property.
  const fill = (box, text) => write.call(box, text);

  // Fill a number box as if the text were typed. The box is emptied first, because the page takes the
  // difference for a single edit at the caret.
  function type(box, text) {
    for (const part of ["", text]) {
      fill(box, part);
      box.dispatchEvent(new Event("input", { bubbles: true }));
    }
  }

  // Return a PNG of what the page in `frame` draws; null before its first picture.
  function picture(frame) {
    const canvas = frame.contentWindow?.__viserMutable?.canvas;
    return canvas ? new Promise((done) => canvas.toBlob(done, "image/png")) : null;
  }

  // Return the {object, point} of three.js that a ray from a pixel of this document meets first in one
  // of the nodes `names`; null if it meets none, or a handle or a node with an action of its own.
  function pick([x, y], names) {
    const { camera, canvas, scene, nodeRefFromName: nodes } = viewer();
    const { raycaster, pointer, internal } = scene.__r3f.root.getState();
    const { left, top, width, height } = canvas.getBoundingClientRect();
    const ray = new raycaster.constructor();
    ray.setFromCamera(pointer.clone().set((2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height), camera);
    const found = (object, what) => object && (what(object) || found(object.parent, what));
    const acts = ({ object }) => found(object, (each) => each.__r3f?.handlers?.onPointerDown);
    if (ray.intersectObjects(internal.interaction, true).some(acts)) return null;
    const there = names.map((name) => nodes[name]).filter(Boolean);
    const hidden = ({ object }) => found(object, (each) => !each.visible);
    return ray.intersectObjects(there, true).find((hit) => !hidden(hit)) ?? null;
  }

  // Return the part round a pixel (x, y) of the page in `frame`, `high` pixels high, as a data URL of
  // `width` by `height` pixels; empty before the first picture.
  function thumbnail(frame, x, y, high, width, height) {
    const canvas = frame.contentWindow?.__viserMutable?.canvas;
    if (!canvas?.height) return "";
    const { left, top, height: shown } = canvas.getBoundingClientRect();
    const scale = canvas.height / shown;
    const part = Math.min(high * scale, canvas.height, (canvas.width * height) / width);
    const size = [(part * width) / height, part];
    // Inside the picture.
    const corner = [(x - left) * scale, (y - top) * scale].map((middle, axis) =>
      Math.max(0, Math.min(middle - size[axis] / 2, [canvas.width, canvas.height][axis] - size[axis])),
    );
    const small = Object.assign(document.createElement("canvas"), { width, height });
    small.getContext("2d").drawImage(canvas, corner[0], corner[1], size[0], size[1], 0, 0, width, height);
    return small.toDataURL("image/jpeg", 0.8);
  }

  return {
    PARAMETER, NUMBER_BOX, SOFTWARE_NOTICE, NARROW, PANEL, PANEL_HANDLE, PANEL_CONTENT, PANEL_GROUND, TAB, TABS, HINT, STEADY,
    HELD, start, hold, missing, keepFocus, forgoCode, tap, viewOf, choiceOf, viewsIn, viewing, replayed, controlsIn, paint, keepControls, rowOf, controlOf, fill, type, picture, pick, press, reveal, thumbnail, veil, controls, handles,
    // Return whether the scene has been drawn.
    isDrawn: () => !held,
    // Return whether nodes are hidden in this page alone.
    isVeiled: () => veiled !== null,
    // Return {camera, canvas, cameraControl} of three.js once the page draws.
    viewer,
    // Return the three.js object of a node; "" is viser's world.
    node: (name) => viewer().nodeRefFromName[name],
    // Return the value that the page shows in a number box.
    shownIn: (box) => box.defaultValue,
  };
})();
