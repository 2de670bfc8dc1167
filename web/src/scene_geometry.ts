// Meshes of the protocol as three's geometries, with their colours.

import * as THREE from "three";
import { partColour, viridis } from "./colour_map";
import type { Mesh } from "./protocol";

/** What a mesh's colours say. */
export type Paint = "plain" | "parts" | "uncertainty";

/** The geometry of a mesh; the paint `parts` gives every triangle its own vertices. */
export function meshGeometry(
  mesh: Mesh,
  paint: Paint,
  deviations: { values: Float32Array; top: number } | null,
): THREE.BufferGeometry {
  if (paint === "parts" && mesh.partOf) return partsGeometry(mesh, mesh.partOf);
  const geometry = plainGeometry(mesh);
  const matches = deviations && deviations.values.length * 3 === mesh.positions.length;
  if (paint === "uncertainty" && matches) {
    const colours = new Float32Array(mesh.positions.length);
    deviations.values.forEach((value, i) => {
      setColour(colours, i, viridis(value / deviations.top));
    });
    geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
  }
  return geometry;
}

/** The geometry of a ghost: flat, so that it needs no normals. */
export function ghostGeometry(mesh: Mesh): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(mesh.positions, 3));
  geometry.setIndex(new THREE.BufferAttribute(mesh.corners, 1));
  return geometry;
}

function plainGeometry(mesh: Mesh): THREE.BufferGeometry {
  const geometry = ghostGeometry(mesh);
  if (mesh.normals) geometry.setAttribute("normal", new THREE.BufferAttribute(mesh.normals, 3));
  else geometry.computeVertexNormals();
  geometry.computeBoundingSphere();
  return geometry;
}

function partsGeometry(mesh: Mesh, partOf: Uint16Array): THREE.BufferGeometry {
  const geometry = plainGeometry(mesh).toNonIndexed();
  const colours = new Float32Array(3 * mesh.corners.length);
  partOf.forEach((part, triangle) => {
    const colour = partColour(part);
    for (let k = 0; k < 3; k++) setColour(colours, 3 * triangle + k, colour);
  });
  geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
  geometry.computeBoundingSphere();
  return geometry;
}

const linear = new THREE.Color();

// Colours of vertices are linear, those of the map are as screens show them.
function setColour(colours: Float32Array, vertex: number, [r, g, b]: number[]): void {
  linear.setRGB(r! / 255, g! / 255, b! / 255, THREE.SRGBColorSpace);
  linear.toArray(colours, 3 * vertex);
}
