// Several files of one object: those that were dropped or chosen, as one .zip file without compression.

// Suffixes of shapes, of files that shapes name, and of shapes that need no other file.
const SHAPES = /\.(stl|obj|ply|glb|gltf|wrl|wrz|zip)$/i;
const OTHERS = /\.(bin|mtl)$/i;
const ALONE = /\.(stl|ply|glb|zip)$/i;

const MAX_FILES = 1000;
const MAX_BYTES = 60e6; // of all files; the server accepts no more
const MAX_DEPTH = 8; // of folders

// Add the files in a dropped file or folder to `found`, as {path, file}.
async function walk(entry, path, depth, found) {
  if (found.length > MAX_FILES || depth > MAX_DEPTH) return;
  if (entry.isFile) {
    const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
    found.push({ path: path + entry.name, file });
    return;
  }
  const reader = entry.createReader();
  for (;;) {
    // A reader returns the entries of a folder in pieces.
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (!some.length) return;
    for (const each of some) await walk(each, `${path}${entry.name}/`, depth + 1, found);
  }
}

// Return the files of shapes among `files` and, in folders, among `entries`, as {path, file}.
export async function gathered(files, entries) {
  const found = [];
  if (entries?.length) for (const entry of entries) await walk(entry, "", 0, found);
  else for (const file of files) found.push({ path: file.webkitRelativePath || file.name, file });
  return found.filter(({ path }) => (SHAPES.test(path) || OTHERS.test(path)) && !/(^|\/)(\.|__MACOSX\/)/.test(path));
}

// Return whether each of the files is an object of its own.
export const areAlone = (found) => found.every(({ path }) => ALONE.test(path));

// Return why the files are too many or too large; empty if they are not.
export function excess(found) {
  if (found.length > MAX_FILES) return `These are over ${MAX_FILES} files. Choose only those of one object.`;
  const bytes = found.reduce((sum, { file }) => sum + file.size, 0);
  return bytes > MAX_BYTES ? `These files have ${Math.ceil(bytes / 1e6)} MB; at most ${MAX_BYTES / 1e6} are read.` : "";
}

const CRC = Uint32Array.from({ length: 256 }, (_, value) => {
  for (let bit = 0; bit < 8; bit++) value = value & 1 ? (value >>> 1) ^ 0xedb88320 : value >>> 1;
  return value;
});

function checksum(bytes) {
  let value = ~0;
  for (const byte of bytes) value = CRC[(value ^ byte) & 255] ^ (value >>> 8);
  return ~value >>> 0;
}

// Return the bytes of `fields`, which are [size, value] in the order of bytes of .zip files.
function packed(...fields) {
  const view = new DataView(new ArrayBuffer(fields.reduce((sum, [size]) => sum + size, 0)));
  let at = 0;
  for (const [size, value] of fields) {
    if (size === 2) view.setUint16(at, value, true);
    else view.setUint32(at, value, true);
    at += size;
  }
  return new Uint8Array(view.buffer);
}

// Return the files as one .zip file of that name.
export async function zipped(found, name) {
  const parts = [];
  const directory = [];
  let at = 0;
  for (const { path, file } of found) {
    const title = new TextEncoder().encode(path);
    const bytes = new Uint8Array(await file.arrayBuffer());
    // Version, names in UTF-8, no compression, the earliest time.
    const common = [[2, 20], [2, 0x800], [2, 0], [2, 0], [2, 0x21], [4, checksum(bytes)], [4, bytes.length], [4, bytes.length], [2, title.length], [2, 0]];
    const head = packed([4, 0x04034b50], ...common);
    directory.push(packed([4, 0x02014b50], [2, 20], ...common, [2, 0], [2, 0], [2, 0], [4, 0], [4, at]), title);
    parts.push(head, title, bytes);
    at += head.length + title.length + bytes.length;
  }
  const size = directory.reduce((sum, each) => sum + each.length, 0);
  const end = packed([4, 0x06054b50], [2, 0], [2, 0], [2, found.length], [2, found.length], [4, size], [4, at], [2, 0]);
  return new File([...parts, ...directory, end], name, { type: "application/zip" });
}

// Return whether a .zip file holds a scene. The names of its files are at its end.
export async function isScene(file) {
  const tail = await file.slice(-200000).arrayBuffer();
  return new TextDecoder("latin1").decode(tail).includes("scene.yaml");
}
