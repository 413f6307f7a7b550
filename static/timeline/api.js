// Requests to the server about recordings.
import { messageOf, queryOf, request } from "../server.js";

/** @typedef {[start: number, end: number]} Span */
/** @typedef {[t: number, kind: string, words: string]} Mark */
/** What was done between two continuations: `since` is the moment of its parent that it continued from, `path` leads to its end. @typedef {{ number: number, parent: number | null, start: number, end: number, since: number | null, path: Span[], drivers: [name: string, source: string][], name: string, outcome: string, hidden: boolean }} Attempt */
const API = "api/v1/playback";
const NEWEST = 1e11; // s since the epoch, after all that is recorded
export const RING = "ring"; // name of the last minutes

/** Return the answer, or null if it has no content. Throws an error with the reason for a refusal. @param {string} url @param {RequestInit} [options] */
export async function answered(url, options) {
  const answer = await request(url, options);
  return answer.status === 204 ? null : answer.json();
}

/** @param {string} url @param {BodyInit | null} body */
const post = (url, body = null) => answered(url, { method: "POST", body });

/** Return {spans, marks, attempts} of a recording. @param {string} of @returns {Promise<{ spans: Span[], marks: Mark[], attempts: Attempt[] }>} */
export const timeline = (of) => answered(`${API}/${encodeURIComponent(of)}`);

/** Send a request about episodes from the window `page`. @param {string} page @param {object} body */
export const ask = (page, body) => post(`api/v1/episodes?page=${page}`, JSON.stringify(body));

/** Keep a part of the last minutes as an episode; return what to tell the person. @param {string} page @param {number} start @param {number} end @param {string} outcome */
export const keep = (page, start, end, outcome) => ask(page, { do: "keep", start, end, outcome }).then(({ number }) => `Episode ${number} is kept: see Episodes.`, messageOf);

/** Keep what was driven since `start`, as a correction. @param {Page.Context} page @param {number} start */
export const keepSince = async ({ name, toast }, start) => toast(await keep(name, start, NEWEST, "success"));

// Show a moment in the window `page`, and one of a second recording if there is one.
/** @param {Record<string, string | number>} query @returns {Promise<{ moving: string[] }>} */
export const show = (query) => post(`${API}/show?${queryOf(query)}`);

/** @param {string} page @returns {Promise<void>} */
export const hide = (page) => post(`${API}/hide?page=${page}`);

/** Send a file and return {name, note} of its recording. @param {File} file @returns {Promise<{ name: string, note: string }>} */
export const open = (file) => post(API, file);
