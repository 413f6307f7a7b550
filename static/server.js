// Requests to the server.

/** Return the query of an address with these values. @param {Record<string, string | number>} values */
export const queryOf = (values) => new URLSearchParams(Object.entries(values).map(([name, value]) => [name, String(value)]));

/** Return the words of an error. @param {unknown} error */
export const messageOf = (error) => (error instanceof Error ? error.message : String(error));

// Return the response to a request. Throws an error with the reason for a refusal and its `choices`, or without an answer.
/** @param {string} url @param {RequestInit} [options] */
export async function request(url, options) {
  const answer = await fetch(url, options).catch(() => null);
  if (!answer) throw new Error("The server does not answer.");
  if (answer.ok) return answer;
  const words = await answer.text();
  const { why, choices } = words.startsWith("{") ? JSON.parse(words) : { why: words };
  throw Object.assign(new Error(why), { choices });
}

/** Return the answer `arm`. Throws an error without one. @returns {Promise<Api.Arm>} */
export const readArm = async () => (await request("api/v1/arm")).json();

/** Return all objects; none if they could not be fetched. @returns {Promise<Api.SceneObject[]>} */
export const readObjects = () => request("api/v1/objects").then(async (answer) => (await answer.json()).objects).catch(() => []);

/** Return the state; null if it could not be fetched. @returns {Promise<Api.State | null>} */
export const readState = () => request("api/v1/state").then((answer) => answer.json()).catch(() => null);
