// Direct changes to the scene: a dropped file, Delete, undo and redo.
"use strict";
const Edit = (() => {
  /** @type {(id: string) => any} */
  const byId = (id) => document.getElementById(id);
  const scene = byId("scene");
  let page = null; // {say, toast, connected, scene}
  let changes = { undo: [], redo: [] }; // names of what can be undone and redone, the newest first
  let revocations = 0; // number of stops and changes of driver: an undo from before the next one is refused
  let leaving = null;

  // what: undo or redo.
  function step(what) {
    if (!page.connected()) return page.toast("No connection to the arm.");
    if (changes[what].length) page.toast(`${what === "undo" ? "Undo" : "Redo"}: ${changes[what][0]}`);
    page.say({ do: what, revocations, id: "undo" });
  }

  // Return whether the key was handled.
  function key(event) {
    // Teach undoes its own changes.
    if (event.type !== "keydown" || event.altKey || event.target?.closest?.("#teach")) return false;
    // The letter on the key, which is elsewhere on other keyboards; the place of the key if it has no such letter.
    const letter = (/^[a-z]$/i.test(event.key) ? event.key : event.code.slice(3)).toLowerCase();
    if ((letter === "z" || letter === "y") && (event.ctrlKey || event.metaKey)) {
      if (!event.repeat) step(letter === "y" || event.shiftKey ? "redo" : "undo");
      return true;
    }
    return !event.repeat && event.key === "Delete" && Boolean(page.scene()?.remove());
  }

  function note({ detail: status }) {
    changes = { undo: status.undo ?? [], redo: status.redo ?? [] };
    revocations = status.revocations;
    const names = changes.undo.length ? changes.undo : ["nothing yet"];
    const list = byId("undoable");
    if ([...list.children].map((each) => each.textContent).join() !== names.join())
      list.replaceChildren(...names.map((name) => Object.assign(document.createElement("li"), { textContent: name })));
    for (const what of ["undo", "redo"]) byId(what).disabled = !changes[what].length;
  }

  // Return the point [x, y] of the table below the pointer; null if it is over something else.
  function tableAt({ clientX, clientY, target }) {
    return target.matches?.("canvas") && target.ownerDocument === scene.contentDocument ? page.scene()?.tableAt([clientX, clientY]) : null;
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
    const files = [...event.dataTransfer.files];
    // Folders are read after this event, which ends the access to what was dropped.
    const entries = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
    if (files.length === 1 && /\.mcap$/i.test(files[0].name)) page.replay(files[0]);
    else if (files.length || entries.length) Objects.take(files, entries, tableAt(event));
  }

  function listen(target) {
    for (const kind of ["dragenter", "dragover", "drop"]) target.addEventListener(kind, drag, { capture: true });
  }

  function begin(options) {
    page = options;
    listen(window);
    window.addEventListener("status", note);
    for (const what of ["undo", "redo"]) byId(what).addEventListener("click", () => step(what));
    // A page that could not be loaded gives no access.
    const enter = () => scene.contentDocument && listen(scene.contentWindow);
    scene.addEventListener("load", enter);
    // It may be loaded already.
    enter();
  }

  return { begin, key };
})();
