// The address of this server for a phone, as a QR code and as text. Loaded on first use.
import { html } from "../instruments/shape.js";

const box = /** @type {HTMLDialogElement} */ (document.getElementById("phone"));
const style = html("link", { rel: "stylesheet", href: new URL("phone.css", import.meta.url).href });
const styled = new Promise((resolve) => ["load", "error"].forEach((kind) => style.addEventListener(kind, resolve)));
document.head.append(style);

const expand = () => {
  for (const each of document.querySelectorAll("[aria-controls=phone]")) each.setAttribute("aria-expanded", String(box.open));
};
box.addEventListener("close", expand);

function shown({ url, code, note }, toast) {
  const head = html("form", { method: "dialog" }, html("h1", {}, "Open on your phone"), html("button", {}, "Close"));
  if (!url) return [head, html("p", {}, note)];
  const field = html("input", { readonly: "", value: url, "aria-label": "Address for a phone" });
  const copy = html("button", { type: "button" }, "Copy");
  copy.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(url);
      toast("The address is copied.");
    } catch {
      field.select();
      toast("Copy the marked address: this browser does not allow the page to do it.");
    }
  });
  return [head, html("img", { src: code, alt: `QR code of ${url}` }), html("div", {}, field, copy), html("p", {}, note)];
}

// Show the address, or hide it again. `toast` shows a sentence to the person.
export async function toggle(toast) {
  if (box.open) return box.close();
  try {
    const answer = await fetch("api/v1/phone");
    if (!answer.ok) throw new Error(await answer.text());
    box.replaceChildren(...shown(await answer.json(), toast));
    await styled;
    box.show();
    expand();
  } catch (error) {
    toast(`There is no address for a phone: ${error.message}`);
  }
}
