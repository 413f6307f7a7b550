// The content of the sheet with its changes, which can be undone; kept in the browser.
import { kept, restored } from "./poses.js";

const KEY = "katana450.teach";
const MAX_CHANGES = 100;

export class Content {
  #storage;
  #listener;
  #past = [];
  #future = [];
  now = { name: "My script", times: 1, poses: [], text: null };
  broken = false; // whether something else was kept

  // storage: of the browser, or null. `listener` is called after each change.
  constructor(storage, listener) {
    this.#storage = storage;
    this.#listener = listener;
    try {
      const json = storage?.getItem(KEY);
      if (json) this.now = restored(json);
    } catch {
      this.broken = true;
    }
  }

  get undoable() {
    return this.#past.length > 0;
  }

  get redoable() {
    return this.#future.length > 0;
  }

  change(fields) {
    this.#past = [...this.#past, this.now].slice(-MAX_CHANGES);
    this.#future = [];
    this.#become({ ...this.now, ...fields });
  }

  // Change one pose.
  changePose(id, fields) {
    this.change({ poses: this.now.poses.map((pose) => (pose.id === id ? { ...pose, ...fields } : pose)) });
  }

  // Keep the text that is being edited, which has an undo of its own.
  keepText(text) {
    this.#become({ ...this.now, text });
  }

  undo() {
    if (!this.undoable) return;
    this.#future.push(this.now);
    this.#become(this.#past.pop());
  }

  redo() {
    if (!this.redoable) return;
    this.#past.push(this.now);
    this.#become(this.#future.pop());
  }

  #become(now) {
    this.now = now;
    try {
      this.#storage?.setItem(KEY, kept(now));
    } catch {
      // The browser keeps nothing; the sheet works as long as the page is open.
    }
    this.#listener();
  }
}
