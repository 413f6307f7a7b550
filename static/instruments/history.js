// The history: a ring buffer of recent samples, each with a time and a number per channel.
const CAPACITY = 18_000; // samples, ten minutes at 30 Hz
const AT_REST = 0.1; // s, age from which a state is that of an arm at rest and not a late one
const RESTART = 1.0; // s by which the clock goes back only if the server was restarted
export const GAP = 1.0; // s without a sample, above which a line is interrupted

export class History {
  #times = new Float64Array(CAPACITY);
  #columns;
  end = 0; // number of all samples; the last CAPACITY of them are stored

  /** channels: [{label, of(state)}]; a missing number is NaN. @param {import("./channels.js").Channel[]} channels */
  constructor(channels) {
    this.channels = channels;
    this.#columns = channels.map(() => new Float64Array(CAPACITY));
  }

  /** @param {Api.State} state */
  take(state) {
    const t = state.sent - state.t > AT_REST ? state.sent : state.t;
    if (t < this.newest - RESTART) this.end = 0;
    if (t <= this.newest) return;
    const slot = this.end % CAPACITY;
    this.#times[slot] = t;
    this.channels.forEach((channel, i) => (this.#columns[i][slot] = channel.of(state) ?? NaN));
    this.end += 1;
  }

  get newest() {
    return this.end ? this.time(this.end - 1) : -Infinity;
  }

  get first() {
    return Math.max(0, this.end - CAPACITY);
  }

  /** @param {number} n */
  time(n) {
    return this.#times[n % CAPACITY];
  }

  /** @param {number} channel @param {number} n */
  value(channel, n) {
    return this.#columns[channel][n % CAPACITY];
  }

  /** Return the first sample that is not before t. @param {number} t */
  at(t) {
    let [low, high] = [this.first, this.end];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time(middle) < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Return the sample nearest to t; -1 if there is none. @param {number} t */
  nearest(t) {
    const n = this.at(t);
    if (n > this.first && (n === this.end || t - this.time(n - 1) < this.time(n) - t)) return n - 1;
    return n < this.end ? n : -1;
  }
}
