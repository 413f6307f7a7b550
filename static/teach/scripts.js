// Scripts in files: those of the server's folder, and those of the person.
import { onChoice, onConfirm, save } from "../dom.js";
import { button, html } from "../instruments/shape.js";
import { request } from "../server.js";

const FILE = ".yaml";
const NEW = ".new"; // value of the option; no script has such a name

export class Scripts {
  #sheet;
  open = html("select", { "aria-label": "Program" });
  shown = new Option("", ""); // the program that the sheet shows
  #asked = ""; // name of the script that the next Save replaces
  #file = html("input", { type: "file", accept: ".yaml,.yml", "aria-label": "File of a script", hidden: "" });
  #keep = button("Save", () => this.#save(), { hidden: "", title: "Save in the folder of the server" });
  /** @type {Record<string, string>} */
  examples = {}; // of steps, by their names
  controls = [button("Download", () => this.#download()), this.#keep, this.#file];

  /** @param {import("./teach.js").Teach} sheet */
  constructor(sheet) {
    this.#sheet = sheet;
    onConfirm(this.open, () => this.open.value && this.#choose());
    onChoice(this.#file, async ([file]) => sheet.load(await file.text(), file.name.replace(/\.ya?ml$/i, "")));
  }

  // List the scripts of the server.
  async list() {
    const answer = await request("api/v1/scripts").catch(() => null);
    if (!answer) return;
    /** @type {{ names: string[], saves: boolean, steps: Record<string, string> }} */
    const { names, saves, steps } = await answer.json();
    this.#keep.hidden = !saves;
    this.examples = steps;
    this.#asked = "";
    this.open.replaceChildren(this.shown, new Option("New poses", NEW), new Option("A file …", FILE), ...names.map((name) => new Option(name)));
    this.open.value = "";
  }

  // Show the script that was chosen, of the library or of the folder of the server.
  async #choose() {
    const name = this.open.value;
    this.open.value = "";
    if (name === FILE) return this.#file.click();
    if (name === NEW) return this.#sheet.begin();
    await this.#sheet.attempt(async () => this.#sheet.load(await (await request(`api/v1/scripts/${encodeURIComponent(name)}`)).text(), name));
  }

  #download() {
    return this.#sheet.attempt(() => {
      const { name, text } = this.#sheet.script();
      save(new Blob([text], { type: "application/yaml" }), `${name}${FILE}`);
      this.#sheet.content.keep({ saved: text });
      this.#sheet.report(`Saved as ${name}${FILE}.`);
    });
  }

  #save() {
    return this.#sheet.attempt(async () => {
      const { name, text } = this.#sheet.script();
      const isAsked = this.#asked === name;
      this.#asked = name;
      const isListed = [...this.open.options].some(({ value }) => value === name);
      if (isListed && !isAsked) throw new Error(`A script ${name} exists already. Press Save again to replace it.`);
      await request(`api/v1/scripts/${encodeURIComponent(name)}${isAsked ? "?replace" : ""}`, { method: "POST", body: text });
      this.#sheet.content.keep({ saved: text });
      await this.list();
      this.#sheet.report(`Saved as ${name}. It is in the list of programs.`);
    });
  }
}
