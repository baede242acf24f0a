// Triangles of boxes, cylinders and spheres: x, y, z, the normal, and a brightness of each corner.

const SEGMENTS = 32; // around a cylinder or sphere
const RINGS = 12; // from pole to pole
const SECTORS = 8; // on the face of a wheel: they show that it turns
const DARK = 1;
const LIGHT = 3.2;

function quad(out, corners, normals, shade) {
  for (const i of [0, 1, 2, 0, 2, 3]) out.push(...corners[i], ...normals[i], shade);
}

export function box([x, y, z]) {
  const out = [];
  const half = [x / 2, y / 2, z / 2];
  for (let axis = 0; axis < 3; axis += 1) {
    const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    for (const sign of [1, -1]) {
      const corner = (a, b) => {
        const at = [0, 0, 0];
        [at[axis], at[u], at[v]] = [sign * half[axis], a * half[u], b * half[v]];
        return at;
      };
      const normal = [0, 0, 0];
      normal[axis] = sign;
      quad(out, [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)], Array(4).fill(normal), DARK);
    }
  }
  return out;
}

/** Its axis is z. A wheel has sectors of two brightnesses on its faces. */
export function cylinder(radius, length, isWheel) {
  const out = [];
  const at = (i) => [Math.cos((2 * Math.PI * i) / SEGMENTS), Math.sin((2 * Math.PI * i) / SEGMENTS)];
  for (let i = 0; i < SEGMENTS; i += 1) {
    const [[c, s], [d, t]] = [at(i), at(i + 1)];
    const [low, high] = [-length / 2, length / 2];
    quad(
      out,
      [[radius * c, radius * s, low], [radius * d, radius * t, low], [radius * d, radius * t, high], [radius * c, radius * s, high]],
      [[c, s, 0], [d, t, 0], [d, t, 0], [c, s, 0]],
      DARK,
    );
    const isLight = isWheel && Math.floor((i * SECTORS) / SEGMENTS) % 2 === 1;
    for (const [z, normal] of [[low, [0, 0, -1]], [high, [0, 0, 1]]]) {
      for (const [x, y] of [[0, 0], [radius * c, radius * s], [radius * d, radius * t]]) {
        out.push(x, y, z, ...normal, isLight ? LIGHT : DARK);
      }
    }
  }
  return out;
}

export function sphere(radius) {
  const out = [];
  const at = (ring, i) => {
    const [down, around] = [(Math.PI * ring) / RINGS, (2 * Math.PI * i) / SEGMENTS];
    return [Math.sin(down) * Math.cos(around), Math.sin(down) * Math.sin(around), Math.cos(down)];
  };
  for (let ring = 0; ring < RINGS; ring += 1) {
    for (let i = 0; i < SEGMENTS; i += 1) {
      const normals = [at(ring, i), at(ring + 1, i), at(ring + 1, i + 1), at(ring, i + 1)];
      quad(out, normals.map((each) => each.map((value) => radius * value)), normals, DARK);
    }
  }
  return out;
}
