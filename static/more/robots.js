// The choice of another robot. Loaded on first use.
import { element, onChoice, styled } from "../dom.js";
import { button, html } from "../instruments/shape.js";
import { messageOf, queryOf, request } from "../server.js";

/** @typedef {Api.Choice} Robot */
const box = element("robots", HTMLDialogElement);
styled("robots.css", import.meta.url);

const KINDS = { included: "Included", first: "With which the server began", uploaded: "Opened here", gallery: "Arms of the gallery, downloaded when first chosen", other: "Other robots of the gallery" };
const PATH = "api/v1/robots";

const search = html("input", { type: "search", placeholder: "Name or maker", "aria-label": "Search a robot" });
const list = html("div", { class: "list" });
const state = html("p", { role: "status" });
const field = html("input", { type: "file", accept: ".urdf,.xacro,.zip", hidden: "", "aria-label": "File of a robot" });
const opener = button("Open a URDF, xacro or .zip…", () => field.click());
const details = html("form", { class: "arguments", hidden: "" });

/** @type {Robot[]} */
let robots = [];
/** @type {Page.Context | null} */
let page = null; // that of the first use
/** @type {Page.Robot | null} */
let driven = null;

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

/** @param {Robot} robot @param {Record<string, string>} [values] */
function choose(robot, values = {}) {
  report(`${robot.title} is being read…`);
  page?.say({ do: "choose_robot", robot: robot.name, arguments: values, id: "robot" });
}

/** Ask for the values of the arguments of a xacro file, and whether to drive a dropped robot. @param {Robot} robot */
function ask(robot, isDropped = false) {
  const boxes = Object.entries(robot.arguments ?? {}).map(([name, value]) => ({ name, input: html("input", { name, value }) }));
  if (!boxes.length && !isDropped) return choose(robot);
  details.replaceChildren(
    html("p", {}, boxes.length ? `Arguments of ${robot.title}` : robot.title),
    ...boxes.map(({ name, input }) => html("label", {}, html("span", {}, name), input)),
    html("button", { class: "main" }, "Drive it"),
  );
  details.hidden = false;
  details.onsubmit = (event) => {
    event.preventDefault();
    const given = Object.fromEntries(boxes.filter(({ input }) => input.value !== input.defaultValue).map(({ name, input }) => [name, input.value]));
    details.hidden = true;
    choose(robot, given);
  };
}

const plain = (/** @type {string} */ words) => words.toLowerCase().replace(/[^\p{L}\d]/gu, ""); // "SO-101" is "so101"

function draw() {
  const words = search.value.split(/\s+/).map(plain);
  const matches = robots.filter((robot) => words.every((word) => plain(`${robot.name} ${robot.title} ${robot.maker ?? ""}`).includes(word)));
  list.replaceChildren();
  for (const kind of /** @type {const} */ (["included", "first", "uploaded", "gallery", "other"])) {
    const group = matches.filter((robot) => robot.kind === kind);
    if (group.length) list.append(html("h2", {}, KINDS[kind]));
    for (const robot of group) {
      const note = [robot.maker, robot.licence].filter(Boolean).join(" · ");
      const opens = button([html("b", {}, robot.title), " ", html("span", {}, note)], () => ask(robot));
      if (robot.name === driven?.name) opens.setAttribute("aria-current", "true");
      list.append(opens);
    }
  }
  if (!matches.length) list.append(html("p", {}, "No robot has this name or maker."));
}

async function load() {
  try {
    ({ robots } = await (await request(PATH)).json());
    draw();
  } catch (error) {
    report(`The list cannot be loaded: ${messageOf(error)}`);
  }
}

/** @param {File} file */
async function upload(file, main = "", isDropped = false) {
  report(`${file.name} is being sent…`);
  try {
    const answer = await request(`${PATH}?${queryOf({ name: file.name, main })}`, { method: "POST", body: file });
    const { robot } = await answer.json();
    report("");
    await load();
    ask(robot, isDropped);
  } catch (error) {
    report(messageOf(error));
    const { choices } = /** @type {{ choices?: string[] }} */ (error);
    if (choices) list.replaceChildren(...choices.map((path) => button(path, () => upload(file, path, isDropped))));
  }
}

search.addEventListener("input", draw);
onChoice(field, ([file]) => upload(file));
/** @param {Page.Status} status @param {Page.Status | null} before */
function note({ robot }, before) {
  if (!robot) return;
  driven = robot;
  if (robot.loading) report(`${robot.loading} is being read…`);
  else if (robot.problem && robot.problem !== before?.robot?.problem) report(robot.problem);
}

/** Show the choice, or hide it again. `options.file`: a description that was dropped on the page. @param {{ page: Page.Context, file?: File }} options */
export async function toggle(options) {
  if (!page) options.page.store.follow(note);
  ({ page } = options);
  driven = page.store.status?.robot ?? driven;
  if (box.open && !options.file) return box.close();
  report(driven?.problem ?? "");
  details.hidden = true;
  if (!box.open) box.show();
  if (matchMedia("(pointer: fine)").matches) search.focus(); // else a keyboard would cover the list
  await load();
  if (options.file) upload(options.file, "", true);
}

// Report the refusal of a request of this dialog.
export const refuse = report;
