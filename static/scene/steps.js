// A program in the panel: its steps, with buttons to run from a step and to pause before a step, and the button
// that edits the chosen script as text.
const AGAIN = 50; // ms between two attempts to restore the focus
const TRIES = 100; // a busy server draws the list after seconds

export class Steps {
  #say;
  #edit;

  /** `edit` opens a script, by its name, as text. @param {Page.Say} say @param {(name: string) => void} edit */
  constructor(say, edit) {
    this.#say = say;
    this.#edit = edit;
  }

  /** @param {Window} inner */
  listen(inner) {
    inner.addEventListener("click", ({ target }) => {
      if (!(target instanceof inner.window.Element)) return;
      /** @type {HTMLElement | null} */
      const named = target.closest("[data-script]");
      if (named?.dataset.script) return this.#edit(named.dataset.script);
      /** @type {HTMLButtonElement | null} */
      const button = target.closest(".steps button");
      if (!button) return;
      const at = this.#step(button);
      if (button.name === "run") this.#say({ do: "steer", order: "run", at });
      else this.#say({ do: "breakpoints", steps: this.#changed(inner, button, at) });
      this.#focus(inner, button.name, at, TRIES);
    });
  }

  /** @param {Element} button */
  #step(button) {
    const row = button.closest("li");
    return row ? [...(row.parentElement?.children ?? [])].indexOf(row) + 1 : 0;
  }

  // Return the steps of the breakpoints after a press of `button` at the step `at`.
  /** @param {Window} inner @param {Element} button @param {number} at */
  #changed(inner, button, at) {
    const pressed = [...inner.document.querySelectorAll(".steps button[aria-pressed=true]")];
    const steps = pressed.map((other) => this.#step(other)).filter((step) => step !== at);
    return button.ariaPressed === "true" ? steps : [...steps, at];
  }

  // The server replaces the list, sometimes twice, and the focus is lost.
  /** @param {Window} inner @param {string} name @param {number} at @param {number} tries */
  #focus(inner, name, at, tries) {
    if (!tries) return;
    setTimeout(() => {
      if (inner.document.activeElement === inner.document.body)
        /** @type {HTMLElement | null} */ (inner.document.querySelector(`.steps li:nth-child(${at}) button[name=${name}]`))?.focus();
      this.#focus(inner, name, at, tries - 1);
    }, AGAIN);
  }
}
