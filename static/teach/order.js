// Drag a row of a list to another place by its handle, as the browser drags.
/** @typedef {(row: HTMLElement, to: number, over: HTMLElement, after: boolean) => void} Drop */
/** @type {{ row: HTMLElement, drop: Drop } | null} */
let dragged = null;

// `drop` is called with the row, the index among the other rows at which it was released, the row below the pointer, and
// whether it is after that.
/** @param {HTMLElement} row @param {HTMLElement} handle @param {Drop} drop */
export function draggable(row, handle, drop) {
  handle.draggable = true;
  handle.addEventListener("dragstart", ({ dataTransfer }) => {
    dragged = { row, drop };
    dataTransfer?.setDragImage(row, 0, 0);
  });
  handle.addEventListener("dragend", () => (dragged = null));
  for (const kind of /** @type {const} */ (["dragover", "dragleave", "drop"]))
    row.addEventListener(kind, (event) => {
      if (!dragged || dragged.row === row) return;
      event.preventDefault();
      const { top, height } = row.getBoundingClientRect();
      const after = event.clientY > top + height / 2;
      row.classList.toggle("before", kind === "dragover" && !after);
      row.classList.toggle("after", kind === "dragover" && after);
      const others = [...(row.parentElement?.children ?? [])].filter((other) => other !== dragged?.row);
      if (kind === "drop") dragged.drop(dragged.row, others.indexOf(row) + Number(after), row, after);
    });
}
