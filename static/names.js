// Names for screen readers of the controls in viser's panel, which viser leaves without one.
"use strict";
(() => {
  const EVERY = 300; // ms
  const LIST = ", ";
  let waiting = false;

  const nameless = (control) =>
    !control.getAttribute("aria-label") && (!control.labels?.length || isList(control));

  // A row of several boxes has one label that is a list, such as "x, y, z".
  const isList = (control) => control.labels?.[0]?.textContent.includes(LIST);

  function nameOfInput(control) {
    const { label, index } = Viser.controlOf(control);
    return label.includes(LIST) ? label.split(LIST)[index] : label;
  }

  function nameOfButton(button) {
    if (button.closest("[role=alert]")) return "Close this message";
    const beside = button.parentElement?.parentElement?.querySelector("input");
    return beside ? "Pick a colour from the screen" : "Settings of the display";
  }

  function nameAll() {
    waiting = false;
    for (const control of document.querySelectorAll("input:not([type=hidden]), [role=slider]"))
      if (nameless(control)) control.setAttribute("aria-label", nameOfInput(control));
    for (const button of document.querySelectorAll("button:not([aria-hidden])"))
      if (nameless(button) && !button.textContent) button.setAttribute("aria-label", nameOfButton(button));
  }

  new MutationObserver(() => {
    if (waiting) return;
    waiting = true;
    setTimeout(nameAll, EVERY);
  }).observe(document, { childList: true, subtree: true });
})();
