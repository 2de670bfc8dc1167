// What the passes share: the buffers, the workgroup's memory, and a scan.
//
// One workgroup draws one scene at a time, so no pass waits for another workgroup. Memory
// of a scene that is only needed while it is drawn (`projected`, `pieces`) belongs to the
// workgroup and is used again for its next scene.

const LANES: u32 = 256u;
// Sides of the mesh that stands for a surface of revolution.
const SIDES: u32 = $SIDESu;
// Words of a row of the bitmap of tested pixels, and of all of it.
const STRIDE: u32 = $STRIDEu;
const WORDS: u32 = $WORDSu;
const RANKS: u32 = WORDS / 4u;
const WIDTH: f32 = $WIDTH.0;
const HEIGHT: f32 = $HEIGHT.0;
// Pieces of a scene, and pixels at which they are tested; scenes with more go to the CPU.
const MOST_PIECES: u32 = $PIECESu;
const MOST_TESTED: u32 = 4096u;
const MOST_LINES: u32 = 2048u;
// Faces whose crossings are found at a time.
const WINDOW: u32 = 8192u;
const FAR_AWAY: u32 = 0x7f800000u; // The bits of infinity.
const NO_FACE: u32 = 0xffffffffu;

const DRAWN: u32 = 0u;
const FOR_CPU: u32 = 1u; // Something that only the CPU draws.
const NO_ROOM: u32 = 2u; // The list of pieces of all scenes is full: to be drawn again.

const ENCLOSES: u32 = 1u;
const OPEN: u32 = 2u;
const MIRRORED: u32 = 4u;
const REVOLUTION: u32 = 8u;

struct Params {
    scenes: u32,
    room: u32,      // Pieces for which `output` has room.
    vertices: u32,  // Vertices for which each workgroup has room in `projected`.
    channels: u32,  // Distance fields: 1, or one per orientation; 0 to write contours.
    size: vec2<u32>,   // Samples of a field.
    scale: vec2<f32>,  // Samples per pixel.
    percent: f32,
    truncate: f32,
    unused: vec2<u32>,
}

struct Scene {
    lens: vec4<f32>, // Pixels per unit (at depth 1), principal point, 1 for a pinhole.
    first: u32,      // Its draws.
    past: u32,
    unused: vec2<u32>,
}

// A placed mesh, or a placed surface of revolution.
struct Draw {
    // Rows of the map from the mesh's to camera coordinates.
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
    // `facing = n . (xyz - w p)`.
    facing: vec4<f32>,
    // Rows of the map of normals.
    nx: vec4<f32>,
    ny: vec4<f32>,
    // In `vertices`; of a surface of revolution, its rings are the positions.
    positions: u32,
    normals: u32,
    count: u32,
    // Its first vertex in the scene's part of `projected`.
    projected: u32,
    // In `topology`.
    triangles: u32,
    triangle_count: u32,
    edges: u32,
    edge_count: u32,
    lines: u32,
    line_count: u32,
    flags: u32,
    unused: u32,
}

// A piece of contour that may be hidden.
struct Piece {
    at: vec4<f32>,   // Middle and tangent.
    more: vec4<f32>, // Length, depth, slack on both sides.
    // Pixel, whether it is inside (bit 16), whether there is a test (17); edge or not (18).
    looks: vec4<u32>,
}

struct Result {
    status: u32,
    first: u32,
    count: u32,
    pieces: u32,
    sums: vec4<f32>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> scenes: array<Scene>;
@group(0) @binding(2) var<storage, read> draws: array<Draw>;
@group(0) @binding(3) var<storage, read> topology: array<u32>;
@group(0) @binding(4) var<storage, read> vertices: array<f32>;
@group(0) @binding(5) var<storage, read> fields: array<f32>;
// x, y, nearness, facing
@group(0) @binding(6) var<storage, read_write> projected: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> pieces: array<Piece>;
@group(0) @binding(8) var<storage, read_write> results: array<Result>;
@group(0) @binding(9) var<storage, read_write> output: array<f32>;
@group(0) @binding(10) var<storage, read_write> written: atomic<u32>;

var<workgroup> marks: array<atomic<u32>, WORDS>;
var<workgroup> ranks: array<u32, RANKS>;
var<workgroup> depths: array<atomic<u32>, MOST_TESTED>;
var<workgroup> bits: array<atomic<u32>, LANES>;
var<workgroup> before: array<u32, LANES>;
var<workgroup> counts: array<u32, LANES>;
var<workgroup> partial: array<u32, 16>;
var<workgroup> specks: array<atomic<u32>, 64>;
var<workgroup> near: atomic<u32>;
var<workgroup> far: atomic<u32>;
var<workgroup> trouble: atomic<u32>;
var<workgroup> holes: atomic<u32>;
var<workgroup> place: u32;

// The sum over the lanes before this one, and over all of them.
fn scan(lane: u32, n: u32) -> vec2<u32> {
    workgroupBarrier();
    counts[lane] = n;
    workgroupBarrier();
    if lane < 16u {
        var sum = 0u;
        for (var k = 0u; k < 16u; k++) {
            sum += counts[lane * 16u + k];
        }
        partial[lane] = sum;
    }
    workgroupBarrier();
    var own = 0u;
    var all = 0u;
    for (var k = 0u; k < 16u; k++) {
        if k == lane >> 4u {
            own = all;
        }
        all += partial[k];
    }
    for (var k = lane & 0xfffffff0u; k < lane; k++) {
        own += counts[k];
    }
    return vec2<u32>(own, all);
}

// The sum over all lanes, in an order that is always the same.
fn total(lane: u32, x: f32) -> f32 {
    workgroupBarrier();
    counts[lane] = bitcast<u32>(x);
    workgroupBarrier();
    if lane < 16u {
        var sum = 0.0;
        for (var k = 0u; k < 16u; k++) {
            sum += bitcast<f32>(counts[lane * 16u + k]);
        }
        partial[lane] = bitcast<u32>(sum);
    }
    workgroupBarrier();
    var all = 0.0;
    for (var k = 0u; k < 16u; k++) {
        all += bitcast<f32>(partial[k]);
    }
    return all;
}

// Counts the bits set in `bits` for [`chosen`]; gives their number.
fn count_bits(lane: u32) -> u32 {
    workgroupBarrier();
    let sums = scan(lane, countOneBits(atomicLoad(&bits[lane])));
    before[lane] = sums.x;
    workgroupBarrier();
    return sums.y;
}

// The number of the k-th bit that is set.
fn chosen(k: u32) -> u32 {
    var word = 0u;
    for (var step = 128u; step > 0u; step >>= 1u) {
        if before[word + step] <= k {
            word += step;
        }
    }
    var left = atomicLoad(&bits[word]);
    for (var skip = k - before[word]; skip > 0u; skip--) {
        left &= left - 1u;
    }
    return word * 32u + firstTrailingBit(left);
}

// Depth from nearness.
fn depth_of(q: f32, pinhole: bool) -> f32 {
    return select(-q, 1.0 / q, pinhole);
}
