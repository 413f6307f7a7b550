// Runs in every frame before all scripts of the page. `harness` already contains the options.
(() => {
  "use strict";
  const MAX_NUMBERS = 64; // longer arrays (meshes, images) are recorded by their length

  harness.received = []; // {time, type, body}: decoded messages from the server
  harness.sent = []; //     {time, type, body}: messages to the server
  harness.links = []; //    {time, type}: "connected" and "closed"
  harness.now = () => (performance.timeOrigin + performance.now()) / 1000; // s since the epoch

  function plain(value) {
    if (ArrayBuffer.isView(value))
      return value.length <= MAX_NUMBERS ? Array.from(value) : { length: value.length };
    if (Array.isArray(value))
      return value.length <= MAX_NUMBERS ? value.map(plain) : { length: value.length };
    if (value === null || typeof value !== "object") return value;
    return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, plain(item)]));
  }

  function note(log, message) {
    log.push({ time: harness.now(), type: message.type, body: plain(message) });
  }

  // viser's socket is in a worker, which passes decoded messages to the page.
  window.Worker = class extends Worker {
    constructor(...args) {
      super(...args);
      // This listener runs before the page's own, which is set after construction.
      this.addEventListener("message", ({ data }) => {
        if (data?.type === "message_batch")
          for (const message of data.messages) note(harness.received, message);
        else if (data?.type === "connected" || data?.type === "closed")
          harness.links.push({ time: harness.now(), type: data.type });
      });
    }
    postMessage(data, ...rest) {
      if (data?.type === "send") note(harness.sent, data.message);
      super.postMessage(data, ...rest);
    }
  };

  // Software rendering is slow: no antialiasing, and drawing only on request.
  harness.draw = (draws) => {
    const before = harness.draws;
    harness.draws = draws;
    return before;
  };
  const DRAWS = ["drawArrays", "drawElements", "drawArraysInstanced", "drawElementsInstanced"];
  const UNMASKED_RENDERER_WEBGL = 0x9246;
  const getContext = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, attributes) {
    if (!/^webgl/.test(kind)) return getContext.call(this, kind, attributes);
    const gl = getContext.call(this, kind, {
      ...attributes,
      antialias: harness.fullQuality,
    });
    if (gl === null || gl.recorded) return gl;
    gl.recorded = true;
    // The light of the scene is drawn once, outside the canvas, and would be missing in a picture.
    let beside = false;
    const bindFramebuffer = gl.bindFramebuffer;
    gl.bindFramebuffer = (target, framebuffer) => {
      beside = framebuffer !== null;
      bindFramebuffer.call(gl, target, framebuffer);
    };
    for (const name of DRAWS) {
      const draw = gl[name];
      gl[name] = (...args) => {
        if (harness.draws || (beside && harness.fullQuality)) draw.apply(gl, args);
      };
    }
    // The name of a software renderer makes viser cover the scene with a warning.
    const getParameter = gl.getParameter;
    gl.getParameter = (name) =>
      name === UNMASKED_RENDERER_WEBGL ? "not named in tests" : getParameter.call(gl, name);
    return gl;
  };

  // viser offers its state here as soon as there is a renderer, before the first frame.
  let viewer;
  Object.defineProperty(window, "__viserMutable", {
    configurable: true,
    get: () => viewer,
    set: (value) => {
      viewer = value;
      const { shadowMap } = value.scene.__r3f.root.getState().gl;
      Object.defineProperty(shadowMap, "enabled", { get: () => harness.fullQuality, set: () => {} });
    },
  });
})();
