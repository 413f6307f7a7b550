// A program in the panel: its steps, with buttons to run from a step and to pause before a step, and the button
// that edits the chosen script as text.
const AGAIN = 50; // ms between two attempts to restore the focus
const TRIES = 20;

export class Steps {
  #say;
  #edit;

  // `edit` opens a script, by its name, as text.
  constructor(say, edit) {
    this.#say = say;
    this.#edit = edit;
  }

  listen(inner) {
    inner.addEventListener("click", ({ target }) => {
      const script = target.closest?.("[data-script]")?.dataset.script;
      if (script) return this.#edit(script);
      const button = target.closest?.(".steps button");
      if (!button) return;
      const at = this.#step(button);
      if (button.name === "run") this.#say({ do: "steer", order: "run", at });
      else this.#say({ do: "breakpoints", steps: this.#changed(inner, button, at) });
      this.#focus(inner, button.name, at, TRIES);
    });
  }

  #step(button) {
    const row = button.closest("li");
    return [...row.parentElement.children].indexOf(row) + 1;
  }

  // Return the steps of the breakpoints after a press of `button` at the step `at`.
  #changed(inner, button, at) {
    const pressed = [...inner.document.querySelectorAll(".steps button[aria-pressed=true]")];
    const steps = pressed.map((each) => this.#step(each)).filter((step) => step !== at);
    return button.ariaPressed === "true" ? steps : [...steps, at];
  }

  // The server replaces the list, sometimes twice, and the focus is lost.
  #focus(inner, name, at, tries) {
    if (!tries) return;
    setTimeout(() => {
      if (inner.document.activeElement === inner.document.body)
        inner.document.querySelector(`.steps li:nth-child(${at}) button[name=${name}]`)?.focus();
      this.#focus(inner, name, at, tries - 1);
    }, AGAIN);
  }
}
