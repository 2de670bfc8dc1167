// Makes the files here: a wave of 17 x 17 vertices with the morph target "up", its weight 0.5, in
// three places, compressed in the ways that gltfpack and glTF Transform offer.
//
//     npm install @gltf-transform/core@4.5.1 @gltf-transform/extensions@4.5.1 \
//         @gltf-transform/functions@4.5.1 draco3dgltf@1.5.7 gltfpack@1.3.0
//     node make.mjs
import { execFileSync } from "node:child_process";
import { writeFileSync, unlinkSync } from "node:fs";
import { Document, NodeIO } from "@gltf-transform/core";
import { ALL_EXTENSIONS } from "@gltf-transform/extensions";
import { draco } from "@gltf-transform/functions";
import draco3d from "draco3dgltf";

const side = 17;
const positions = [], up = [], corners = [];
for (let y = 0; y < side; y++) {
  for (let x = 0; x < side; x++) {
    positions.push(x / 8, y / 8, ((x * x + 3 * y) % 7) / 16);
    up.push(0, 0, x % 2);
  }
}
for (let y = 0; y + 1 < side; y++) {
  for (let x = 0; x + 1 < side; x++) {
    const a = y * side + x;
    corners.push(a, a + 1, a + side + 1, a, a + side + 1, a + side);
  }
}

function wave(places, morph) {
  const doc = new Document();
  const buffer = doc.createBuffer();
  const numbers = (type, array) => doc.createAccessor().setType(type).setArray(array).setBuffer(buffer);
  const primitive = doc.createPrimitive()
    .setAttribute("POSITION", numbers("VEC3", new Float32Array(positions)))
    .setIndices(numbers("SCALAR", new Uint16Array(corners)));
  const mesh = doc.createMesh("wave").addPrimitive(primitive);
  if (morph) {
    primitive.addTarget(doc.createPrimitiveTarget("up").setAttribute("POSITION", numbers("VEC3", new Float32Array(up))));
    mesh.setWeights([0.5]);
  }
  const scene = doc.createScene();
  for (let i = 0; i < places; i++) {
    const turn = [0, 0, Math.sin(i * 0.3), Math.cos(i * 0.3)];
    scene.addChild(doc.createNode("wave").setMesh(mesh).setTranslation([4 * i, 0, i]).setRotation(turn).setScale([1, 1 + i, 1]));
  }
  return doc;
}

const io = new NodeIO().registerExtensions(ALL_EXTENSIONS)
  .registerDependencies({ "draco3d.encoder": await draco3d.createEncoderModule() });
const pack = (from, to, ...options) =>
  execFileSync("node", ["node_modules/gltfpack/cli.js", "-i", from, "-o", to, ...options]);

await io.write("plain.glb", wave(1, true));
pack("plain.glb", "meshopt_ext.glb", "-cc", "-kn", "-ke");
pack("plain.glb", "meshopt_khr.glb", "-cz", "-vpf", "-kn", "-ke");
await io.write("plain.glb", wave(3, false));
pack("plain.glb", "meshopt_copies.glb", "-c", "-mi");
unlinkSync("plain.glb");
const compressed = wave(1, false);
await compressed.transform(draco());
await io.write("draco.glb", compressed);
