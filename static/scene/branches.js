// The branches in the picture: the arm on the branch whose row in the panel is under the pointer, for this
// window alone, with a name and the time of the change.
import { html, write } from "../instruments/shape.js";

const ROW = "tr[data-branch]";
const EVERY = 250; // ms between two places of the name
const OPACITY = 0.4;
const PARTS = ["shoulder", "elbow", "wrist"]; // words of the name of a branch
const ELBOW = 2; // number of the joint whose link carries the name

export class Branches {
  #scene;
  #status;
  #arm = null; // description of the arm
  #options = new Map(); // name of a branch to its words and joint angles
  #row = null; // name of the branch under the pointer
  #ghost = null; // {object, elbow, material} of that branch
  #label = html("p", { id: "branch-label", class: "scene-label", hidden: "" });
  #asked = 0; // number of the last question

  // status: returns the state of the page, which has the speed.
  constructor(stage, scene, arm, status) {
    this.#scene = scene;
    this.#arm = arm;
    this.#status = status;
    stage.append(this.#label);
    this.#read();
    setInterval(() => document.hidden || this.#name(), EVERY);
  }

  listen(inner) {
    const row = ({ target }) => target.closest?.(ROW);
    inner.addEventListener("pointerover", (event) => event.pointerType !== "touch" && this.#over(row(event)));
    // A finger shows a branch by a tap, and hides it by another anywhere.
    inner.addEventListener("click", (event) => event.pointerType === "touch" && this.#over(row(event)));
    inner.document.addEventListener("pointerleave", () => this.#over(null));
  }

  #over(row) {
    const name = row?.ariaCurrent ? null : row?.dataset.branch ?? null;
    if (name === this.#row) return;
    this.#row = name;
    this.#remove();
    if (name) this.#show(name, getComputedStyle(row.querySelector("i")).backgroundColor);
    else this.#name();
  }

  async #show(name, colour) {
    const state = await this.#read();
    const option = this.#options.get(name);
    if (!state || this.#row !== name || this.#ghost || option.refusal) return;
    const { viewer, node } = this.#inner;
    const links = this.#arm.links.map(({ path }) => node(`/arm/${path.join("/")}`));
    const [first] = links;
    if (!first) return;
    let material = null;
    let elbow = null;
    const copy = (object) => {
      const made = object.clone(false);
      const joint = links.indexOf(object);
      if (joint >= 0) {
        const axis = made.position.clone().set(...this.#arm.links[joint].axis);
        made.quaternion.multiply(made.quaternion.clone().setFromAxisAngle(axis, option.q[joint] - state.q[joint]));
        made.updateMatrix();
      }
      if (joint === ELBOW) elbow = made;
      if (made.isMesh) {
        material ??= Object.assign(made.material.clone(), { map: null, transparent: true, opacity: OPACITY, depthWrite: false });
        made.material = material;
        made.castShadow = made.receiveShadow = false;
      }
      // The conduit has bent shapes of its own.
      for (const child of object.children) if (!child.isMesh || child.type === "Mesh") made.add(copy(child));
      return made;
    };
    const object = copy(first);
    material?.color.set(colour);
    // Outside of the arm, of which it is no part.
    const frame = first.parent.clone(false);
    first.parent.updateWorldMatrix(true, false);
    frame.name = "branch";
    frame.matrixAutoUpdate = false;
    frame.matrix.copy(first.parent.matrixWorld);
    frame.add(object);
    viewer().scene.add(frame);
    this.#ghost = { object: frame, elbow, material };
    this.#name();
    viewer().requestRender();
  }

  #remove() {
    this.#ghost?.object.removeFromParent();
    this.#ghost?.material?.dispose();
    this.#ghost = null;
    this.#inner?.viewer()?.requestRender();
  }

  // Read the options and return the state to which they belong; null without an answer.
  async #read() {
    const asked = (this.#asked += 1);
    const questions = ["branches", "state"].map((at) => fetch(`api/v1/${at}`).catch(() => null));
    const answers = await Promise.all(questions);
    if (answers.some((each) => !each?.ok) || asked !== this.#asked) return null;
    const [{ choices }, state] = await Promise.all(answers.map((each) => each.json()));
    const now = state.branch ?? [];
    this.#options = new Map(
      choices.map((each) => {
        const parts = each.name.split("-");
        const differs = parts.map((word, k) => (word === now[k] ? "" : `${PARTS[k]} ${word}`));
        const time = each.time / (this.#status()?.speed ?? 1);
        const words = [...differs.filter(Boolean), `${time.toFixed(1)} s`].join(", ");
        return [each.name, { words, q: each.q, refusal: each.refusal }];
      }),
    );
    return state;
  }

  // Write the name of the ghost at its elbow.
  #name() {
    const { node, pixelOf } = this.#inner ?? {};
    const elbow = this.#ghost?.elbow;
    const place = elbow?.getWorldPosition(elbow.position.clone());
    const pixel = place && pixelOf(place.applyMatrix4(node("").matrixWorld.clone().invert()).toArray());
    this.#label.hidden = !pixel;
    if (!pixel) return;
    const [x, y] = pixel;
    write(this.#label, this.#options.get(this.#row).words);
    this.#label.style.left = `${this.#scene.offsetLeft + x}px`;
    this.#label.style.top = `${this.#scene.offsetTop + y}px`;
  }

  get #inner() {
    return this.#scene.contentWindow?.katanaScene;
  }
}
