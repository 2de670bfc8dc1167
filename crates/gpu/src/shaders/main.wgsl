// Draws scene after scene: vertices, pieces, depth where they are tested, and what is seen.

const TOLERANCE: f32 = 0.006;
const EDGE_SLACK: f32 = 0.06;
const SILHOUETTE_SLACK: f32 = 0.15;

fn is_free(look: u32, depth: f32, slack: f32, most: f32, tolerance: f32) -> bool {
    if (look & (1u << 17u)) == 0u {
        return false;
    }
    var given = min(slack, most);
    if (look & (1u << 16u)) == 0u {
        given = max(given, 10.0 * tolerance);
    }
    let seen = bitcast<f32>(atomicLoad(&depths[rank(look & 0xffffu)]));
    return seen >= depth - given - tolerance - 1e-6 * depth;
}

fn is_visible(at: u32, extent: f32) -> bool {
    let looks = pieces[at].looks;
    let more = pieces[at].more;
    let most = extent * select(SILHOUETTE_SLACK, EDGE_SLACK, looks.z != 0u);
    let tolerance = TOLERANCE * extent;
    return is_free(looks.x, more.y, more.z, most, tolerance)
        || is_free(looks.y, more.y, more.w, most, tolerance);
}

// The distance to the observed contours, as `vision::Chamfer` reads it.
fn distance_at(p: vec4<f32>) -> f32 {
    let most = vec2<f32>(params.size - 1u);
    let g = clamp(p.xy * params.scale - 0.5, vec2<f32>(0.0), most);
    let low = min(vec2<u32>(g), max(params.size, vec2<u32>(2u)) - 2u);
    let high = min(low + 1u, params.size - 1u);
    let f = g - vec2<f32>(low);
    var first = 0u;
    var second = 0u;
    var share = 0.0;
    let each = params.size.x * params.size.y;
    if params.channels > 1u {
        let channels = f32(params.channels);
        var k = atan2(p.w, p.z) * (channels / 3.14159265358979);
        k = select(k, k + channels, k < 0.0);
        k = select(k, k - channels, k >= channels);
        let lower = min(u32(k), params.channels - 1u);
        share = k - f32(lower);
        first = lower * each;
        second = ((lower + 1u) % params.channels) * each;
    }
    let a = bilinear(first, low, high, f);
    if params.channels == 1u {
        return a;
    }
    return a + share * (bilinear(second, low, high, f) - a);
}

fn bilinear(field: u32, low: vec2<u32>, high: vec2<u32>, f: vec2<f32>) -> f32 {
    let above = field + low.y * params.size.x;
    let below = field + high.y * params.size.x;
    let top = mix(fields[above + low.x], fields[above + high.x], f.x);
    let bottom = mix(fields[below + low.x], fields[below + high.x], f.x);
    return mix(top, bottom, f.y);
}

// Sums of one direction: length, length times distance, length times its square.
fn score(lane: u32, pool: u32, found: u32, extent: f32) -> vec4<f32> {
    var sums = vec3<f32>(0.0);
    for (var i = lane; i < found; i += LANES) {
        if is_visible(pool + i, extent) {
            let at = pieces[pool + i].at;
            let border = min(min(at.x, WIDTH - at.x), min(at.y, HEIGHT - at.y));
            let length = pieces[pool + i].more.x * clamp(border + 0.5, 0.0, 1.0) * params.percent;
            let distance = min(distance_at(at), params.truncate);
            sums += length * vec3<f32>(1.0, distance, distance * distance);
        }
    }
    return vec4<f32>(total(lane, sums.x), total(lane, sums.y), total(lane, sums.z), 0.0);
}

// Appends the visible pieces to those of all scenes.
fn put(lane: u32, number: u32, pool: u32, found: u32, extent: f32) {
    workgroupBarrier();
    atomicStore(&bits[lane], 0u);
    workgroupBarrier();
    for (var i = lane; i < found; i += LANES) {
        if is_visible(pool + i, extent) {
            atomicOr(&bits[i >> 5u], 1u << (i & 31u));
        }
    }
    let count = count_bits(lane);
    if lane == 0u {
        place = atomicAdd(&written, count);
    }
    workgroupBarrier();
    let first = place;
    let fits = first + count <= params.room;
    if lane == 0u {
        results[number] = Result(select(NO_ROOM, DRAWN, fits), first, count, found, vec4<f32>(0.0));
    }
    if !fits {
        return;
    }
    for (var k = lane; k < count; k += LANES) {
        let i = pool + chosen(k);
        let at = pieces[i].at;
        output[first + k] = at.x;
        output[params.room + first + k] = at.y;
        output[2u * params.room + first + k] = at.z;
        output[3u * params.room + first + k] = at.w;
        output[4u * params.room + first + k] = pieces[i].more.x;
    }
}

fn draw(lane: u32, number: u32, group: u32) {
    let scene = scenes[number];
    let projections = group * params.vertices;
    let pool = group * MOST_PIECES;
    workgroupBarrier();
    for (var i = lane; i < WORDS; i += LANES) {
        atomicStore(&marks[i], 0u);
    }
    if lane == 0u {
        atomicStore(&near, FAR_AWAY);
        atomicStore(&far, 0u);
        atomicStore(&trouble, 0u);
    }
    workgroupBarrier();
    project(lane, scene, projections);
    storageBarrier();
    workgroupBarrier();
    let extent = max(bitcast<f32>(atomicLoad(&far)) - bitcast<f32>(atomicLoad(&near)), 0.0);
    var found = 0u;
    var tested = 0u;
    let sound = atomicLoad(&trouble) == 0u;
    if sound {
        for (var d = scene.first; d < scene.past; d++) {
            found = extract(lane, scene, d, projections, pool, found);
        }
        storageBarrier();
        workgroupBarrier();
        tested = rank_marks(lane);
    }
    if !sound || found > MOST_PIECES || tested > MOST_TESTED {
        if lane == 0u {
            results[number] = Result(FOR_CPU, 0u, 0u, found, vec4<f32>(0.0));
        }
        return;
    }
    draw_depth(lane, scene, projections);
    workgroupBarrier();
    if params.channels == 0u {
        put(lane, number, pool, found, extent);
    } else {
        let sums = score(lane, pool, found, extent);
        if lane == 0u {
            results[number] = Result(DRAWN, 0u, 0u, found, sums);
        }
    }
}

@compute @workgroup_size(256)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    for (var number = group.x; number < params.scenes; number += groups.x) {
        draw(lane, number, group.x);
    }
}
