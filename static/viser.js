// The structure of viser's page: its elements and messages, which are private parts of viser.
// docs/viser.md lists each one with its test. Loading this file changes nothing.
import { NUMBER_BOX } from "./viser/names.js";

const [CONNECTED, CLOSED, BATCH, SEND, SERVER, RETRY] = ["connected", "closed", "message_batch", "send", "set_server", "retry"];
// The worker gives up an attempt to connect after 5 s, and reports it as closed. [ms]
const ATTEMPT = 6000;

const valueOfBox = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value");
/** @type {Map<string, string | undefined>} */
const groups = new Map(); // labels of the rows of buttons, by id
/** @type {Map<string, boolean>} */
const shown = new Map(); // whether the server shows a node, by name
/** @type {Set<string>} */
const written = new Set(); // names of labels, for which viser loads no node: it draws all of them together
/** @type {((name: string) => boolean) | null} */
let hidden = null; // returns whether this page hides the node of a name
/** @type {Worker | null} */
let page = null; // the page's worker

// Return {camera, canvas, cameraControl} of three.js once the page draws; undefined before that.
export const viewer = () => window.__viserMutable;

// The same for a page that draws.
export function drawing() {
  const state = viewer();
  if (!state) throw new Error("viser's page does not draw yet.");
  return state;
}

/** Return the three.js object of a node; "" is viser's world. @param {string} name */
export const node = (name) => drawing().nodeRefFromName[name];

/** Return the name of the node that is an object of three.js; empty for another. @param {Three.Object3D} object */
export const nameOf = (object) => Object.entries(drawing().nodeRefFromName).find(([, other]) => other === object)?.[0] ?? "";

// Return viser's world.
export function world() {
  const root = node("");
  if (!root) throw new Error("viser's world is not there yet.");
  return root;
}

// viser's page reconnects only while it has the focus.
export const keepFocus = () => (document.hasFocus = () => true);

// The policy of the page forbids to run text as code. viser tries it once, for clouds of splats,
// which are not used here. This function keeps the error off the console.
export function forgoCode() {
  const refusal = new EvalError("Running text as code is not allowed.");
  const refuse = () => {
    throw refusal;
  };
  window.Function = new Proxy(window.Function, { apply: refuse, construct: refuse });
  window.addEventListener(
    "unhandledrejection",
    (event) => event.reason === refusal && event.preventDefault(),
  );
}

// Start viser's program as soon as the decoder of its messages, which it expects, is compiled, the
// document is there, and `ready` is resolved.
/** @param {Promise<void>} [ready] */
export async function start(ready) {
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
const HOLD = 5000; // ms after the first messages until which the scene is waited for
let held = false;
/** @type {number | null} */
let since = null; // time of the first messages
export function hold(drawn = () => {}) {
  const { documentElement } = document;
  documentElement.dataset.held = "";
  const before = Object.getOwnPropertyDescriptor(window, "__viserMutable");
  /** @type {ViserPage.Viewer | undefined} */
  let mine;
  Object.defineProperty(window, "__viserMutable", {
    configurable: true,
    get: () => mine,
    /** @param {ViserPage.Viewer} value */
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

// Return whether the scene has been drawn.
export const isDrawn = () => !held;

// Whether all that the server shows, and the light of the room, is loaded.
function isWhole() {
  if (since === null) return false;
  if (performance.now() - since > HOLD) return true;
  const { firstMessageBatch, messageQueue } = drawing();
  return !firstMessageBatch && !messageQueue.length && !missing().length;
}

/** Return the names of visible nodes, and of those `wanted`, that are not loaded. @param {string[]} wanted */
export function missing(wanted = []) {
  const nodes = drawing().nodeRefFromName;
  const parents = [...shown].filter(([, visible]) => !visible).map(([name]) => name);
  /** @param {string} name */
  const isHidden = (name) => parents.some((parent) => name === parent || name.startsWith(`${parent}/`));
  return [...shown.keys(), ...wanted].filter((name) => !nodes[name] && !written.has(name) && !isHidden(name));
}

/**
 * What the page does with the messages between viser's page and its server.
 * @typedef {object} Interceptor
 * @property {(address: string, connection: ViserPage.Connection) => string} server the address for the socket
 * @property {(message: ViserPage.Message, connection: ViserPage.Connection) => boolean} sends whether a message is sent
 * @property {() => void} connected called before the page gets the same event
 * @property {(messages: ViserPage.Message[], connection: ViserPage.Connection) => void} receives the same
 */

// viser's socket is in a worker, whose messages go through `interceptor`. A connection has `say`, which sends to the
// server, and `show`, which shows to the page.
/** @param {Interceptor} interceptor */
export function interceptMessages({ server, sends, connected, receives }) {
  const Plain = window.Worker;
  window.Worker = class extends Plain {
    #tried = -Infinity; // time of an attempt to connect that has not ended
    /** @type {ViserPage.Connection} */
    #connection = {
      say: (message) => super.postMessage({ type: SEND, message }),
      show: (messages) => void this.dispatchEvent(batchOf(messages)),
    };

    /** @param {string | URL} url @param {WorkerOptions} [options] */
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
          data.messages.forEach(note);
          since ??= performance.now();
          receives(data.messages, this.#connection);
        }
      });
    }

    /** @param {{ type?: string, server?: string, message?: ViserPage.Message }} data @param {Transferable[] | StructuredSerializeOptions} [options] */
    postMessage(data, options) {
      // viser tries again each second, and each attempt ends the one before. A server that takes longer to answer,
      // because it or the line is slow, would never be reached.
      if (data?.type === RETRY && performance.now() - this.#tried < ATTEMPT) return;
      if (data?.type === RETRY || data?.type === SERVER) this.#tried = performance.now();
      if (data?.type === SERVER) data = { ...data, server: server(data.server ?? "", this.#connection) };
      if (data?.type === SEND && data.message && !sends(data.message, this.#connection)) return;
      if (Array.isArray(options)) super.postMessage(data, options);
      else super.postMessage(data, options);
    }
  };
}

/** @param {ViserPage.Message[]} messages */
const batchOf = (messages) => new MessageEvent("message", { data: { type: BATCH, messages, ours: true } });

/** Note what the server shows, and hide the nodes that are hidden in this page alone. @param {ViserPage.Message} message */
function note(message) {
  const { type, uuid = "", props, name = "", visible = false } = message;
  if (type === "GuiButtonGroupMessage") groups.set(uuid, props?.label);
  if (type === "LabelMessage") written.add(name);
  if (type !== "SetSceneNodeVisibilityMessage") return;
  shown.set(name, visible);
  if (hidden?.(name)) message.visible = false;
}

/** Return the view in `message` of the page; null for another message. @param {ViserPage.Message} message */
export const viewOf = (message) =>
  message.type === "ViewerCameraMessage" ? /** @type {ViserPage.View} */ (message) : null;

/** Return {label, value} of the button that `message` of the page presses; null for another message. @param {ViserPage.Message} message */
export const choiceOf = ({ uuid = "", updates }) =>
  groups.has(uuid) ? { label: groups.get(uuid), value: updates?.value ?? "" } : null;

/** Send a message as if viser's page had. @param {ViserPage.Message} message */
export const send = (message) => page?.postMessage({ type: SEND, message });

/** Press the button `value` of the row `label`, which need not be shown. @param {string} label @param {string} value */
export function press(label, value) {
  for (const [uuid, name] of groups)
    if (name === label) send({ type: "GuiUpdateMessage", uuid, updates: { value } });
}

/** Show a node in this page, or show it as the server does. @param {string} name @param {boolean} [visible] */
export function reveal(name, visible = shown.get(name) ?? false) {
  page?.dispatchEvent(batchOf([{ type: "SetSceneNodeVisibilityMessage", name, visible: visible && !hidden?.(name) }]));
}

// Hide the nodes for whose names `hides` returns true in this page alone; null shows them as the server does.
/** @param {((name: string) => boolean) | null} hides */
export function hideNodes(hides) {
  const changes = hides ?? hidden;
  hidden = hides;
  for (const name of shown.keys()) if (changes?.(name)) reveal(name, hides ? false : undefined);
}

// Return whether nodes are hidden in this page alone.
export const hasHidden = () => hidden !== null;

/** Whether `message` of the page uses a control of the panel. @param {ViserPage.Message} message */
export const controls = ({ type }) => type === "GuiUpdateMessage";

/** Whether `message` of the page drags or clicks something in the scene. @param {ViserPage.Message} message */
export const handles = ({ type }) => /^(TransformControls|SceneNodeClick|SceneNodeDrag|ScenePointer)/.test(type);

/** Return the part of a drag of a handle that `message` of the page is: Start, Update or End; otherwise undefined. @param {ViserPage.Message} message */
export const phaseOf = ({ type }) => /^TransformControls(?:Drag)?(Start|Update|End)/.exec(type)?.[1];

/** Return the server's last messages that place and turn the camera; each may be missing. @param {ViserPage.Message[]} messages */
export const viewsIn = (messages) =>
  ["SetCameraPositionMessage", "SetCameraLookAtMessage"].map((type) =>
    messages.findLast((message) => message.type === type),
  );

/** Return whether the server's whole scene has arrived with `messages`. @param {ViserPage.Message[]} messages */
export const replayed = (messages) => messages.some(({ type }) => type === "ReplayDoneMessage");

/** Return whether `messages` contain controls of the panel, without which viser shows its own settings. @param {ViserPage.Message[]} messages */
export const controlsIn = (messages) => messages.some(({ type }) => /^Gui(?!Set|Update|Remove)/.test(type));

// Change `messages` to a theme {dark, sky, properties of the floor}. Return the changed messages.
/** @param {ViserPage.Message[]} messages @param {ViserPage.Theme} theme */
export function paint(messages, { sky, dark, ...floor }) {
  return messages.filter((message) => {
    if (message.type === "ThemeConfigurationMessage") message.dark_mode = dark;
    else if (message.name === "/floor" && message.type === "GridMessage") Object.assign(message.props ?? {}, floor);
    else if (message.type === "BackgroundImageMessage")
      message.rgb_data = Uint8Array.from(atob(sky), (byte) => byte.charCodeAt(0));
    else return false;
    return true;
  });
}

// Store the properties of number controls from `messages` of the server, by id.
/** @param {Map<string, ViserPage.ControlProps>} controls @param {ViserPage.Message[]} messages */
export function keepControls(controls, messages) {
  for (const { uuid = "", props, updates } of messages) {
    const control = controls.get(uuid);
    if (props && "step" in props) controls.set(uuid, { ...props });
    else if (updates && control) Object.assign(control, updates);
  }
}

/** Return the row of the control in which `target` is, or a larger part of the page outside of them. @param {EventTarget | null} target */
export const rowOf = (target) => (target instanceof Element ? target.closest(":has(label[for])") : null);

/** Return id and label of the control of a number box or of its buttons, and the index of the box in it. @param {Element} box */
export function controlOf(box) {
  const row = rowOf(box);
  const label = row?.querySelector("label[for]");
  const index = row ? [...row.querySelectorAll(NUMBER_BOX)].findIndex((other) => other.parentElement?.contains(box)) : 0;
  return { id: label?.getAttribute("for") ?? "", label: label?.textContent ?? "", index };
}

/** Return the value that the page shows in a number box. @param {HTMLInputElement} box */
export const shownIn = (box) => box.defaultValue;

// Fill a number box without the page's notice. The page compares the value with its own last one by
// the element's own property.
/** @param {HTMLInputElement} box @param {string} text */
export const fill = (box, text) => valueOfBox?.set?.call(box, window.translated?.(text) ?? text);

// Fill a number box as if the text were typed. The box is emptied first, because the page takes the
// difference for a single edit at the caret.
/** @param {HTMLInputElement} box @param {string} text */
export function type(box, text) {
  for (const part of ["", text]) {
    fill(box, part);
    box.dispatchEvent(new Event("input", { bubbles: true }));
  }
}

/** @param {Page.Pixel} pixel of this document */
function rayAt([x, y]) {
  const { camera, canvas, scene } = drawing();
  const { raycaster, pointer } = scene.__r3f.root.getState();
  const { left, top, width, height } = canvas.getBoundingClientRect();
  const ray = new raycaster.constructor();
  ray.setFromCamera(pointer.clone().set((2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height), camera);
  return ray;
}

/** Return the innermost object round `object`, or itself, that fits; null without one. @param {Three.Object3D | null} object @param {(part: Three.Object3D) => boolean} fits */
export function owner(object, fits) {
  while (object && !fits(object)) object = object.parent;
  return object;
}

/** Return the part of a handle, or the node with an action of its own, at a pixel of this document; null without one. @param {Page.Pixel} pixel */
export function partAt(pixel) {
  const { interaction } = drawing().scene.__r3f.root.getState().internal;
  const parts = rayAt(pixel).intersectObjects(interaction, true).map(({ object }) =>
    owner(object, (part) => Boolean(part.__r3f?.handlers?.onPointerDown)));
  return parts.find((part) => part !== null) ?? null;
}

// Return the {object, point} of three.js that a ray from a pixel of this document meets first in one
// of the nodes `names`; null if it meets none, or a part of `partAt`.
/** @param {Page.Pixel} pixel @param {string[]} names */
export function pick(pixel, names) {
  if (partAt(pixel)) return null;
  const { nodeRefFromName: nodes } = drawing();
  const targets = names.map((name) => nodes[name]).filter((object) => object !== undefined);
  /** @param {Three.Hit} hit */
  const isHidden = ({ object }) => owner(object, (part) => !part.visible) !== null;
  return rayAt(pixel).intersectObjects(targets, true).find((hit) => !isHidden(hit)) ?? null;
}
