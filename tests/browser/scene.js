// Functions that read the page: nodes, poses, the camera, and the handle under a pixel.
(() => {
  "use strict";
  const FRAME_LIMIT = 30000; // ms; a software renderer compiles its shaders for seconds

  const viewer = () => window.__viserMutable;
  const renderer = () => viewer().scene.__r3f.root.getState();

  function node(name) {
    const object = viewer().nodeRefFromName[name];
    if (!object) throw new Error(`the page shows no node ${name}`);
    return object;
  }

  // Return the names of missing nodes or parts; empty when the scene can be used.
  harness.missing = (names) => {
    if (!viewer()?.cameraControl || !window.__viserSceneTree) return ["viser"];
    if (harness.links.at(-1)?.type !== "connected") return ["connection"];
    if (viewer().firstMessageBatch || viewer().messageQueue.length) return ["messages"];
    const tree = window.__viserSceneTree.getState();
    const shown = Object.keys(tree).filter((name) => tree[name]?.effectiveVisibility !== false);
    const { nodeRefFromName, nodePoseData } = viewer();
    return [...new Set([...shown, ...names])].filter((name) => {
      // viser draws all labels together, so they have no nodes.
      if (tree[name]?.message?.type === "LabelMessage") return false;
      const pose = nodePoseData[name];
      return !nodeRefFromName[name] || (pose && pose.poseUpdateState !== "updated");
    });
  };

  // Whether the server has sent everything since the last connection, with the panel and hidden nodes.
  harness.replayed = () => {
    const since = harness.links.findLast(({ type }) => type === "connected")?.time;
    return harness.received.some(({ type, time }) => type === "ReplayDoneMessage" && time >= since);
  };

  // Resolve with the time of the first frame that shows the whole scene with these nodes, when its pixels are there.
  harness.firstWhole = (names) =>
    new Promise((resolve) => {
      (function watch() {
        if (!viewer()?.scene) return requestAnimationFrame(watch);
        const { scene } = viewer();
        let whole = false;
        const [before, after] = [scene.onBeforeRender, scene.onAfterRender];
        scene.onBeforeRender = function (...args) {
          before.apply(this, args);
          whole = renderer().gl.getRenderTarget() === null && !harness.missing(names).length;
        };
        scene.onAfterRender = function (gl, ...args) {
          after.call(this, gl, ...args);
          if (!whole) return;
          [scene.onBeforeRender, scene.onAfterRender] = [before, after];
          const context = gl.getContext();
          context.readPixels(0, 0, 1, 1, context.RGBA, context.UNSIGNED_BYTE, new Uint8Array(4));
          resolve(harness.now());
        };
      })();
    });

  // Resolve after one more frame, in which all messages that have come are handled.
  harness.drawn = () =>
    new Promise((resolve, reject) => {
      const { scene } = viewer();
      const before = scene.onAfterRender;
      const timer = setTimeout(() => {
        scene.onAfterRender = before;
        reject(new Error(`no frame was drawn for ${FRAME_LIMIT / 1000} s`));
      }, FRAME_LIMIT);
      scene.onAfterRender = function (...args) {
        clearTimeout(timer);
        scene.onAfterRender = before;
        before.apply(this, args);
        resolve();
      };
      viewer().requestRender();
    });

  // Return column-major 4x4 matrices into three.js's world, of the node and of viser's world.
  harness.poses = async (name) => {
    await harness.drawn();
    const [object, root] = [node(name), node("")];
    object.updateWorldMatrix(true, false);
    return { node: object.matrixWorld.toArray(), root: root.matrixWorld.toArray() };
  };

  // Return whether a node is there, and visible with all above it.
  harness.shows = (name) => {
    const seen = (object) => object.visible && (!object.parent || seen(object.parent));
    const object = viewer().nodeRefFromName[name];
    return Boolean(object) && seen(object);
  };

  // Return the camera's column-major matrices, and the rectangle of its picture on the page [px].
  harness.view = () => {
    const { camera, canvas } = viewer();
    const { left, top, width, height } = canvas.getBoundingClientRect();
    return {
      projection: camera.projectionMatrix.toArray(),
      inverse: camera.matrixWorldInverse.toArray(),
      root: node("").matrixWorld.toArray(),
      rectangle: [left, top, width, height],
    };
  };

  // Turn the camera; both arguments are in viser's world.
  harness.lookFrom = (position, target) => {
    const { camera, cameraControl } = viewer();
    const three = (point) =>
      camera.position.clone().set(...point).applyMatrix4(node("").matrixWorld).toArray();
    cameraControl.setLookAt(...three(position), ...three(target), false);
  };

  function toPixel(point) {
    const { camera, canvas } = viewer();
    const { left, top, width, height } = canvas.getBoundingClientRect();
    const ndc = point.clone().project(camera);
    return [left + ((1 + ndc.x) / 2) * width, top + ((1 - ndc.y) / 2) * height];
  }

  // Return the object whose pointerdown handler a press at this pixel calls, and the point it hits.
  function pressed([x, y]) {
    const { camera, canvas } = viewer();
    if (document.elementFromPoint(x, y) !== canvas) return null;
    const { left, top, width, height } = canvas.getBoundingClientRect();
    const { raycaster, pointer, internal } = renderer();
    const ray = new raycaster.constructor();
    const ndc = new pointer.constructor();
    ndc.set((2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height);
    ray.setFromCamera(ndc, camera);
    for (const { object, point } of ray.intersectObjects(internal.interaction, true))
      for (let owner = object; owner; owner = owner.parent)
        if (owner.__r3f?.handlers?.onPointerDown) return { owner, point };
    return null;
  }

  // drei's PivotControls keeps its handles in the control's first child. Arrows lie along y of
  // their group; rings and planes have z of their group as normal.
  function describe(group) {
    const axisOf = (matrix, column) =>
      "xyz"[[0, 1, 2].find((row) => Math.abs(matrix.elements[4 * column + row]) > 0.5)];
    const pressable = (object) => Boolean(object.__r3f?.handlers?.onPointerDown);
    if (pressable(group)) return { kind: "ring", axis: axisOf(group.matrix, 2), owner: group };
    const inner = group.children[0];
    if (pressable(inner)) return { kind: "arrow", axis: axisOf(inner.matrix, 1), owner: inner };
    return { kind: "plane", axis: axisOf(group.matrix, 2), owner: inner.children[0] };
  }

  // Return points on the handle in its own coordinates, those with the most space around them first.
  function spots({ kind, owner }) {
    const point = (x, y, z) => node("").position.clone().set(x, y, z);
    if (kind === "arrow") {
      const { height } = owner.children.find((c) => c.geometry?.parameters).geometry.parameters;
      return [0.9, 0.8, 0.97, 0.7, 0.6, 0.5, 0.4].map((part) => point(0, part * height, 0));
    }
    const starts = owner.children.find((c) => c.isLine2).geometry.attributes.instanceStart;
    const middle = starts.count / 2;
    return [...Array(starts.count).keys()]
      .sort((i, j) => Math.abs(i - middle) - Math.abs(j - middle))
      .map((i) => point(starts.getX(i), starts.getY(i), starts.getZ(i)));
  }

  // Return where to press for a handle: the pixel, the point that is hit and the handle's matrix.
  harness.grip = async (name, kind, axis) => {
    await harness.drawn();
    const handles = node(name).children[0].children.map(describe);
    const handle = handles.find((each) => each.kind === kind && each.axis === axis);
    if (!handle) {
      const there = handles.map((each) => `${each.kind} ${each.axis}`).join(", ");
      throw new Error(`${name} has no ${kind} ${axis}; it has: ${there || "no handle"}`);
    }
    handle.owner.updateWorldMatrix(true, false);
    for (const spot of spots(handle)) {
      const pixel = toPixel(spot.applyMatrix4(handle.owner.matrixWorld));
      const hit = pressed(pixel);
      if (hit?.owner === handle.owner)
        return { pixel, hit: hit.point.toArray(), matrix: handle.owner.matrixWorld.toArray() };
    }
    throw new Error(`no spot of ${kind} ${axis} of ${name} can be pressed: it is covered`);
  };
})();
