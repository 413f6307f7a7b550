// The buttons of the lease: take, request, give and release the arm.
import { onConfirm, t } from "../dom.js";
import { button, html } from "../instruments/shape.js";

const MAIN = { class: "main" };

/** Whether a motion or a change of this person would be accepted if the arm is not stopped. @param {Page.Status | null} status */
export const mayDrive = (status) =>
  Boolean(status && status.role !== "viewer" && (status.mine || status.own_program || status.holder === null));

/** Return the controls that a person has with this status. @param {Page.Status} status @param {Page.Say} say @returns {HTMLElement[]} */
export function leaseControls(status, say) {
  const { mine, holder, role, asked, asking: requests, others } = status;
  if (role === "viewer") return [];
  // Requests are shown only to the driver and to the owner of a driving program, which ends when the arm is given away.
  // They are answered one after the other.
  const [first] = requests;
  /** @type {HTMLElement[]} */
  const buttons = first
    ? [
        button(mine ? "Give" : "Allow", () => say({ do: "give", to: first.number }), { ...MAIN, title: first.name }),
        button("Refuse", () => say({ do: "decline", to: first.number })),
      ]
    : [];
  if (mine) {
    const more = others.filter(({ number }) => number !== first?.number);
    if (more.length) buttons.push(handOver(more, say));
    return [...buttons, button("Release", () => say({ do: "release_lease" }))];
  }
  if (holder === null) return [button("Take", () => say({ do: "acquire" }), MAIN)];
  if (requests.length) return buttons;
  const free = [];
  if (asked) free.push(button("Withdraw", () => say({ do: "withdraw" })));
  // Nobody asks a program of their own.
  else if (!status.own_program) free.push(button("Request", () => say({ do: "ask" }), MAIN));
  if (role === "admin") free.push(button("Take over", () => say({ do: "take" })));
  return free;
}

/** @param {Page.Named[]} others @param {Page.Say} say */
function handOver(others, say) {
  const choices = others.map(({ number, name }) => new Option(name, String(number)));
  const list = html("select", { "aria-label": "Give to" }, new Option("Give to …", ""), ...choices);
  onConfirm(list, () => list.value && say({ do: "give", to: Number(list.value) }));
  return list;
}

/** @param {Element | null} control */
const labelOf = (control) => control?.getAttribute("aria-label") ?? control?.textContent ?? "";

// Replace the controls in `group`. The focus, and the choice of a list, stay with the same label.
/** @param {HTMLElement} group @param {HTMLElement[]} controls */
export function replaceKeepingFocus(group, controls) {
  const old = document.activeElement;
  const same = group.contains(old) ? controls.find((control) => t(labelOf(control)) === labelOf(old)) : undefined;
  if (same instanceof HTMLSelectElement && old instanceof HTMLSelectElement)
    if ([...same.options].some(({ value }) => value === old.value)) same.value = old.value;
  group.replaceChildren(...controls);
  same?.focus();
}
