// The light or dark theme, for both documents of a tab, set before either draws. It is the one chosen
// in this tab, otherwise that of the system.
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
    // The background of a document without styles.
    html.style.colorScheme = html.dataset.theme;
    follow(name());
  }
  system.addEventListener("change", apply);
  // The other document of the tab has changed the theme.
  window.addEventListener("storage", apply);
  apply();

  return {
    name,
    choose(chosen) {
      sessionStorage.setItem(KEPT, chosen);
      apply();
    },
    // Call `listener` with the name of each theme from now on.
    follow: (listener) => (follow = listener),
  };
})();
