// The light or dark theme, for both documents of a tab, set before either draws. It is the one chosen
// in this tab, otherwise that of the system.
import { storage } from "./page/storage.js";

const KEY = "katana450.theme";
const system = matchMedia("(prefers-color-scheme: dark)");
/** @typedef {"Dark" | "Light"} Name */
/** @type {(name: Name) => void} */
let listener = () => {};

const kept = storage(() => sessionStorage);
if (new URLSearchParams(location.search).has("darkMode") && !kept.getItem(KEY)) kept.setItem(KEY, "Dark");
/** @returns {Name} */
export const name = () => ((kept.getItem(KEY) ?? (system.matches ? "Dark" : "Light")) === "Dark" ? "Dark" : "Light");

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
  kept.setItem(KEY, theme);
  apply();
}

/** Call `follower` with the name of each theme from now on. @param {(name: Name) => void} follower */
export const follow = (follower) => (listener = follower);
