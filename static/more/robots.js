// The choice of another robot. Loaded on first use.
import { html } from "../instruments/shape.js";

/** @typedef {{ name: string, title: string, kind: "own" | "first" | "uploaded" | "gallery", maker?: string, licence?: string, arguments?: Record<string, string> }} Robot */
/** @typedef {{ name: string, key: string, loading: string | null, problem: string }} Driven */

const box = /** @type {HTMLDialogElement} */ (document.getElementById("robots"));
document.head.append(html("link", { rel: "stylesheet", href: new URL("robots.css", import.meta.url).href }));

const KINDS = { own: "Of this app", first: "With which the server began", uploaded: "Opened here", gallery: "Gallery" };
const PATH = "api/v1/robots";

const search = /** @type {HTMLInputElement} */ (html("input", { type: "search", placeholder: "Name or maker", "aria-label": "Search a robot" }));
const list = html("div", { class: "list" });
const state = html("p", { role: "status" });
const field = /** @type {HTMLInputElement} */ (html("input", { type: "file", accept: ".urdf,.xacro,.zip", hidden: "", "aria-label": "File of a robot" }));
const opener = html("button", { type: "button" }, "Open a URDF, xacro or .zip…");
const details = html("form", { class: "arguments", hidden: "" });

/** @type {Robot[]} */
let robots = [];
/** @type {Driven | null} */
let driven = null;
/** @type {(request: object) => void} */
let say = () => {};

box.append(
  html("form", { method: "dialog" }, html("h1", {}, "Change the robot"), html("button", {}, "Close")),
  html("p", {}, "The server starts again with it, for everybody. Objects and the undo list are gone; recordings stay."),
  html("div", { class: "open" }, opener, field, search),
  details,
  state,
  list,
);

/** @param {string} words */
const report = (words) => {
  state.textContent = words;
};

/** @param {Robot} robot */
function choose(robot, values = {}) {
  report(`${robot.title} is being read…`);
  say({ do: "choose_robot", robot: robot.name, arguments: values, id: "robot" });
}

// Ask for the values of the arguments of a xacro file, which has `robot.arguments`.
/** @param {Robot} robot */
function ask(robot) {
  const boxes = Object.entries(robot.arguments ?? {}).map(([name, value]) => [name, html("input", { name, value })]);
  if (!boxes.length) return choose(robot);
  details.replaceChildren(
    html("p", {}, `Arguments of ${robot.title}`),
    ...boxes.map(([name, input]) => html("label", {}, html("span", {}, name), input)),
    html("button", { class: "main" }, "Drive it"),
  );
  details.hidden = false;
  details.onsubmit = (event) => {
    event.preventDefault();
    const given = Object.fromEntries(boxes.filter(([, input]) => input.value !== input.defaultValue).map(([name, input]) => [name, input.value]));
    details.hidden = true;
    choose(robot, given);
  };
}

function draw() {
  const words = search.value.trim().toLowerCase().split(/\s+/);
  const matches = robots.filter((robot) => words.every((word) => `${robot.name} ${robot.title} ${robot.maker ?? ""}`.toLowerCase().includes(word)));
  list.replaceChildren();
  for (const kind of /** @type {const} */ (["own", "first", "uploaded", "gallery"])) {
    const group = matches.filter((robot) => robot.kind === kind);
    if (group.length) list.append(html("h2", {}, KINDS[kind]));
    for (const robot of group) {
      const note = [robot.maker, robot.licence].filter(Boolean).join(" · ");
      const button = html("button", { type: "button" }, html("b", {}, robot.title), " ", html("span", {}, note));
      if (robot.name === driven?.name) button.setAttribute("aria-current", "true");
      button.addEventListener("click", () => ask(robot));
      list.append(button);
    }
  }
  if (!matches.length) list.append(html("p", {}, "No robot has this name or maker."));
}

async function load() {
  try {
    const answer = await fetch(PATH);
    if (!answer.ok) throw new Error(await answer.text());
    ({ robots } = await answer.json());
    draw();
  } catch (error) {
    report(`The list cannot be loaded: ${/** @type {Error} */ (error).message}`);
  }
}

/** @param {File} file */
async function upload(file, main = "") {
  report(`${file.name} is being sent…`);
  try {
    const answer = await fetch(`${PATH}?${new URLSearchParams({ name: file.name, main })}`, { method: "POST", body: file });
    const { robot, why, choices } = await answer.json();
    if (choices) {
      report(why);
      const buttons = choices.map((/** @type {string} */ path) => {
        const button = html("button", { type: "button" }, path);
        button.addEventListener("click", () => upload(file, path));
        return button;
      });
      return list.replaceChildren(...buttons);
    }
    if (!answer.ok) return report(why);
    report("");
    await load();
    ask(robot);
  } catch (error) {
    report(`${file.name} was not sent: ${/** @type {Error} */ (error).message}`);
  }
}

const expand = () => document.getElementById("robots-button")?.setAttribute("aria-expanded", String(box.open));
box.addEventListener("close", expand);
search.addEventListener("input", draw);
opener.addEventListener("click", () => field.click());
field.addEventListener("change", () => {
  if (field.files?.length) upload(field.files[0]);
  field.value = "";
});
for (const type of ["dragover", "drop"])
  box.addEventListener(type, (event) => {
    const { dataTransfer } = /** @type {DragEvent} */ (event);
    event.preventDefault();
    event.stopPropagation();
    if (type === "drop" && dataTransfer?.files.length) upload(dataTransfer.files[0]);
  });
window.addEventListener("status", (event) => {
  const now = /** @type {CustomEvent<{ robot?: Driven }>} */ (event).detail.robot;
  if (!now) return;
  const before = driven;
  driven = now;
  if (now.loading) report(`${now.loading} is being read…`);
  else if (now.problem && now.problem !== before?.problem) report(now.problem);
});

// Show the choice, or hide it again. `options.file`: a description that was dropped on the page.
/** @param {{ say: (request: object) => void, robot?: Driven, file?: File }} options */
export async function toggle(options) {
  ({ say } = options);
  driven = options.robot ?? driven;
  if (box.open && !options.file) return box.close();
  report(driven?.problem ?? "");
  details.hidden = true;
  if (!box.open) box.show();
  expand();
  await load();
  if (options.file) upload(options.file);
}

// Report the refusal of a request of this dialog.
export const refuse = report;
