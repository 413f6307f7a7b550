// The address of this server for a phone, as a QR code and as text. Loaded on first use.
import { element, styled } from "../dom.js";
import { button, html } from "../instruments/shape.js";
import { messageOf, request } from "../server.js";

const box = element("phone", HTMLDialogElement);
const style = styled("phone.css", import.meta.url);

/** @param {{ url: string | null, code: string, note: string, command: string | null }} address @param {Page.Toast} toast */
function shown({ url, code, note, command }, toast) {
  const head = html("form", { method: "dialog" }, html("h1", {}, "Open on your phone"), html("button", {}, "Close"));
  const text = url ?? command;
  if (!text) return [head, html("p", {}, note)];
  const name = url ? "Address for a phone" : "Command that opens the server";
  const field = html("input", { readonly: "", value: text, "aria-label": name });
  const copy = button("Copy", async () => {
    try {
      await navigator.clipboard.writeText(text);
      toast("It is copied.");
    } catch {
      field.select();
      toast("Copy the marked text: this browser does not allow the page to do it.");
    }
  });
  const first = url ? html("img", { src: code, alt: `QR code of ${url}` }) : html("p", {}, note);
  return [head, first, html("div", {}, field, copy), ...(url ? [html("p", {}, note)] : [])];
}

/** Show the address, or hide it again. `toast` shows a sentence to the person. @param {Page.Toast} toast */
export async function toggle(toast) {
  if (box.open) return box.close();
  try {
    const answer = await request("api/v1/phone");
    box.replaceChildren(...shown(await answer.json(), toast));
    await style;
    box.show();
  } catch (error) {
    toast(`There is no address for a phone: ${messageOf(error)}`);
  }
}
