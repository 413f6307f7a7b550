// The page's line to the gateway, in a worker, where a busy page and a hidden tab do not slow it.
"use strict";
const BEAT = 100; // ms; app/katana450/arm/control/lease.py counts on it
const AGAIN = 400; // ms
const GIVE_UP = 3000; // ms for a connection to open, or of silence on one that is open
const AHEAD = 3; // states asked for and not yet come: a slow line is asked less often

let url = null;
let socket = null;
let count = 0;
let heard = 0;
let opened = 0;
const heartbeats = new Map();
let pace = null; // of asking for states, while somebody looks at them
const looks = new Map();

function connect() {
  socket = new WebSocket(url);
  opened = performance.now();
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
  socket.send(JSON.stringify(message));
  return true;
}

function look() {
  if (looks.size >= AHEAD) return;
  const id = (count += 1);
  if (say({ do: "query", id })) looks.set(id, performance.now());
}

// Without an arm yet there is none to be shown.
function shown(message) {
  const took = performance.now() - looks.get(message.id);
  looks.delete(message.id);
  if (message.is === "state") postMessage({ heard: message, took });
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
    // The browser itself would wait for minutes.
    const old = socket;
    socket = null;
    old.close();
    postMessage({ link: "down", code: 0 });
    setTimeout(connect, AGAIN);
  } else if (open) {
    heartbeats.set(++count, now);
    say({ do: "heartbeat", n: count });
    postMessage({ silent: now - heard });
  }
}, BEAT);

onmessage = ({ data }) => {
  if (data.open) {
    url = data.open;
    connect();
  } else if (data.watch !== undefined) watch(data.watch);
  else if (!say(data.say)) postMessage({ unsaid: data.say.do });
};
