// The quality of the connection: in the bar, and in a banner over the scene if it is lost or slow.
import { element, first, write } from "../dom.js";

const STALE = 1.0; // s, age from which a picture is marked as old
const SLOW = 150; // ms, round trip from which a connection counts as slow
const QUIET = 300; // ms without a message after which the state is unknown
const ROUND_TRIP = "Round trip to the arm, and the age of the picture";
export const OFFLINE = "No connection to the arm.";

/** @param {Page.Context} page @param {boolean} unanswered whether a press of STOP has no answer */
export function drawLink({ store }, unanswered) {
  const { status, up, silent, since } = store;
  const trip = store.trip ?? 0;
  const age = up ? Math.max(status?.age ?? 0, silent / 1000 - 0.2) : (performance.now() - since) / 1000;
  const bad = up && (silent > QUIET || age >= STALE);
  const link = element("link", HTMLElement);
  link.className = !up ? "lost" : bad || age >= 0.4 || trip > SLOW ? "slow" : "";
  const old = age >= 0.3 ? `, ${age.toFixed(1)} s old` : "";
  const quality = !up ? "Offline" : store.trip === null ? "" : `${Math.round(trip)} ms${old}`;
  write(first(":scope > :last-child", Element, link), quality);
  link.title = `${ROUND_TRIP}: ${quality}`;
  document.body.classList.toggle("stale", !up || bad);
  const banner = element("banner", HTMLElement);
  const missing = status?.problem ?? "";
  banner.hidden = !(!up || bad || missing) || !status;
  banner.className = up ? "" : "lost";
  if (banner.hidden) return;
  const stale = "The picture is old.";
  let words = "The picture is old, although the connection is fast: this device may draw too slowly.";
  if (up && !bad) words = missing;
  else if (store.proven) words = `The arm has confirmed the stop on another path. ${stale}`;
  else if (!up) words = `${OFFLINE} ${unanswered ? "Your STOP is sent as soon as it is back." : `${stale} Reconnecting.`}`;
  else if (silent > QUIET) words = `The arm does not answer. ${stale}`;
  else if (trip > SLOW) words = `The connection is slow. ${stale}`;
  write(banner, words);
}
