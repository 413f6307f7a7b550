// Who is connected, for admins: a list with buttons that mute and disconnect.
"use strict";
const People = (() => {
  const EVERY = 1000; // ms between two queries while the list is open
  const KINDS = { page: "page", scene: "scene", program: "program", lines: "TCP", posts: "HTTP" };
  /** @type {(id: string) => any} */
  const byId = (id) => document.getElementById(id);
  /** @type {(request: object) => void} */
  let say = () => {};
  let timer = null;
  let drawn = "";

  const time = (since) => new Date(since).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });

  // "2 pages, scene, TCP": the kinds of connections with their numbers.
  function connections(all) {
    const kinds = Object.keys(KINDS).map((kind) => [kind, all.filter((each) => each.kind === kind).length]);
    const words = kinds.filter(([, count]) => count);
    return words.map(([kind, count]) => (count > 1 ? `${count} × ${KINDS[kind]}` : KINDS[kind])).join(", ");
  }

  function about(person) {
    const { role, drives, asks, program, connections: all, refused, muted, kept_out: out, link } = person;
    const addresses = [...new Set(all.map(({ address }) => address))].join(", ");
    return [
      role,
      drives && (program ? `runs ${program}` : "drives"),
      asks && "asks for the arm",
      all.length > 0 && `${connections(all)} from ${addresses} since ${time(all[0].since)}`,
      link && `link ${link.slice(0, 6)}`,
      refused > 0 && `${refused} refused`,
      muted !== null && `muted, one STOP in ${muted} s`,
      out !== null && `disconnected for ${Math.ceil(out / 60)} min`,
    ].filter(Boolean).join(" · ");
  }

  // `key` stays the same while the label changes, so that the focus finds the button again.
  function button(key, label, name, act) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = label;
    made.setAttribute("aria-label", `${label} ${name}`);
    made.dataset.key = key;
    made.addEventListener("click", () => {
      act();
      look();
    });
    return made;
  }

  function kick(person) {
    const { value } = byId("kick-for");
    if (value === "revoke") say({ do: "kick", person, revoke: true });
    else say({ do: "kick", person, seconds: Number(value) });
  }

  function row(each) {
    const { person, name, role, you, muted, kept_out: out } = each;
    const item = document.createElement("li");
    const title = document.createElement("b");
    title.textContent = you ? `${name} (you)` : name;
    const line = document.createElement("span");
    line.textContent = about(each);
    const acts = document.createElement("div");
    if (role !== "admin")
      acts.append(
        muted === null
          ? button(`mute ${person}`, "Mute", name, () => say({ do: "mute", person }))
          : button(`mute ${person}`, "Unmute", name, () => say({ do: "unmute", person })),
      );
    const lets = () => say({ do: "kick", person, seconds: 0 });
    if (out !== null) acts.append(button(`kick ${person}`, "Let in", name, lets));
    else if (!you) acts.append(button(`kick ${person}`, "Disconnect", name, () => kick(person)));
    item.append(title, acts, line);
    return item;
  }

  function heard({ people }) {
    const parts = (each) => [each.person, each.name, each.role, each.muted === null, each.kept_out === null];
    const key = JSON.stringify(people.map(parts));
    // Buttons are not replaced while they may be pressed.
    if (key === drawn) {
      const lines = byId("people-list").querySelectorAll("span");
      people.forEach((each, number) => (lines[number].textContent = about(each)));
      return;
    }
    drawn = key;
    /** @type {HTMLElement | null} */
    const focused = document.activeElement?.closest("#people-list button");
    const kept = focused?.dataset.key;
    byId("people-list").replaceChildren(...people.map(row));
    byId("people-for").hidden = people.length < 2;
    byId("kick-for").options[3].hidden = people.every(({ link }) => link === null);
    byId("people-note").hidden = people.every(({ role }) => role === "admin");
    // The focus stays on its button, although the list is drawn again.
    /** @type {HTMLElement[]} */
    const buttons = [...byId("people-list").querySelectorAll("button")];
    if (kept) (buttons.find((each) => each.dataset.key === kept) ?? byId("people-button")).focus();
  }

  function look() {
    say({ do: "list_people" });
  }

  // Below the bar and not modal, so that mouse and finger can press STOP.
  function begin(page) {
    say = page.say;
    const [dialog, opener] = [byId("people"), byId("people-button")];
    const toggle = () => {
      if (dialog.open) return dialog.close();
      byId("help").close();
      drawn = "";
      dialog.show();
      opener.setAttribute("aria-expanded", "true");
      look();
      timer = setInterval(look, EVERY);
    };
    opener.addEventListener("click", toggle);
    byId("people-help-button").addEventListener("click", toggle);
    dialog.addEventListener("close", () => {
      clearInterval(timer);
      opener.setAttribute("aria-expanded", "false");
    });
  }

  // An admin sees the number of connections as the button that opens the list.
  function draw({ role, windows }) {
    const opener = byId("people-button");
    opener.hidden = byId("people-help").hidden = role !== "admin";
    const words = `${windows} connected`;
    if (opener.textContent !== words) opener.textContent = words;
    if (opener.hidden && byId("people").open) byId("people").close();
  }

  return { begin, draw, heard };
})();
