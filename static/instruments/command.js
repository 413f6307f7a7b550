// The requests of one knob: limited in rate, but the last one is always sent, and followed until the
// state includes them.
const EVERY = 40; // ms
const HEED = 300; // ms after which a state includes a request without a ticket

export class Command {
  #say;
  #request;
  #value = 0;
  /** @type {number | null} */
  #timer = null;
  #sent = 0;
  #open = 0; // number of unanswered requests
  #ticket = 0;
  #until = 0;
  revocations = 0; // of the state before the turn

  // id: id of the requests. request: returns the message for a value, without the id.
  /** @param {string} id @param {(value: number) => Api.Act} request @param {Page.Say} say */
  constructor(id, request, say) {
    this.id = id;
    this.#request = request;
    this.#say = say;
  }

  /** @param {number} value */
  send(value) {
    this.#value = value;
    if (this.#timer === null)
      this.#timer = setTimeout(() => this.#now(), Math.max(0, this.#sent + EVERY - performance.now()));
  }

  #now() {
    this.#timer = null;
    this.#sent = performance.now();
    this.#open += 1;
    this.#say({ ...this.#request(this.#value), revocations: this.revocations, id: this.id });
  }

  /** @param {Pick<Api.Done, "ticket">} answer */
  done({ ticket }) {
    this.#open = Math.max(0, this.#open - 1);
    if (ticket == null) this.#until = performance.now() + HEED;
    else this.#ticket = ticket;
  }

  // Drop all requests after a refusal or a loss of the connection. A new server counts tickets from the start.
  forget() {
    clearTimeout(this.#timer ?? undefined);
    this.#timer = null;
    this.#open = this.#ticket = this.#until = 0;
  }

  /** Return whether `state` includes all requests; until then its goal is older. @param {Api.State} state */
  heededIn(state) {
    const underWay = this.#timer !== null || this.#open > 0 || performance.now() < this.#until;
    return !underWay && state.ticket >= this.#ticket;
  }
}
