// The page's connection to the gateway, in a worker, so that a busy page or a hidden tab cannot slow it.
const HEARTBEAT = 100; // ms between heartbeats of a page that may drive; app/katana450/arm/control/lease.py expects it
const REST = 500; // ms between them while nobody drives and this page is not used
const USE = 2000; // ms after the last act for which a page counts as used
const AGAIN = 400; // ms before the next attempt to connect
const GIVE_UP = 3000; // ms, timeout for opening a connection and for silence on an open one
const AHEAD = 3; // maximum of unanswered queries: fewer states are requested on a slow connection

/** @type {string | null} */
let url = null;
/** @type {WebSocket | null} */
let socket = null;
let count = 0;
let heard = 0;
let opened = 0;
let beaten = -Infinity; // time of the newest heartbeat
let used = -Infinity; // time of the newest act of a person
let free = false; // whether nobody drives and nothing is planned, so that nothing moves
/** @type {Map<number, number>} */
const heartbeats = new Map();
/** @type {number | undefined} */
let pace; // timer of the queries for states, while they are shown
/** @type {Map<number | string, number>} */
const looks = new Map();

/** @param {Page.LinkEvent} message */
const post = (message) => postMessage(message);

function connect() {
  if (url === null) return;
  socket = new WebSocket(url);
  opened = performance.now();
  free = false;
  const mine = socket;
  mine.onopen = () => {
    heard = performance.now();
    heartbeats.clear();
    looks.clear();
    post({ link: "up" });
  };
  mine.onmessage = ({ data }) => {
    heard = performance.now();
    const message = JSON.parse(data);
    if (looks.has(message.id)) return shown(message);
    if (message.is === "status") learn(message);
    if (message.is !== "echo") return post({ heard: message });
    const sent = heartbeats.get(message.n);
    if (sent !== undefined) post({ trip: heard - sent });
    for (const n of heartbeats.keys()) if (n <= message.n) heartbeats.delete(n);
  };
  mine.onclose = ({ code }) => {
    if (mine !== socket) return;
    post({ link: "down", code });
    socket = null;
    setTimeout(connect, AGAIN);
  };
}

/** @param {Api.Act} message */
function say(message) {
  if (socket?.readyState !== WebSocket.OPEN) return false;
  // The server does not execute what arrives late, by this page's own clock.
  socket.send(JSON.stringify({ ...message, made: performance.now() / 1000 }));
  return true;
}

function look() {
  if (looks.size >= AHEAD) return;
  const id = (count += 1);
  if (say({ do: "query", id })) looks.set(id, performance.now());
}

/** Pass on the answer to a query. It is no state while there is no arm yet. @param {Api.Answer} message */
function shown(message) {
  const took = performance.now() - (looks.get(message.id ?? "") ?? 0);
  looks.delete(message.id ?? "");
  if (message.is === "state") post({ heard: message, took });
}

/** Learn from the changes of the status whether the arm is free. @type {Partial<Page.Status>} */
const known = {};
/** @param {Partial<Page.Status>} changes */
function learn(changes) {
  Object.assign(known, changes);
  free = known.holder === null && !known.planning;
}

/** @param {number} now */
function beat(now) {
  beaten = now;
  heartbeats.set(++count, now);
  say({ do: "heartbeat", n: count });
}

// Note an act of a person, which may begin to drive: heartbeats come at once and often from now on.
function use() {
  used = performance.now();
  if (used - beaten >= HEARTBEAT && socket?.readyState === WebSocket.OPEN) beat(used);
}

/** @param {number} hz */
function watch(hz) {
  clearInterval(pace);
  pace = hz > 0 ? setInterval(look, 1000 / hz) : undefined;
}

setInterval(() => {
  if (!socket) return;
  const now = performance.now();
  const open = socket.readyState === WebSocket.OPEN;
  if (now - (open ? heard : opened) > GIVE_UP) {
    // The browser's own timeout is several minutes.
    const old = socket;
    socket = null;
    old.close();
    post({ link: "down", code: 0 });
    setTimeout(connect, AGAIN);
  } else if (open) {
    if (!free || now - used < USE || now - beaten > REST - HEARTBEAT / 2) beat(now);
    const [unanswered = now] = heartbeats.values();
    post({ silent: now - Math.max(heard, unanswered) });
  }
}, HEARTBEAT);

/** @param {MessageEvent<Page.Order>} event */
onmessage = ({ data }) => {
  if (data.open) {
    url = data.open;
    connect();
  } else if (data.watch !== undefined) watch(data.watch);
  else if (data.used) use();
  else {
    if (data.say && !say(data.say)) post({ unsaid: data.say.do });
    use();
  }
};
