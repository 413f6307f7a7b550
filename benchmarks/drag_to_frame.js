// Measures one mouse move at a time: the event, the message it causes, the frame that shows it.
(() => {
  "use strict";
  const MOVE_LIMIT = 10000; // ms
  const SAME = 1e-9; // m, and rotation entries: a smaller change is not a new pose

  let prefixes = [];
  let lastChange = 0;
  let mark = null; // {event, drawn} of the current move, ms of performance.now()
  const seen = new Map(); // matrix of each watched node in the last frame, by name

  const isWatched = (name) =>
    prefixes.some((prefix) => name === prefix || name.startsWith(`${prefix}/`));

  function isShown(object) {
    for (let each = object; each; each = each.parent) if (!each.visible) return false;
    return true;
  }

  function changed() {
    let any = false;
    for (const [name, object] of Object.entries(window.__viserMutable.nodeRefFromName)) {
      if (!object || !isWatched(name) || !isShown(object)) continue;
      const { elements } = object.matrixWorld;
      if (seen.get(name)?.every((old, i) => Math.abs(old - elements[i]) <= SAME)) continue;
      seen.set(name, [...elements]);
      any = true;
    }
    return any;
  }

  function later(condition, what) {
    return new Promise((resolve, reject) => {
      const deadline = performance.now() + MOVE_LIMIT;
      const look = () => {
        if (condition()) resolve();
        else if (performance.now() > deadline) reject(new Error(what));
        else setTimeout(look, 5);
      };
      look();
    });
  }

  // Watches nodes below the prefixes; returns the number of nodes shown now.
  harness.watch = (below) => {
    prefixes = below;
    const { scene } = window.__viserMutable;
    changed();
    const before = scene.onAfterRender;
    scene.onAfterRender = function (...args) {
      before.apply(this, args);
      if (!changed()) return;
      lastChange = performance.now();
      if (mark?.event && !mark.drawn) mark.drawn = lastChange;
    };
    const onMove = (event) => {
      if (mark && !mark.event) mark.event = event.timeStamp;
    };
    window.addEventListener("pointermove", onMove, { capture: true });
    return seen.size;
  };

  // Waits until no watched node has moved for `quiet` ms, then measures the next mouse move.
  harness.arm = async (quiet) => {
    const still = () => performance.now() - lastChange > quiet;
    await later(still, `the watched nodes do not come to rest: no ${quiet} ms without a new pose`);
    mark = {};
  };

  // Returns the first message since a time (s) that changes the pose of a watched node.
  function firstNewPose(since) {
    const last = new Map();
    return harness.received.find(({ time, type, body }) => {
      const pose = { SetPositionMessage: body.position, SetOrientationMessage: body.wxyz }[type];
      if (!pose || !isWatched(body.name)) return false;
      const key = `${type} ${body.name}`;
      const isNew = String(pose) !== last.get(key);
      last.set(key, String(pose));
      return isNew && time >= since;
    });
  }

  // Returns ms from the mouse event to the message with a new pose of a watched node and its frame.
  harness.timed = async () => {
    await later(() => mark.drawn, "no watched node moved after the mouse did");
    const since = (performance.timeOrigin + mark.event) / 1000;
    return { message: (firstNewPose(since).time - since) * 1000, drawn: mark.drawn - mark.event };
  };
})();
