// The bus of Feetech STS3215 servos: packets, and a Web Serial port that asks the motors one request
// at a time. As app/katana450/extensions/leader/packets.py and motor_bus.py.
const BAUD = 1_000_000;
const DEADLINE = 60; // ms, timeout for the answers to a request
const TRIES = 3;
const BROADCAST = 0xfe;
const LONGEST = 0x80; // highest length field that is taken for a packet
const [READ, WRITE, SYNC_READ] = [0x02, 0x03, 0x82];
// Registers: address, size, number of the sign bit
export const HOMING_OFFSET = [31, 2, 11];
export const TORQUE_ENABLE = [40, 1];
export const POSITION = [56, 2, 15];

const checksum = (body) => ~body.reduce((sum, byte) => sum + byte, 0) & 0xff;

// Return the bytes of a packet.
export function packet(id, code, parameters = []) {
  const body = [id, parameters.length + 2, code, ...parameters];
  return new Uint8Array([0xff, 0xff, ...body, checksum(body)]);
}

// Return the packets {id, code, parameters} in `bytes` and the rest, which may be the start of one.
export function packets(bytes) {
  const found = [];
  let at = 0;
  for (; at < bytes.length; at += 1) {
    if (bytes[at] !== 0xff || (bytes[at + 1] ?? 0xff) !== 0xff) continue;
    if (bytes.length - at < 6) break;
    const [id, length] = [bytes[at + 2], bytes[at + 3]];
    const end = at + 4 + length;
    if (id > BROADCAST || length < 2 || length > LONGEST) continue;
    if (end > bytes.length) break;
    const body = bytes.slice(at + 2, end - 1);
    if (bytes[end - 1] !== checksum(body)) continue;
    found.push({ id, code: body[2], parameters: body.slice(3) });
    at = end - 1;
  }
  return { found, rest: bytes.slice(at) };
}

// Return the value of `register` in little-endian bytes.
export function value([, , sign], bytes) {
  const number = bytes.reduce((sum, byte, i) => sum + byte * 256 ** i, 0);
  const bit = 2 ** (sign ?? 31);
  return Math.floor(number / bit) % 2 ? -(number % bit) : number;
}

export class Bus {
  #port;
  #reader;
  #writer;
  #rest = [];
  /** @type {(packet: {id: number, parameters: number[]}) => void} */
  #heard = () => {};
  lost = null; // the reason for which the port is lost

  // Open `port`. Throws an error of the browser.
  static async on(port) {
    await port.open({ baudRate: BAUD });
    return new Bus(port);
  }

  constructor(port) {
    this.#port = port;
    this.#reader = port.readable.getReader();
    this.#writer = port.writable.getWriter();
    this.#listen();
  }

  // Close the port, which may be lost.
  async close() {
    this.lost ??= "The port is closed.";
    await this.#reader.cancel().catch(() => {});
    this.#reader.releaseLock();
    this.#writer.releaseLock();
    await this.#port.close().catch(() => {});
  }

  async read(id, register) {
    return value(register, await this.#insist(packet(id, READ, register.slice(0, 2)), id, register[1]));
  }

  // Set a register of one byte.
  async write(id, register, byte) {
    await this.#insist(packet(id, WRITE, [register[0], byte]), id, 0);
  }

  // Return the values of `register` by the ids of the motors; null if one does not answer.
  async readAll(ids, register) {
    const answers = await this.#ask(packet(BROADCAST, SYNC_READ, [...register.slice(0, 2), ...ids]), ids, register[1]);
    return answers && new Map([...answers].map(([id, bytes]) => [id, value(register, bytes)]));
  }

  async #insist(request, id, size) {
    for (let i = 0; i < TRIES; i += 1) {
      const answers = await this.#ask(request, [id], size);
      if (answers) return answers.get(id);
    }
    throw new Error(this.lost ?? `Motor ${id} of the leader does not answer. Check its power and its cables.`);
  }

  // Return the parameters of the answers of all `ids`; null if one is missing.
  async #ask(request, ids, size) {
    this.#rest = [];
    const answers = new Map();
    const all = new Promise((resolve) => {
      this.#heard = ({ id, parameters }) => {
        if (ids.includes(id) && parameters.length === size) answers.set(id, parameters);
        if (answers.size === ids.length) resolve(answers);
      };
    });
    const late = new Promise((resolve) => setTimeout(resolve, DEADLINE, null));
    const sent = this.#writer.write(request).catch((error) => this.#lose(error.message));
    return Promise.race([all, late, sent.then(() => (this.lost ? null : all))]);
  }

  async #listen() {
    try {
      for (;;) {
        const { value: bytes, done } = await this.#reader.read();
        if (done) break;
        const { found, rest } = packets([...this.#rest, ...bytes]);
        this.#rest = rest;
        found.forEach((each) => this.#heard(each));
      }
      this.#lose("the port has ended.");
    } catch (error) {
      this.#lose(error.message);
    }
  }

  #lose(why) {
    this.lost ??= `The leader is unplugged: ${why}`;
  }
}
