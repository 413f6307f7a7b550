// viser's panel on a narrow screen. viser lays it over the scene. Here it is a sheet below the scene,
// which gets the remaining height, and it starts folded.
"use strict";
(() => {
  const { NARROW, PANEL, PANEL_HANDLE, PANEL_CONTENT } = Viser;
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(`@media ${NARROW} {
    :has(> ${PANEL}) { flex-direction: column; }
    :has(> ${PANEL}) > :not(${PANEL}) { min-height: 0; }
    ${PANEL} { position: static !important; flex: none; width: 100% !important; max-height: 55% !important; }
    ${PANEL_CONTENT} { width: 100% !important; }
    ${PANEL_HANDLE}::after { content: "Controls"; font-size: 0.9em; opacity: 0.7; }
  }`);
  document.adoptedStyleSheets.push(sheet);

  let folded = null; // handle of the panel that was already folded; a person may open it
  const fold = () => {
    /** @type {HTMLElement | null} */
    const handle = document.querySelector(PANEL_HANDLE);
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
