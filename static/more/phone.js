// The address of this server for a phone, as a QR code and as text. Loaded on first use.
import { element, styled } from "../dom.js";
import { html } from "../instruments/shape.js";
import { messageOf, request } from "../server.js";

const box = element("phone", HTMLDialogElement);
const style = styled("phone.css", import.meta.url);

const expand = () => {
  for (const button of document.querySelectorAll("[aria-controls=phone]")) button.setAttribute("aria-expanded", String(box.open));
};
box.addEventListener("close", expand);

/** @param {{ url: string, code: string, note: string }} address @param {Page.Toast} toast */
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

/** Show the address, or hide it again. `toast` shows a sentence to the person. @param {Page.Toast} toast */
export async function toggle(toast) {
  if (box.open) return box.close();
  try {
    const answer = await request("api/v1/phone");
    box.replaceChildren(...shown(await answer.json(), toast));
    await style;
    box.show();
    expand();
  } catch (error) {
    toast(`There is no address for a phone: ${messageOf(error)}`);
  }
}
