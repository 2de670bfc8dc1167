// Binary frames: headers, meshes, and what is wrong with short ones.

import assert from "node:assert/strict";
import test from "node:test";
import { readFrame, readMesh } from "../src/protocol";
import { frame } from "./frames";

test("a frame is a header and data", () => {
  const { header, data } = frame({ id: 7, type: "image/png" }, Uint8Array.of(1, 2));
  assert.equal(header.id, 7);
  assert.deepEqual([...data], [1, 2]);
});

test("a mesh is read wherever its header ends", () => {
  const positions = Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0);
  const normals = Float32Array.of(0, 0, 1, 0, 0, 1, 0, 0, 1);
  const corners = Uint32Array.of(0, 1, 2);
  const parts = [positions, normals, corners, Uint16Array.of(5, 0)];
  const data = new Uint8Array(parts.flatMap((p) => [...new Uint8Array(p.buffer)]));
  for (const padding of ["", "a", "ab", "abc"]) {
    const header = { id: 1, type: "mesh", vertices: 3, triangles: 1, topology: "k", padding };
    const mesh = readMesh(frame(header, data));
    assert.deepEqual([...mesh.positions], [...positions]);
    assert.deepEqual([...mesh.normals!], [...normals]);
    assert.deepEqual([...mesh.corners], [0, 1, 2]);
    assert.deepEqual([...mesh.partOf!], [5]);
  }
});

test("what is too short is an error, not a wrong mesh", () => {
  assert.throws(() => readFrame(new ArrayBuffer(2)), /shorter/);
  const header = { id: 1, type: "mesh", vertices: 9, triangles: 1 };
  assert.throws(() => readMesh(frame(header, new Uint8Array(8))), /9 vertices/);
});
