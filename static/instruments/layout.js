// The layout: which instruments are shown, in which order and size. A layout is an immutable list of
// places {id, size, shown}, one for each instrument.
/** @typedef {{ id: string, size: string, shown: boolean }} Place */
/** @typedef {{ id: string, sizes: string[], shown: boolean }} Instrument */
const KEY = "katana450.instruments";
const VERSION = 1;

// Return the initial layout of a catalogue [{id, sizes, shown}], each instrument in its first size.
/** @param {Instrument[]} catalogue @returns {Place[]} */
export function initial(catalogue) {
  return catalogue.map(({ id, sizes, shown }) => ({ id, size: sizes[0], shown }));
}

// Return the stored layout. Invalid places and missing instruments get their initial ones.
/** @param {Storage | null} storage @param {Instrument[]} catalogue */
export function read(storage, catalogue) {
  /** @type {{ version?: number, places?: Partial<Place>[] } | null} */
  let kept = null;
  try {
    kept = JSON.parse(storage?.getItem(KEY) ?? "null");
  } catch {
    // The stored text is damaged or from another program.
  }
  if (kept?.version !== VERSION || !Array.isArray(kept.places)) return initial(catalogue);
  const known = new Map(catalogue.map((instrument) => [instrument.id, instrument]));
  /** @type {Place[]} */
  const layout = [];
  for (const place of kept.places) {
    const instrument = known.get(place?.id ?? "");
    if (!instrument) continue;
    const { id, sizes } = instrument;
    known.delete(id);
    const size = sizes.find((name) => name === place.size) ?? sizes[0];
    layout.push({ id, size, shown: typeof place.shown === "boolean" ? place.shown : instrument.shown });
  }
  return [...layout, ...initial([...known.values()])];
}

/** @param {Storage | null} storage @param {Place[]} layout */
export function write(storage, layout) {
  try {
    storage?.setItem(KEY, JSON.stringify({ version: VERSION, places: layout }));
  } catch {
    // Storage is full or not allowed: the layout lasts as long as the page.
  }
}

// Move `id` to the place of `other`; the instruments between shift by one.
/** @param {Place[]} layout @param {string} id @param {string} other */
export function moved(layout, id, other) {
  const [from, to] = [id, other].map((name) => layout.findIndex((place) => place.id === name));
  if (from < 0 || to < 0 || from === to) return layout;
  const after = [...layout];
  after.splice(to, 0, ...after.splice(from, 1));
  return after;
}

// Move `id` past the next shown instrument before (by -1) or after it (by 1).
/** @param {Place[]} layout @param {string} id @param {number} by */
export function nudged(layout, id, by) {
  const shown = layout.filter((place) => place.shown);
  const other = shown[shown.findIndex((place) => place.id === id) + by];
  return other ? moved(layout, id, other.id) : layout;
}

/** @param {Place[]} layout @param {string} id @param {Partial<Place>} news */
export function changed(layout, id, news) {
  return layout.map((place) => (place.id === id ? { ...place, ...news } : place));
}
