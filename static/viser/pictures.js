// Pictures of what viser's page draws in a frame.

/** @param {HTMLIFrameElement} frame */
const canvasOf = (frame) => frame.contentWindow?.__viserMutable?.canvas;

// Return a PNG of what the page in `frame` draws; null before its first picture.
/** @param {HTMLIFrameElement} frame @returns {Promise<Blob | null> | null} */
export function picture(frame) {
  const canvas = canvasOf(frame);
  return canvas ? new Promise((done) => canvas.toBlob(done, "image/png")) : null;
}

// Return the middle of what the page in `frame` draws at its full height, as a data URL of `height` and at most `width`
// pixels; empty before the first picture.
/** @param {HTMLIFrameElement} frame @param {number} width @param {number} height */
export function thumbnail(frame, width, height) {
  const canvas = canvasOf(frame);
  if (!canvas?.height) return "";
  const scale = canvas.height / height;
  const wide = Math.min(canvas.width, width * scale);
  const small = Object.assign(document.createElement("canvas"), { width: wide / scale, height });
  small.getContext("2d")?.drawImage(canvas, (canvas.width - wide) / 2, 0, wide, canvas.height, 0, 0, small.width, height);
  return small.toDataURL("image/jpeg", 0.8);
}
