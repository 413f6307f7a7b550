// Functions that create HTML and SVG elements, draw round scales and format numbers.
const SVG = "http://www.w3.org/2000/svg";

export function html(tag, attributes = {}, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, tag), attributes, children);
}

function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) set(element, name, value);
  element.append(...children);
  return element;
}

// Write only changes: at 30 updates a second, writing is most of the cost of a card.
export function set(element, name, value) {
  const text = String(value);
  if (element.getAttribute(name) !== text) element.setAttribute(name, text);
}

export function write(element, words) {
  if (element.textContent !== words) element.textContent = words;
}

// Return the point on a dial at `degrees`, clockwise from the top.
export function onDial(radius, degrees) {
  const angle = (degrees * Math.PI) / 180;
  return [radius * Math.sin(angle), -radius * Math.cos(angle)];
}

export function arc(radius, from, to) {
  const [low, high] = from < to ? [from, to] : [to, from];
  const [x0, y0] = onDial(radius, low);
  const [x1, y1] = onDial(radius, Math.min(high, low + 359.9));
  const large = high - low > 180 ? 1 : 0;
  const round = (value) => value.toFixed(2);
  return `M${round(x0)} ${round(y0)}A${radius} ${radius} 0 ${large} 1 ${round(x1)} ${round(y1)}`;
}

export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

// Return `value` with a true minus sign, and never "−0".
export function signed(value, digits = 1) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}
