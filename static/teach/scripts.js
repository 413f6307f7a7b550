// Scripts in files: those of the server's folder, and those of the person.
import { save } from "../dom.js";
import { button, html } from "../instruments/shape.js";
import { messageOf, request } from "../server.js";

const FILE = ".yaml";

/**
 * What the sheet does with a script.
 * @typedef {object} Sheet
 * @property {() => { name: string, text: string }} script returns the one that is shown; throws an error without one
 * @property {(text: string, name: string, asText: boolean) => Promise<void>} load
 * @property {(words: string, bad?: boolean) => void} report
 */

export class Scripts {
  #sheet;
  #open = html("select", { "aria-label": "Open a script" });
  #file = html("input", { type: "file", accept: ".yaml,.yml", "aria-label": "File of a script", hidden: "" });
  #keep = button("Save", () => this.#save(), { hidden: "", title: "Save in the folder of the server" });
  controls = [button("Download", () => this.#download()), this.#keep, this.#open, this.#file];

  /** @param {Sheet} sheet */
  constructor(sheet) {
    this.#sheet = sheet;
    this.#open.addEventListener("change", () => this.#choose());
    this.#file.addEventListener("change", () => this.#take());
  }

  // List the scripts of the server.
  async list() {
    const answer = await fetch("api/v1/scripts").catch(() => null);
    if (!answer?.ok) return;
    /** @type {{ names: string[], saves: boolean }} */
    const { names, saves } = await answer.json();
    this.#keep.hidden = !saves;
    this.#open.replaceChildren(new Option("Open …", ""), new Option("A file …", FILE), ...names.map((name) => new Option(name)));
  }

  // Show the script of this name, of the library or of the folder of the server: as text, or as poses if it has only these.
  /** @param {string} name @param {boolean} asText */
  async open(name, asText) {
    const answer = await fetch(`api/v1/scripts/${encodeURIComponent(name)}`).catch(() => null);
    if (answer?.ok) await this.#sheet.load(await answer.text(), name, asText);
    else this.#sheet.report(answer ? await answer.text() : "There is no connection to the arm.", true);
  }

  async #choose() {
    const name = this.#open.value;
    this.#open.value = "";
    if (name === FILE) this.#file.click();
    else if (name) await this.open(name, false);
  }

  async #take() {
    const file = this.#file.files?.[0];
    this.#file.value = "";
    if (file) await this.#sheet.load(await file.text(), file.name.replace(/\.ya?ml$/i, ""), false);
  }

  #download() {
    try {
      const { name, text } = this.#sheet.script();
      save(new Blob([text], { type: "application/yaml" }), `${name}${FILE}`);
      this.#sheet.report(`Saved as ${name}${FILE}.`);
    } catch (error) {
      this.#sheet.report(messageOf(error), true);
    }
  }

  async #save() {
    try {
      const { name, text } = this.#sheet.script();
      await request(`api/v1/scripts/${encodeURIComponent(name)}`, { method: "POST", body: text });
      this.#sheet.report(`Saved as ${name}. It is under Script in the tab Programs.`);
      await this.list();
    } catch (error) {
      this.#sheet.report(messageOf(error), true);
    }
  }
}
