// Names of this page and of presses of STOP.

export function randomName() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

// A reloaded page keeps its name; a second tab gets another. A browser may refuse to store it.
export function pageName() {
  const [entry] = /** @type {PerformanceNavigationTiming[]} */ (performance.getEntriesByType("navigation"));
  const fresh = randomName();
  try {
    const old = entry?.type === "reload" ? sessionStorage.getItem("page") : null;
    sessionStorage.setItem("page", old || fresh);
    return old || fresh;
  } catch {
    return fresh;
  }
}
