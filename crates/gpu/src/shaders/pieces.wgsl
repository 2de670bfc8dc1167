// The pieces of contour of a mesh, hidden or not, in the order of its faces and then its
// edges, as `render/lines` makes them on the CPU.

const LONGEST: f32 = 1.5;
const SPECK: f32 = 0.1;
const BESIDE: f32 = 1.2;

// A segment in the image, and the part of it that is inside.
struct Segment {
    a: vec3<f32>, // x, y, nearness
    d: vec3<f32>, // to the other end
    tangent: vec2<f32>,
    direction: vec2<f32>,
    slack: vec2<f32>,
    part: vec2<f32>,
    length: f32, // of the part
    both: bool,  // whether both sides are tested
    count: u32,  // of pieces
}

fn corners(d: u32, face: u32) -> vec3<u32> {
    let at = draws[d].triangles + 3u * face;
    return vec3<u32>(topology[at], topology[at + 1u], topology[at + 2u]);
}

fn is_inside(p: vec2<f32>) -> bool {
    return p.x >= 0.0 && p.y >= 0.0 && p.x <= WIDTH && p.y <= HEIGHT;
}

// The part of `a + t d` inside the image (Liang and Barsky 1984); empty if x >= y.
fn clip(a: vec2<f32>, d: vec2<f32>) -> vec2<f32> {
    var part = vec2<f32>(0.0, 1.0);
    let size = vec2<f32>(WIDTH, HEIGHT);
    for (var axis = 0u; axis < 2u; axis++) {
        if d[axis] == 0.0 {
            if a[axis] < 0.0 || a[axis] > size[axis] {
                return vec2<f32>(1.0, 0.0);
            }
            continue;
        }
        let u = -a[axis] / d[axis];
        let v = (size[axis] - a[axis]) / d[axis];
        part = vec2<f32>(max(part.x, min(u, v)), min(part.y, max(u, v)));
    }
    return part;
}

// Divides the segment into pieces.
fn divide(s: ptr<function, Segment>, long: f32) {
    let a = (*s).a.xy;
    let b = a + (*s).d.xy;
    if is_inside(a) && is_inside(b) {
        (*s).part = vec2<f32>(0.0, 1.0);
    } else {
        (*s).part = clip(a, (*s).d.xy);
    }
    let share = (*s).part.y - (*s).part.x;
    (*s).length = long * share;
    if share > 0.0 && (*s).length > 1e-9 {
        (*s).count = select(u32((*s).length + 0.5), 1u, (*s).length < LONGEST);
    }
}

// The image of a segment from a point of the mesh, in camera coordinates; differences are
// computed apart, which keeps the directions of short segments exact.
fn image(scene: Scene, c: vec3<f32>, d: vec3<f32>, s: ptr<function, Segment>) {
    if scene.lens.w > 0.0 {
        let q = -1.0 / c.z;
        let other = -1.0 / (c.z + d.z);
        let dq = d.z * q * other;
        let k = scene.lens.x * q;
        (*s).a = vec3<f32>(scene.lens.y + k * c.x, scene.lens.z - k * c.y, q);
        let moved = scene.lens.x * (d.xy * other + c.xy * dq);
        (*s).d = vec3<f32>(moved.x, -moved.y, dq);
    } else {
        let k = scene.lens.x;
        (*s).a = vec3<f32>(scene.lens.y + k * c.x, scene.lens.z - k * c.y, c.z);
        (*s).d = vec3<f32>(k * d.x, -k * d.y, d.z);
    }
}

fn to_camera(d: u32, p: vec4<f32>) -> vec3<f32> {
    return vec3<f32>(dot(draws[d].x, p), dot(draws[d].y, p), dot(draws[d].z, p));
}

fn in_depth(scene: Scene, nearness: f32, at: f32) -> f32 {
    return max(select(nearness, nearness / (at * at), scene.lens.w > 0.0), 0.0);
}

// The silhouette in a face that it crosses.
fn silhouette(scene: Scene, d: u32, base: u32, face: u32, open: bool) -> Segment {
    var s: Segment;
    s.both = open;
    var v = corners(d, face);
    var f = vec3<f32>(projected[base + v.x].w, projected[base + v.y].w, projected[base + v.z].w);
    let front = f >= vec3<f32>(0.0);
    // Begins with the corner whose sign differs from the others'.
    if front.x == front.y {
        v = v.zxy;
        f = f.zxy;
    } else if front.x == front.z {
        v = v.yzx;
        f = f.yzx;
    }
    let u = f.x / (f.x - f.y);
    let w = f.x / (f.x - f.z);
    let p = position(d, v.x);
    let q = position(d, v.y) - p;
    let r = position(d, v.z) - p;
    let along = to_camera(d, vec4<f32>(r * w - q * u, 0.0));
    image(scene, to_camera(d, vec4<f32>(p + q * u, 1.0)), along, &s);
    let long = length(s.d.xy);
    if !(long > 1e-9) {
        return s;
    }
    let t = s.d.xy / long;
    let n = normal(d, v.x) * (2.0 - u - w) + normal(d, v.y) * u + normal(d, v.z) * w;
    let out = vec2<f32>(dot(draws[d].nx.xyz, n), -dot(draws[d].ny.xyz, n));
    let size = length(out);
    s.direction = vec2<f32>(t.y, -t.x);
    if size > 1e-12 {
        s.direction = out / size;
    }
    let steep = select(0.0, s.d.z / long, long > 0.02);
    var most = 0.0;
    for (var k = 0u; k < 3u; k++) {
        let c = projected[base + v[k]];
        most = max(most, c.z - s.a.z - steep * dot(c.xy - s.a.xy, t));
    }
    s.slack = vec2<f32>(in_depth(scene, most, s.a.z));
    s.tangent = select(t, -t, t.y * s.direction.x - t.x * s.direction.y < 0.0);
    divide(&s, long);
    return s;
}

// A crease or boundary; `faces.y` may be missing.
fn sharp(
    scene: Scene,
    d: u32,
    base: u32,
    ends: vec2<u32>,
    faces: vec2<u32>,
    open: bool,
) -> Segment {
    var s: Segment;
    s.both = true;
    let p = position(d, ends.x);
    let q = position(d, ends.y);
    image(scene, to_camera(d, vec4<f32>(p, 1.0)), to_camera(d, vec4<f32>(q - p, 0.0)), &s);
    let long = length(s.d.xy);
    if !(long > 1e-9) {
        return s;
    }
    let t = s.d.xy / long;
    s.direction = vec2<f32>(t.y, -t.x);
    let steep = s.d.z / long;
    var any = open;
    var side = 0.0;
    for (var k = 0u; k < 2u; k++) {
        if faces[k] == NO_FACE {
            continue;
        }
        let v = corners(d, faces[k]);
        let first = position(d, v.x);
        let second = position(d, v.y);
        let third = position(d, v.z);
        // The corner opposite to the edge. Vertices are split along creases, so positions
        // are compared.
        var opposite = v.z;
        if any_differ(second, p) && any_differ(second, q) {
            opposite = v.y;
        }
        if any_differ(first, p) && any_differ(first, q) {
            opposite = v.x;
        } else if opposite == v.z && !(any_differ(third, p) && any_differ(third, q)) {
            continue;
        }
        let to = draws[d].facing;
        let front = dot(cross(second - first, third - first), to.xyz - to.w * first) > 0.0;
        any |= front;
        if front || open {
            let c = projected[base + opposite];
            let away = dot(c.xy - s.a.xy, s.direction);
            side -= select(-1.0, 1.0, away >= 0.0);
            if abs(away) > 1e-3 {
                let along = dot(c.xy - s.a.xy, t);
                let per_pixel = (c.z - s.a.z - steep * along) / abs(away);
                let slack = in_depth(scene, 2.0 * per_pixel, s.a.z);
                if away < 0.0 {
                    s.slack.y = max(s.slack.y, slack);
                } else {
                    s.slack.x = max(s.slack.x, slack);
                }
            }
        }
    }
    s.tangent = select(t, -t, side < 0.0);
    if any {
        divide(&s, long);
    }
    return s;
}

fn any_differ(a: vec3<f32>, b: vec3<f32>) -> bool {
    return any(a != b);
}

// The pixel that a position lies in, or the nearest one, and marks it.
fn look(p: vec2<f32>) -> u32 {
    let inside = p.x >= 0.0 && p.y >= 0.0 && p.x < WIDTH && p.y < HEIGHT;
    let at = vec2<u32>(clamp(p, vec2<f32>(0.0), vec2<f32>(WIDTH - 1.0, HEIGHT - 1.0)));
    let pixel = at.y * (STRIDE * 32u) + at.x;
    atomicOr(&marks[pixel >> 5u], 1u << (pixel & 31u));
    return pixel | select(0u, 1u << 16u, inside) | (1u << 17u);
}

// Writes a segment's pieces from `first` on.
fn write(scene: Scene, s: ptr<function, Segment>, first: u32, edge: bool) {
    let step = ((*s).part.y - (*s).part.x) / f32((*s).count);
    let length = (*s).length / f32((*s).count);
    for (var i = 0u; i < (*s).count; i++) {
        let at = (*s).a + (*s).d * ((*s).part.x + step * (f32(i) + 0.5));
        let aside = BESIDE * (*s).direction;
        var looks = vec4<u32>(look(at.xy + aside), 0u, select(0u, 1u, edge), 0u);
        if (*s).both {
            looks.y = look(at.xy - aside);
        }
        let depth = depth_of(at.z, scene.lens.w > 0.0);
        pieces[first + i] = Piece(
            vec4<f32>(at.xy, (*s).tangent),
            vec4<f32>(length, depth, (*s).slack),
            looks,
        );
    }
}

// Finds the lines of edges that are too small to be seen, and whether there is a hole that
// is not.
fn find_specks(lane: u32, d: u32, base: u32) {
    if lane < 64u {
        atomicStore(&specks[lane], 0u);
    }
    if lane == 0u {
        atomicStore(&holes, 0u);
    }
    let lines = draws[d].line_count;
    for (var first = 0u; first < lines; first += 64u) {
        workgroupBarrier();
        atomicStore(&bits[lane], 0xffffffffu);
        workgroupBarrier();
        let at = draws[d].lines;
        var start = 0u;
        if first > 0u {
            start = topology[at + 2u * (first - 1u)];
        }
        let past = topology[at + 2u * (min(first + 64u, lines) - 1u)];
        for (var e = start + lane; e < past; e += LANES) {
            let edge = draws[d].edges + 5u * e;
            let box = 4u * (topology[edge + 4u] - first);
            for (var k = 0u; k < 2u; k++) {
                // In 1/1024 of a pixel, above 0.
                let p = vec2<i32>(round(projected[base + topology[edge + k]].xy * 1024.0));
                let low = vec2<u32>(p + 0x40000000);
                let high = vec2<u32>(0x40000000 - p);
                atomicMin(&bits[box], low.x);
                atomicMin(&bits[box + 1u], low.y);
                atomicMin(&bits[box + 2u], high.x);
                atomicMin(&bits[box + 3u], high.y);
            }
        }
        workgroupBarrier();
        let line = first + lane;
        if lane < 64u && line < lines {
            let box = 4u * lane;
            // The bounds cancel, modulo 2^32.
            let span = i32(0u - (atomicLoad(&bits[box]) + atomicLoad(&bits[box + 1u])
                + atomicLoad(&bits[box + 2u]) + atomicLoad(&bits[box + 3u])));
            if f32(span) < SPECK * 1024.0 {
                atomicOr(&specks[line >> 5u], 1u << (line & 31u));
            } else if topology[at + 2u * line + 1u] != 0u {
                atomicOr(&holes, 1u);
            }
        }
    }
    workgroupBarrier();
}

// Extracts the pieces of a mesh; gives the number of pieces so far.
fn extract(lane: u32, scene: Scene, d: u32, projections: u32, pool: u32, already: u32) -> u32 {
    let base = projections + draws[d].projected;
    var found = already;
    find_specks(lane, d, base);
    let open = atomicLoad(&holes) != 0u;
    let faces = draws[d].triangle_count;
    for (var first = 0u; first < faces; first += WINDOW) {
        workgroupBarrier();
        atomicStore(&bits[lane], 0u);
        workgroupBarrier();
        let past = min(first + WINDOW, faces);
        for (var face = first + lane; face < past; face += LANES) {
            let v = corners(d, face);
            let a = projected[base + v.x].w >= 0.0;
            if a != (projected[base + v.y].w >= 0.0) || a != (projected[base + v.z].w >= 0.0) {
                atomicOr(&bits[(face - first) >> 5u], 1u << ((face - first) & 31u));
            }
        }
        let crossed = count_bits(lane);
        for (var k = lane; k - lane < crossed; k += LANES) {
            var s: Segment;
            if k < crossed {
                s = silhouette(scene, d, base, first + chosen(k), open);
            }
            let sums = scan(lane, s.count);
            if found + sums.x + s.count <= MOST_PIECES {
                write(scene, &s, pool + found + sums.x, false);
            }
            found += sums.y;
        }
    }
    let edges = draws[d].edge_count;
    for (var e = lane; e - lane < edges; e += LANES) {
        var s: Segment;
        if e < edges {
            let at = draws[d].edges + 5u * e;
            let line = topology[at + 4u];
            if (atomicLoad(&specks[line >> 5u]) & (1u << (line & 31u))) == 0u {
                let ends = vec2<u32>(topology[at], topology[at + 1u]);
                let faces = vec2<u32>(topology[at + 2u], topology[at + 3u]);
                s = sharp(scene, d, base, ends, faces, open);
            }
        }
        let sums = scan(lane, s.count);
        if found + sums.x + s.count <= MOST_PIECES {
            write(scene, &s, pool + found + sums.x, true);
        }
        found += sums.y;
    }
    return found;
}
