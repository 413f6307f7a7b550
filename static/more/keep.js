// Saves what the server has recorded. Loaded on first use.
import { save, timestamp } from "../dom.js";
import { messageOf, queryOf, request } from "../server.js";

let working = false;

// `toast` shows a sentence to the person. `query` names the part: its last seconds, or begin and end.
/** @param {Page.Toast} toast @param {Record<string, string | number>} query */
export async function keep(toast, query) {
  if (working) return;
  working = true;
  toast("The recording is being made.");
  try {
    const answer = await request(`api/v1/recording?${queryOf(query)}`);
    const name = `katana450-${timestamp()}.mcap`;
    save(await answer.blob(), name);
    toast(`The recording is saved as ${name}.`);
  } catch (error) {
    toast(`Nothing was saved: ${messageOf(error)}`);
  } finally {
    working = false;
  }
}
