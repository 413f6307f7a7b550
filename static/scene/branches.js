// The branches in the picture: the arm on the branch whose row in the panel is under the pointer, for this
// window alone, with a name and the time of the change.
import { sceneIn, sceneOf, write } from "../dom.js";
import { html } from "../instruments/shape.js";
import { readState, request } from "../server.js";
import { isMesh } from "./glow.js";

const ROW = "tr[data-branch]";
const OPACITY = 0.4;
const PARTS = ["shoulder", "elbow", "wrist"]; // words of the name of a branch

export class Branches {
  #scene;
  #store;
  #arm; // description of the arm
  /** @type {string | null} */
  #row = null; // name of the branch under the pointer
  /** @type {{ object: Three.Object3D, material: Three.Material | null } | null} */
  #ghost = null; // {object, material} of that branch
  #label = html("p", { id: "branch-label", class: "scene-label", hidden: "" });

  /** @param {HTMLElement} stage @param {HTMLIFrameElement} scene @param {Api.Arm} arm @param {Page.Store} store */
  constructor(stage, scene, arm, store) {
    this.#scene = scene;
    this.#arm = arm;
    this.#store = store;
    stage.append(this.#label);
  }

  /** @param {Window} inner */
  listen(inner) {
    /** @param {Event} event @returns {HTMLElement | null} */
    const row = ({ target }) => (target instanceof inner.window.Element ? target.closest(ROW) : null);
    inner.addEventListener("pointerover", (event) => event.pointerType !== "touch" && this.#over(row(event)));
    // A finger shows a branch by a tap, and hides it by another anywhere.
    inner.addEventListener("click", (event) => event.pointerType === "touch" && this.#over(row(event)));
    inner.document.addEventListener("pointerleave", () => this.#over(null));
  }

  /** @param {HTMLElement | null} row */
  #over(row) {
    const name = row?.ariaCurrent ? null : row?.dataset.branch ?? null;
    if (name === this.#row) return;
    this.#row = name;
    this.#remove();
    const sign = row?.querySelector("i");
    if (name && sign) this.#show(name, getComputedStyle(sign).backgroundColor);
  }

  /** @param {string} name @param {string} colour */
  async #show(name, colour) {
    const [answer, state] = await Promise.all([request("api/v1/branches").catch(() => null), readState()]);
    /** @type {Api.Branches | undefined} */
    const branches = await answer?.json();
    const option = branches?.choices.find((choice) => choice.name === name);
    if (!state || !option || this.#row !== name || this.#ghost || option.refusal) return;
    const { drawing, node } = sceneIn(this.#scene);
    const links = this.#arm.links.map(({ path }) => node(`/arm/${path.join("/")}`));
    const [first] = links;
    if (!first?.parent) return;
    const turns = option.q.map((angle, joint) => angle - state.q[joint]);
    const copy = this.#copy(first, links, turns);
    copy.material?.color.set(colour);
    // Outside of the arm, of which it is no part.
    const frame = first.parent.clone(false);
    first.parent.updateWorldMatrix(true, false);
    frame.name = "branch";
    frame.matrixAutoUpdate = false;
    frame.matrix.copy(first.parent.matrixWorld);
    frame.add(copy.object);
    drawing().scene.add(frame);
    this.#ghost = { ...copy, object: frame };
    const parts = name.split("-").map((word, k) => (word === state.branch?.[k] ? "" : `${PARTS[k]} ${word}`));
    const seconds = option.time / (this.#store.live?.speed ?? 1);
    write(this.#label, [...parts.filter(Boolean), `${seconds.toFixed(1)} s`].join(", "));
    this.#label.hidden = false;
    drawing().requestRender();
  }

  // Return a translucent copy of an object with its `links`, each turned by its angle [rad].
  /** @param {Three.Object3D} source @param {(Three.Object3D | undefined)[]} links @param {number[]} turns */
  #copy(source, links, turns) {
    /** @type {Three.Material | null} */
    let material = null;
    /** @param {Three.Object3D} object */
    const copy = (object) => {
      const made = object.clone(false);
      const joint = links.indexOf(object);
      if (joint >= 0) {
        const [x, y, z] = this.#arm.links[joint].axis;
        const axis = made.position.clone().set(x, y, z);
        made.quaternion.multiply(made.quaternion.clone().setFromAxisAngle(axis, turns[joint]));
        made.updateMatrix();
      }
      if (isMesh(made)) {
        material ??= Object.assign(made.material.clone(), { map: null, transparent: true, opacity: OPACITY, depthWrite: false });
        made.material = material;
        made.castShadow = made.receiveShadow = false;
      }
      // The conduit has bent shapes of its own.
      for (const child of object.children) if (!isMesh(child) || child.type === "Mesh") made.add(copy(child));
      return made;
    };
    const object = copy(source);
    return { object, material: /** @type {Three.Material | null} */ (material) };
  }

  #remove() {
    this.#ghost?.object.removeFromParent();
    this.#ghost?.material?.dispose();
    this.#ghost = null;
    this.#label.hidden = true;
    sceneOf(this.#scene)?.viewer()?.requestRender();
  }
}
