// The address of this server for a phone, as a QR code and as text. Loaded on first use.
import { html } from "../instruments/shape.js";

const byId = (id) => document.getElementById(id);
const [button, box] = [byId("phone-button"), byId("phone")];
document.head.append(html("link", { rel: "stylesheet", href: new URL("phone.css", import.meta.url).href }));

function shown({ url, code, note }, toast) {
  if (!url) return [html("p", {}, note)];
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
  return [html("img", { src: code, alt: `QR code of ${url}` }), html("div", {}, field, copy), html("p", {}, note)];
}

// Show the address, or hide it again. `toast` shows a sentence to the person.
export async function toggle(toast) {
  if (!box.hidden) {
    box.hidden = true;
  } else {
    try {
      const answer = await fetch("api/v1/phone");
      if (!answer.ok) throw new Error(await answer.text());
      box.replaceChildren(...shown(await answer.json(), toast));
      box.hidden = false;
    } catch (error) {
      toast(`There is no address for a phone: ${error.message}`);
    }
  }
  button.setAttribute("aria-expanded", String(!box.hidden));
}
