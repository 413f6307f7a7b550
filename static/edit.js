// Direct changes to the scene: a dropped file, Delete, undo and redo.
import { closest, element, matches, t } from "./dom.js";
import * as Objects from "./objects.js";

/** @typedef {"undo" | "redo"} Step */
const STEPS = /** @type {const} */ (["undo", "redo"]);
/** @type {Page.Context} */
let page;
/** @type {Parts} */
let parts;
/** @typedef {Pick<import("./page/parts.js").Parts, "stage" | "teach" | "replay">} Parts those that are loaded later */
/** @type {number | undefined} */
let leaving; // timer of the end of a drag

/** @param {Step} what */
function step(what) {
  const { live } = page.store;
  if (!live) return page.toast("No connection to the arm.");
  const [change] = live[what] ?? [];
  if (change) page.toast(`${what === "undo" ? "Undo" : "Redo"}: ${change}`);
  // An undo from before a stop or a change of driver is refused.
  page.say({ do: what, revocations: live.revocations, id: "undo" });
}

/** Return whether the key was handled. @param {KeyboardEvent} event */
export function key(event) {
  if (event.type !== "keydown" || event.altKey) return false;
  // The sheet of programs undoes its own changes.
  const content = closest(event.target, "#teach") && parts.teach?.content;
  // The letter on the key, which is elsewhere on other keyboards; the place of the key if it has no such letter.
  const letter = (/^[a-z]$/i.test(event.key) ? event.key : event.code.slice(3)).toLowerCase();
  if ((letter === "z" || letter === "y") && (event.ctrlKey || event.metaKey)) {
    const what = letter === "y" || event.shiftKey ? "redo" : "undo";
    if (content) content[what]();
    else if (!event.repeat) step(what);
    return true;
  }
  return !content && !event.repeat && event.key === "Delete" && Boolean(parts.stage?.selection?.remove());
}

/** @param {Page.Status} status */
function note(status) {
  const names = (status.undo?.length ? status.undo : ["nothing yet"]).map(t);
  const list = element("undoable", HTMLElement);
  if ([...list.children].map((entry) => entry.textContent).join() !== names.join())
    list.replaceChildren(...names.map((name) => Object.assign(document.createElement("li"), { textContent: name })));
  for (const what of STEPS) element(what, HTMLButtonElement).disabled = !status[what]?.length;
}

/** Return the point [x, y] of the table below the pointer; null if it is over something else. @param {DragEvent} event */
function tableAt({ clientX, clientY, target }) {
  const isScene = matches(target, "canvas") && target.ownerDocument === page.scene.contentDocument;
  return isScene ? (parts.stage?.tableAt([clientX, clientY]) ?? null) : null;
}

/** Show the place for a file while one is dragged over the page. @param {DragEvent} event */
function drag(event) {
  if (!event.dataTransfer?.types.includes("Files")) return;
  event.preventDefault();
  const over = event.type === "dragover";
  const { stage } = page;
  event.dataTransfer.dropEffect = "copy";
  stage.classList.toggle("dropping", over || event.type === "dragenter");
  clearTimeout(leaving);
  // dragover comes all the time while the file is over the page.
  leaving = setTimeout(() => stage.classList.remove("dropping"), 300);
  if (event.type !== "drop") return;
  const files = [...event.dataTransfer.files];
  if (files.length === 1 && /\.mcap$/i.test(files[0].name)) parts.replay(files[0]);
  else if (files.length) Objects.take(files, tableAt(event));
}

/** @param {Window} target */
function listen(target) {
  for (const kind of /** @type {const} */ (["dragenter", "dragover", "drop"])) target.addEventListener(kind, drag, { capture: true });
}

/** @param {Page.Context} context @param {Parts} later */
export function begin(context, later) {
  [page, parts] = [context, later];
  const { scene } = page;
  listen(window);
  page.store.follow(note);
  for (const what of STEPS) element(what, HTMLButtonElement).addEventListener("click", () => step(what));
  // A page that could not be loaded gives no access.
  const enter = () => scene.contentDocument && scene.contentWindow && listen(scene.contentWindow);
  scene.addEventListener("load", enter);
  // It may be loaded already.
  enter();
}
