// The page around the scene: its connection to the server, and what its parts need of each other.
import { element, onClick } from "./dom.js";
import * as Edit from "./edit.js";
import * as Jog from "./jog.js";
import * as More from "./more.js";
import * as Objects from "./objects.js";
import * as Pace from "./pace.js";
import { Bar } from "./page/bar.js";
import { OFFLINE, drawLink } from "./page/connection.js";
import { FirstFrame } from "./page/first_frame.js";
import { keyHandler } from "./page/keys.js";
import { pageName } from "./page/page_name.js";
import { Parts, QUIETLY } from "./page/parts.js";
import { Sheets } from "./page/sheets.js";
import { StopPress } from "./page/stop.js";
import { storage } from "./page/storage.js";
import { Store } from "./page/store.js";
import { named, showToast } from "./page/words.js";
import { PARAMETER } from "./viser/address.js";

const DRAW_EVERY = 200; // ms between two looks at the age of the picture
const SIGN_IN = 4401; // close code: the page has to sign in again
const REPEATED = ["heartbeat", "jog", "servo", "query"]; // requests that are sent without a press

if (document.documentElement.lang !== "en") import("./language/translator.js");
const worker = new Worker("static/link.js");
/** @param {Page.Order} order */
const send = (order) => worker.postMessage(order);
/** @param {string} words */
const withNames = (words) => named(words, parts.stage?.jointLabels ?? []);
/** @type {Page.Context} */
const page = {
  store: new Store(),
  say(request) {
    send({ say: request });
    // Only now: an error of the drawing must keep no request.
    parts.timeline?.said(request);
  },
  toast: (words) => showToast(withNames(words)),
  kept: storage(() => localStorage),
  scene: element("scene", HTMLIFrameElement),
  stage: element("stage", HTMLElement),
  name: pageName(),
  past: null,
};
const { store } = page;
const frame = new FirstFrame();
const stopPress = new StopPress(page, () => {
  bar.draw();
  showLink();
});
const bar = new Bar(page, stopPress, withNames);
/** @type {Parts} */
const parts = new Parts(page, frame, (hz) => send({ watch: hz }));
const sheets = new Sheets(page, parts);
const key = keyHandler(parts, stop);

function stop() {
  stopPress.send();
  Jog.quiet();
  // Last: an error of the drawing must not keep the press from any path.
  parts.timeline?.live();
}

const showLink = () => drawLink(page, stopPress.unanswered);

// Stop at the press, not at the release. A click without a pointer is the Enter key.
const stopButton = element("stop", HTMLButtonElement);
stopButton.addEventListener("pointerdown", (event) => {
  event.preventDefault();
  stop();
});
stopButton.addEventListener("click", (event) => event.detail === 0 && stop());

for (const kind of /** @type {const} */ (["keydown", "keyup"])) window.addEventListener(kind, key, { capture: true });
function blur() {
  // The focus may only have moved between the two documents.
  setTimeout(() => document.hasFocus() || Jog.quiet());
}
window.addEventListener("blur", blur);

// A person uses viser's page, which may begin to drive.
const used = () => send({ used: true });

/** The parameters for viser's page, which loads meanwhile; resolved when the person has signed in. @type {(parameters: URLSearchParams) => void} */
let enterScene = () => {};
window.katana = {
  key, blur, used,
  toast: page.toast,
  drawn: () => void (frame.note() && parts.enterScene()),
  closeSheets: () => sheets.close(),
  live: () => parts.timeline?.live(),
  entered: new Promise((done) => (enterScene = done)),
};

// A window that is closed frees the arm at once. A page that is reloaded returns before that matters.
window.addEventListener("pagehide", () => navigator.sendBeacon(`leave?page=${page.name}`));

// Below the bar and not modal, so that mouse and finger can press STOP.
const help = element("help", HTMLDialogElement);
onClick("help-button", () => (help.open ? help.close() : help.show()));

// The buttons of a dialog say whether it is open.
const opened = new MutationObserver(([{ target }]) => {
  const { id, open } = /** @type {HTMLDialogElement} */ (target);
  for (const button of document.querySelectorAll(`[aria-controls=${id}]`)) button.setAttribute("aria-expanded", String(open));
});
for (const dialog of document.querySelectorAll("dialog")) opened.observe(dialog, { attributeFilter: ["open"] });

// What is held when the stop is cleared must not move the arm, also where other people stopped and cleared it.
store.follow((status, before) => {
  if (before?.stopped || status.stopped) Jog.quiet();
  element("gate", HTMLElement).hidden = true;
  store.proven = null;
  bar.draw();
});

Pace.begin(page);
More.begin(page);
Jog.begin({ say: page.say, stop });
Objects.begin(page);
Edit.begin(page, parts);

// Messages of the worker

function lose() {
  store.disconnect();
  bar.drawUnknown();
  Jog.quiet();
  parts.stage?.drop();
}

/** @param {Page.Answer} answer */
function take(answer) {
  if (answer.is === "stopped") stopPress.answered();
  else if (answer.is === "status") store.take(answer);
  else if ([More, parts.welcome, parts.teach, parts.timeline].some((part) => part?.hear(answer))) return;
  else if (answer.is === "refused" && answer.id !== QUIETLY) {
    page.toast(answer.why);
    parts.stage?.joints.refused(answer);
  }
}

/** @param {MessageEvent<Page.LinkEvent>} message */
worker.onmessage = ({ data }) => {
  parts.panel?.hear(data);
  if (data.link === "up") store.connect();
  else if (data.link === "down") {
    lose();
    if (data.code === SIGN_IN) enter().catch(() => {});
  } else if (data.trip !== undefined) store.note(data.trip);
  else if (data.silent !== undefined) store.silent = data.silent;
  else if (data.unsaid === "stop") stopPress.repeat();
  else if (data.unsaid) REPEATED.includes(data.unsaid) || page.toast(OFFLINE);
  else if (data.heard) take(data.heard);
  showLink();
};
setInterval(showLink, DRAW_EVERY);

// Sign-in

// An access link has its token behind the #, which browsers do not send. It is sent once, by POST.
async function enter() {
  const gate = element("gate", HTMLElement);
  const token = location.hash.slice(1);
  if (token) history.replaceState(null, "", location.pathname + location.search);
  const answer = await fetch("enter", { method: "POST", body: JSON.stringify({ token }) });
  stopPress.port = answer.headers.get("X-Stop-Port") ?? stopPress.port;
  gate.hidden = answer.ok;
  if (token && !answer.ok) element("gate-why", HTMLElement).textContent = await answer.text();
  return answer.ok;
}

enter().then((mayEnter) => {
  if (!mayEnter) return;
  // Pass on no other parameters: some parameters of viser's page could harm the server.
  const query = [...new URLSearchParams(location.search)].filter(([parameter]) => PARAMETER.test(parameter));
  enterScene(new URLSearchParams([["page", page.name], ...query]));
  const { protocol, host } = location;
  send({ open: `${protocol.replace("http", "ws")}//${host}/control?page=${page.name}` });
  parts.begin();
  sheets.begin(frame.rest);
});
