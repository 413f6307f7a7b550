// The page's connection to the gateway, in a worker, so that a busy page or a hidden tab cannot slow it.
"use strict";
const HEARTBEAT = 100; // ms between heartbeats of a page that may drive; app/katana450/arm/control/lease.py expects it
const REST = 500; // ms between them while nobody drives and this page is not used
const USE = 2000; // ms after the last act for which a page counts as used
const AGAIN = 400; // ms before the next attempt to connect
const GIVE_UP = 3000; // ms, timeout for opening a connection and for silence on an open one
const AHEAD = 3; // maximum of unanswered queries: fewer states are requested on a slow connection

let url = null;
let socket = null;
let count = 0;
let heard = 0;
let opened = 0;
let beaten = -Infinity; // time of the newest heartbeat
let used = -Infinity; // time of the newest act of a person
let free = false; // whether nobody drives and nothing is planned, so that nothing moves
const heartbeats = new Map();
let pace = null; // timer of the queries for states, while they are shown
const looks = new Map();

function connect() {
  socket = new WebSocket(url);
  opened = performance.now();
  free = false;
  const mine = socket;
  mine.onopen = () => {
    heard = performance.now();
    heartbeats.clear();
    looks.clear();
    postMessage({ link: "up" });
  };
  mine.onmessage = ({ data }) => {
    heard = performance.now();
    const message = JSON.parse(data);
    if (looks.has(message.id)) return shown(message);
    if (message.is === "status") learn(message);
    if (message.is !== "echo") return postMessage({ heard: message });
    const sent = heartbeats.get(message.n);
    if (sent !== undefined) postMessage({ trip: heard - sent });
    for (const n of heartbeats.keys()) if (n <= message.n) heartbeats.delete(n);
  };
  mine.onclose = ({ code }) => {
    if (mine !== socket) return;
    postMessage({ link: "down", code });
    socket = null;
    setTimeout(connect, AGAIN);
  };
}

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

// Pass on the answer to a query. It is no state while there is no arm yet.
function shown(message) {
  const took = performance.now() - looks.get(message.id);
  looks.delete(message.id);
  if (message.is === "state") postMessage({ heard: message, took });
}

// Learn from the changes of the status whether the arm is free.
const known = {};
function learn(changes) {
  Object.assign(known, changes);
  free = known.holder === null && !known.planning;
}

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

function watch(hz) {
  clearInterval(pace);
  pace = hz > 0 ? setInterval(look, 1000 / hz) : null;
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
    postMessage({ link: "down", code: 0 });
    setTimeout(connect, AGAIN);
  } else if (open) {
    if (!free || now - used < USE || now - beaten > REST - HEARTBEAT / 2) beat(now);
    const [unanswered = now] = heartbeats.values();
    postMessage({ silent: now - Math.max(heard, unanswered) });
  }
}, HEARTBEAT);

onmessage = ({ data }) => {
  if (data.open) {
    url = data.open;
    connect();
  } else if (data.watch !== undefined) watch(data.watch);
  else if (data.used) use();
  else {
    if (!say(data.say)) postMessage({ unsaid: data.say.do });
    use();
  }
};
