// The chosen object in the sheet of objects: its looks, size and place, what carries it, and the rule for the arm in a zone.
import { byId, onClick, repeating, styled, write } from "../dom.js";
import { numberBox } from "../instruments/parts.js";
import { button, html } from "../instruments/shape.js";
import { notNumber, numberIn } from "../number.js";
import { mayDrive } from "../page/lease.js";
import { readObjects } from "../server.js";

const EVERY = 1000; // ms between two looks at the objects, which others change too
const SEND_EVERY = 100; // ms between two values of a slider
const HELD = 500; // ms after a change for which an older answer of the server is not shown
const PLAIN = "#94a3b8"; // of an object without a colour of its own
const DEGREES = 180 / Math.PI;
/** @type {[string, Api.Attachment, string][]} */
const MOUNTS = [
  ["Hand", "hand", "It moves with the hand as a part of it"],
  ["Fixed here", "world", "It stays where it is, even in the air"],
];

/** @type {[string, Api.Zone][]} */
const ZONES = [["None: it is a body", "none"], ["The arm keeps out", "keep_out"], ["The arm is slow", "slow"]];
const NEW_BOX = /** @type {Partial<Api.Place>} */ ({ shape: "box", size: [0.03, 0.03, 0.05], zone: "none", can_be_held: true, colour: "#0f9d8a" }); // m
const NEW_ZONE = /** @type {Partial<Api.Place>} */ ({ shape: "box", size: [0.2, 0.2, 0.2] }); // m
const NEW_PLANE = /** @type {Partial<Api.Place>} */ ({ shape: "plane", size: [0.8, 0.6], T: [[1, 0, 0, 0.3], [0, 0, -1, 0.45], [0, 1, 0, 0.3], [0, 0, 0, 1]] }); // m

/** What the numbers of a size are, of shapes other than boxes. @type {Record<string, string>} */
const SIZES = { sphere: "Radius, mm", cylinder: "Radius × height, mm", vessel: "Radius × height, mm" };

const PLACING = "#objects :is(#add, #add-box, #add-zone, #add-plane, #unit, #load)"; // what needs the arm, beside the chosen object
const NUMBER = { inputmode: "decimal" };

/** Return the pose `T` turned by `angle` [degrees] about the vertical through it. @param {number[][]} T @param {number} angle */
function turned(T, angle) {
  const [c, s] = [Math.cos(angle / DEGREES), Math.sin(angle / DEGREES)];
  const [x, y] = [0, 1].map((row) => T[row].slice(0, 3));
  return [[...x.map((a, i) => c * a - s * y[i]), T[0][3]], [...x.map((a, i) => s * a + c * y[i]), T[1][3]], T[2], T[3]];
}

export class ObjectForm {
  #page; // {say, store, toast}
  /** @type {Api.SceneObject[]} */
  #objects = [];
  #sender = 0;
  watch = repeating(() => this.#read(), EVERY); // looks at the objects
  #acted = -Infinity; // ms, time of the last change
  #choice = html("select", { "aria-label": "Object" });
  #remove = button("Remove", () => this.#act({ do: "remove", name: this.#name }));
  #colour = this.#input("Colour", { type: "color" }, (value) => ({ colour: value }));
  #opacity = this.#input("Opacity", { type: "range", min: 5, max: 100, step: 1 }, (value) => ({ opacity: Number(value) / 100 }));
  #scale = this.#input("Scale", NUMBER, (value) => ({ scale: numberIn(value) }));
  #size = this.#input("Size", { type: "text" }, (value) => ({ size: this.#sizeOf(value) }));
  #place = ["x", "y", "z"].map((name, row) => this.#input(name, { ...NUMBER, "aria-label": name }, (value) => this.#moved(row, numberIn(value) / 1e3)));
  #sizeLabel = html("span");
  #zone = html("select", {}, ...ZONES.map(([label, zone]) => new Option(label, zone)));
  #turn = this.#input("Turn", { type: "range", min: -180, max: 180, step: 1, "aria-label": "Turn" }, (value) => this.#turned(Number(value)));
  #angle = this.#input("Turn", { ...NUMBER, "aria-label": "Turn, °" }, (value) => this.#turned(numberIn(value)));
  #hidden = this.#input("Hidden", { type: "checkbox" }, () => ({ hidden: this.#hidden.checked }));
  #percent = html("output");
  #why = html("p", { role: "status" });
  #refusal = html("p", { class: "refusal", role: "status" }); // why nothing can be changed here
  #mounts = MOUNTS.map(([label, to, title]) => button(label, () => this.#act({ do: "attach", name: this.#name, to }), { title }));
  element = html("fieldset", { id: "object", "aria-label": "Chosen object" });

  /** @param {Pick<Page.Context, "say" | "store" | "toast">} page */
  constructor(page) {
    this.#page = page;
    styled("object.css", import.meta.url);
    byId("objects").prepend(this.#refusal);
    byId("which").after(this.element);
    /** @param {string} name @param {(Node | string)[]} content */
    const row = (name, ...content) => html("label", {}, html("span", {}, name), ...content);
    this.#choice.addEventListener("change", () => page.store.select(this.#choice.value));
    this.#zone.addEventListener("change", () => this.#act({ do: "place", name: this.#name, zone: /** @type {Api.Zone} */ (this.#zone.value) }));
    onClick("add-box", () => this.#add("box", NEW_BOX));
    onClick("add-zone", () => this.#add("zone", NEW_ZONE));
    onClick("add-plane", () => this.#add("plane", NEW_PLANE));
    this.element.append(
      // What is in the legend stays in use while the rest is not.
      html("legend", {}, this.#choice, this.#remove),
      this.#why,
      html("div", { role: "group", "aria-label": "Position" }, html("span", {}, "x, y, z, mm"), ...this.#place),
      html("div", {}, html("span", {}, "Turn, °"), this.#turn, this.#angle),
      html("div", {}, row("Colour", this.#colour), button("Own colour", () => this.#act({ do: "place", name: this.#name, colour: "own" }))),
      row("Opacity", this.#opacity, this.#percent),
      html("label", {}, this.#sizeLabel, this.#size),
      row("Scale", this.#scale),
      row("Zone", this.#zone),
      row("Hidden", this.#hidden, html("small", {}, "not drawn; the arm still keeps clear of it")),
      html("div", { role: "group", "aria-label": "Attach to" }, html("span", {}, "Attach to"), ...this.#mounts),
    );
    page.store.follow(() => this.#permit());
    window.addEventListener("selected", () => {
      this.#choice.value = page.store.object;
      this.#show(true);
    });
  }

  get #name() {
    return this.#choice.value;
  }

  get #object() {
    return this.#objects.find(({ name }) => name === this.#name);
  }

  /** Return a control that changes the object when it is used. @param {string} name @param {import("../instruments/shape.js").Attributes} attributes @param {(value: string) => Partial<Api.Place>} change */
  #input(name, attributes, change) {
    const isTyped = !attributes.type || attributes.type === "text";
    const input = attributes.inputmode ? numberBox({ name, ...attributes }) : html("input", { name, ...attributes });
    const send = () => {
      this.#sender = 0;
      const fields = change(input.value);
      if (!Object.values(fields).flat(2).some(Number.isNaN)) return this.#act({ do: "place", name: this.#name, ...fields });
      this.#page.toast(notNumber(name, input.value));
      this.#show(true);
    };
    input.addEventListener(isTyped ? "change" : "input", () => {
      input.defaultValue = input.value;
      this.#percent.value = `${this.#opacity.value} %`;
      if (!this.#sender) this.#sender = setTimeout(send, SEND_EVERY);
    });
    return input;
  }

  /** Return the lengths [m] in a text, at the scale 1. @param {string} text */
  #sizeOf(text) {
    const sides = text.split(/[×x;\s]+/).filter(Boolean);
    return sides.map((side) => numberIn(side) / 1e3 / (this.#object?.scale ?? 1));
  }

  /** @param {string} word @param {Partial<Api.Place>} fields */
  #add(word, fields) {
    let number = 1;
    while (this.#objects.some(({ name }) => name === `${word} ${number}`)) number += 1;
    this.#act({ do: "place", name: `${word} ${number}`, zone: "keep_out", ...fields });
  }

  /** @param {number} axis @param {number} value of this coordinate [m] @returns {Partial<Api.Place>} */
  #moved(axis, value) {
    return { T: this.#object?.T.map((row, i) => (i === axis ? [...row.slice(0, 3), value] : row)) };
  }

  /** @param {number} angle @returns {Partial<Api.Place>} */
  #turned(angle) {
    const T = this.#object?.T;
    return T ? { T: turned(T, angle - Math.atan2(T[1][0], T[0][0]) * DEGREES) } : {};
  }

  /** @param {Api.Act} request */
  #act(request) {
    this.#page.say(request);
    if (this.#object && request.do === "place" && request.name === this.#name) this.#object.T = request.T ?? this.#object.T; // for the next coordinate
    this.#acted = performance.now();
    setTimeout(() => this.#read(), HELD);
  }

  async #read() {
    const before = this.#objects;
    this.#objects = await readObjects();
    // An object that stands in the arm may not be seen.
    for (const { name, overlap } of this.#objects) if (overlap && !before.some((other) => other.name === name && other.overlap)) this.#page.toast(overlap);
    const names = this.#objects.map(({ name }) => name);
    const added = before.length ? names.find((name) => !before.some((object) => object.name === name)) : undefined;
    const { store } = this.#page;
    if (names.join("\n") !== before.map(({ name }) => name).join("\n")) {
      this.#choice.replaceChildren(new Option("Choose an object", ""), ...names.map((name) => new Option(name)));
      this.#choice.value = store.object;
      // None takes the place of one that is gone: its Remove would remove another.
      const isGone = !names.includes(store.object);
      store.select(added ?? (isGone ? (before.length ? "" : names[0] ?? "") : store.object));
    }
    this.#show();
  }

  // Let the person change objects, or say why not.
  #permit() {
    const { live } = this.#page.store;
    const may = mayDrive(live);
    for (const control of document.querySelectorAll(PLACING)) control.toggleAttribute("disabled", !may);
    write(this.#refusal, may ? "" : live ? `${live.holder} drives. Request the arm at the top to change objects.` : "No connection to the arm.");
    this.element.disabled = this.#remove.disabled = !may || Boolean(this.#object?.held);
  }

  // Show the chosen object; what a person is changing only with `again`.
  #show(again = false) {
    const object = this.#object;
    this.element.hidden = !this.#objects.length;
    this.element.classList.toggle("none", !object);
    this.#permit();
    if (!object || (!again && (this.#sender || performance.now() - this.#acted < HELD || this.element.matches(":active")))) return;
    const { colour, opacity, size, scale, hidden, T, held, fixed, zone, overlap } = object;
    /** A typed text that is not sent yet stays. @param {HTMLInputElement} input @param {string | number} text */
    const fill = (input, text) => {
      if (again || input.value === input.defaultValue) input.defaultValue = input.value = String(text);
    };
    const angle = Math.atan2(T[1][0], T[0][0]) * DEGREES;
    this.#colour.value = colour ?? PLAIN;
    this.#colour.classList.toggle("own", !colour);
    this.#opacity.value = String(Math.round(100 * opacity));
    this.#percent.value = `${this.#opacity.value} %`;
    fill(this.#scale, scale);
    fill(this.#size, size.map((side) => Number((1e3 * scale * side).toPrecision(6))).join(" × "));
    this.#place.forEach((input, row) => fill(input, Number((1e3 * T[row][3]).toFixed(2)) + 0));
    fill(this.#angle, Number(angle.toFixed(2)) + 0);
    write(this.#sizeLabel, SIZES[object.shape] ?? "Size, mm");
    this.#size.readOnly = object.shape === "mesh";
    this.#zone.value = zone ?? "none";
    this.#turn.value = String(Math.round(angle));
    this.#hidden.checked = hidden;
    this.#mounts.forEach((mount, i) => (mount.ariaPressed = String(fixed === (i === 0))));
    write(this.#why, held ? "It is held: open the gripper first" : fixed ? "It is attached to the hand and moves with it." : overlap);
  }
}
