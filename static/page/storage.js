// What the browser keeps for this page.

/** Return `of`, a storage of the browser, such that what it refuses to keep lasts as long as the document. @param {() => Storage} of @returns {Page.Kept} */
export function storage(of) {
  /** @type {Map<string, string>} */
  const refused = new Map();
  return {
    getItem(name) {
      try {
        return refused.get(name) ?? of().getItem(name);
      } catch {
        return null;
      }
    },
    setItem(name, value) {
      try {
        of().setItem(name, value);
        refused.delete(name);
      } catch {
        refused.set(name, value);
      }
    },
  };
}
