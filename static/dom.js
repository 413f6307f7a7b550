// Elements of the document, of a known kind.

const SAVED_AFTER = 1000; // ms

// Return the element with an id. Throws an error if it is missing or of another kind.
/** @template {Element} T @param {string} id @param {new () => T} kind @returns {T} */
export function element(id, kind) {
  const match = document.getElementById(id);
  if (!(match instanceof kind)) throw new Error(`The page has no ${kind.name} with the id ${id}.`);
  return match;
}

/** @param {string} id */
export const byId = (id) => element(id, HTMLElement);

/** Call `act` for each click on the element with an id. @param {string} id @param {() => void} act */
export const onClick = (id, act) => byId(id).addEventListener("click", act);

/** Call `use` with the files that a person chooses in a box. @param {HTMLInputElement} input @param {(list: File[]) => void} use */
export function onChoice(input, use) {
  input.addEventListener("change", () => {
    const list = [...(input.files ?? [])];
    // Cleared, so that the same file can be chosen again.
    input.value = "";
    if (list.length) use(list);
  });
}

// Return the first element in `root` that a selector matches. Throws an error if it is missing or of another kind.
/** @template {Element} T @param {string} selector @param {new () => T} kind @param {ParentNode} root @returns {T} */
export function first(selector, kind, root = document) {
  const match = root.querySelector(selector);
  if (!(match instanceof kind)) throw new Error(`The page has no ${kind.name} at ${selector}.`);
  return match;
}

/** Return `words` in the language of the page. @param {string} words */
export const t = (words) => window.translated?.(words) ?? words;

/** Write only changes: a text that is written again is read aloud again. @param {Element} target @param {string} words */
export function write(target, words) {
  if (target.textContent !== t(words)) target.textContent = t(words);
}

/** Return what viser's page in `frame` offers: nothing before its scripts have run, or if it could not be loaded. @param {HTMLIFrameElement} frame */
export const sceneOf = (frame) => (frame.contentDocument ? frame.contentWindow?.katanaScene : undefined);

/** The same for a page whose scene is drawn. Throws an error for another. @param {HTMLIFrameElement} frame */
export function sceneIn(frame) {
  const scene = sceneOf(frame);
  if (!scene) throw new Error("The scene is not loaded.");
  return scene;
}

/** Let the person save a file of this name. @param {Blob} content @param {string} name */
export function save(content, name) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(content), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), SAVED_AFTER);
}

// The present second of the clock on the wall, as a part of the name of a file.
export const timestamp = () => new Date().toLocaleString("sv").replace(" ", "T").replaceAll(":", "-");

/** Load the style beside a module, whose address is `url`; resolved when it is there or cannot be loaded. @param {string} name @param {string} url */
export function styled(name, url) {
  const link = Object.assign(document.createElement("link"), { rel: "stylesheet", href: new URL(name, url).href });
  document.head.append(link);
  return new Promise((done) => ["load", "error"].forEach((kind) => link.addEventListener(kind, done)));
}

// Act on the choice in a closed list. A key changes it at once, and Enter confirms it.
/** @param {HTMLSelectElement} list @param {() => void} act */
export function onConfirm(list, act) {
  let byKeys = false;
  list.addEventListener("pointerdown", () => (byKeys = false));
  list.addEventListener("keydown", ({ key }) => {
    if (key === "Enter") act();
    byKeys = true;
  });
  list.addEventListener("change", () => byKeys || act());
  list.addEventListener("blur", () => (list.value = ""));
}

/** Call `act` with each choice in a list, which then shows its first entry again. @param {HTMLSelectElement} list @param {(value: string) => void} act */
export function onPick(list, act) {
  list.addEventListener("change", () => {
    act(list.value);
    list.value = "";
  });
}

// Whether the target of an event, of this document or of viser's, matches a selector.
/** @param {EventTarget | null} target @param {string} selector @returns {target is HTMLElement} */
export const matches = (target, selector) => Boolean(/** @type {Partial<Element> | null} */ (target)?.matches?.(selector));

// Return the element round the target of an event that matches a selector; null without one.
/** @param {EventTarget | null} target @param {string} selector */
export const closest = (target, selector) => /** @type {Partial<Element> | null} */ (target)?.closest?.(selector) ?? null;

/** Return a switch: while it is on, `act` is called at once and then each `every` ms. @param {() => void} act @param {number} every */
export function repeating(act, every) {
  let timer = 0;
  return (/** @type {boolean} */ on) => {
    clearInterval(timer);
    if (!on) return;
    timer = setInterval(act, every);
    act();
  };
}
