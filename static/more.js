// The small menu: the person's name, a picture, a recording, and a link to this view.
"use strict";
const More = (() => {
  const NAME = "katana450.name";
  /** @type {(id: string) => any} */
  const byId = (id) => document.getElementById(id);
  const [dialog, button, field, why] = ["more", "more-button", "own-name", "own-name-why"].map(byId);
  const ID = "name"; // id of the request for a name
  const RECORDED = 600; // s of motion that the server keeps
  /** @type {(request: object) => void} */
  let say = () => {};
  /** @type {(words: string) => void} */
  let toast = () => {};
  /** @type {Storage | null} */
  let kept = null;
  let wanted = ""; // name that was sent and not answered yet
  let known = ""; // name that the server shows
  let robot = null; // the robot that the server drives
  let chosen = ""; // name that the server has taken, if the browser stores none

  const refuse = (words) => {
    why.textContent = words;
    field.setAttribute("aria-invalid", String(words !== ""));
  };

  function ask(name) {
    wanted = name;
    say({ do: "rename", name, id: ID });
  }

  function open() {
    if (byId("phone").open) byId("phone").close();
    field.value = known;
    refuse("");
    dialog.show();
    button.setAttribute("aria-expanded", "true");
    field.select();
  }

  async function snapshot() {
    const picture = await Viser.picture(byId("scene"));
    if (!picture) return toast("There is no picture yet. Wait until the scene is shown.");
    const link = document.createElement("a");
    link.href = URL.createObjectURL(picture);
    link.download = `katana450-${new Date().toISOString().slice(0, 19).replaceAll(":", "-")}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href));
    toast(`The picture is saved as ${link.download}.`);
  }

  async function copyView(view) {
    const place = (point) => point.map((x) => Number(x.toFixed(4))).join(",");
    const query = { initialCameraPosition: place(view.position), initialCameraLookAt: place(view.look_at) };
    const link = byId("view-link");
    // Commas are legal in a query and easier to read.
    const search = Object.entries(query).map((pair) => pair.join("=")).join("&");
    link.value = `${location.origin}${location.pathname}?${search}`;
    link.hidden = false;
    try {
      await navigator.clipboard.writeText(link.value);
      toast("The link to this view is copied.");
    } catch {
      link.select();
      toast("Copy the marked link: this browser does not allow the page to do it.");
    }
  }

  // `view` returns the camera of the scene; null before the first.
  function begin(options) {
    ({ say, toast, kept } = options);
    const toggle = () => (dialog.open ? dialog.close() : open());
    button.addEventListener("click", toggle);
    document.querySelector("#who p").addEventListener("click", toggle);
    dialog.addEventListener("close", () => button.setAttribute("aria-expanded", "false"));
    byId("own-name-form").addEventListener("submit", (event) => {
      event.preventDefault();
      ask(field.value);
    });
    byId("snapshot").addEventListener("click", snapshot);
    byId("copy-view").addEventListener("click", () => {
      const view = options.view();
      if (view) copyView(view);
      else toast("There is no view yet. Wait until the scene is shown.");
    });
    byId("keep-recording").addEventListener("click", async () => {
      const { keep } = await import("./more/keep.js");
      keep(toast, { last: RECORDED });
    });
    byId("robots-button").addEventListener("click", () => chooseRobot());
    // In the bar, or in the menu for a finger.
    for (const id of ["phone-bar", "phone-button"])
      byId(id).addEventListener("click", async () => {
        if (dialog.open) dialog.close();
        const { toggle } = await import("./more/phone.js");
        toggle(toast);
      });
  }

  // Show the choice of another robot; `file`: a description that was dropped on the page.
  async function chooseRobot(file) {
    if (dialog.open) dialog.close();
    const { toggle } = await import("./more/robots.js");
    toggle({ say, robot, file });
  }

  // All windows load again when the server has changed its robot.
  window.addEventListener("status", ({ detail }) => {
    if (!detail.robot) return;
    if (robot && robot.key !== detail.robot.key) location.reload();
    ({ robot } = detail);
  });

  // Take the name in a status; use the kept one for a person whom the server has named.
  function draw(name) {
    if (name === known) return;
    known = name;
    const own = kept?.getItem(NAME) ?? chosen;
    // A server that was restarted has forgotten it.
    if (own && own !== name && /^Window \d+$/.test(name)) ask(own);
  }

  // Take an answer; return whether it was for the menu.
  function hear(answer) {
    if (answer.id === "robot") {
      if (answer.is === "refused") import("./more/robots.js").then(({ refuse }) => refuse(answer.why));
      return true;
    }
    if (answer.id !== ID) return false;
    if (answer.is === "refused") {
      refuse(answer.why);
      if (!dialog.open) toast(answer.why);
    } else {
      chosen = wanted.trim();
      kept?.setItem(NAME, chosen);
      refuse("");
      if (dialog.open) dialog.close();
    }
    return true;
  }

  return { begin, draw, hear, chooseRobot };
})();
