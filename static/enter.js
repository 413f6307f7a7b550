// The name of this page, and its sign-in. Runs as soon as the frame of the scene is there, so that viser's
// page loads beside the rest of this one; viser's program starts when the person has signed in.
"use strict";
(() => {
  // A reloaded page keeps its name; a second tab gets another. A browser may refuse to store it.
  function name() {
    /** @type {any[]} */
    const [entry] = performance.getEntriesByType("navigation");
    const again = entry?.type === "reload";
    const fresh = randomName();
    try {
      const old = again && sessionStorage.getItem("page");
      sessionStorage.setItem("page", old || fresh);
      return old || fresh;
    } catch {
      return fresh;
    }
  }

  function randomName() {
    const bytes = crypto.getRandomValues(new Uint8Array(16));
    return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
  }

  // An access link has its token behind the #, which browsers do not send. It is sent once, by POST.
  async function enter() {
    const token = location.hash.slice(1);
    if (token) history.replaceState(null, "", location.pathname + location.search);
    const answer = await fetch("enter", { method: "POST", body: JSON.stringify({ token }) });
    const { ok, status, headers } = answer;
    // 403: an admin has disconnected this person, whose STOP still works.
    const why = status === 403 || (token && !ok) ? await answer.text() : "";
    return { ok, out: status === 403, why, stopPort: headers.get("X-Stop-Port") };
  }

  const page = name();
  window.entry = { page, randomName, enter, entered: enter() };
  // Pass on no other parameters: some parameters of viser's page could harm the server.
  const query = [...new URLSearchParams(location.search)].filter(([key]) => Viser.PARAMETER.test(key));
  /** @type {any} */ (document.getElementById("scene")).src = `viser/?${new URLSearchParams([["page", page], ...query])}`;
})();
