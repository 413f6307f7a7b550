// Runs in viser's page before viser's own script. It names the surrounding page, reports the frames on
// the screen to the gateway, keeps the camera over a lost connection, sets the theme of the scene and
// passes keys to the page.
import * as Fields from "./fields.js";
import * as Fit from "./fit.js";
import "./names.js";
import "./sheet.js";
import * as Theme from "./theme.js";
import * as Viser from "./viser.js";
import * as Names from "./viser/names.js";

const REPORT_EVERY = 50; // ms
const CAMERA = ["initialCameraPosition", "initialCameraLookAt"]; // parameters of the address
/** The properties of the floor and the file of the sky, for each theme. @type {Record<Theme.Name, ViserPage.Theme>} */
const ROOMS = JSON.parse(document.currentScript?.dataset.rooms ?? "{}");
const outer = window.parent === window ? null : window.parent;

if (window.parent.document.documentElement.lang !== "en") import("./language/translator.js");
document.documentElement.dataset.loading = "";
Viser.keepFocus();
Viser.forgoCode();
/** @type {ViserPage.Connection | null} */
let first = null; // the connection of the first messages
Viser.hold(() => {
  if (first) report(first);
  outer?.katana?.drawn();
});
const sheet = new CSSStyleSheet();
sheet.replaceSync(`${Names.STEADY} ${Names.HELD}
    html[data-theme=dark] { color-scheme: dark; background: #14181d }
    ${Names.SOFTWARE_NOTICE} { display: none }
    html[data-used] ${Names.HINT} { visibility: hidden !important }
    input[aria-invalid=true] { border-color: #c47500 !important; outline: 2px solid #c47500; }
    [role=slider]:focus-visible { outline: 3px solid #4b96ea !important; outline-offset: 2px; }`);
document.adoptedStyleSheets.push(sheet);

/** @type {Page.View | null} */
let camera = null; // this person's last view, at first that of the address
/** @type {Map<string, ViserPage.Message>} */
const themed = new Map(); // the last message of each type that depends on the theme
let loaded = false; // whether the panel of this connection has arrived
let seen = 0;
let reported = 0;
let reporting = false;

/** @param {ViserPage.Connection} connection */
function report(connection) {
  if (reporting) return;
  reporting = true;
  const soon = () => {
    const count = seen;
    setTimeout(() => {
      reporting = false;
      reported = performance.now();
      connection.say({ type: "Seen", count });
      if (seen > count) report(connection);
    }, Math.max(0, reported + REPORT_EVERY - performance.now()));
  };
  // Report after the frame is drawn. A hidden page draws none.
  if (document.hidden) soon();
  else requestAnimationFrame(soon);
}

/** The hint of a control goes when the control is used, and may return when the pointer has left it. @type {Element | null} */
let used = null;
for (const kind of ["pointerdown", "keydown"])
  window.addEventListener(kind, ({ target }) => {
    // viser's own settings fold away slowly. They are shown again when a person asks for them.
    if (loaded) delete document.documentElement.dataset.loading;
    used = Viser.rowOf(target);
    document.documentElement.dataset.used = "";
  }, { capture: true });
window.addEventListener("pointerover", ({ target, buttons }) => {
  if (!buttons && Viser.rowOf(target) !== used) delete document.documentElement.dataset.used;
});

// The server sends every window the light theme. It is changed to the window's theme here, before
// viser gets it. This needs no answer of the server, which a slow page would miss.
/** @param {ViserPage.Message[]} messages */
function applyTheme(messages) {
  for (const message of Viser.paint(messages, ROOMS[Theme.name()])) themed.set(message.type, message);
}

/** @param {ViserPage.Connection} connection */
function changeTheme(connection) {
  const messages = [...themed.values()].map((message) => structuredClone(message));
  applyTheme(messages);
  connection.show(messages);
}

/** @param {ViserPage.View} view */
function noteView(view) {
  outer?.katana?.turned?.();
  if (loaded) camera = view;
}

Viser.interceptMessages({
  server(address, connection) {
    Theme.follow(() => changeTheme(connection));
    const page = new URLSearchParams(location.search).get("page");
    return page ? `${address}?page=${page}` : address;
  },
  sends(message) {
    // The time of its making [s]: our server does not execute what arrives late, and takes this out for viser.
    message.made = performance.now() / 1000;
    outer?.katana?.used();
    const view = Viser.viewOf(message);
    if (view) noteView(view);
    const choice = Viser.choiceOf(message);
    // What is seen may be the past: it cannot be dragged, and a control of the panel shows the present.
    if (Viser.hasHidden() && Viser.handles(message)) return false;
    if (Viser.hasHidden() && Viser.controls(message) && choice?.label !== "View") outer?.katana?.live();
    if (choice?.label === "View") Fit.choose(choice.value);
    if (Viser.phaseOf(message)) outer?.katana?.dragged?.(message);
    return true;
  },
  connected() {
    outer?.katana?.live?.();
    document.documentElement.dataset.loading = "";
    loaded = false;
    seen = 0;
  },
  receives(messages, connection) {
    Fields.hear(messages);
    seen += 1;
    // The server sends the panel when the scene is drawn.
    first = connection;
    if (Viser.isDrawn() || document.hidden) report(connection);
    const ready = Viser.replayed(messages);
    applyTheme(messages);
    Fit.hear(messages, camera);
    if (Viser.controlsIn(messages)) loaded = true;
    if (ready) Fit.begin();
  },
});

// This page loads at once. Its parameters come from the surrounding page, when the person has signed in there.
async function entered() {
  if (!outer) return;
  if (!outer.katana) await new Promise((done) => outer.addEventListener("DOMContentLoaded", done));
  const parameters = (await outer.katana?.entered) ?? new URLSearchParams();
  const [position, look_at] = CAMERA.map((name) => parameters.get(name)?.split(",").map(Number));
  if (position && look_at) camera = { position, look_at };
  // viser would return to these after each lost connection.
  for (const name of CAMERA) parameters.delete(name);
  history.replaceState(null, "", `?${parameters}`);
}

window.katanaScene = { ...Names, ...Viser, ...Fit };
Viser.start(entered());
Fields.begin((words) => outer?.katana?.toast(words));
for (const kind of /** @type {const} */ (["keydown", "keyup"]))
  window.addEventListener(kind, (event) => outer?.katana?.key(event), { capture: true });
window.addEventListener("blur", () => outer?.katana?.blur());
