// The small menu: the person's name, a picture, the address for a phone, and another robot.
import { element, first, onClick, save, t, timestamp } from "./dom.js";
import { picture } from "./viser/pictures.js";

const [NAME, LANGUAGE] = ["katana450.name", "katana450.language"];
const hover = matchMedia("(hover: hover)");
const dialog = element("more", HTMLDialogElement);
const theme = first("#theme select", HTMLSelectElement);
const language = first("#language select", HTMLSelectElement);
const field = element("own-name", HTMLInputElement);
const why = element("own-name-why", HTMLElement);
const ID = "name"; // id of the request for a name
/** @type {Page.Context} */
let page;
let wanted = ""; // name that was sent and not answered yet

// The name that the server shows.
const nameNow = () => page.store.status?.name ?? "";

/** @param {string} words */
const refuse = (words) => {
  why.textContent = words;
  field.setAttribute("aria-invalid", String(words !== ""));
};

/** @param {string} name */
function ask(name) {
  wanted = name;
  page.say({ do: "rename", name, id: ID });
}

function open() {
  element("phone", HTMLDialogElement).close();
  field.value = t(nameNow());
  theme.value = document.documentElement.dataset.theme === "dark" ? "Dark" : "Light";
  language.value = document.documentElement.lang;
  refuse("");
  dialog.show();
  // On a touch screen the field would open its keyboard.
  hover.matches ? field.select() : dialog.focus();
}

async function snapshot() {
  const { scene, toast } = page;
  const png = await picture(scene);
  if (!png) return toast("There is no picture yet. Wait until the scene is shown.");
  const name = `katana450-${timestamp()}.png`;
  save(png, name);
  toast(`The picture is saved as ${name}.`);
}

/** @param {Page.Context} context */
export function begin(context) {
  page = context;
  const toggle = () => (dialog.open ? dialog.close() : open());
  onClick("more-button", toggle);
  first("#who p", HTMLElement).addEventListener("click", toggle);
  element("own-name-form", HTMLFormElement).addEventListener("submit", (event) => {
    event.preventDefault();
    ask(field.value === t(nameNow()) ? nameNow() : field.value);
  });
  theme.addEventListener("change", async () => (await import("./theme.js")).choose(theme.value));
  language.addEventListener("change", () => {
    page.kept.setItem(LANGUAGE, language.value);
    location.reload();
  });
  onClick("snapshot", snapshot);
  onClick("robots-button", () => chooseRobot());
  onClick("phone-bar", async () => {
    dialog.close();
    const { toggle } = await import("./more/phone.js");
    toggle(page.toast);
  });
  page.store.follow(note);
}

/** Show the choice of another robot; `file`: a description that was dropped on the page. @param {File} [file] */
export async function chooseRobot(file) {
  dialog.close();
  const { toggle } = await import("./more/robots.js");
  toggle({ page, file });
}

// Take a status: all windows load again when the server has changed its robot, and a person whom the server has named
// gets the kept name.
/** @param {Page.Status} status @param {Page.Status | null} before */
function note({ robot, name }, before) {
  if (robot && before?.robot && before.robot.key !== robot.key) location.reload();
  if (name === before?.name) return;
  const own = page.kept.getItem(NAME);
  // A server that was restarted has forgotten it.
  if (own && own !== name && /^Window \d+$/.test(name)) ask(own);
}

/** Take an answer; return whether it was for the menu. @param {Page.Answer} answer */
export function hear(answer) {
  if (answer.id === "robot") {
    if (answer.is === "refused") import("./more/robots.js").then(({ refuse }) => refuse(answer.why));
    return true;
  }
  if (answer.id !== ID) return false;
  if (answer.is === "refused") {
    refuse(answer.why);
    if (!dialog.open) page.toast(answer.why);
  } else {
    page.kept.setItem(NAME, wanted.trim());
    refuse("");
    dialog.close();
  }
  return true;
}
