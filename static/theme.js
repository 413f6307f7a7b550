// Light or dark, for both documents of a tab and before either draws: as chosen in this tab, else as
// the system has it.
"use strict";
const Theme = (() => {
  const KEPT = "katana450.theme";
  const system = matchMedia("(prefers-color-scheme: dark)");
  /** @type {(name: string) => void} */
  let follow = () => {};

  if (new URLSearchParams(location.search).has("darkMode") && !sessionStorage.getItem(KEPT))
    sessionStorage.setItem(KEPT, "Dark");
  const name = () => sessionStorage.getItem(KEPT) ?? (system.matches ? "Dark" : "Light");

  function apply() {
    const html = document.documentElement;
    html.dataset.theme = name().toLowerCase();
    // The ground of a document that has no styles yet.
    html.style.colorScheme = html.dataset.theme;
    follow(name());
  }
  system.addEventListener("change", apply);
  // The other document of the tab has chosen.
  window.addEventListener("storage", apply);
  apply();

  return {
    name,
    choose(chosen) {
      sessionStorage.setItem(KEPT, chosen);
      apply();
    },
    // `listener` is called with the name of each theme from now on.
    follow: (listener) => (follow = listener),
  };
})();
