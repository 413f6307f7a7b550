// A grabbed point of a link: which value of its joint brings it to the pointer. All vectors are those of
// three.js, in its world [m]; pixels are those of viser's document.

const FACING = 0.35; // sine of the angle between ray and plane of the motion, below which it counts as seen edge-on
const LEVER = 40; // px, minimum lever: a pointer near the axis must not turn a joint by leaps
const NEAR_SIDE = 0.3; // fraction of the lever below which a point seen edge-on moves mostly along the ray
const STEP = 1e-3; // m, to measure how many pixels a metre has

export class Grab {
  #viewer;
  #start; // pixel of the press
  #value; // [rad or m] of the joint at the press
  #centre; // point on the axis
  #axis; // its direction
  /** @type {Page.Pixel | null} */
  #across = null; // [px per rad or m] motion of the point in the picture; null if the pointer's angle counts
  /** @type {{ direction: Three.Vector3, lever: number } | null} */
  #last = null; // {direction, lever} of the pointer from the axis, seen last
  #turned = 0; // rad

  // viewer: three's camera and canvas. link: the link's object. point: where the ray met it. joint: {axis,
  // slides}, the axis in the frame of the link, whose origin is on it. value: [rad or m] of the joint.
  /**
   * @param {ViserPage.Viewer} viewer @param {Three.Object3D} link @param {Three.Vector3} point
   * @param {{ axis: number[], slides: boolean }} joint @param {Page.Pixel} pixel @param {number} value
   */
  constructor(viewer, link, point, { axis, slides }, pixel, value) {
    this.#viewer = viewer;
    this.#start = pixel;
    this.#value = value;
    const origin = this.#vector().setFromMatrixPosition(link.matrixWorld);
    this.#axis = this.#vector().set(axis[0], axis[1], axis[2]).transformDirection(link.matrixWorld);
    this.#centre = origin.addScaledVector(this.#axis, point.clone().sub(origin).dot(this.#axis));
    if (slides) {
      this.#across = this.#motion(point, this.#axis);
      return;
    }
    const ray = this.#ray(pixel);
    if (Math.abs(ray.dot(this.#axis)) >= FACING) this.#last = this.#direction(pixel);
    else this.#across = this.#lever(point, ray);
  }

  /** Return the value [rad or m] of the joint for the pointer at a pixel. @param {Page.Pixel} pixel */
  at(pixel) {
    if (this.#across) {
      const [x, y] = this.#across;
      const [right, down] = [pixel[0] - this.#start[0], pixel[1] - this.#start[1]];
      return this.#value + (right * x + down * y) / (x * x + y * y);
    }
    const now = this.#direction(pixel);
    if (now && this.#last) {
      const [from, to] = [this.#last.direction, now.direction];
      const angle = Math.atan2(this.#axis.dot(from.clone().cross(to)), from.dot(to));
      this.#turned += angle * Math.min(1, now.lever / LEVER, this.#last.lever / LEVER);
    }
    this.#last = now ?? this.#last;
    return this.#value + this.#turned;
  }

  // Return the motion [px/rad] in the picture of a point that turns about an axis seen edge-on. A point
  // that moves along the ray is replaced by one on the near side of the axis.
  /** @param {Three.Vector3} point @param {Three.Vector3} ray @returns {Page.Pixel} */
  #lever(point, ray) {
    const radius = point.clone().sub(this.#centre);
    const own = this.#motion(point, this.#axis.clone().cross(radius));
    const size = radius.length();
    const towards = ray.clone().negate().addScaledVector(this.#axis, ray.dot(this.#axis)).setLength(size);
    const near = this.#motion(this.#centre.clone().add(towards), this.#axis.clone().cross(towards));
    const [x, y] = Math.hypot(...own) > NEAR_SIDE * Math.hypot(...near) ? own : near;
    const length = Math.hypot(x, y) || 1;
    const longer = Math.max(LEVER, length) / length;
    return [x * longer, y * longer];
  }

  // Return the unit direction from the axis to where the ray of a pixel meets the plane of the motion, and
  // the lever [px]; null without such a point.
  /** @param {Page.Pixel} pixel */
  #direction(pixel) {
    const { position } = this.#viewer.camera;
    const ray = this.#ray(pixel);
    const distance = this.#centre.clone().sub(position).dot(this.#axis) / ray.dot(this.#axis);
    if (!(distance > 0) || !Number.isFinite(distance)) return null;
    const [x, y] = this.#pixel(this.#centre);
    const direction = position.clone().addScaledVector(ray, distance).sub(this.#centre).normalize();
    return { direction, lever: Math.hypot(pixel[0] - x, pixel[1] - y) };
  }

  // Return the motion in the picture [px per unit] of a point that moves by `along` [m per unit].
  /** @param {Three.Vector3} point @param {Three.Vector3} along @returns {Page.Pixel} */
  #motion(point, along) {
    const size = along.length() || 1;
    const [a, b] = [this.#pixel(point), this.#pixel(point.clone().addScaledVector(along, STEP / size))];
    return [((b[0] - a[0]) * size) / STEP, ((b[1] - a[1]) * size) / STEP];
  }

  /** @param {Three.Vector3} point @returns {Page.Pixel} */
  #pixel(point) {
    const { left, top, width, height } = this.#viewer.canvas.getBoundingClientRect();
    const { x, y } = point.clone().project(this.#viewer.camera);
    return [left + ((1 + x) / 2) * width, top + ((1 - y) / 2) * height];
  }

  /** @param {Page.Pixel} pixel */
  #ray([x, y]) {
    const { camera, canvas } = this.#viewer;
    const { left, top, width, height } = canvas.getBoundingClientRect();
    const end = this.#vector().set((2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height, 0.5);
    return end.unproject(camera).sub(camera.position).normalize();
  }

  #vector() {
    return this.#viewer.camera.position.clone();
  }
}
