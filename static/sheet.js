// viser's panel on a narrow screen. viser lays it over the scene; here it is a sheet below the scene,
// which keeps the rest of the height, and it starts folded.
"use strict";
(() => {
  // viser's own breakpoint, and the box and handle of its panel below that.
  const NARROW = "(max-width: 36em)";
  const PANEL = '.mantine-Paper-root[style*="position: fixed"]';
  const HANDLE = `${PANEL} [style*="height: 3.5em"]`;
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(`@media ${NARROW} {
    :has(> ${PANEL}) { flex-direction: column; }
    :has(> ${PANEL}) > :not(${PANEL}) { min-height: 0; }
    ${PANEL} { position: static !important; flex: none; width: 100% !important; max-height: 55% !important; }
    ${PANEL} [style*="width: 20em"] { width: 100% !important; }
    ${HANDLE}::after { content: "Controls"; font-size: 0.9em; opacity: 0.7; }
  }`);
  document.adoptedStyleSheets.push(sheet);

  let folded = null; // the panel that was folded already; a person may open it
  const fold = () => {
    /** @type {HTMLElement | null} */
    const handle = document.querySelector(HANDLE);
    if (handle && handle !== folded) handle.click();
    folded = handle;
  };
  const narrow = matchMedia(NARROW);
  const watch = new MutationObserver(fold);
  const follow = () => {
    watch.disconnect();
    if (narrow.matches) watch.observe(document.documentElement, { childList: true, subtree: true });
    else folded = null;
  };
  narrow.addEventListener("change", follow);
  follow();
})();
