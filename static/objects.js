// Objects and scenes from files: the server reads a file, and the object is placed before the arm.
"use strict";
const Objects = (() => {
  const API = "api/v1/";
  const UNREACHABLE = "The server does not answer. Try again.";
  /** @type {(id: string) => any} */
  const byId = (id) => document.getElementById(id);
  /** @type {(request: object) => void} */
  let say = () => {};
  let file = null; // the last file that was chosen
  let placed = null; // the name of its object

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
      tell(text.startsWith("{") ? JSON.parse(text).why : text, true);
    } catch {
      tell(UNREACHABLE, true);
    } finally {
      for (const each of busy) each.disabled = false;
    }
    return null;
  }

  async function add(again) {
    if (!file) return;
    tell(`Reading ${file.name} …`);
    const query = new URLSearchParams({ name: file.name });
    if (byId("unit").value) query.set("unit", byId("unit").value);
    const mesh = await ask(`mesh?${query}`, file);
    if (!mesh) return;
    // A changed unit applies to the object that is already placed.
    placed = again && placed ? placed : mesh.name;
    window.dispatchEvent(new Event("placed"));
    say({ do: "place", name: placed, shape: "mesh", mesh: mesh.key });
    tell(`${placed}: ${mesh.text}`);
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
      const [first] = input.files;
      // Cleared, so that the same file can be chosen again.
      input.value = "";
      if (first) use(first);
    });
  }

  function begin(page) {
    say = page.say;
    byId("add").addEventListener("click", () => byId("object-file").click());
    byId("load").addEventListener("click", () => byId("scene-file").click());
    byId("save").addEventListener("click", save);
    byId("unit").addEventListener("change", () => add(true));
    chosen(byId("object-file"), take);
    chosen(byId("scene-file"), load);
  }

  // Read a file that was chosen or dropped: an object, or a scene in a .zip file.
  function take(first) {
    if (byId("objects").hidden) byId("objects-button").click();
    if (/\.zip$/i.test(first.name)) return load(first);
    file = first;
    placed = null;
    return add(false);
  }

  return { begin, take };
})();
