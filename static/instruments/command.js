// What one knob asks for: not more often than the arm can use, the last word always, and what has
// become of it.
const EVERY = 40; // ms
const HEED = 300; // ms that a request without a ticket may take to be seen in the state

export class Command {
  #say;
  #request;
  #wanted = null;
  #timer = null;
  #sent = 0;
  #open = 0; // requests that are not answered yet
  #ticket = 0;
  #until = 0;

  // id: of its requests. request: of a value, the message without the id.
  constructor(id, request, say) {
    this.id = id;
    this.#request = request;
    this.#say = say;
  }

  send(value) {
    this.#wanted = value;
    if (this.#timer === null)
      this.#timer = setTimeout(() => this.#now(), Math.max(0, this.#sent + EVERY - performance.now()));
  }

  #now() {
    this.#timer = null;
    this.#sent = performance.now();
    this.#open += 1;
    this.#say({ ...this.#request(this.#wanted), id: this.id });
  }

  done({ ticket }) {
    this.#open = Math.max(0, this.#open - 1);
    if (ticket === undefined) this.#until = performance.now() + HEED;
    else this.#ticket = ticket;
  }

  // Refused, or the line is gone: nothing is wanted any more. Another server counts anew.
  forget() {
    clearTimeout(this.#timer);
    this.#timer = null;
    this.#open = this.#ticket = this.#until = 0;
  }

  // Whether a state knows all that was asked; until then its goal is an older one.
  heededIn(state) {
    const underWay = this.#timer !== null || this.#open > 0 || performance.now() < this.#until;
    return !underWay && state.ticket >= this.#ticket;
  }
}
