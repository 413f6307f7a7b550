// The page's line to the gateway, in a worker, where a busy page and a hidden tab do not slow it.
"use strict";
const BEAT = 100; // ms; app/control/lease.py counts on it
const AGAIN = 400; // ms
const GIVE_UP = 3000; // ms for a connection to open, or of silence on one that is open

let url = null;
let socket = null;
let count = 0;
let heard = 0;
let opened = 0;
const beats = new Map();

function connect() {
  socket = new WebSocket(url);
  opened = performance.now();
  const mine = socket;
  mine.onopen = () => {
    heard = performance.now();
    beats.clear();
    postMessage({ link: "up" });
  };
  mine.onmessage = ({ data }) => {
    heard = performance.now();
    const message = JSON.parse(data);
    if (message.is !== "echo") return postMessage({ heard: message });
    const sent = beats.get(message.n);
    if (sent !== undefined) postMessage({ trip: heard - sent });
    for (const n of beats.keys()) if (n <= message.n) beats.delete(n);
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
    beats.set(++count, now);
    say({ do: "beat", n: count });
    postMessage({ silent: now - heard });
  }
}, BEAT);

onmessage = ({ data }) => {
  if (data.open) {
    url = data.open;
    connect();
  } else if (!say(data.say)) postMessage({ unsaid: data.say.do });
};
