// Pictures of cameras beside the scene, with their age. Loaded when the server has cameras.
import { styled, t, write } from "../dom.js";
import { messageOf, request } from "../server.js";
import { html } from "../instruments/shape.js";

const OLD = 300; // ms, age from which a picture is grey
const LOOK = 100; // ms between two looks at the ages
const AGAIN = 1000; // ms before the next attempt to connect
const SIZE = { width: 640, height: 480 }; // px, of a camera of this machine
const QUALITY = 0.8; // of its pictures
const AGE_BYTES = 8; // before the JPEG file of a message, the age when it was sent: a float64 [s]

class Camera {
  #canvas = html("canvas", { role: "img", "aria-label": "Picture of the camera" });
  #says = html("p", { role: "status" });
  #age = html("span", {});
  /** @type {WebSocket | null} */
  #socket = null;
  #made = -Infinity; // time of the picture that is shown
  /** @type {Page.Context["past"]} */
  #past = null; // the moment whose picture is shown

  /** @type {MediaStream | null} */
  #stream = null; // of a camera of this machine that the person shares
  #share = html("button", { type: "button" }, "Share a camera of this device");

  /** @param {Page.Camera} camera @param {Page.Context} page */
  constructor({ name, shared }, page) {
    this.page = page;
    this.name = name;
    this.view = html("details", { "aria-label": `${t("Camera")} ${name}` }, html("summary", {}, name, this.#age), this.#canvas, this.#says);
    this.view.addEventListener("toggle", () => (this.view.open ? this.#connect() : this.#socket?.close()));
    this.view.open = matchMedia("(min-width: 900px)").matches;
    if (shared) this.view.append(this.#share);
    this.#share.addEventListener("click", () => (this.#stream ? this.#end() : this.#begin().catch((error) => this.#end(error))));
    setInterval(() => this.#look(), LOOK);
  }

  // Send pictures of a camera of this machine, each after the answer to the one before.
  async #begin() {
    if (!navigator.mediaDevices) throw new Error("The browser gives cameras only to pages of this machine or over https.");
    const stream = (this.#stream = await navigator.mediaDevices.getUserMedia({ video: SIZE }));
    write(this.#share, "Stop sharing");
    const video = Object.assign(html("video", {}), { srcObject: stream, muted: true });
    await video.play();
    const canvas = new OffscreenCanvas(video.videoWidth, video.videoHeight);
    while (this.#stream === stream && stream.active) {
      const made = await new Promise((next) => video.requestVideoFrameCallback((now, { captureTime = now }) => next(captureTime)));
      canvas.getContext("2d")?.drawImage(video, 0, 0);
      const body = await canvas.convertToBlob({ type: "image/jpeg", quality: QUALITY });
      const age = Math.max(performance.now() - made + (this.page.store.trip ?? 0) / 2, 0) / 1000;
      await request(`api/v1/cameras/${this.name}?page=${this.page.name}&age=${age}`, { method: "POST", body });
    }
    this.#end();
  }

  /** @param {unknown} [error] */
  #end(error) {
    for (const track of this.#stream?.getTracks() ?? []) track.stop();
    this.#stream = null;
    write(this.#share, "Share a camera of this device");
    if (error) this.page.toast(messageOf(error));
  }

  #connect() {
    if (!this.view.open || !this.view.isConnected || this.#socket) return;
    const socket = new WebSocket(new URL(`api/v1/cameras/${this.name}`, location.href.replace(/^http/, "ws")));
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    // As often as the page is drawn: a hidden one asks for nothing.
    const ask = () => requestAnimationFrame(() => socket.readyState === WebSocket.OPEN && socket.send(""));
    socket.onopen = ask;
    socket.onmessage = async ({ data }) => {
      if (typeof data === "string") {
        this.#made = -Infinity;
        write(this.#says, data);
      } else if (!this.page.past) await this.#show(data);
      ask();
    };
    socket.onclose = ({ reason }) => {
      this.#socket = null;
      this.#made = -Infinity;
      if (reason) write(this.#says, reason);
      setTimeout(() => this.#connect(), AGAIN);
    };
  }

  /** @param {ArrayBuffer} data */
  async #show(data) {
    // Half the round trip is the way of the picture from the server.
    const age = 1000 * new DataView(data).getFloat64(0, true) + (this.page.store.trip ?? 0) / 2;
    const made = performance.now() - age;
    if (!(await this.#draw(new Blob([data.slice(AGE_BYTES)], { type: "image/jpeg" })))) return;
    this.#made = made;
    this.#look();
  }

  // Draw a picture, and return whether it could be read.
  /** @param {Blob} file */
  async #draw(file) {
    const picture = await createImageBitmap(file).catch(() => null);
    if (!picture) return write(this.#says, "A picture of this camera cannot be read.");
    [this.#canvas.width, this.#canvas.height] = [picture.width, picture.height];
    this.#canvas.getContext("2d")?.drawImage(picture, 0, 0);
    picture.close();
    return true;
  }

  // Show the picture of a moment of a recording.
  /** @param {NonNullable<Page.Context["past"]>} past */
  async #showPast(past) {
    this.#made = -Infinity;
    this.view.dataset.old = "false";
    const answer = await request(`api/v1/playback/${encodeURIComponent(past.of)}/pictures/${this.name}?t=${past.t}`).catch(() => null);
    if (past !== this.page.past) return;
    const shown = answer?.status === 200 && (await this.#draw(await answer.blob()));
    this.#canvas.hidden = !shown;
    write(this.#age, "Recorded");
    write(this.#says, shown ? "" : "No picture of this camera is recorded here.");
  }

  #look() {
    const past = this.page.past;
    if (past && past !== this.#past) this.#showPast(past);
    this.#past = past;
    if (past) return;
    const age = performance.now() - this.#made;
    const isOld = age > OLD;
    this.view.dataset.old = String(isOld);
    this.#canvas.hidden = age === Infinity;
    write(this.#age, age === Infinity ? "" : isOld ? `${(age / 1000).toFixed(1)} s` : `${Math.round(age)} ms`);
    if (age < Infinity) write(this.#says, isOld ? "This picture is old. Do not drive by it." : "");
  }
}

export class Card {
  #cards = html("div", { id: "cameras" });
  #page;
  #shown = "";

  /** @param {HTMLElement} stage @param {Page.Context} page */
  constructor(stage, page) {
    this.#page = page;
    styled("cameras.css", import.meta.url);
    stage.before(this.#cards);
  }

  /** Show the cameras of a status. @param {Page.Status} status */
  draw({ cameras = [] }) {
    if (this.#shown === (this.#shown = JSON.stringify(cameras))) return;
    this.#cards.replaceChildren(...cameras.map((camera) => new Camera(camera, this.#page).view));
  }
}
