// Drag a row of a list to another place by its handle, with mouse, pen or finger.
const EDGE = 36; // px from the ends of the scrolled box within which it scrolls
const PACE = 8; // px

// `drop` is called with the row and the index among the other rows at which it was released.
export function draggable(row, handle, drop) {
  let start = null; // {y, scroll, list, box} of the press
  let target = 0;

  const mark = (list, to) => {
    const others = [...list.children].filter((each) => each !== row);
    others.forEach((each, i) => {
      each.classList.toggle("before", i === to);
      each.classList.toggle("after", to === others.length && i === to - 1);
    });
  };

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
    const near = list.closest(".scrolled");
    const box = getComputedStyle(near).overflowY === "auto" ? near : near.closest(".sheet");
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
    const others = [...list.children].filter((each) => each !== row);
    target = others.filter((each) => {
      const box = each.getBoundingClientRect();
      return clientY > box.top + box.height / 2;
    }).length;
    mark(list, target);
  });
  handle.addEventListener("pointerup", () => end(true));
  handle.addEventListener("pointercancel", () => end(false));
  handle.addEventListener("lostpointercapture", () => end(false));
}
