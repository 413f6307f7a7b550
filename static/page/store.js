// What the page knows: the status of the arm, and its connection to the server. The parts of the page read it here, and
// follow each status.

export class Store {
  /** @type {Page.Status | null} */
  status = null; // the newest; null before the first
  up = false; // whether there is a connection
  since = performance.now(); // time of the last loss of the connection
  silent = 0; // ms without a message
  /** @type {number | null} */
  trip = null; // ms, round trip; null if it is not known
  /** @type {string | null} */
  proven = null; // cause of a stop that is confirmed on another path
  object = ""; // name of the selected object
  /** @type {((status: Page.Status, before: Page.Status | null) => void)[]} */
  #followers = [];

  // The status while there is a connection; null without one.
  get live() {
    return this.up ? this.status : null;
  }

  /** Call `follower` with each status from now on, and the one before it. @param {(status: Page.Status, before: Page.Status | null) => void} follower */
  follow(follower) {
    this.#followers.push(follower);
  }

  /** Select an object by its name, in the scene and in the sheet of objects; "" selects none. @param {string} name */
  select(name) {
    if (name === this.object) return;
    this.object = name;
    window.dispatchEvent(new Event("selected"));
  }

  connect() {
    [this.up, this.silent] = [true, 0];
  }

  disconnect() {
    if (this.up) this.since = performance.now();
    [this.up, this.trip] = [false, null];
  }

  /** Note a round trip [ms]. @param {number} trip */
  note(trip) {
    this.trip = this.trip === null ? trip : 0.8 * this.trip + 0.2 * trip;
  }

  /** Take a message, which has only the changes; the first has all. @param {Partial<Page.Status>} changes */
  take(changes) {
    const before = this.status;
    const status = /** @type {Page.Status} */ ({ ...before, ...changes });
    this.status = status;
    for (const follower of this.#followers) follower(status, before);
  }
}
