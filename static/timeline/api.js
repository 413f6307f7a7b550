// Requests to the server about recordings.
const API = "api/v1/playback";

async function answered(url, options) {
  const answer = await fetch(url, options).catch(() => null);
  if (!answer) throw new Error("The server does not answer.");
  if (!answer.ok) throw new Error(await answer.text());
  return answer.status === 204 ? null : answer.json();
}

const post = (url, body = null) => answered(url, { method: "POST", body });

// Return {spans, marks} of a recording.
export const timeline = (of) => answered(`${API}/${encodeURIComponent(of)}`);

// Show a moment in the window `page`, and one of a second recording if there is one.
export const show = (query) => post(`${API}/show?${new URLSearchParams(query)}`);

export const hide = (page) => post(`${API}/hide?page=${page}`);

// Return {t, joints, slides, tool} of two recordings.
export const difference = (query) => answered(`${API}/difference?${new URLSearchParams(query)}`);

// Send a file and return {name, note} of its recording.
export const open = (file) => post(API, file);
