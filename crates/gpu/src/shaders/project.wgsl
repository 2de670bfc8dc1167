// The vertices of a scene in the image, and its depth range.

// What the CPU's single precision and bounds leave to its own code.
const NEAR: f32 = 1e-3;
const BOUND: f32 = 16384.0;

fn position(d: u32, v: u32) -> vec3<f32> {
    let first = draws[d].positions;
    if (draws[d].flags & REVOLUTION) != 0u {
        let ring = first + 4u * (v / SIDES);
        let turn = 2u * (v % SIDES);
        let r = vertices[ring];
        return vec3<f32>(r * vertices[turn], vertices[ring + 1u], r * vertices[turn + 1u]);
    }
    let at = first + 3u * v;
    return vec3<f32>(vertices[at], vertices[at + 1u], vertices[at + 2u]);
}

fn normal(d: u32, v: u32) -> vec3<f32> {
    if (draws[d].flags & REVOLUTION) != 0u {
        let ring = draws[d].positions + 4u * (v / SIDES) + 2u;
        let turn = 2u * (v % SIDES);
        let r = vertices[ring];
        return vec3<f32>(r * vertices[turn], vertices[ring + 1u], r * vertices[turn + 1u]);
    }
    let at = draws[d].normals + 3u * v;
    return vec3<f32>(vertices[at], vertices[at + 1u], vertices[at + 2u]);
}

fn project(lane: u32, scene: Scene, base: u32) {
    var least = FAR_AWAY;
    var most = 0u;
    var sound = true;
    // Lanes go on where the mesh before ended, so that small meshes fill them too.
    var turn = 0u;
    for (var d = scene.first; d < scene.past; d++) {
        let count = draws[d].count;
        for (var v = (lane - turn) % LANES; v < count; v += LANES) {
            let p = position(d, v);
            let at = vec4<f32>(p, 1.0);
            let c = vec3<f32>(dot(draws[d].x, at), dot(draws[d].y, at), dot(draws[d].z, at));
            let depth = -c.z;
            let pinhole = scene.lens.w > 0.0;
            let q = select(-depth, 1.0 / depth, pinhole);
            let k = select(scene.lens.x, scene.lens.x * q, pinhole);
            let x = scene.lens.y + k * c.x;
            let y = scene.lens.z - k * c.y;
            // Written so that it is false for NaN.
            if !(depth >= NEAR && depth < 1e9 && abs(x) < BOUND && abs(y) < BOUND) {
                sound = false;
            }
            let to = draws[d].facing;
            projected[base + draws[d].projected + v] =
                vec4<f32>(x, y, q, dot(normal(d, v), to.xyz - to.w * p));
            least = min(least, bitcast<u32>(depth));
            most = max(most, bitcast<u32>(depth));
        }
        turn += count;
    }
    atomicMin(&near, least);
    atomicMax(&far, most);
    if !sound {
        atomicMax(&trouble, 1u);
    }
}
