// 4 x 4 matrices for the view in three dimensions: 16 numbers, column after column.

export const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** a b: first b, then a. */
export function multiply(a, b) {
  const out = Array(16).fill(0);
  for (let column = 0; column < 4; column += 1) {
    for (let row = 0; row < 4; row += 1) {
      for (let k = 0; k < 4; k += 1) out[4 * column + row] += a[4 * k + row] * b[4 * column + k];
    }
  }
  return out;
}

export function translation(x, y, z) {
  return [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1];
}

/** A rotation by `angle` (rad) about an axis of length 1. */
export function rotation([x, y, z], angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const t = 1 - c;
  return [
    t * x * x + c, t * x * y + s * z, t * x * z - s * y, 0,
    t * x * y - s * z, t * y * y + c, t * y * z + s * x, 0,
    t * x * z + s * y, t * y * z - s * x, t * z * z + c, 0,
    0, 0, 0, 1,
  ];
}

/** The pose of a URDF origin: roll, pitch and yaw about fixed axes, then the translation. */
export function origin([x, y, z], [roll, pitch, yaw]) {
  const turns = multiply(rotation([0, 0, 1], yaw), multiply(rotation([0, 1, 0], pitch), rotation([1, 0, 0], roll)));
  return multiply(translation(x, y, z), turns);
}

/** What a camera with this vertical field of view (rad) sees. */
export function perspective(field, aspect, near, far) {
  const f = 1 / Math.tan(field / 2);
  const depth = near - far;
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / depth, -1, 0, 0, (2 * far * near) / depth, 0];
}

/** The view around `target` from a direction (rad) above the floor, z up. */
export function orbit(target, heading, elevation, distance) {
  const tilt = multiply(rotation([1, 0, 0], elevation - Math.PI / 2), rotation([0, 0, 1], -Math.PI / 2 - heading));
  return multiply(multiply(translation(0, 0, -distance), tilt), translation(...target.map((value) => -value)));
}
