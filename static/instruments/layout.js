// Which instruments are shown, in what order and how large. A layout is a list of places
// {id, size, shown} with each instrument once; a change gives a new one.
const KEY = "katana450.instruments";
const VERSION = 1;

// catalogue: [{id, sizes, shown}], each in its first size unless somebody says otherwise.
export function initial(catalogue) {
  return catalogue.map(({ id, sizes, shown }) => ({ id, size: sizes[0], shown }));
}

// What was kept, as far as it makes sense; of an instrument that it does not know the initial place.
export function read(storage, catalogue) {
  let kept = null;
  try {
    kept = JSON.parse(storage?.getItem(KEY) ?? "null");
  } catch {
    // Somebody else wrote there, or half of it is lost.
  }
  if (kept?.version !== VERSION || !Array.isArray(kept.places)) return initial(catalogue);
  const known = new Map(catalogue.map((each) => [each.id, each]));
  const layout = [];
  for (const place of kept.places) {
    const instrument = known.get(place?.id);
    if (!instrument) continue;
    known.delete(place.id);
    const size = instrument.sizes.includes(place.size) ? place.size : instrument.sizes[0];
    layout.push({ id: place.id, size, shown: typeof place.shown === "boolean" ? place.shown : instrument.shown });
  }
  return [...layout, ...initial([...known.values()])];
}

export function write(storage, layout) {
  try {
    storage?.setItem(KEY, JSON.stringify({ version: VERSION, places: layout }));
  } catch {
    // No room, or not allowed: it lasts as long as the page.
  }
}

// `id` in the place of `other`, on the side it comes from.
export function moved(layout, id, other) {
  const [from, to] = [id, other].map((name) => layout.findIndex((place) => place.id === name));
  if (from < 0 || to < 0 || from === to) return layout;
  const after = [...layout];
  after.splice(to, 0, ...after.splice(from, 1));
  return after;
}

// `id` past the next shown one before or behind it.
export function nudged(layout, id, by) {
  const shown = layout.filter((place) => place.shown);
  const other = shown[shown.findIndex((place) => place.id === id) + by];
  return other ? moved(layout, id, other.id) : layout;
}

export function changed(layout, id, news) {
  return layout.map((place) => (place.id === id ? { ...place, ...news } : place));
}
