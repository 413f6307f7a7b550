// Objects and scenes from files: the server reads a file, and the object is placed where it was dropped, or before the arm.
import { byId, element, onChoice, save } from "./dom.js";
import { button } from "./instruments/shape.js";
import { chooseRobot } from "./more.js";
import { messageOf, request } from "./server.js";

const API = "api/v1/";
const ALONE = /\.(stl|ply|glb|3mf|zip)$/i; // what needs no other file
const TOGETHER = "Files that belong together, such as a .gltf and its .bin, or a folder, are read from a .zip: put them into one.";
const [ROBOT, ROBOT_INSIDE] = [/\.(urdf|xacro)$/i, /\.(urdf|xacro)/i]; // in a name, and in the names in a .zip file
const MAX_BYTES = 60e6; // of a file; the server accepts no more
const TAIL = 200_000; // bytes at the end of a .zip file in which the names of its files are
/** @type {Page.Context} */
let page;
const unit = element("unit", HTMLSelectElement);
/** @type {File | null} */
let file = null; // the last one that was chosen
let main = ""; // the file to read in it, if it is a .zip file of several
/** @type {string | null} */
let placed = null; // the name of its object
let fitted = false; // whether its scale was chosen to fit
/** @type {[number, number] | null} */
let where = null; // [x, y] of the point of the table on which the files were dropped

/** @param {string} words */
function report(words, bad = false) {
  const text = byId("read");
  text.textContent = words;
  text.classList.toggle("bad", bad);
}

/** Send `body`, if there is one, and return the answer. A refusal is shown in the sheet, and null is returned. @param {string} path @param {File} [body] */
async function ask(path, body) {
  /** @type {NodeListOf<HTMLElement>} */
  const parts = document.querySelectorAll("#objects > :not(p)");
  for (const part of parts) part.inert = true; // nothing can be removed that the answer would place again
  try {
    return await request(API + path, body && { method: "POST", body });
  } catch (error) {
    report(messageOf(error), true);
    offer(/** @type {{ choices?: string[] }} */ (error).choices ?? []);
  } finally {
    for (const part of parts) part.inert = false;
  }
  return null;
}

/** Read the file, or `part` of a .zip, and place its object; `again`: the unit of an object that is placed has changed. @param {boolean} again */
async function add(again, part = main) {
  if (!file) return;
  main = part;
  offer([]);
  report(`Reading ${file.name} …`);
  const query = new URLSearchParams({ name: file.name });
  if (unit.value) query.set("unit", unit.value);
  if (main) query.set("main", main);
  /** @type {Api.Mesh | null} */
  const mesh = await (await ask(`mesh?${query}`, file))?.json();
  if (!mesh) return;
  // A changed unit applies to the object that is already placed.
  mesh.name = again && placed ? placed : mesh.name;
  const fits = mesh.scale === 1;
  report(`${mesh.name}: ${fits ? "" : `placed at the scale ${mesh.scale}, which you can change below. `}${mesh.text}`);
  placed = mesh.name;
  window.dispatchEvent(new Event("placed"));
  // A unit that fits replaces a scale that was chosen to fit, but not one that was set for the object.
  const scale = fits && !fitted ? {} : { scale: mesh.scale };
  page.say({ do: "place", name: placed, shape: "mesh", mesh: mesh.key, ...(where && { near: where }), ...scale });
  fitted = !fits;
}

/** Offer the files of a .zip file, one of which is to be read. @param {string[]} choices */
function offer(choices) {
  byId("which").replaceChildren(...choices.slice(0, 24).map((path) => button(path, () => add(false, path))));
}

/** @param {File} scene */
async function load(scene) {
  report(`Reading ${scene.name} …`);
  const answer = await (await ask("scene", scene))?.json();
  if (!answer) return;
  placed = null;
  page.say({ do: "load", scene: answer.key });
  report(answer.text);
}

async function saveScene() {
  const answer = await ask("scene");
  if (!answer) return;
  save(await answer.blob(), "scene.zip");
  report("Saved. scene.zip contains scene.yaml and the files of its objects.");
}

/** @param {Page.Context} context */
export function begin(context) {
  page = context;
  byId("add").addEventListener("click", () => byId("object-file").click());
  byId("load").addEventListener("click", () => byId("scene-file").click());
  byId("save").addEventListener("click", saveScene);
  unit.addEventListener("change", () => add(true));
  // The text on an object goes with it.
  window.addEventListener("selected", () => placed && page.store.object !== placed && report(""));
  onChoice(element("object-file", HTMLInputElement), take);
  onChoice(element("scene-file", HTMLInputElement), ([first]) => load(first));
}

/** @type {Promise<import("./objects/object.js").ObjectForm> | null} */
let form = null; // of the chosen object

/** Note that the sheet is shown, or hidden. @param {boolean} shown */
export async function show(shown) {
  if (!shown && !form) return;
  form ??= import("./objects/object.js").then(({ ObjectForm }) => new ObjectForm(page));
  (await form).watch(!byId("objects").hidden);
  if (!shown) page.store.select("");
}

// Read files that were chosen or dropped, each of which is an object, or a scene or a robot in a .zip file. `at` is the
// point of the table on which they were dropped.
/** @param {File[]} list @param {[number, number] | null} [at] */
export async function take(list, at = null) {
  const names = await Promise.all(list.map(namesIn));
  const isScene = names.map((all) => all.includes("scene.yaml"));
  const robot = list.find((file, i) => ROBOT.test(file.name) || (ROBOT_INSIDE.test(names[i]) && !isScene[i]));
  if (robot) return chooseRobot(robot);
  where = at;
  if (byId("objects").hidden) byId("objects-button").click();
  const isFolder = list.length === 1 && !list[0].name.includes(".");
  if (isFolder || (list.length > 1 && !list.every(({ name }) => ALONE.test(name)))) return report(TOGETHER, true);
  for (const [i, next] of list.entries()) await (isScene[i] ? load(next) : read(next));
}

/** Return a text with the names of the files in a .zip file; empty for another file. @param {File} file */
async function namesIn(file) {
  if (!/\.zip$/i.test(file.name)) return "";
  return new TextDecoder("latin1").decode(await file.slice(-TAIL).arrayBuffer());
}

/** @param {File} first */
function read(first) {
  if (first.size > MAX_BYTES) return report(`${first.name} has ${Math.ceil(first.size / 1e6)} MB; at most ${MAX_BYTES / 1e6} are read.`, true);
  file = first;
  placed = null;
  fitted = false;
  return add(false, "");
}
