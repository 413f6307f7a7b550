// The axis of the timeline: recorded seconds, without the time in which the arm rested. The server has the functions of
// spans too, in files/spans.py.
import { html } from "../instruments/shape.js";

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

/** Return the attempt that was under way at `t`. @param {import("./api.js").Attempt[]} attempts @param {number} t */
export const attemptAt = (attempts, t) => attempts.findLast(({ start }) => start <= t) ?? attempts[0];

/** Return the bars on the track: episodes, continuations, and what did not lead to the attempt that is shown. @param {import("./api.js").Mark[]} marks @param {import("./api.js").Span[]} spans @param {import("./api.js").Attempt[]} attempts @param {import("./api.js").Attempt | undefined} shown */
export function bars(marks, spans, attempts, shown) {
  const length = lengthOf(spans) || 1;
  /** @param {number} from @param {number} to @param {string} kind @param {string} title */
  const bar = (from, to, kind, title) => {
    const [begin, end] = [from, to].map((t) => (100 * placeOf(spans, t)) / length);
    const shape = html("b", { class: kind, title });
    shape.style.cssText = `left: ${begin}%; width: ${end - begin}%`;
    return shape;
  };
  const left = shown?.path.slice(1).map(([start], i) => bar(shown.path[i][1], start, "left", "Left: the run was set back to the start of this part")) ?? [];
  const branches = attempts.filter(({ since, hidden }) => since !== null && !hidden).map(({ since, start, name, number }) => bar(since ?? 0, start, "branch", name || `Attempt ${number}`));
  return marks.flatMap(([t, kind, words]) => {
    const [, name] = (kind === "episode" && /^(Episode \d+) begins/.exec(words)) || [];
    if (!name) return [];
    const [end] = marks.find(([, , other]) => other === `${name} ends`) ?? [Infinity];
    return [bar(t, end, "episode", words)];
  }).concat(left, branches);
}
