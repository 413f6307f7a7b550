// Direct changes to the scene: a dropped file, a click on an object, Delete, and Ctrl-Z.
"use strict";
const Edit = (() => {
  const CLICK = 5; // px, within which a press and its release count as a click
  /** @type {(id: string) => any} */
  const byId = (id) => document.getElementById(id);
  const scene = byId("scene");
  let page = null; // {say, toast, connected}
  let undoable = []; // names of the changes that can be undone, the newest first
  let selection = null; // loaded with the first click into the scene
  let pressed = null;
  let leaving = null;

  function undo() {
    if (!page.connected()) return page.toast("No connection to the arm.");
    if (undoable.length) page.toast(`Undo: ${undoable[0]}`);
    page.say({ do: "undo", id: "undo" });
  }

  // Return whether the key was handled.
  function key(event) {
    if (event.type !== "keydown" || event.altKey) return false;
    // The letter on the key, which is elsewhere on other keyboards; the place of the key if it has no such letter.
    const isZ = /^[a-z]$/i.test(event.key) ? event.key.toLowerCase() === "z" : event.code === "KeyZ";
    if (isZ && (event.ctrlKey || event.metaKey) && !event.shiftKey) {
      if (!event.repeat) undo();
      return true;
    }
    return !event.repeat && event.key === "Delete" && Boolean(selection?.remove());
  }

  function note({ detail: status }) {
    undoable = status.undo ?? [];
    const list = undoable.slice(0, 5).join(", ") || "nothing yet";
    if (byId("undoable").textContent !== list) byId("undoable").textContent = list;
    byId("undo").disabled = !undoable.length;
  }

  // Show the place for a file while one is dragged over the page.
  function drag(event) {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    const over = event.type === "dragover";
    event.dataTransfer.dropEffect = "copy";
    byId("stage").classList.toggle("dropping", over || event.type === "dragenter");
    clearTimeout(leaving);
    // dragover comes all the time while the file is over the page.
    leaving = setTimeout(() => byId("stage").classList.remove("dropping"), 300);
    if (event.type !== "drop") return;
    const [file] = event.dataTransfer.files;
    if (file) Objects.take(file);
  }

  async function click(event) {
    const still = pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < CLICK;
    pressed = null;
    if (!still || event.button) return;
    if (!selection) {
      const { Selection } = await import("./selection/selection.js");
      selection ??= new Selection(byId("stage"), scene, page.say);
    }
    selection.pick(event.clientX, event.clientY);
  }

  function listen(target) {
    for (const kind of ["dragenter", "dragover", "drop"]) target.addEventListener(kind, drag, { capture: true });
  }

  function begin(options) {
    page = options;
    listen(window);
    window.addEventListener("status", note);
    byId("undo").addEventListener("click", undo);
    scene.addEventListener("load", () => {
      // A page that could not be loaded gives no access.
      if (!scene.contentDocument) return;
      const inner = scene.contentWindow;
      listen(inner);
      inner.addEventListener("pointerdown", ({ target, clientX, clientY }) => {
        pressed = target.matches?.("canvas") ? [clientX, clientY] : null;
      }, { capture: true });
      inner.addEventListener("pointerup", click, { capture: true });
    });
  }

  return { begin, key };
})();
