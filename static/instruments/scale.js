// Round numbers along an axis.
const ROUND = [1, 2, 2.5, 5, 10];

// The round step that gives about `count` of them in `range`.
export function step(range, count) {
  const rough = range / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * ROUND.find((each) => each * power >= rough * (1 - 1e-9));
}

// {low, high, by}: round bounds round the values, at least `least` apart.
export function scale(lowest, highest, least, count) {
  const spare = Math.max(0, (least - (highest - lowest)) / 2);
  const [from, to] = [lowest - spare, highest + spare];
  const by = step(to - from, count);
  return { low: Math.floor(from / by + 1e-9) * by, high: Math.ceil(to / by - 1e-9) * by, by };
}

// How many digits behind the point a multiple of `by` has.
export function digits(by) {
  let count = 0;
  while (Math.abs(Math.round(by * 10 ** count) / 10 ** count - by) > 1e-9 * by) count += 1;
  return count;
}
