// Normals of meshes that come without them.

import type { Mesh } from "./protocol";

const CREASE = Math.cos((40 * Math.PI) / 180);

/** A normal for each corner of each triangle: smooth, except at edges that turn by more than
 * 40 degrees. */
export function creasedNormals({ positions, corners }: Mesh): Float32Array {
  // The normals of triangles, longer for larger ones, which so count for more.
  const faces = new Float32Array(corners.length);
  const lengths = new Float32Array(corners.length / 3);
  for (let i = 0; i < corners.length; i += 3) {
    const [a, b, c] = [3 * corners[i]!, 3 * corners[i + 1]!, 3 * corners[i + 2]!];
    const edge = (to: number, axis: number) => positions[to + axis]! - positions[a + axis]!;
    const x = edge(b, 1) * edge(c, 2) - edge(b, 2) * edge(c, 1);
    const y = edge(b, 2) * edge(c, 0) - edge(b, 0) * edge(c, 2);
    const z = edge(b, 0) * edge(c, 1) - edge(b, 1) * edge(c, 0);
    faces.set([x, y, z], i);
    lengths[i / 3] = Math.hypot(x, y, z);
  }
  // The triangles at vertex v are those at from[v] to from[v + 1] - 1 of `around`.
  const from = new Uint32Array(positions.length / 3 + 1);
  for (const vertex of corners) from[vertex + 1]!++;
  for (let v = 1; v < from.length; v++) from[v]! += from[v - 1]!;
  const next = from.slice();
  const around = new Uint32Array(corners.length);
  corners.forEach((vertex, i) => (around[next[vertex]!++] = Math.floor(i / 3)));

  const normals = new Float32Array(3 * corners.length);
  corners.forEach((vertex, i) => {
    const own = 3 * Math.floor(i / 3);
    const [x, y, z] = [faces[own]!, faces[own + 1]!, faces[own + 2]!];
    const sum = [0, 0, 0];
    for (let k = from[vertex]!; k < from[vertex + 1]!; k++) {
      const other = 3 * around[k]!;
      const dot = x * faces[other]! + y * faces[other + 1]! + z * faces[other + 2]!;
      if (other !== own && dot < CREASE * lengths[own / 3]! * lengths[around[k]!]!) continue;
      for (let axis = 0; axis < 3; axis++) sum[axis]! += faces[other + axis]!;
    }
    const length = Math.hypot(...sum) || 1;
    for (let axis = 0; axis < 3; axis++) normals[3 * i + axis] = sum[axis]! / length;
  });
  return normals;
}
