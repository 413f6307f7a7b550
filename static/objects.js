// Objects and scenes from files: the server reads a file, and the object is placed where it was dropped, or before the arm.
"use strict";
const Objects = (() => {
  const API = "api/v1/";
  const UNREACHABLE = "The server does not answer. Try again.";
  /** @type {(id: string) => any} */
  const byId = (id) => document.getElementById(id);
  /** @type {(request: object) => void} */
  let say = () => {};
  let file = null; // the last file that was chosen
  let main = ""; // the file to read in it, if it is a .zip file of several
  let placed = null; // the name of its object
  let fitted = false; // whether its scale was chosen to fit
  let where = null; // [x, y] of the point of the table on which the files were dropped
  let waiting = null; // an answer whose object is placed when its scale is chosen
  const files = () => import("./objects/files.js");

  function tell(words, bad) {
    const line = byId("read");
    line.textContent = words;
    line.classList.toggle("bad", Boolean(bad));
  }

  // Send `body` and return the answer. A refusal is shown in the sheet, and null is returned.
  async function ask(path, body) {
    /** @type {NodeListOf<HTMLButtonElement | HTMLSelectElement>} */
    const busy = document.querySelectorAll("#objects button, #objects select");
    for (const each of busy) each.disabled = true;
    try {
      const answer = await fetch(API + path, { method: "POST", body });
      const text = await answer.text();
      if (answer.ok) return JSON.parse(text);
      const refused = text.startsWith("{") ? JSON.parse(text) : { why: text };
      tell(refused.why, true);
      offer(refused.choices ?? []);
    } catch {
      tell(UNREACHABLE, true);
    } finally {
      for (const each of busy) each.disabled = false;
    }
    return null;
  }

  async function add(again) {
    if (!file) return;
    byId("fit").hidden = true;
    offer([]);
    tell(`Reading ${file.name} …`);
    const query = new URLSearchParams({ name: file.name });
    if (byId("unit").value) query.set("unit", byId("unit").value);
    if (main) query.set("main", main);
    const mesh = await ask(`mesh?${query}`, file);
    if (!mesh) return;
    // A changed unit applies to the object that is already placed.
    mesh.name = again && placed ? placed : mesh.name;
    tell(`${mesh.name}: ${mesh.text}`);
    if (mesh.scale === 1) {
      // A unit that fits replaces a scale that was chosen to fit, but not one that was set in the panel.
      place(mesh, fitted ? 1 : undefined);
      fitted = false;
      return;
    }
    waiting = mesh;
    byId("fit-scale").value = String(mesh.scale);
    byId("fit").hidden = false;
    resize();
  }

  function place(mesh, scale) {
    placed = mesh.name;
    window.dispatchEvent(new Event("placed"));
    say({ do: "place", name: placed, shape: "mesh", mesh: mesh.key, ...(where && { near: where }), ...(scale && { scale }) });
  }

  const millimetres = (metres) => String(Number((1e3 * metres).toPrecision(3)));

  // Show the size that the typed scale gives.
  function resize() {
    const scale = Number(byId("fit-scale").value);
    const sides = waiting.size.map((side) => scale * side);
    const longest = Math.max(...sides);
    const fits = longest >= 1e-3 && longest <= 2 && scale >= 1e-3 && scale <= 1e3;
    byId("fit-size").textContent = fits || longest > 0 ? `${sides.map(millimetres).join(" × ")} mm` : "";
    byId("fit-size").classList.toggle("bad", !fits);
    byId("fit-place").disabled = !fits;
  }

  // Offer the files of a .zip file, one of which is to be read.
  function offer(choices) {
    byId("which").hidden = !choices.length;
    byId("which").replaceChildren(
      ...choices.slice(0, 24).map((path) => {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = path;
        button.addEventListener("click", () => {
          main = path;
          add(false);
        });
        return button;
      }),
    );
  }

  async function load(scene) {
    tell(`Reading ${scene.name} …`);
    const answer = await ask("scene", scene);
    if (!answer) return;
    say({ do: "load", scene: answer.key });
    tell(answer.text);
  }

  async function save() {
    const answer = await fetch(`${API}scene`).catch(() => null);
    if (!answer?.ok) return tell(answer ? (await answer.json()).why : UNREACHABLE, true);
    const link = document.createElement("a");
    link.href = URL.createObjectURL(await answer.blob());
    link.download = "scene.zip";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    tell("Saved. scene.zip contains scene.yaml and the files of its objects.");
  }

  function chosen(input, use) {
    input.addEventListener("change", () => {
      const list = [...input.files];
      // Cleared, so that the same file can be chosen again.
      input.value = "";
      if (list.length) use(list);
    });
  }

  function begin(page) {
    say = page.say;
    byId("add").addEventListener("click", () => byId("object-file").click());
    byId("load").addEventListener("click", () => byId("scene-file").click());
    byId("save").addEventListener("click", save);
    byId("unit").addEventListener("change", () => add(true));
    byId("add-folder").addEventListener("click", () => byId("object-folder").click());
    byId("add-folder").hidden = !("webkitdirectory" in byId("object-folder")) || matchMedia("(pointer: coarse)").matches;
    byId("fit-scale").addEventListener("input", resize);
    byId("fit").addEventListener("submit", (event) => {
      event.preventDefault();
      const scale = Number(byId("fit-scale").value);
      byId("fit").hidden = true;
      fitted = true;
      place(waiting, scale);
      tell(`${waiting.name}: placed at the scale ${scale}, ${byId("fit-size").textContent}.`);
    });
    chosen(byId("object-file"), take);
    chosen(byId("object-folder"), take);
    chosen(byId("scene-file"), ([first]) => load(first));
  }

  // Read files that were chosen or dropped: one object or several, or a scene in a .zip file. `entries` are the dropped
  // files and folders, `at` is the point of the table on which they were dropped.
  async function take(list, entries, at = null) {
    const robot = [...list].find(({ name }) => /\.(urdf|xacro)$/i.test(name));
    if (robot) return More.chooseRobot(robot);
    where = at;
    if (byId("objects").hidden) byId("objects-button").click();
    const { gathered, areAlone, excess, zipped, isScene } = await files();
    const found = await gathered(list, entries).catch(() => []);
    if (!found.length) {
      // One file of another kind is refused by the server, which lists the kinds it can read.
      if (list.length === 1 && list[0].size) return read(list[0]);
      return tell("None of these files can be read as an object.", true);
    }
    const why = excess(found);
    if (why) return tell(why, true);
    if (found.length > 1 && !areAlone(found)) {
      const [folder] = found[0].path.split("/").slice(0, -1);
      return read(await zipped(found, `${folder ?? "files"}.zip`));
    }
    for (const each of found) {
      if (/\.zip$/i.test(each.path) && (await isScene(each.file))) await load(each.file);
      else await read(each.file);
    }
  }

  function read(first) {
    file = first;
    main = "";
    placed = null;
    fitted = false;
    return add(false);
  }

  return { begin, take };
})();
