// Round numbers along an axis.
const ROUND = [1, 2, 2.5, 5, 10];

/** Return the round step of which about `count` fit in `range`. @param {number} range @param {number} count */
export function step(range, count) {
  const rough = range / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * (ROUND.find((factor) => factor * power >= rough * (1 - 1e-9)) ?? 10);
}

// Return {low, high, by}: round bounds that contain the values and differ by at least `least`.
/** @param {number} lowest @param {number} highest @param {number} least @param {number} count */
export function scale(lowest, highest, least, count) {
  const spare = Math.max(0, (least - (highest - lowest)) / 2);
  const [from, to] = [lowest - spare, highest + spare];
  const by = step(to - from, count);
  return { low: Math.floor(from / by + 1e-9) * by, high: Math.ceil(to / by - 1e-9) * by, by };
}

/** Return the number of decimals of the multiples of `by`. @param {number} by */
export function digits(by) {
  let count = 0;
  while (Math.abs(Math.round(by * 10 ** count) / 10 ** count - by) > 1e-9 * by) count += 1;
  return count;
}
