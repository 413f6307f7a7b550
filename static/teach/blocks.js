// Edits of a script by its blocks, which the server finds: the lines of a step are moved, copied, removed, commented out
// or added. All other lines stay as they are.

/** @typedef {Api.TextBlock} Block a step as lines of the text, from 1 */
/** @typedef {Api.StepValue} Value a part of a line; what has a `before` is not in the text yet */
/** @typedef {{ line: number, indent: number, group: number, depth: number }} Place before a line, in a list */
/** @typedef {{ text: string, line: number }} Edit a new text, and the line of the block in it */

/** Return the index of the first block behind the block `i` and those in it. @param {Block[]} blocks @param {number} i */
function indexBehind(blocks, i) {
  const next = blocks.findIndex(({ depth }, other) => other > i && depth <= blocks[i].depth);
  return next < 0 ? blocks.length : next;
}

/** Return whether the block `i` is the only step of its list, which needs one. @param {Block[]} blocks @param {number} i */
export const isOnly = (blocks, i) =>
  blocks[i].enabled !== false && !blocks.some(({ group, enabled }, other) => other !== i && enabled && group === blocks[i].group);

/** Return the index of the innermost block at a place; -1 without one. @param {Block[]} blocks @param {number} line */
export const indexAt = (blocks, line, place = Infinity) =>
  blocks.findLastIndex((own) => own.first <= line && line <= own.last && (line > own.line || own.column <= place));

/** Return the number of each block, from 1, among the enabled ones without others in them; 0 for all else. @param {Block[]} blocks */
export function numbersOf(blocks) {
  let count = 0;
  return blocks.map(({ enabled, depth }, i) => (enabled && !(blocks[i + 1]?.depth > depth) ? (count += 1) : 0));
}

// Return the places to which the block `i` can go, in the order of the lines: before each other block and at the end of
// each list. `here` is the index of the place where it is.
/** @param {Block[]} blocks @param {number} i */
export function placesOf(blocks, i) {
  const own = blocks[i];
  const end = indexBehind(blocks, i);
  const outside = blocks.filter(({ indent }, other) => indent !== null && (other <= i || other >= end));
  /** @param {Block} block @param {number} line @returns {Place} */
  const place = ({ indent, group, depth }, line) => ({ line, indent: indent ?? 0, group, depth });
  const starts = outside.filter((block) => block !== own).map((block) => place(block, block.first));
  const ends = outside.filter((block, other) => !outside.some(({ group }, later) => later > other && group === block.group));
  // A list ends before the list around it does.
  const places = [...starts, ...ends.map((block) => place(block, block.last + 1))].sort((a, b) => a.line - b.line || b.depth - a.depth);
  return { places, here: places.findIndex(({ line, group }) => group === own.group && line > own.first) };
}

// Return the place directly above or below the head of the block `target`.
/** @param {Block[]} blocks @param {number} i the block that goes there @param {number} target @param {boolean} below */
export function placeBeside(blocks, i, target, below) {
  const { places } = placesOf(blocks, i);
  const { first, group } = blocks[target];
  if (!below) return places.find((place) => place.line === first && place.group === group);
  const inner = blocks[target + 1]?.depth > blocks[target].depth ? blocks[target + 1] : null;
  return places.find((place) => place.line > first && place.group === (inner ?? blocks[target]).group);
}

/** @param {string} line @param {number} by */
const shifted = (line, by) => (by < 0 ? line.replace(new RegExp(`^ {0,${-by}}`), "") : line.trim() && " ".repeat(by) + line);

// Return `text` with the lines of `own` at another place, indented as the list there.
/** @param {string} text @param {Block} own @param {Place} place @returns {Edit} */
export function moved(text, own, place) {
  const lines = text.split("\n");
  const part = lines.splice(own.first - 1, own.last - own.first + 1).map((line) => shifted(line, place.indent - (own.indent ?? 0)));
  const index = place.line - 1 - (place.line > own.last ? part.length : 0);
  lines.splice(index, 0, ...part);
  return { text: lines.join("\n"), line: index + 1 + own.line - own.first };
}

/** Return `text` with the lines of `own` again after them. @param {string} text @param {Block} own @returns {Edit} */
export function duplicated(text, { first, last, line }) {
  const lines = text.split("\n");
  lines.splice(last, 0, ...lines.slice(first - 1, last));
  return { text: lines.join("\n"), line: last + 1 + line - first };
}

/** Return `text` without the lines of `own`. @param {string} text @param {Block} own @returns {Edit} */
export function removed(text, { first, last }) {
  const lines = text.split("\n");
  lines.splice(first - 1, last - first + 1);
  return { text: lines.join("\n"), line: first };
}

// Return `text` with `own` commented out, or no longer so. A comment in it that begins before the step is indented.
/** @param {string} text @param {Block} own @returns {Edit} */
export function toggled(text, { line, last, enabled, indent }) {
  const lines = text.split("\n");
  const blanks = " ".repeat(indent ?? 0);
  /** @param {string} row */
  const off = (row) => {
    if (!row.trim()) return `${blanks}#`;
    return `${blanks}# ${row.startsWith(blanks) ? row.slice(blanks.length) : `  ${row.trim()}`}`;
  };
  /** @param {string} row */
  const on = (row) => (row.slice(blanks.length + 2) ? blanks + row.slice(blanks.length + 2) : "");
  const part = lines.slice(line - 1, last).map(enabled ? off : on);
  lines.splice(line - 1, part.length, ...part);
  return { text: lines.join("\n"), line };
}

// Texts that need no quotes, and those of them that YAML takes for something else.
const PLAIN = /^[-+]?[\p{L}\d_.(][\p{L}\d_.()+*/ -]*$/u;
const OTHER = /^(null|true|false|yes|no|on|off)$/i;

/** Return `text` with other words for a value; they keep its quotes. @param {string} text @param {Value} value @param {string} words */
export function replaced(text, { line, column, end, before, after = "" }, words) {
  const lines = text.split("\n");
  // Columns count characters, not the units of a text here.
  const row = [...lines[line - 1]];
  const isPlain = PLAIN.test(words) && !OTHER.test(words) && (before || !"\"'".includes(row[column - 1] ?? " "));
  row.splice(column - 1, end - column, (before ?? (column === end ? " " : "")) + (isPlain ? words : JSON.stringify(words)) + after);
  lines[line - 1] = row.join("");
  return lines.join("\n");
}

// Return `text` with a step after the lines of `own`. Without a block it is the first step of a script of this name.
/** @param {string} text @param {Block | null} own @param {string} step @returns {Edit} */
export function inserted(text, own, step) {
  const lines = text.split("\n");
  const { last, indent } = own ?? { last: lines.length - 1, indent: 2 };
  const part = `- ${step}`.split("\n").map((line) => shifted(line.trimEnd(), indent ?? 0));
  lines.splice(last, 0, ...part);
  return { text: lines.join("\n"), line: last + 1 };
}
