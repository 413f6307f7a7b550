// A highlight of shapes in the picture: each gets a material of its own, which glows, and then its former one.
const COLOUR = 0x2477d4;
const STRENGTH = 0.3;

// Return the shapes of an object of three.js, but not those of the objects `without`.
export function shapesOf(object, without = [], found = new Set()) {
  if (object?.isMesh && object.material.emissive) found.add(object);
  for (const child of object?.children ?? []) if (!without.includes(child)) shapesOf(child, without, found);
  return found;
}

export class Glow {
  #lit = new Map(); // own and former material of each highlighted shape

  // Highlight these shapes and no others.
  show(shapes) {
    for (const [shape, [mine, before]] of this.#lit)
      if (!shapes.has(shape)) {
        if (shape.material === mine) shape.material = before;
        mine.dispose();
        this.#lit.delete(shape);
      }
    for (const shape of shapes) {
      if (this.#lit.has(shape)) continue;
      const mine = shape.material.clone();
      mine.emissive.set(COLOUR);
      mine.emissiveIntensity = STRENGTH;
      this.#lit.set(shape, [mine, shape.material]);
      shape.material = mine;
    }
  }
}
