// Several files of one object: those that were dropped or chosen, as one .zip file without compression.

// Suffixes of shapes, of files that shapes name, and of shapes that need no other file.
const SHAPES = /\.(stl|obj|ply|glb|gltf|3mf|wrl|zip)$/i;
const OTHERS = /\.(bin|mtl)$/i;
const ALONE = /\.(stl|ply|glb|3mf|zip)$/i;

/** @typedef {{ path: string, file: File }} Part */
const MAX_FILES = 1000;
const MAX_BYTES = 60e6; // of all files; the server accepts no more
const MAX_DEPTH = 8; // of folders

/** @param {FileSystemEntry} entry @returns {entry is FileSystemFileEntry} */
const isFile = (entry) => entry.isFile;
/** @param {FileSystemEntry} entry @returns {entry is FileSystemDirectoryEntry} */
const isFolder = (entry) => entry.isDirectory;

// Add the files in a dropped file or folder to `parts`, as {path, file}.
/** @param {FileSystemEntry} entry @param {string} path @param {number} depth @param {Part[]} parts */
async function walk(entry, path, depth, parts) {
  if (parts.length > MAX_FILES || depth > MAX_DEPTH) return;
  if (isFile(entry)) {
    /** @type {File} */
    const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
    parts.push({ path: path + entry.name, file });
    return;
  }
  if (!isFolder(entry)) return;
  const reader = entry.createReader();
  for (;;) {
    /** A reader returns the entries of a folder in pieces. @type {FileSystemEntry[]} */
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (!some.length) return;
    for (const inner of some) await walk(inner, `${path}${entry.name}/`, depth + 1, parts);
  }
}

// Return the files of shapes among `files` and, in folders, among `entries`, as {path, file}.
/** @param {File[]} files @param {FileSystemEntry[]} [entries] */
export async function gathered(files, entries) {
  /** @type {Part[]} */
  const parts = [];
  if (entries?.length) for (const entry of entries) await walk(entry, "", 0, parts);
  else for (const file of files) parts.push({ path: file.webkitRelativePath || file.name, file });
  return parts.filter(({ path }) => (SHAPES.test(path) || OTHERS.test(path)) && !/(^|\/)(\.|__MACOSX\/)/.test(path));
}

/** Return whether each of the files is an object of its own. @param {Part[]} parts */
export const areAlone = (parts) => parts.every(({ path }) => ALONE.test(path));

/** Return why the files are too many or too large; empty if they are not. @param {Part[]} parts */
export function excess(parts) {
  if (parts.length > MAX_FILES) return `These are over ${MAX_FILES} files. Choose only those of one object.`;
  const bytes = parts.reduce((sum, { file }) => sum + file.size, 0);
  return bytes > MAX_BYTES ? `These files have ${Math.ceil(bytes / 1e6)} MB; at most ${MAX_BYTES / 1e6} are read.` : "";
}

const CRC = Uint32Array.from({ length: 256 }, (_, value) => {
  for (let bit = 0; bit < 8; bit++) value = value & 1 ? (value >>> 1) ^ 0xedb88320 : value >>> 1;
  return value;
});

/** @param {Uint8Array<ArrayBuffer>} bytes */
function checksum(bytes) {
  let value = ~0;
  for (const byte of bytes) value = CRC[(value ^ byte) & 255] ^ (value >>> 8);
  return ~value >>> 0;
}

// Return the bytes of `fields`, which are [size, value] in the order of bytes of .zip files.
/** @param {[size: number, value: number][]} fields */
function packed(...fields) {
  const view = new DataView(new ArrayBuffer(fields.reduce((sum, [size]) => sum + size, 0)));
  let offset = 0;
  for (const [size, value] of fields) {
    if (size === 2) view.setUint16(offset, value, true);
    else view.setUint32(offset, value, true);
    offset += size;
  }
  return new Uint8Array(view.buffer);
}

/** Return the files as one .zip file of that name. @param {Part[]} files @param {string} name */
export async function zipped(files, name) {
  /** @type {Uint8Array<ArrayBuffer>[]} */
  const parts = [];
  /** @type {Uint8Array<ArrayBuffer>[]} */
  const directory = [];
  let offset = 0;
  for (const { path, file } of files) {
    const title = new TextEncoder().encode(path);
    const bytes = new Uint8Array(await file.arrayBuffer());
    /** Version, names in UTF-8, no compression, the earliest time. @type {[number, number][]} */
    const common = [[2, 20], [2, 0x800], [2, 0], [2, 0], [2, 0x21], [4, checksum(bytes)], [4, bytes.length], [4, bytes.length], [2, title.length], [2, 0]];
    const head = packed([4, 0x04034b50], ...common);
    directory.push(packed([4, 0x02014b50], [2, 20], ...common, [2, 0], [2, 0], [2, 0], [4, 0], [4, offset]), title);
    parts.push(head, title, bytes);
    offset += head.length + title.length + bytes.length;
  }
  const size = directory.reduce((sum, entry) => sum + entry.length, 0);
  const end = packed([4, 0x06054b50], [2, 0], [2, 0], [2, files.length], [2, files.length], [4, size], [4, offset], [2, 0]);
  return new File([...parts, ...directory, end], name, { type: "application/zip" });
}

/** Return whether a .zip file holds a scene. The names of its files are at its end. @param {File} file */
export async function isScene(file) {
  const tail = await file.slice(-200000).arrayBuffer();
  return new TextDecoder("latin1").decode(tail).includes("scene.yaml");
}
