// Names of this page and of presses of STOP.
import { storage } from "./storage.js";

export function randomName() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

// A reloaded page keeps its name; a second tab gets another.
export function pageName() {
  const [entry] = /** @type {PerformanceNavigationTiming[]} */ (performance.getEntriesByType("navigation"));
  const kept = storage(() => sessionStorage);
  const name = (entry?.type === "reload" && kept.getItem("page")) || randomName();
  kept.setItem("page", name);
  return name;
}
