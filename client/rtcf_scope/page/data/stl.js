// Meshes from binary STL files: corners with normals, which are smooth across small angles.
const SMOOTH = Math.cos(35 * Math.PI / 180);

// Returns {positions, normals, index}: 3 numbers per corner in the first two, 3 corners per triangle in `index`.
export function meshOf(buffer) {
  const data = new DataView(buffer), count = data.getUint32(80, true);
  const places = new Float32Array(count * 9), faces = new Float32Array(count * 3);
  const around = new Map(); // triangles by the position of a corner
  for (let i = 0; i < count; i++) {
    for (let j = 0; j < 9; j++) places[9 * i + j] = data.getFloat32(84 + 50 * i + 12 + 4 * j, true);
    faces.set(normalOf(places, 9 * i), 3 * i);
    for (let corner = 0; corner < 3; corner++) {
      const key = keyOf(places, 9 * i + 3 * corner);
      if (around.has(key)) around.get(key).push(i); else around.set(key, [i]);
    }
  }
  const positions = [], normals = [], index = new Uint32Array(count * 3), known = new Map();
  for (let at = 0; at < count * 3; at++) {
    const face = Math.floor(at / 3), key = keyOf(places, 3 * at), sum = [0, 0, 0];
    for (const other of around.get(key))
      if (dot(faces, 3 * face, 3 * other) >= SMOOTH) for (let k = 0; k < 3; k++) sum[k] += faces[3 * other + k];
    const length = Math.hypot(...sum) || 1, normal = sum.map((each) => each / length);
    const corner = `${key} ${normal.map((each) => Math.round(each * 100))}`;
    if (!known.has(corner)) {
      known.set(corner, positions.length / 3);
      positions.push(...places.subarray(3 * at, 3 * at + 3));
      normals.push(...normal);
    }
    index[at] = known.get(corner);
  }
  return { positions: new Float32Array(positions), normals: new Float32Array(normals), index };
}

// A position, rounded to a hundredth of a millimetre, as a key.
function keyOf(places, at) {
  return `${Math.round(places[at] * 1e5)},${Math.round(places[at + 1] * 1e5)},${Math.round(places[at + 2] * 1e5)}`;
}

function normalOf(p, at) {
  const u = [p[at + 3] - p[at], p[at + 4] - p[at + 1], p[at + 5] - p[at + 2]];
  const v = [p[at + 6] - p[at], p[at + 7] - p[at + 1], p[at + 8] - p[at + 2]];
  const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const length = Math.hypot(...n) || 1;
  return n.map((each) => each / length);
}

function dot(faces, one, other) {
  return faces[one] * faces[other] + faces[one + 1] * faces[other + 1] + faces[one + 2] * faces[other + 2];
}
