// Drag a row of a list to another place by its handle, with mouse, pen or finger.
const EDGE = 36; // px from the ends of the scrolled box within which it scrolls
const PACE = 8; // px

// `drop` is called with the row and the index among the other rows at which it was released.
/** @param {HTMLElement} row @param {HTMLElement} handle @param {(row: HTMLElement, to: number) => void} drop */
export function draggable(row, handle, drop) {
  /** @type {{ y: number, scroll: number, list: Element, box: Element } | null} */
  let start = null; // {y, scroll, list, box} of the press
  let target = 0;

  /** @param {Element} list @param {number} to */
  const mark = (list, to) => {
    const others = [...list.children].filter((other) => other !== row);
    others.forEach((other, i) => {
      other.classList.toggle("before", i === to);
      other.classList.toggle("after", to === others.length && i === to - 1);
    });
  };

  /** @param {boolean} kept */
  const end = (kept) => {
    if (!start) return;
    const { list } = start;
    start = null;
    mark(list, -1);
    row.classList.remove("dragged");
    row.style.translate = "";
    if (kept) drop(row, target);
  };

  handle.addEventListener("pointerdown", (event) => {
    if (event.button || start) return;
    event.preventDefault();
    handle.setPointerCapture(event.pointerId);
    const list = row.parentElement;
    const near = list?.closest(".scrolled");
    const box = near && getComputedStyle(near).overflowY === "auto" ? near : near?.closest(".sheet");
    if (!list || !box) return;
    start = { y: event.clientY, scroll: box.scrollTop, list, box };
    target = [...list.children].indexOf(row);
    row.classList.add("dragged");
  });
  handle.addEventListener("pointermove", ({ clientY }) => {
    if (!start) return;
    const { list, box } = start;
    const { top, bottom } = box.getBoundingClientRect();
    if (clientY < top + EDGE) box.scrollTop -= PACE;
    else if (clientY > bottom - EDGE) box.scrollTop += PACE;
    row.style.translate = `0 ${clientY - start.y + box.scrollTop - start.scroll}px`;
    const others = [...list.children].filter((other) => other !== row);
    target = others.filter((other) => {
      const { top, height } = other.getBoundingClientRect();
      return clientY > top + height / 2;
    }).length;
    mark(list, target);
  });
  handle.addEventListener("pointerup", () => end(true));
  handle.addEventListener("pointercancel", () => end(false));
  handle.addEventListener("lostpointercapture", () => end(false));
}
