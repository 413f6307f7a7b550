// A highlight of shapes in the picture: each gets a material of its own, which glows, and then its former one.
const COLOUR = 0x2477d4;
const STRENGTH = 0.3;

/** @param {Three.Object3D} object @returns {object is Three.Mesh} */
export const isMesh = (object) => "isMesh" in object;

// Return the shapes of an object of three.js, but not those of the objects `without`.
/**
 * @param {Three.Object3D | null | undefined} object @param {(Three.Object3D | undefined)[]} without
 * @param {Set<Three.Mesh>} shapes
 */
export function shapesOf(object, without = [], shapes = new Set()) {
  if (object && isMesh(object) && object.material.emissive) shapes.add(object);
  for (const child of object?.children ?? []) if (!without.includes(child)) shapesOf(child, without, shapes);
  return shapes;
}

export class Glow {
  /** @type {Map<Three.Mesh, [own: Three.Material, former: Three.Material]>} */
  #lit = new Map(); // own and former material of each highlighted shape

  /** Highlight these shapes and no others. @param {Set<Three.Mesh>} shapes */
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
      mine.emissive?.set(COLOUR);
      mine.color.lerp(mine.emissive ?? mine.color, 2 * STRENGTH); // light is not seen on what is white
      mine.emissiveIntensity = STRENGTH;
      this.#lit.set(shape, [mine, shape.material]);
      shape.material = mine;
    }
  }
}
