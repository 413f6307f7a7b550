// The axis of the timeline: recorded seconds, without the time in which the arm rested. The server
// has the same functions in playback/spans.py.

/** Length of the axis [s] of `spans`, each [begin, end] in seconds since the epoch. @param {import("./api.js").Span[]} spans */
export const lengthOf = (spans) => spans.reduce((sum, [start, end]) => sum + end - start, 0);

/** Return the time at a place [s] of the axis. @param {import("./api.js").Span[]} spans @param {number} place */
export function atPlace(spans, place) {
  for (const [start, end] of spans) {
    if (place <= end - start) return start + Math.max(place, 0);
    place -= end - start;
  }
  return spans.at(-1)?.[1] ?? 0;
}

/** Return the place [s] of a time on the axis; inside a rest, that of its start. @param {import("./api.js").Span[]} spans @param {number} t */
export function placeOf(spans, t) {
  let place = 0;
  for (const [start, end] of spans) {
    if (t < start) break;
    place += Math.min(t, end) - start;
  }
  return place;
}
