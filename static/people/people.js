// Who is connected, for admins: a list with buttons that disconnect.
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
/** @type {(id: string) => any} */
const byId = (id) => document.getElementById(id);

const time = (since) => new Date(since).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });

function about(person) {
  const { role, drives, asks, program, connections, kept_out: out, link } = person;
  const addresses = [...new Set(connections.map(({ address }) => address))].join(", ");
  return [
    role,
    drives && (program ? `runs ${program}` : "drives"),
    asks && "asks for the arm",
    connections.length > 0 && `connected from ${addresses} since ${time(connections[0].since)}`,
    link && `link ${link.slice(0, 6)}`,
    out !== null && `disconnected for ${Math.ceil(out / 60)} min`,
  ].filter(Boolean).join(" · ");
}

export class People {
  // The dialog is below the bar and not modal, so that mouse and finger can press STOP.
  constructor(say) {
    this.say = say;
    this.timer = null;
    this.drawn = "";
    const style = document.createElement("link");
    style.rel = "stylesheet";
    style.href = new URL("people.css", import.meta.url).href;
    document.head.append(style);
    this.dialog = document.createElement("dialog");
    this.dialog.id = "people";
    this.dialog.setAttribute("aria-labelledby", "people-title");
    this.dialog.innerHTML = CONTENT;
    document.querySelector("main").append(this.dialog);
    this.dialog.addEventListener("close", () => {
      clearInterval(this.timer);
      byId("help-button").focus();
    });
    byId("kick-for").addEventListener("change", () => {
      this.drawn = "";
      this.look();
    });
  }

  show() {
    this.drawn = "";
    this.dialog.show();
    this.look();
    clearInterval(this.timer);
    this.timer = setInterval(() => this.look(), EVERY);
  }

  look() {
    this.say({ do: "list_people" });
  }

  // `key` stays the same while the label changes, so that the focus finds the button again.
  button(key, label, name, act) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = label;
    made.setAttribute("aria-label", `${label} ${name}`);
    made.dataset.key = key;
    made.addEventListener("click", () => {
      act(made);
      this.look();
    });
    return made;
  }

  // The second click revokes a link, because nothing brings it back.
  kick({ person, name }, button) {
    const { value } = byId("kick-for");
    if (value !== "revoke") this.say({ do: "kick", person, seconds: Number(value) });
    else if (button.dataset.sure) this.say({ do: "kick", person, revoke: true });
    else {
      button.dataset.sure = "asked";
      button.textContent = "Revoke for ever?";
      button.setAttribute("aria-label", `Revoke the link of ${name} for ever?`);
    }
  }

  row(each) {
    const { person, name, you, kept_out: out } = each;
    const item = document.createElement("li");
    const title = document.createElement("b");
    title.textContent = you ? `${name} (you)` : name;
    const line = document.createElement("span");
    line.textContent = about(each);
    const acts = document.createElement("div");
    const add = (key, label, act) => acts.append(this.button(`${key} ${person}`, label, name, act));
    if (out !== null) add("kick", "Let in", () => this.say({ do: "kick", person, seconds: 0 }));
    else if (!you) add("kick", "Disconnect", (button) => this.kick(each, button));
    item.append(title, acts, line);
    return item;
  }

  heard({ people }) {
    const parts = (each) => [each.person, each.name, each.role, each.kept_out === null];
    const key = JSON.stringify(people.map(parts));
    // Buttons are not replaced while they may be pressed.
    if (key === this.drawn) {
      const lines = byId("people-list").querySelectorAll("span");
      people.forEach((each, number) => (lines[number].textContent = about(each)));
      return;
    }
    this.drawn = key;
    /** @type {HTMLElement | null} */
    const focused = document.activeElement?.closest("#people-list button");
    const kept = focused?.dataset.key;
    byId("people-list").replaceChildren(...people.map((each) => this.row(each)));
    byId("people-for").hidden = people.length < 2;
    byId("kick-for").options[3].hidden = people.every(({ link }) => link === null);
    byId("people-note").hidden = people.every(({ role }) => role === "admin");
    // The focus stays on its button, although the list is drawn again.
    /** @type {HTMLElement[]} */
    const buttons = [...byId("people-list").querySelectorAll("button")];
    if (kept) (buttons.find((each) => each.dataset.key === kept) ?? this.dialog.querySelector("button")).focus();
  }
}
