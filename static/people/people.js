// Who is connected, for admins: a list with buttons that disconnect.
import { element, first, repeating, styled } from "../dom.js";
import { button, html } from "../instruments/shape.js";

const EVERY = 1000; // ms between two queries while the list is open
const CONTENT = `
  <form method="dialog"><h1 id="people-title">Who is connected</h1><button class="main" autofocus>Close</button></form>
  <p id="people-for"><label>Disconnect for <select id="kick-for">
    <option value="60">1 minute</option><option value="600">10 minutes</option><option value="3600">1 hour</option>
    <option value="revoke">ever: revoke the link</option>
  </select></label></p>
  <ul id="people-list"></ul>
  <p id="people-note">A disconnected person can still stop the arm from a page that is open, until the link is revoked.</p>
`;

/** @param {Api.ConnectedPerson} person */
function about(person) {
  const { role, drives, addresses, kept_out: out, link } = person;
  return [
    role,
    drives && "drives",
    addresses.length > 0 && `connected from ${[...new Set(addresses)].join(", ")}`,
    link && `link ${link.slice(0, 6)}`,
    out !== null && `disconnected for ${Math.ceil(out / 60)} min`,
  ].filter(Boolean).join(" · ");
}

export class People {
  /** The dialog is below the bar and not modal, so that mouse and finger can press STOP. @param {Page.Say} say */
  constructor(say) {
    this.say = say;
    this.watch = repeating(() => this.say({ do: "list_people" }), EVERY);
    this.drawn = "";
    styled("people.css", import.meta.url);
    this.dialog = html("dialog", { id: "people", "aria-labelledby": "people-title" });
    this.dialog.innerHTML = CONTENT;
    first("main", HTMLElement).append(this.dialog);
    this.list = element("people-list", HTMLElement);
    this.select = element("kick-for", HTMLSelectElement);
    this.dialog.addEventListener("close", () => {
      this.watch(false);
      element("help-button", HTMLButtonElement).focus();
    });
    this.select.addEventListener("change", () => {
      this.drawn = "";
      this.watch(true);
    });
  }

  show() {
    this.drawn = "";
    this.dialog.show();
    this.watch(true);
  }

  /** The second click revokes a link, because nothing brings it back. @param {Api.ConnectedPerson} person @param {HTMLButtonElement} button */
  kick({ person, name }, button) {
    const { value } = this.select;
    if (value !== "revoke") this.say({ do: "kick", person, seconds: Number(value) });
    else if (button.dataset.sure) this.say({ do: "kick", person, revoke: true });
    else {
      button.dataset.sure = "asked";
      button.textContent = "Revoke for ever?";
      button.setAttribute("aria-label", `Revoke the link of ${name} for ever?`);
    }
  }

  /** @param {Api.ConnectedPerson} member */
  row(member) {
    const { person, name, you, kept_out: out } = member;
    const label = out === null ? "Disconnect" : "Let in";
    const act = () => {
      if (out === null) this.kick(member, made);
      else this.say({ do: "kick", person, seconds: 0 });
      this.watch(true);
    };
    // Its person stays the same while the label changes, so that the focus finds the button again.
    const made = button(label, act, { "aria-label": `${label} ${name}`, "data-person": person });
    const acts = html("div", {}, ...(you && out === null ? [] : [made]));
    return html("li", {}, html("b", {}, you ? `${name} (you)` : name), acts, html("span", {}, about(member)));
  }

  /** @param {Api.People} answer */
  heard({ people }) {
    /** @param {Api.ConnectedPerson} member */
    const parts = ({ person, name, role, kept_out: out }) => [person, name, role, out === null];
    const key = JSON.stringify(people.map(parts));
    // Buttons are not replaced while they may be pressed.
    if (key === this.drawn) {
      const lines = this.list.querySelectorAll("span");
      people.forEach((member, number) => (lines[number].textContent = about(member)));
      return;
    }
    this.drawn = key;
    /** @type {HTMLElement | null | undefined} */
    const focused = document.activeElement?.closest("#people-list button");
    const kept = focused?.dataset.person;
    this.list.replaceChildren(...people.map((member) => this.row(member)));
    element("people-for", HTMLElement).hidden = people.length < 2;
    this.select.options[3].hidden = people.every(({ link }) => link === null);
    element("people-note", HTMLElement).hidden = people.every(({ role }) => role === "admin");
    // The focus stays on its button, although the list is drawn again.
    const buttons = [...this.list.querySelectorAll("button")];
    if (kept) (buttons.find((button) => button.dataset.person === kept) ?? this.dialog.querySelector("button"))?.focus();
  }
}
