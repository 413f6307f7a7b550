// The light or dark theme, for both documents of a tab, set before either draws. It is the one chosen
// in this tab, otherwise that of the system.
const KEY = "katana450.theme";
const system = matchMedia("(prefers-color-scheme: dark)");
/** @typedef {"Dark" | "Light"} Name */
/** @type {(name: Name) => void} */
let listener = () => {};

/** @type {string | null} */
let chosen = null; // if the browser refuses to store it
const stored = () => {
  try {
    return sessionStorage.getItem(KEY) ?? chosen;
  } catch {
    return chosen;
  }
};
/** @param {string} theme */
const store = (theme) => {
  chosen = theme;
  try {
    sessionStorage.setItem(KEY, theme);
  } catch {
    // It lasts as long as this document.
  }
};

if (new URLSearchParams(location.search).has("darkMode") && !stored()) store("Dark");
/** @returns {Name} */
export const name = () => ((stored() ?? (system.matches ? "Dark" : "Light")) === "Dark" ? "Dark" : "Light");

function apply() {
  const html = document.documentElement;
  html.dataset.theme = name().toLowerCase();
  // The background of a document without styles.
  html.style.colorScheme = html.dataset.theme;
  listener(name());
}
system.addEventListener("change", apply);
// The other document of the tab has changed the theme.
window.addEventListener("storage", apply);
apply();

/** @param {string} theme */
export function choose(theme) {
  store(theme);
  apply();
}

/** Call `follower` with the name of each theme from now on. @param {(name: Name) => void} follower */
export const follow = (follower) => (listener = follower);
