// The content of the sheet with its changes, which can be undone; kept in the browser for each arm.
import { kept, nameIn, restored } from "./poses.js";

/** @typedef {import("./poses.js").Kept} Kept */
/** @typedef {import("./poses.js").Pose} Pose */
const KEY = "katana450.teach";
const MAX_CHANGES = 100;
/** @type {Kept} */
export const NEW = { name: "My script", times: 1, poses: [], text: null, saved: null };

export class Content {
  #storage;
  #key;
  #listener;
  /** @type {Kept[]} */
  past = []; // what undo restores, the newest last
  /** @type {Kept[]} */
  future = []; // the same for redo
  now = NEW;
  broken = false; // whether something else was kept

  // storage: of the browser; arm: the answer `arm`. `listener` is called after each change.
  /** @param {Page.Kept} storage @param {Api.Arm} arm @param {() => void} listener */
  constructor(storage, arm, listener) {
    this.#storage = storage;
    this.#key = `${KEY} ${arm.name}`;
    this.#listener = listener;
    try {
      const json = storage.getItem(this.#key);
      if (json) this.now = restored(json, arm.joints.length);
    } catch {
      this.broken = true;
    }
  }

  /** The index of a pose; -1 without one. @param {string | null} id */
  indexOf(id) {
    return this.now.poses.findIndex((pose) => pose.id === id);
  }

  /** @param {Partial<Kept>} fields */
  change(fields) {
    this.past = [...this.past, this.now].slice(-MAX_CHANGES);
    this.future = [];
    this.#become({ ...this.now, ...fields });
  }

  /** Change one pose. @param {string} id @param {Partial<Pose>} fields */
  changePose(id, fields) {
    this.change({ poses: this.now.poses.map((pose) => (pose.id === id ? { ...pose, ...fields } : pose)) });
  }

  /** Keep what is no change to be undone, such as the text that is being edited, which has an undo of its own. @param {Partial<Kept>} fields */
  keep(fields) {
    this.#become({ ...this.now, ...fields });
  }

  undo() {
    const before = this.past.pop();
    if (!before) return;
    this.future.push(this.now);
    this.#become(before);
  }

  redo() {
    const after = this.future.pop();
    if (!after) return;
    this.past.push(this.now);
    this.#become(after);
  }

  /** @param {Kept} now */
  #become(now) {
    // A text has the name.
    this.now = { ...now, name: nameIn(now.text ?? "") ?? now.name };
    this.#storage.setItem(this.#key, kept(this.now));
    this.#listener();
  }
}
