// Meshes of the protocol as three's geometries, with their colours.

import * as THREE from "three";
import { partColour, viridis, type Rgb } from "./colour_map";
import type { Mesh } from "./protocol";

/** The meaning of a mesh's colours. */
export type Paint = "plain" | "parts" | "uncertainty";

/** The geometry of a mesh; the paint `parts` gives every triangle its own vertices. */
export function meshGeometry(
  mesh: Mesh,
  paint: Paint,
  deviations: { values: Float32Array; top: number } | null,
): THREE.BufferGeometry {
  let geometry = ghostGeometry(mesh);
  const partOf = paint === "parts" ? mesh.partOf : null;
  if (paint === "uncertainty" && deviations?.values.length === mesh.positions.length / 3) {
    const { values, top } = deviations;
    paintVertices(geometry, (vertex) => viridis(values[vertex]! / top));
  }
  // Meshes have their vertices twice along sharp edges, which so stay sharp.
  if (mesh.normals) geometry.setAttribute("normal", new THREE.BufferAttribute(mesh.normals, 3));
  else geometry.computeVertexNormals();
  if (partOf) {
    geometry = geometry.toNonIndexed();
    paintVertices(geometry, (corner) => partColour(partOf[Math.floor(corner / 3)]!));
  }
  geometry.computeBoundingSphere();
  return geometry;
}

/** The geometry of a ghost: flat, so that it needs no normals. */
export function ghostGeometry(mesh: Mesh): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(mesh.positions, 3));
  geometry.setIndex(new THREE.BufferAttribute(mesh.corners, 1));
  return geometry;
}

const linear = new THREE.Color();

// Colours of vertices are linear, those of the map are as screens show them.
function paintVertices(geometry: THREE.BufferGeometry, colour: (vertex: number) => Rgb): void {
  const { count } = geometry.getAttribute("position");
  const colours = new Float32Array(3 * count);
  for (let vertex = 0; vertex < count; vertex++) {
    const [r, g, b] = colour(vertex);
    linear.setRGB(r / 255, g / 255, b / 255, THREE.SRGBColorSpace);
    linear.toArray(colours, 3 * vertex);
  }
  geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
}
