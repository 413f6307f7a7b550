// Drag a row of a list to another place by its handle, with a mouse, a pen or a finger.
/** @typedef {(row: HTMLElement, to: number, over: HTMLElement, after: boolean) => void} Drop */
const MOVED = 5; // px, below which a press is no drag

// `drop` is called with the row, the index among the other rows at which it was released, the row below the pointer, and
// whether it is after that.
/** @param {HTMLElement} row @param {HTMLElement} handle @param {Drop} drop */
export function draggable(row, handle, drop) {
  handle.classList.add("grip");
  handle.addEventListener("pointerdown", ({ button, clientY: start, pointerId }) => {
    const others = [...(row.parentElement?.children ?? [])].filter((other) => other !== row);
    if (button || !others.length) return;
    handle.setPointerCapture(pointerId);
    /** @type {{ over: HTMLElement, after: boolean } | null} */
    let place = null;
    /** @param {typeof place} next */
    const mark = (next) => {
      place?.over.classList.remove("before", "after");
      place = next;
      place?.over.classList.add(place.after ? "after" : "before");
    };
    handle.onpointermove = ({ clientY }) => {
      if (Math.abs(clientY - start) < MOVED) return mark(null);
      const over = /** @type {HTMLElement} */ (others.find((other) => clientY < other.getBoundingClientRect().bottom) ?? others.at(-1));
      const { top, height } = over.getBoundingClientRect();
      mark({ over, after: clientY > top + height / 2 });
      over.scrollIntoView({ block: "nearest" });
    };
    handle.onpointerup = () => place && drop(row, others.indexOf(place.over) + Number(place.after), place.over, place.after);
    handle.onlostpointercapture = () => {
      mark(null);
      handle.onpointermove = handle.onpointerup = null;
    };
  });
}
