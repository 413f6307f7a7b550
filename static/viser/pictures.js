// Pictures of what viser's page draws in a frame.

/** @param {HTMLIFrameElement} frame */
const canvasOf = (frame) => frame.contentWindow?.__viserMutable?.canvas;

// Return a PNG of what the page in `frame` draws; null before its first picture.
/** @param {HTMLIFrameElement} frame @returns {Promise<Blob | null> | null} */
export function picture(frame) {
  const canvas = canvasOf(frame);
  return canvas ? new Promise((done) => canvas.toBlob(done, "image/png")) : null;
}

// Return the part round a pixel (x, y) of the page in `frame`, `high` pixels high, as a data URL of
// `width` by `height` pixels; empty before the first picture.
/**
 * @param {HTMLIFrameElement} frame
 * @param {number} x @param {number} y @param {number} high @param {number} width @param {number} height
 */
export function thumbnail(frame, x, y, high, width, height) {
  const canvas = canvasOf(frame);
  if (!canvas?.height) return "";
  const { left, top, height: shown } = canvas.getBoundingClientRect();
  const scale = canvas.height / shown;
  const part = Math.min(high * scale, canvas.height, (canvas.width * height) / width);
  const size = [(part * width) / height, part];
  // Inside the picture.
  const corner = [(x - left) * scale, (y - top) * scale].map((middle, axis) =>
    Math.max(0, Math.min(middle - size[axis] / 2, [canvas.width, canvas.height][axis] - size[axis])),
  );
  const small = Object.assign(document.createElement("canvas"), { width, height });
  small.getContext("2d")?.drawImage(canvas, corner[0], corner[1], size[0], size[1], 0, 0, width, height);
  return small.toDataURL("image/jpeg", 0.8);
}
