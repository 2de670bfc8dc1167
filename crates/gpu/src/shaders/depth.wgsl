// The depth at the marked pixels.

// Numbers the marked pixels; gives how many there are.
fn rank_marks(lane: u32) -> u32 {
    let each = (RANKS + LANES - 1u) / LANES;
    let first = lane * each;
    var sum = 0u;
    for (var g = first; g < min(first + each, RANKS); g++) {
        for (var k = 0u; k < 4u; k++) {
            sum += countOneBits(atomicLoad(&marks[4u * g + k]));
        }
    }
    let sums = scan(lane, sum);
    var at = sums.x;
    for (var g = first; g < min(first + each, RANKS); g++) {
        ranks[g] = at;
        for (var k = 0u; k < 4u; k++) {
            at += countOneBits(atomicLoad(&marks[4u * g + k]));
        }
    }
    for (var i = lane; i < min(sums.y, MOST_TESTED); i += LANES) {
        atomicStore(&depths[i], FAR_AWAY);
    }
    workgroupBarrier();
    return sums.y;
}

// The number of a marked pixel.
fn rank(pixel: u32) -> u32 {
    let word = pixel >> 5u;
    var at = ranks[word >> 2u];
    for (var w = word & 0xfffffffcu; w < word; w++) {
        at += countOneBits(atomicLoad(&marks[w]));
    }
    return at + countOneBits(atomicLoad(&marks[word]) & ((1u << (pixel & 31u)) - 1u));
}

fn fill(scene: Scene, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, back: f32) {
    // The pixels whose centres lie in the bounding box.
    let low = ceil(min(min(a.xy, b.xy), c.xy) - 0.5);
    let high = floor(max(max(a.xy, b.xy), c.xy) - 0.5);
    let limit = vec2<f32>(WIDTH - 1.0, HEIGHT - 1.0);
    if any(low > limit) || any(high < vec2<f32>(0.0)) || any(low > high) {
        return;
    }
    let start = vec2<u32>(max(low, vec2<f32>(0.0)));
    let to = vec2<u32>(min(high, limit));
    let e = b.xy - a.xy;
    let f = c.xy - a.xy;
    let area = e.x * f.y - e.y * f.x;
    if area == 0.0 || area * back > 0.0 {
        return;
    }
    let q = vec2<f32>(b.z - a.z, c.z - a.z);
    let slope = vec2<f32>(q.x * f.y - q.y * e.y, q.y * e.x - q.x * f.x) / area;
    let near = max(max(a.z, b.z), c.z);
    let far = min(min(a.z, b.z), c.z);
    let way = sign(area);
    let g = c.xy - b.xy;
    // A ten-thousandth of a pixel, so that rounding leaves no gaps between triangles.
    let slack = -1e-4 * vec3<f32>(abs(e.x) + abs(e.y), abs(g.x) + abs(g.y), abs(f.x) + abs(f.y));
    for (var row = start.y; row <= to.y; row++) {
        for (var word = start.x >> 5u; word <= to.x >> 5u; word++) {
            var left = atomicLoad(&marks[row * STRIDE + word]);
            if word == start.x >> 5u {
                left &= 0xffffffffu << (start.x & 31u);
            }
            if word == to.x >> 5u {
                left &= 0xffffffffu >> (31u - (to.x & 31u));
            }
            while left != 0u {
                let column = word * 32u + firstTrailingBit(left);
                left &= left - 1u;
                let p = vec2<f32>(f32(column), f32(row)) + 0.5;
                let u = p - a.xy;
                let v = p - b.xy;
                let inside = way * vec3<f32>(
                    e.x * u.y - e.y * u.x,
                    g.x * v.y - g.y * v.x,
                    u.x * f.y - u.y * f.x,
                ) >= slack;
                if all(inside) {
                    let nearness = clamp(a.z + dot(slope, u), far, near);
                    let depth = depth_of(nearness, scene.lens.w > 0.0);
                    atomicMin(&depths[rank(row * (STRIDE * 32u) + column)], bitcast<u32>(depth));
                }
            }
        }
    }
}

fn draw_depth(lane: u32, scene: Scene, projections: u32) {
    var turn = 0u;
    for (var d = scene.first; d < scene.past; d++) {
        let base = projections + draws[d].projected;
        let flags = draws[d].flags;
        // Clockwise in the image is away from the camera, unless mirrored.
        var back = 0.0;
        if (flags & ENCLOSES) != 0u {
            back = select(1.0, -1.0, (flags & MIRRORED) != 0u);
        }
        let faces = draws[d].triangle_count;
        for (var face = (lane - turn) % LANES; face < faces; face += LANES) {
            let v = corners(d, face);
            let a = projected[base + v.x].xyz;
            fill(scene, a, projected[base + v.y].xyz, projected[base + v.z].xyz, back);
        }
        turn += faces;
    }
}
