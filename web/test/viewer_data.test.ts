// One scene through the three doors of the viewer: the studio's protocol, the data of a report,
// the bytes of a notebook. It is drawn alike.

import assert from "node:assert/strict";
import test from "node:test";
import { deflateSync } from "node:zlib";
import { Store, type Known } from "../src/actions";
import { readQuantities } from "../src/embedded_draws";
import { EmbeddedData, type EmbeddedScene } from "../src/embedded_data";
import { NotebookData } from "../src/notebook_data";
import type { Camera, Mesh, Run, Session, State } from "../src/protocol";
import { meshGeometry } from "../src/scene_geometry";
import { StudioData, stateOf, statesOf, timelineOf } from "../src/studio_data";
import type { ViewerData } from "../src/viewer";
import { frame } from "./frames";

// A roof: two triangles with a common edge, at a right angle.
const POSITIONS = Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1);
const CORNERS = Uint32Array.of(0, 1, 2, 0, 3, 1);
const CAMERA: Camera = { eye: [0, 0, 4], target: [0, 0, 0], up: [0, 1, 0], fov_y: 30 };

function packed(data: ArrayBufferView): string {
  return deflateSync(new Uint8Array(data.buffer)).toString("base64");
}

const LOW = [-1, 0, 0];
const HIGH = [2, 10, 2.5];

/** Positions as the program writes them into a report: steps between bounds, all x first. */
function steps(positions: Float32Array): string {
  const words: number[] = [];
  for (let axis = 0; axis < 3; axis++) {
    let before = 0;
    for (let i = axis; i < positions.length; i += 3) {
      const width = HIGH[axis]! - LOW[axis]!;
      const step = Math.round(((positions[i]! - LOW[axis]!) / width) * 65535);
      words.push((step - before) & 0xffff);
      before = step;
    }
  }
  return packed(Uint16Array.from(words));
}

function report(): EmbeddedScene {
  const draw = (place: number) => ({
    chain: 1,
    draw: place,
    log_joint: -place,
    label: null,
    topology: "roof",
    positions: steps(POSITIONS.map((x) => place * x)),
  });
  return {
    camera: CAMERA,
    photo: "data:image/png;base64,",
    topologies: { roof: packed(CORNERS) },
    low: LOW,
    high: HIGH,
    draws: [draw(1), draw(2)],
    layers: { overlay: "data:image/png;base64,AA==" },
  };
}

/** A program that answers requests for meshes and cameras, and keeps what was asked. */
class Program {
  readonly asked: [string, State][] = [];

  async ask<T>(method: string, params: object): Promise<T> {
    this.asked.push([method, (params as { state: State }).state]);
    return CAMERA as T;
  }

  async askBinary(method: string, params: object) {
    this.asked.push([method, (params as { state: State }).state]);
    const normals = new Float32Array(12);
    const parts = [POSITIONS, normals, CORNERS, Uint16Array.of(0, 1)];
    const data = new Uint8Array(parts.flatMap((p) => [...new Uint8Array(p.buffer)]));
    return frame({ id: 1, type: "mesh", vertices: 4, triangles: 2, topology: "roof" }, data);
  }
}

function known(patch: Partial<Known>): Known {
  const session = { session: 7, observe: ["cup.png"], photo: {}, has_view: true, log_joint: -3 };
  const run = { run: "runs/a", observe: ["cup.png"], draws: 2, revision: 1, session: 7 };
  const draws = [1, 2].map((draw) => ({ chain: 1, draw, log_joint: -draw }));
  return {
    ...new Store().now,
    session: session as unknown as Session,
    runs: [run as unknown as Run],
    run: "runs/a",
    draws: { draws, film: [0, 1, 8].map((step) => ({ step, log_joint: -9 })), chains: 1 },
    modes: 2,
    ...patch,
  };
}

function notebook(): NotebookData {
  // Bytes from a kernel begin at any place of their buffer.
  const moved = (data: ArrayBufferView) => {
    const bytes = new Uint8Array(data.byteLength + 3);
    bytes.set(new Uint8Array(data.buffer), 3);
    return new DataView(bytes.buffer, 3);
  };
  const model = { vertices: moved(POSITIONS), triangles: moved(CORNERS), picture: moved(CORNERS) };
  return new NotebookData({ get: (name) => model[name], on() {}, off() {} }, false);
}

/** The corners that are drawn, to a thousandth. */
function drawn(mesh: Mesh): number[] {
  const corners = meshGeometry(mesh, "plain", null).toNonIndexed().getAttribute("position");
  return [...corners.array].map((x) => Math.round(1000 * x) / 1000);
}

test("a scene is drawn alike in the studio, in a report and in a notebook", async () => {
  const all: ViewerData[] = [
    new StudioData(new Program(), known({ view: "draws" })),
    new EmbeddedData(report()),
    notebook(),
  ];
  for (const data of all) {
    assert.deepEqual(drawn(await data.mesh(0)), [...CORNERS].flatMap((v) => [
      ...POSITIONS.subarray(3 * v, 3 * v + 3),
    ]));
  }
  assert.deepEqual(await Promise.all(all.map((data) => data.camera(0))), [CAMERA, CAMERA, null]);
  assert.deepEqual(all.map((data) => data.drawCount), [2, 2, null]);
  assert.deepEqual(all[0]!.frames.map((f) => f.logJoint), all[1]!.frames.map((f) => f.logJoint));
});

test("a report's draws are told apart, and its pictures lie in the page", async () => {
  const data = new EmbeddedData(report());
  const larger = drawn(await data.drawMesh(1));
  assert.deepEqual(larger, drawn(await data.mesh(0)).map((x) => 2 * x));
  assert.deepEqual(data.layers, ["overlay"]);
  assert.equal((await data.picture(0, "overlay")).url, "data:image/png;base64,AA==");
  await assert.rejects(data.picture(0, "depth"), /no picture `depth`/);
});

test("a report's draws return from their steps", async () => {
  const chains = [packed(Uint16Array.of(0, 65535, 65534)), packed(Uint16Array.of(32767))];
  const none = { low: null, high: null, chains: [packed(Uint16Array.of(65535))] };
  const most = Number.MAX_VALUE;
  const quantities = [{ low: -1, high: 3, chains }, none, { low: -most, high: most, chains }];
  const [x, y, far] = await readQuantities({ every: 1, quantities }, ["x", "y", "far"]);
  assert.deepEqual(x, { name: "x", chains: [[-1, null, 3], [1]] });
  assert.deepEqual(y!.chains, [[null]]);
  assert.deepEqual(far!.chains, [[-most, null, most], [0]]);
});

test("the studio asks for the state of the chosen view", async () => {
  const states: [Partial<Known>, State | null][] = [
    [{ view: "session" }, { session: 7 }],
    [{ view: "best" }, { run: "runs/a" }],
    [{ view: "draws", at: 9 }, { run: "runs/a", draw: 1 }],
    [{ view: "film", at: 2 }, { run: "runs/a", film: 2 }],
    [{ view: "modes" }, { run: "runs/a", mode: 0 }],
    [{ view: "draws", draws: null }, null],
    [{ view: "best", run: null }, null],
  ];
  for (const [patch, state] of states) {
    const program = new Program();
    const now = known(patch);
    assert.deepEqual(stateOf(now), state);
    const data = new StudioData(program, now);
    if (!state) assert.equal(data.frames.length, 0);
    else await data.mesh(Math.min(now.at ?? 0, data.frames.length - 1));
    assert.deepEqual(program.asked, state ? [["mesh", state]] : []);
  }
});

test("the timeline leads from the best state to the draws, or to the film before there are any", () => {
  assert.equal(timelineOf(known({ view: "best" })), "draws");
  const early = { draws: [], film: known({}).draws!.film, chains: 1 };
  assert.equal(timelineOf(known({ view: "best", draws: early })), "film");
  assert.equal(timelineOf(known({ view: "best", draws: null })), null);
  assert.equal(timelineOf(known({ view: "session" })), null);
  const film = statesOf(known({ view: "film" })).map(([frame]) => [frame.step, frame.label]);
  assert.deepEqual(film[2], [8, "Step 8"]);
});

test("a program without a scene has choices, and no pictures", () => {
  const session = { session: 7, observe: [], photo: null, has_view: false };
  const now = known({ view: "best", session: session as unknown as Session });
  assert.deepEqual(stateOf(now), { run: "runs/a" });
  assert.equal(new StudioData(new Program(), now).frames.length, 0);
});

test("a notebook without WebGL shows the kernel's picture", () => {
  assert.deepEqual(notebook().layers, ["scene"]);
});

test("colours follow the vertices, whichever normals a mesh has", () => {
  const base = { topology: "", parts: [], positions: POSITIONS, corners: CORNERS };
  const given = new Float32Array(12);
  const deviations = { values: Float32Array.of(0, 1, 0, 0), top: 1 };
  for (const normals of [null, given]) {
    const mesh: Mesh = { ...base, normals, partOf: Uint16Array.of(0, 1) };
    const spread = meshGeometry(mesh, "uncertainty", deviations);
    const parts = meshGeometry(mesh, "parts", null);
    for (const geometry of [spread, parts]) {
      const { count } = geometry.getAttribute("position");
      assert.equal(geometry.getAttribute("color").count, count);
      assert.equal(geometry.getAttribute("normal").count, count);
    }
    const red = [...parts.getAttribute("color").array].filter((_, i) => i % 3 === 0);
    assert.ok(red[0] === red[2] && red[2] !== red[3]);
  }
});
