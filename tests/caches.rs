//! Whatever is kept for later depends on all that it was made from: each input alone is changed, and what comes out with everything
//! warm from the old input is what comes out on a thread, and for data, that has seen nothing, to the last bit.
//! docs/reliability.md lists what is kept, by what it is told, and the test here that changes that.

#[path = "../examples/shipped/mod.rs"]
mod shipped;

use glam::DVec3;
use pcadlang::geom::armature::{JointPose, Rules, Turn};
use pcadlang::geom::{Affine, Caps, Mesh, Profile, Solid, lathe, sphere};
use pcadlang::lang::builtins::scene::{DepthValue, ImageValue, MaskValue};
use pcadlang::lang::value::Value;
use pcadlang::render::{Camera, Channels, Contours, Frame, Projection, View};
use pcadlang::trace::Draws;
use pcadlang::vision::{DepthMap, Mask, Photo};
use pcadlang::{Model, Program};
use std::sync::Arc;

/// What a thread that has done nothing before makes of it.
fn afresh<T: Send>(make: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|s| s.spawn(make).join().unwrap())
}

fn contour_bits(c: &Contours) -> Vec<u32> {
    let lists = [&c.x, &c.y, &c.tx, &c.ty, &c.length];
    [c.width, c.height].into_iter().chain(lists.into_iter().flatten().map(|v| v.to_bits())).collect()
}

fn frame_bits(f: &Frame) -> Vec<u32> {
    let normals = f.normal.iter().flatten().chain(&f.depth).map(|v| v.to_bits());
    [f.width, f.height].into_iter().chain(normals).chain(f.part.iter().map(|p| u32::from(*p))).collect()
}

fn mesh_bits(m: &Mesh) -> String {
    let numbers = m.positions.iter().chain(&m.normals).map(|v| v.to_array().map(f32::to_bits));
    format!("{:?} {:?}", numbers.collect::<Vec<_>>(), m.topology)
}

fn ball(at: f64, radius: f64) -> Solid {
    let mesh = Arc::new(sphere(radius, 12).unwrap());
    Solid::new(mesh).placed(Affine::new(DVec3::new(at, 0.3 * at, 0.2 * at), DVec3::ZERO, DVec3::ONE))
}

/// Cameras that differ from the first in one field each, and what that is.
fn cameras(projection: Projection) -> Vec<(String, Camera)> {
    let base = Camera { projection, ..Camera::default_for(72, 56) };
    let mut all = vec![("nothing".to_owned(), base)];
    let mut add = |what: String, change: &dyn Fn(&mut Camera)| {
        let mut other = base;
        change(&mut other);
        all.push((what, other));
    };
    let vectors: [(&str, fn(&mut Camera) -> &mut DVec3); 4] =
        [("eye", |c| &mut c.eye), ("right", |c| &mut c.right), ("up", |c| &mut c.up), ("forward", |c| &mut c.forward)];
    for (name, of) in vectors {
        for axis in 0..3 {
            add(format!("{name}[{axis}]"), &|c| of(c)[axis] += 0.03);
        }
    }
    add("width".into(), &|c| c.width += 1);
    add("height".into(), &|c| c.height -= 20);
    for k in 0..3 {
        add(format!("number {k} of the projection"), &|c| {
            c.projection = match c.projection {
                Projection::Pinhole { mut focal_px, mut cx, mut cy } => {
                    *[&mut focal_px, &mut cx, &mut cy][k] += 1.3;
                    Projection::Pinhole { focal_px, cx, cy }
                }
                Projection::Orthographic { mut units_per_pixel, mut cx, mut cy } => {
                    *[&mut units_per_pixel, &mut cx, &mut cy][k] *= 1.05;
                    Projection::Orthographic { units_per_pixel, cx, cy }
                }
            };
        });
    }
    add("kind of the projection".into(), &|c| {
        c.projection = match c.projection {
            Projection::Pinhole { focal_px, cx, cy } => {
                Projection::Orthographic { units_per_pixel: focal_px.recip(), cx, cy }
            }
            Projection::Orthographic { units_per_pixel, cx, cy } => {
                Projection::Pinhole { focal_px: units_per_pixel.recip(), cx, cy }
            }
        };
    });
    all
}

/// Contours drawn at once, of layers, and before a backdrop, through views with frames and without.
#[test]
fn pictures_of_another_camera() {
    let members: Vec<Solid> = (0..8).map(|i| ball(0.4 * f64::from(i) - 1.4, 0.5)).collect();
    let still = Solid::group(&members);
    // One that moves before others that stand still, which makes a backdrop.
    let moved = Solid::group(&[&members[..3], &[ball(-0.1, 0.8)], &members[4..]].concat());
    let solids = [("at once", &members[0], &members[1]), ("of parts", &still, &moved)];
    let (cx, cy) = (36.0, 28.0);
    let projections =
        [Projection::Pinhole { focal_px: 130.0, cx, cy }, Projection::Orthographic { units_per_pixel: 0.06, cx, cy }];
    for ((how, a, b), projection) in solids.iter().flat_map(|s| projections.map(|p| (s, p))) {
        let cameras = cameras(projection);
        let base = cameras[0].1;
        for (what, camera) in &cameras {
            let seen = |eye: &Camera| {
                (contour_bits(&Contours::of(a, eye)), frame_bits(&Frame::render(a, eye, Channels::Depth)))
            };
            let differs = seen(camera) != seen(&base);
            assert!(differs == (what != "nothing"), "{how}, {what}: the picture shows nothing of it");
            for (solid, eye) in [(a, &base), (b, &base), (a, &base), (a, camera), (b, camera), (a, camera), (a, &base)]
            {
                let here = contour_bits(&Contours::of(solid, eye));
                let there = afresh(|| contour_bits(&Contours::of(solid, eye)));
                assert!(here == there, "{how}: contours with another {what} of the camera");
                let here = frame_bits(&Frame::render(solid, eye, Channels::All));
                let there = afresh(|| frame_bits(&Frame::render(solid, eye, Channels::All)));
                assert!(here == there, "{how}: frames with another {what} of the camera");
                let view = || View::new((*solid).clone(), *eye);
                let change = |v: &View| {
                    let change = v.change(72);
                    change.as_ref().as_ref().map(|c| (contour_bits(&c.moving), c.count))
                };
                let (view, other) = (view(), view());
                let counted = change(&view).map_or(view.contours(72).len(), |c| c.1);
                assert_eq!(counted, afresh(|| other.contours(72).len()), "{how}: what changed with another {what}");
            }
        }
    }
}

/// The kind of projection alone: a scene so large that one number is good as focal length and as size of a pixel.
#[test]
fn pictures_of_another_kind_of_camera() {
    let by = Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::splat(800.0));
    let members: Vec<Solid> = (0..6).map(|i| ball(0.4 * f64::from(i) - 1.0, 0.5).placed(by)).collect();
    let moved = Solid::group(&[&members[..5], &[ball(1.1, 0.3).placed(by)]].concat());
    let still = Solid::group(&members);
    let (scale, cx, cy) = (80.0, 36.0, 28.0);
    let kinds =
        [Projection::Pinhole { focal_px: scale, cx, cy }, Projection::Orthographic { units_per_pixel: scale, cx, cy }];
    let mut seen = Vec::new();
    for i in 0..8 {
        let base = Camera { projection: kinds[i % 2], ..Camera::default_for(72, 56) };
        let camera = Camera { eye: DVec3::new(0.0, 0.0, 6400.0), ..base };
        for solid in [&still, &moved, &still] {
            let here = contour_bits(&Contours::of(solid, &camera));
            assert!(here == afresh(|| contour_bits(&Contours::of(solid, &camera))), "another kind of projection");
            seen.push(here);
        }
    }
    assert!(seen[0] != seen[3] && seen[0] != seen[1] && seen[0].len() > 100);
}

/// Another mesh at the same place, in the memory of one that is gone; another placement by one number.
#[test]
fn pictures_of_another_mesh_and_placement() {
    let camera = Camera::default_for(64, 64);
    let rest: Vec<Solid> = (0..5).map(|i| ball(0.5 * f64::from(i) - 1.0, 0.4)).collect();
    let with = |one: &Solid| Solid::group(&[&rest[..], &[one.clone()]].concat());
    let check = |what: &str, solid: &Solid| {
        let here = contour_bits(&Contours::of(solid, &camera));
        assert!(here == afresh(|| contour_bits(&Contours::of(solid, &camera))), "{what}");
        here
    };
    let mut seen = Vec::new();
    for i in 0..40 {
        seen.push(check("another mesh", &with(&ball(0.1, 0.6 + 0.01 * f64::from(i % 20)))));
    }
    assert!((1..20).all(|i| seen[i] != seen[i - 1] && seen[i] == seen[i + 20]));
    let mesh = Arc::new(sphere(0.7, 16).unwrap());
    let base = Affine::new(DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.1, 0.2, 0.3), DVec3::ONE);
    let placed = |by: Affine| with(&Solid::new(mesh.clone()).placed(by));
    let first = check("a placement", &placed(base));
    for k in 0..12 {
        let mut numbers = base.0.to_cols_array();
        numbers[k] += 0.05;
        let other = check("another placement", &placed(Affine(glam::DAffine3::from_cols_array(&numbers))));
        assert!(other != first, "number {k} of a placement is not seen");
        assert!(check("the placement again", &placed(base)) == first);
    }
    // One field of the mesh itself.
    let fields: [fn(&mut Mesh); 4] = [
        |m| m.positions[40].x += 0.2,
        |m| m.normals.iter_mut().for_each(|n| *n = -*n),
        |m| drop(Arc::make_mut(&mut m.topology).triangles.truncate(60)),
        |m| Arc::make_mut(&mut m.topology).encloses ^= true,
    ];
    for (k, field) in fields.iter().enumerate() {
        let mut other = Mesh::clone(&mesh);
        field(&mut other);
        check(&format!("a mesh with another field {k}"), &with(&Solid::new(Arc::new(other)).placed(base)));
        assert!(check("the mesh again", &placed(base)) == first);
    }
}

/// Topologies that surfaces of revolution share.
#[test]
fn surfaces_of_other_numbers() {
    let profile = |points: usize, top: f64| {
        let y: Vec<f64> = (0..points).map(|i| i as f64 / (points - 1) as f64).collect();
        let r = y.iter().map(|y| 0.5 + (top - 0.5) * y).collect();
        Profile { y, r }
    };
    let round = |points: usize, least: f64| {
        let at = |i: usize| std::f64::consts::PI * i as f64 / (points - 1) as f64;
        let r = (0..points).map(|i| if i % (points - 1) == 0 { least } else { libm::sin(at(i)).max(least) }).collect();
        Profile { y: (0..points).map(|i| -libm::cos(at(i))).collect(), r }
    };
    let above = |p: Profile, by: f64| Profile { y: p.y.iter().map(|y| y + by).collect(), ..p };
    let one = || vec![profile(6, 0.4)];
    type Asked = (&'static str, Vec<Profile>, u32, f64, Caps);
    let all: Vec<Asked> = vec![
        ("the first", one(), 12, 0.0, Caps::Both),
        ("sides", one(), 13, 0.0, Caps::Both),
        ("points", vec![profile(7, 0.4)], 12, 0.0, Caps::Both),
        ("a pole", vec![profile(6, 0.0)], 12, 0.0, Caps::Both),
        ("a wall", one(), 12, 0.05, Caps::Both),
        ("the lower cap", one(), 12, 0.0, Caps::Bottom),
        ("the upper cap", one(), 12, 0.0, Caps::Top),
        ("no cap", one(), 12, 0.0, Caps::None),
        ("two parts", vec![profile(6, 0.4), above(profile(6, 0.4), 1.0)], 12, 0.0, Caps::Both),
        ("two parts that meet", vec![profile(6, 0.5), above(profile(6, 0.5), 1.0)], 12, 0.0, Caps::Both),
        ("two parts that meet at an angle", vec![profile(6, 0.5), above(profile(6, 2.0), 1.0)], 12, 0.0, Caps::Both),
        ("two parts that bend", vec![profile(6, 0.5), above(profile(6, 0.2), 1.0)], 12, 0.0, Caps::Both),
        ("a dome", vec![round(9, 0.0)], 12, 0.0, Caps::None),
        ("a round tube", vec![round(9, 0.2)], 12, 0.0, Caps::None),
        ("parts of other numbers", vec![profile(5, 0.5), above(profile(7, 0.5), 1.0)], 12, 0.0, Caps::Both),
        ("radii", vec![profile(6, 0.3)], 12, 0.0, Caps::Both),
    ];
    let make = |(_, parts, sides, thickness, caps): &Asked| {
        // A wall is of a vessel that is open.
        let caps = if *thickness > 0.0 { Caps::Bottom } else { *caps };
        lathe(parts, *sides, *thickness, caps).map(|m| mesh_bits(&m)).unwrap_or_else(|e| format!("{e}"))
    };
    for a in &all {
        for b in &all {
            make(a);
            let here = make(b);
            assert!(here == afresh(|| make(b)), "{} after {}", b.0, a.0);
            assert_eq!(here == make(a), a.0 == b.0, "{} and {}", a.0, b.0);
        }
    }
    // Of as many rings, and another number of parts.
    let ball = || mesh_bits(&sphere(0.7, 12).unwrap());
    for points in 3..30 {
        let egg = ("an egg", vec![round(points, 0.0)], 12, 0.0, Caps::Both);
        for _ in 0..2 {
            assert!(
                ball() == afresh(ball) && make(&egg) == afresh(|| make(&egg)),
                "a sphere and an egg of {points} rings"
            );
        }
    }
}

/// Parts of bodies that earlier poses moved alike.
#[test]
fn bodies_in_other_poses() {
    let body = shipped::human("human.lod2").unwrap();
    let stout = Arc::new(body.shaped(&[("heavy", 0.7)]).unwrap());
    let rest: Vec<JointPose> =
        (0..body.rig().joints().len()).map(|i| JointPose::turned(DVec3::new(0.1, 0.02 * i as f64, 0.0))).collect();
    let bits = |body: &Arc<_>, pose: &[JointPose], rules: &Rules| -> Vec<String> {
        let posed = pcadlang::geom::armature::Armature::posed(body, pose, rules).unwrap();
        let landmarks = posed.landmarks().iter().map(|l| format!("{:?}", l.position.to_array().map(f64::to_bits)));
        let meshes = posed.instances().iter().map(|i| {
            let numbers = i.mesh.positions.iter().chain(&i.mesh.normals).flat_map(|v| v.to_array());
            numbers.fold(0u64, |h, x| (h ^ u64::from(x.to_bits())).wrapping_mul(0x100000001b3)).to_string()
        });
        landmarks.chain(meshes).collect()
    };
    let rules = Rules::default();
    let first = bits(&body, &rest, &rules);
    let changes: [(&str, fn(&mut JointPose)); 11] = [
        ("x of the turn", |p| p.turn = turned(p.turn, DVec3::X * 0.01)),
        ("y of the turn", |p| p.turn = turned(p.turn, DVec3::Y * 0.01)),
        ("z of the turn", |p| p.turn = turned(p.turn, DVec3::Z * 0.01)),
        ("x of the location", |p| p.location.x += 0.01),
        ("z of the location", |p| p.location.z += 0.01),
        ("the location, hardly", |p| p.location.y += 1e-7),
        ("the turn in the last bit", |p| p.turn = turned(p.turn, DVec3::X * 1e-17)),
        ("-0", |p| p.turn = turned(p.turn, DVec3::Z * -0.0)),
        ("the location", |p| p.location.y += 0.01),
        ("the scale", |p| p.scale.x += 0.01),
        ("the scale, hardly", |p| p.scale.x += f64::EPSILON),
    ];
    // At rest a location moves one number of a transform.
    let still = vec![JointPose::REST; rest.len()];
    for joint in (0..rest.len()).step_by(3) {
        for (what, change) in changes {
            let mut pose = still.clone();
            bits(&body, &pose, &rules);
            change(&mut pose[joint]);
            assert!(
                bits(&body, &pose, &rules) == afresh(|| bits(&body, &pose, &rules)),
                "{joint}, at rest: another {what}"
            );
            let mut pose = rest.clone();
            bits(&body, &pose, &rules);
            change(&mut pose[joint]);
            let here = bits(&body, &pose, &rules);
            assert!(here == afresh(|| bits(&body, &pose, &rules)), "joint {joint}: another {what}");
            assert!(bits(&body, &rest, &rules) == first, "joint {joint}: {what}, and back");
            assert!(
                here != first || ["-0", "the turn in the last bit"].contains(&what) || what.contains("hardly"),
                "{what}"
            );
        }
    }
    // Where turns are about nothing, signs of 0 are all that differs.
    for sign in [0.0, -0.0, 0.0] {
        let pose = vec![JointPose::turned(DVec3::splat(sign)); rest.len()];
        assert!(bits(&body, &pose, &rules) == afresh(|| bits(&body, &pose, &rules)), "turned by {sign}");
    }
    let other = bits(&stout, &rest, &rules);
    assert!(other != first && other == afresh(|| bits(&stout, &rest, &rules)) && bits(&body, &rest, &rules) == first);
}

fn turned(turn: Turn, by: DVec3) -> Turn {
    match turn {
        Turn::Vector(v) => Turn::Vector(v + by),
        other => other,
    }
}

/// Coarser versions of a mesh, by how far they may be off, at any size and from anywhere.
#[test]
fn meshes_at_other_details() {
    let part = Profile { y: vec![-1.0, -0.6, -0.1, 0.4, 0.9], r: vec![0.3, 0.6, 0.65, 0.5, 0.2] };
    let make = || Solid::lathe(std::slice::from_ref(&part), 48, 0.0, Caps::Both).unwrap();
    let shared = make();
    let near = Camera { eye: DVec3::new(0.0, 0.0, 5.0), ..Camera::default_for(200, 200) };
    for detail in [0.0, 0.2, 1.0, 4.0, 0.5, 0.2, 0.0] {
        for size in [32, 200, 64] {
            for camera in [Camera::default_for(200, 200), near] {
                let see = |solid: Solid| {
                    let view = View::with_detail(solid, camera, detail);
                    (contour_bits(&view.contours(size)), frame_bits(&view.depth(size)), view.triangles(size))
                };
                let here = see(shared.clone());
                assert!(here == afresh(|| see(make())), "detail {detail} at {size} pixels");
            }
        }
    }
}

fn inside(i: u32, width: u32) -> bool {
    let (x, y) = (f64::from(i % width) - 50.0, f64::from(i / width) - 30.0);
    x * x + y * y < 400.0
}

const SIZE: [u32; 2] = [96, 64];

/// What is observed, made anew so that it has nothing prepared.
fn observed(kind: &str) -> Value {
    let [w, h] = SIZE;
    match kind {
        "mask" => Value::object(MaskValue::new(Mask::new(w, h, (0..w * h).map(|i| inside(i, w)).collect()).unwrap())),
        "depth" => {
            let depth = (0..w * h).map(|i| if inside(i, w) { 7.0 + i as f32 * 1e-4 } else { f32::INFINITY });
            Value::object(DepthValue::new(DepthMap::new(w, h, depth.collect()).unwrap()))
        }
        _ => {
            let colour = |x: u32, y: u32| {
                let noise = (x * 7919 + y * 104_729 + x * y) % 97;
                let base = if inside(y * w + x, w) { [150, 60, 50] } else { [70, 110, 140] };
                image::Rgb(base.map(|b: u32| (b + noise) as u8))
            };
            Value::object(ImageValue::photo(Photo::from_rgb(image::RgbImage::from_fn(w, h, colour)).unwrap()))
        }
    }
}

/// Writes `<base,step>` as base, or base + step if p[i] is 1, `<a|b>` as one or the other; gives how many.
fn written(text: &str) -> (String, usize) {
    let (mut out, mut count, mut rest) = (String::new(), 0, text);
    while let Some((before, after)) = rest.split_once('<') {
        let (one, after) = after.split_once('>').unwrap();
        let (a, b) = one.split_once([',', '|']).unwrap();
        out.push_str(before);
        match one.contains('|') {
            true => out += &format!("(if p[{count}] > 0.5 {{ {b} }} else {{ {a} }})"),
            false => out += &format!("({a} + {b} * step(p[{count}] - 0.5))"),
        }
        (count, rest) = (count + 1, after);
    }
    (out + rest, count)
}

const SCENE: &str = "
    let eye = scene.camera(position = [<0,0.1>, <0,0.1>, <8,0.2>], look_at = [<0,0.1>, <0,0.1>, <0,0.3>],
        up = [<0,0.1>, 1, <0,0.1>], focal = <1.8,0.05>, width = <96,1>, height = <64,1>);
    let h = linspace(-1, 1, <8,1>);
    let vase = scene.lathe({ y: <1,0.1> * h, r: <0.6,0.1> + 0.25 * sin(2.5 * h) }, sides = <16,2>);
    let ball = scene.affine(translate = [<1,0.1>, <0.5,0.1>, <0.3,0.1>]) * scene.sphere(<0.4,0.1>, sides = <12,2>);
    let rest = scene.group([scene.box([1, 0.4, 0.3]), scene.affine(translate = [-1.2, 0.4, 0]) * scene.sphere(0.3)]);
    let placed = scene.affine(translate = [<0,0.1>, <0,0.1>, <0,0.1>], rotate = [<0.1,0.1>, <0.2,0.1>, <0.4,0.1>],
        scale = <1,0.05>) * scene.group([vase, ball, rest, scene.affine(translate = [0, -1, 0]) * scene.sphere(0.2)]);
    let view = scene.render(placed, camera = eye, detail = <0,0.5>);";

/// What is compared, with what, by what.
const COMPARED: [(&str, &str); 6] = [
    (
        "image",
        "scene.contour(view, size = <64,8>, foreground = <0.75,-0.1>, sd = <0.4,0.1>, truncate = <3.3,1>, credit = <2,1>, \
         weight = <0.5,0.1>) = seen",
    ),
    (
        "image",
        "scene.chamfer(view, sigma = <3,1>, mode = <\"mean\"|\"sum\">, symmetric = <false|true>, truncate = <20,-15>, \
         oriented = <1,1>, size = <64,8>) = seen",
    ),
    (
        "image",
        "scene.chamfer(view, sigma = 3) = scene.edges(seen, size = <256,-64>, smooth = <1.6,1>, strength = <0.4,0.3>)",
    ),
    ("mask", "scene.mask(view, eps_in = <0.05,0.05>, eps_out = <0.05,0.05>, size = <64,8>) = seen"),
    (
        "depth",
        "scene.depth(view, sd = <0.2,0.1>, outlier = <0.05,0.05>, near = <0,1>, far = <100,10>, size = <64,8>) = seen",
    ),
    (
        "image",
        "scene.region(view, power = <0.05,0.05>, tiles = <8,-3>, tile_power = <0.1,0.1>, colours = <32,-16>, \
         groups = <\"silhouette\"|\"parts\">, shading = <0,0.1>, size = <64,8>) = seen",
    ),
];

fn program(kind: &str, compared: &str) -> (Model, usize) {
    let (text, count) = written(&format!("{SCENE} observe {compared};"));
    let data = if kind == "image" { "data seen: image;".into() } else { format!("data seen = {kind}();") };
    let text = format!("include \"std/scene.pcad\" as scene; {data} assume p ~ iid(normal(0, 1), {count}); {text}");
    let model = Program::parse(&text).map(|p| p.observe("seen", observed(kind))).and_then(Program::compile);
    (model.unwrap_or_else(|e| panic!("{e}\n{text}")), count)
}

fn put(t: &mut pcadlang::trace::Trace, address: &str, v: Value) {
    t.set(address, v, Draws::default()).unwrap_or_else(|e| panic!("{address}: {e}"));
}

/// Every argument of cameras, shapes, placements, views and comparators alone.
#[test]
fn scores_of_other_arguments() {
    for (kind, compared) in COMPARED {
        let (model, count) = program(kind, compared);
        let mut here = model.simulate(1, 0).unwrap_or_else(|e| panic!("{compared}: {e}"));
        let from_scratch = |p: Vec<f64>| {
            afresh(|| {
                let mut there = program(kind, compared).0.simulate(1, 0).unwrap();
                put(&mut there, "@p", Value::array(p));
                there.log_likelihood()
            })
        };
        put(&mut here, "@p", Value::array(vec![0.0; count]));
        let base = here.log_likelihood();
        assert_eq!(base.to_bits(), from_scratch(vec![0.0; count]).to_bits(), "{compared}");
        let mut shows = 0;
        for k in 0..count {
            let address = format!("@p[{k}]");
            put(&mut here, &address, 1.0.into());
            let mut p = vec![0.0; count];
            p[k] = 1.0;
            let (found, expected) = (here.log_likelihood(), from_scratch(p));
            assert_eq!(
                found.to_bits(),
                expected.to_bits(),
                "{compared}: argument {k}: {found}, from scratch {expected}"
            );
            shows += usize::from(found.to_bits() != base.to_bits());
            put(&mut here, &address, 0.0.into());
            assert_eq!(here.log_likelihood().to_bits(), base.to_bits(), "{compared}: argument {k} and back");
        }
        // A few say nothing of this picture: the depth of the point looked at, a shift along the line of sight, levels of detail.
        println!("{shows} of {count} show: {compared}");
        assert!(shows + 5 >= count, "{compared}: {shows} of {count} arguments change the score");
    }
}
