// The bars on the track of the timeline: episodes, and what the run left when it was set back.
import { html } from "../instruments/shape.js";
import { lengthOf, placeOf } from "./axis.js";

/** @typedef {import("./api.js").Mark} Mark */
/** @typedef {import("./api.js").Span} Span */

/** @param {Mark[]} marks @param {Span[]} spans */
export function bars(marks, spans) {
  const length = lengthOf(spans) || 1;
  /** @param {number} from @param {number} to @param {string} kind @param {string} title */
  const bar = (from, to, kind, title) => {
    const [begin, end] = [from, to].map((t) => (100 * placeOf(spans, t)) / length);
    const shape = html("b", { class: kind, title });
    shape.style.cssText = `left: ${begin}%; width: ${end - begin}%`;
    return shape;
  };
  return marks.flatMap(([t, kind, words, since]) => {
    if (since !== null) return [bar(since, t, "left", "Left: the run was set back to the start of this part")];
    const [, name] = (kind === "episode" && /^(Episode \d+) begins/.exec(words)) || [];
    if (!name) return [];
    const [end] = marks.find(([, , other]) => other === `${name} ends`) ?? [Infinity];
    return [bar(t, end, "episode", words)];
  });
}
