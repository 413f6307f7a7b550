// The light or dark theme, for both documents of a tab, set before either draws. It is the one chosen
// in this tab, otherwise that of the system.
"use strict";
const Theme = (() => {
  const KEPT = "katana450.theme";
  const system = matchMedia("(prefers-color-scheme: dark)");
  /** @type {(name: string) => void} */
  let follow = () => {};

  let chosen = null; // if the browser refuses to store it
  const kept = () => {
    try {
      return sessionStorage.getItem(KEPT) ?? chosen;
    } catch {
      return chosen;
    }
  };
  const keep = (theme) => {
    chosen = theme;
    try {
      sessionStorage.setItem(KEPT, theme);
    } catch {
      // It lasts as long as this document.
    }
  };

  if (new URLSearchParams(location.search).has("darkMode") && !kept()) keep("Dark");
  const name = () => kept() ?? (system.matches ? "Dark" : "Light");

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
    choose(theme) {
      keep(theme);
      apply();
    },
    // Call `listener` with the name of each theme from now on.
    follow: (listener) => (follow = listener),
  };
})();
