//! Pictures of objects of any size and position by any camera; single precision compared
//! with rays in double precision.

use super::points::Points;
use glam::{DVec3, Vec3};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_scene::geom::{Affine, Mesh, Solid, Topology, cuboid, sphere};
use pcadlang_scene::render::{Camera, Channels, Contours, Frame, Projection};
use std::sync::Arc;

/// The largest relative error of a depth, for a surface whose normal is within 60 degrees
/// of the ray. For slanted surfaces, the position of the ray may also be off by
/// `PLACE_ERROR` pixels.
const DEPTH_ERROR: f64 = 1e-6;
const PLACE_ERROR: f64 = 1e-3;

fn ball(sides: u32) -> Solid {
    Solid::new(Arc::new(sphere(1.0, sides).unwrap()))
}

fn block() -> Solid {
    Solid::new(Arc::new(cuboid(DVec3::new(1.2, 0.8, 2.0)).unwrap()))
}

fn placed(solid: &Solid, translate: [f64; 3], rotate: [f64; 3], scale: f64) -> Solid {
    solid.placed(Affine::new(translate.into(), rotate.into(), DVec3::splat(scale)))
}

/// A triangle in world space.
struct Face([DVec3; 3]);

impl Face {
    fn all(solid: &Solid) -> Vec<Face> {
        let corners: Vec<DVec3> = solid.vertices().collect();
        let mut first = 0;
        let mut faces = Vec::new();
        for instance in solid.instances() {
            faces.extend(
                instance
                    .mesh
                    .topology
                    .triangles
                    .iter()
                    .map(|t| Face(t.map(|v| corners[first + v as usize]))),
            );
            first += instance.mesh.positions.len();
        }
        faces
    }

    /// Intersects the plane of the triangle with a ray (Möller and Trumbore 1997).
    /// Returns the distance along the ray, and the smallest barycentric coordinate, which
    /// is in 0 to 1/3 if the triangle is hit.
    fn hit(&self, eye: DVec3, ray: DVec3) -> Option<(f64, f64)> {
        let Face([a, b, c]) = *self;
        let (u, v, from) = (b - a, c - a, eye - a);
        let (p, q) = (ray.cross(v), from.cross(u));
        let det = u.dot(p);
        let (s, t) = (from.dot(p) / det, ray.dot(q) / det);
        (det != 0.0).then(|| (v.dot(q) / det, s.min(t).min(1.0 - s - t)))
    }

    fn normal(&self) -> DVec3 {
        let Face([a, b, c]) = *self;
        (b - a).cross(c - a).normalize_or_zero()
    }
}

/// Returns the ray through a point of the picture, parameterised by depth.
fn ray(camera: &Camera, x: f64, y: f64) -> (DVec3, DVec3) {
    let (near, far) = (camera.unproject(x, y, 0.0), camera.unproject(x, y, 1.0));
    (near, far - near)
}

/// Returns the depth and the face of the nearest hit beyond the near plane.
fn nearest<'a>(faces: &'a [Face], camera: &Camera, x: f64, y: f64) -> Option<(f64, &'a Face)> {
    let (eye, ray) = ray(camera, x, y);
    let hits = faces.iter().filter_map(|f| {
        f.hit(eye, ray).filter(|h| h.0 >= Camera::NEAR && h.1 >= 0.0).map(|h| (h.0, f))
    });
    hits.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Checks that the depths of a picture are those of rays, except where a ray a thousandth
/// of a pixel away would differ.
fn as_by_rays(solid: &Solid, camera: &Camera) -> Result<f64, String> {
    let (frame, faces) = (Frame::render(solid, camera, Channels::Depth), Face::all(solid));
    // For parallel rays, the error of a depth is relative to the farthest depth.
    let far = solid.vertices().map(|v| camera.project(v).2.abs()).fold(0.0, f64::max);
    let unit = |depth: f64| {
        if matches!(camera.projection, Projection::Pinhole { .. }) { depth } else { far }
    };
    let mut worst = 0.0f64;
    for row in 0..camera.height {
        for column in 0..camera.width {
            let (x, y) = (f64::from(column) + 0.5, f64::from(row) + 0.5);
            let got = f64::from(frame.depth[(row * camera.width + column) as usize]);
            let around = [
                (0.0, 0.0),
                (1.0, 0.0),
                (-1.0, 0.0),
                (0.0, 1.0),
                (0.0, -1.0),
                (1.0, 1.0),
                (1.0, -1.0),
                (-1.0, 1.0),
                (-1.0, -1.0),
            ];
            let depth = |(i, j): (f64, f64)| {
                nearest(&faces, camera, x + PLACE_ERROR * i, y + PLACE_ERROR * j)
                    .map_or(f64::INFINITY, |h| h.0)
            };
            let (eye, way) = ray(camera, x, y);
            let exact = nearest(&faces, camera, x, y);
            if let Some((expected, face)) = exact
                && got.is_finite()
                && way.normalize().dot(face.normal()).abs() > 0.5
            {
                let error = (got - expected).abs() / unit(expected);
                let beside =
                    faces.iter().any(|f| f.hit(eye, way).is_some_and(|h| h.1.abs() < 1e-3));
                if !beside {
                    worst = worst.max(error);
                }
            }
            let (least, most) = around
                .map(depth)
                .into_iter()
                .fold((f64::INFINITY, 0.0f64), |(l, m), d| (l.min(d), m.max(d)));
            let within =
                |depth: f64| if depth.is_finite() { DEPTH_ERROR * unit(depth) } else { 0.0 };
            if !(got >= least - within(least) && got <= most + within(most)) {
                return Err(format!("pixel {column}, {row}: {got}, rays {least} to {most}"));
            }
        }
    }
    if worst <= DEPTH_ERROR { Ok(worst) } else { Err(format!("a relative error of {worst:e}")) }
}

#[test]
fn single_precision_is_near_double_precision() {
    let mut points = Points::of("depth against rays");
    let mut worst = 0.0f64;
    let mut random = StreamKey::new(51, 0, Purpose::VALUES).stream(0, 0, 0);
    let shapes = [
        ball(16),
        block(),
        Solid::group(&[placed(&ball(8), [0.6, 0.3, 0.5], [0.0; 3], 0.7), block()]),
    ];
    for round in 0..90 {
        let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
        // From far away to intersecting the near plane and enclosing the camera.
        let scale = 10f64.powf(between(-1.0, 1.5));
        let away = [8.0 - 4.0 * scale, 8.0 - 1.5 * scale, 8.0 - 0.5 * scale][round % 3];
        let place = [between(-0.5, 0.5) * scale, between(-0.5, 0.5) * scale, away];
        let turn = [between(-3.0, 3.0), between(-3.0, 3.0), between(-3.0, 3.0)];
        let solid = placed(&shapes[round / 3 % 3], place, turn, scale);
        let mut camera = Camera::default_for(24, 18);
        if round % 5 == 0 {
            camera.projection =
                Projection::Orthographic { units_per_pixel: 0.1 * scale, cx: 12.0, cy: 9.0 };
        }
        // Faces of a closed body are visible from outside only: with the camera inside,
        // there would be nothing to see.
        let end = as_by_rays(&open(&solid), &camera);
        worst = worst.max(end.clone().unwrap_or(0.0));
        points.check(end.is_ok(), || {
            format!("round {round}, scale {scale}, at {place:?}: {}", end.unwrap_err())
        });
    }
    println!("the greatest relative error of a depth: {worst:e}");
    points.finish();
}

/// Returns the same solid without the flag that its faces enclose a body.
fn open(solid: &Solid) -> Solid {
    let instance = |i: &pcadlang_scene::geom::Instance| {
        let topology = Topology { encloses: false, ..(*i.mesh.topology).clone() };
        Solid::new(Arc::new(Mesh { topology: Arc::new(topology), ..(*i.mesh).clone() }))
            .placed(i.affine)
    };
    Solid::group(&solid.instances().iter().map(instance).collect::<Vec<_>>())
}

/// Checks that depths are positive, contours finite and both channels consistent; returns
/// the number of covered pixels.
fn sound(solid: &Solid, camera: &Camera) -> Result<usize, String> {
    let (frame, all) = (
        Frame::render(solid, camera, Channels::Depth),
        Frame::render(solid, camera, Channels::All),
    );
    if frame.depth.len() != camera.pixels() || frame.depth.iter().any(|d| d.is_nan()) {
        return Err("depths are missing or NaN".into());
    }
    if matches!(camera.projection, Projection::Pinhole { .. })
        && frame.depth.iter().any(|d| *d <= 0.0)
    {
        return Err("depths that are not above 0".into());
    }
    if frame.depth.iter().zip(&all.depth).any(|(a, b)| a.to_bits() != b.to_bits()) {
        return Err("depth differs with other channels".into());
    }
    if all.normal.iter().flatten().any(|n| !n.is_finite() || n.abs() > 1.001) {
        return Err("a normal is none".into());
    }
    let contours = Contours::of(solid, camera);
    let lists = [&contours.x, &contours.y, &contours.tx, &contours.ty, &contours.length];
    if lists.iter().any(|l| l.iter().any(|v| !v.is_finite())) {
        return Err("a contour is not finite".into());
    }
    Ok(frame.mask().filter(|m| *m).count())
}

/// Powers of ten from 1e-300 to 1e300.
fn magnitudes() -> Vec<f64> {
    [
        -300, -200, -150, -100, -46, -40, -38, -30, -20, -10, -6, -3, -1, 0, 1, 3, 6, 10, 18, 19,
        20, 30, 38, 39, 46, 77, 100, 150, 154, 200, 300,
    ]
    .iter()
    .map(|p| 10f64.powi(*p))
    .collect()
}

#[test]
fn objects_of_any_size_and_place_are_drawn() {
    let mut points = Points::of("objects of any size and place");
    let pinhole = Camera::default_for(40, 30);
    let parallel = Projection::Orthographic { units_per_pixel: 0.1, cx: 20.0, cy: 15.0 };
    let parallel = Camera { projection: parallel, ..pinhole };
    let nothing = |end: &Result<usize, String>| matches!(end, Ok(0));
    for camera in [&pinhole, &parallel] {
        for thing in [ball(16), block()] {
            for m in magnitudes() {
                let small = sound(&placed(&thing, [0.0; 3], [0.1, 0.2, 0.3], m), camera);
                // An object smaller than a pixel covers at most one.
                let right = small
                    .as_ref()
                    .is_ok_and(|seen| if m < 0.01 { *seen <= 1 } else { m != 1.0 || *seen > 20 });
                points.check(right, || format!("scaled by {m:e}: {small:?}"));
                let wall = sound(&placed(&thing, [0.0, 0.0, -2.0 * m], [0.0; 3], m), camera);
                // A wall in front of the camera that is larger than the picture fills it;
                // one that is a thousand million units away is out of sight.
                let right = wall.as_ref().is_ok_and(|seen| match m {
                    1e3..1e8 => *seen == camera.pixels(),
                    1e9.. => *seen == 0,
                    _ => true,
                });
                points.check(right, || format!("a wall, scaled by {m:e}: {wall:?}"));
                for away in [[m, 0.0, 0.0], [0.0, -m, 0.0], [0.0, 0.0, m], [0.0, 0.0, -m]] {
                    let end = sound(&placed(&thing, away, [0.0; 3], 1.0), camera);
                    let right = end.is_ok() && (m < 100.0 || away[2] < 0.0 || nothing(&end));
                    points.check(right, || format!("at {away:?}: {end:?}"));
                }
                let end = sound(&placed(&thing, [0.0; 3], [m, -m, m], 1.0), camera);
                points.check(end.as_ref().is_ok_and(|seen| *seen > 20), || {
                    format!("turned by {m:e}: {end:?}")
                });
                let flat =
                    thing.placed(Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(1.0, m, 1.0)));
                let end = sound(&flat, camera);
                points.check(end.is_ok(), || format!("one axis scaled by {m:e}: {end:?}"));
            }
            for odd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let ends = [
                    sound(&placed(&thing, [odd, 0.0, 0.0], [0.0; 3], 1.0), camera),
                    sound(&placed(&thing, [0.0; 3], [0.0, odd, 0.0], 1.0), camera),
                    sound(&placed(&thing, [0.0; 3], [0.0; 3], odd), camera),
                ];
                for (i, end) in ends.iter().enumerate() {
                    points.check(nothing(end), || format!("{odd} as argument {i}: {end:?}"));
                }
            }
        }
    }
    points.finish();
}

#[test]
fn meshes_of_any_numbers_are_drawn() {
    let mut points = Points::of("meshes of any numbers");
    let camera = Camera::default_for(40, 30);
    let corners = [
        Vec3::new(-0.7, -0.6, 0.2),
        Vec3::new(0.8, -0.5, -0.4),
        Vec3::new(0.1, 0.9, 0.3),
        Vec3::new(0.2, 0.1, 7.0),
    ];
    let raw = |positions: Vec<Vec3>| {
        let triangles = vec![[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]];
        let normals = vec![Vec3::Z; positions.len()];
        let topology = Topology {
            parts: vec![0; triangles.len()],
            triangles,
            part_count: 1,
            ..Topology::default()
        };
        Solid::new(Arc::new(Mesh::of(positions, normals, Arc::new(topology))))
    };
    let odd = [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        f32::MIN,
        1e30,
        1e19,
        1e-45,
        1e-30,
        8.0,
        7.999,
    ];
    for value in odd {
        for vertex in 0..4 {
            for axis in 0..3 {
                let mut positions = corners.to_vec();
                positions[vertex][axis] = value;
                let end = sound(&raw(positions.clone()), &camera);
                points.check(end.is_ok(), || {
                    format!("{value} at {axis} of vertex {vertex}: {end:?}")
                });
                let made = Mesh::new(
                    positions,
                    vec![[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]],
                    vec![0; 4],
                );
                points.check(made.is_ok() == value.is_finite(), || {
                    format!("{value}: {:?}", made.err())
                });
            }
        }
    }
    for (i, bad) in
        [0.0, -1.0, 1e-31, 1e7, f64::NAN, f64::INFINITY, f64::NEG_INFINITY].into_iter().enumerate()
    {
        points.check(sphere(bad, 16).is_err(), || format!("a radius of {bad}, {i}"));
        points.check(cuboid(DVec3::new(1.0, bad, 1.0)).is_err(), || format!("an edge of {bad}"));
    }
    points.finish();
}

#[test]
fn any_camera_gives_a_picture() {
    let mut points = Points::of("cameras");
    let thing = Solid::group(&[ball(16), placed(&block(), [0.5, 0.0, 1.0], [0.3, 0.2, 0.1], 0.5)]);
    for m in magnitudes() {
        for sign in [1.0, -1.0] {
            let plain = Camera::default_for(40, 30);
            let Projection::Pinhole { focal_px, cx, cy } = plain.projection else { panic!() };
            let cameras = [
                Camera { projection: Projection::Pinhole { focal_px: sign * m, cx, cy }, ..plain },
                Camera { projection: Projection::Pinhole { focal_px, cx: sign * m, cy }, ..plain },
                Camera {
                    projection: Projection::Orthographic { units_per_pixel: sign * m, cx, cy },
                    ..plain
                },
                Camera { eye: DVec3::new(0.0, 0.0, sign * m), ..plain },
                Camera { eye: DVec3::new(sign * m, 0.0, 8.0), ..plain },
            ];
            for (i, camera) in cameras.iter().enumerate() {
                let end = sound(&thing, camera);
                points.check(end.is_ok(), || format!("{} as number {i}: {end:?}", sign * m));
            }
        }
    }
    for odd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0] {
        let plain = Camera::default_for(40, 30);
        let cameras = [
            Camera {
                projection: Projection::Pinhole { focal_px: odd, cx: 20.0, cy: 15.0 },
                ..plain
            },
            Camera {
                projection: Projection::Orthographic { units_per_pixel: odd, cx: 20.0, cy: 15.0 },
                ..plain
            },
            Camera { eye: DVec3::new(0.0, odd, 8.0), ..plain },
            Camera { forward: DVec3::splat(odd), ..plain },
        ];
        for (i, camera) in cameras.iter().enumerate() {
            let end = sound(&thing, camera);
            points.check(end.is_ok(), || format!("{odd} as number {i}: {end:?}"));
        }
    }
    points.finish();
}

#[test]
fn pictures_of_any_size_are_drawn() {
    let mut points = Points::of("sizes of pictures");
    let wall = placed(&block(), [0.0, 0.0, -1000.0], [0.0; 3], 1000.0);
    for (width, height) in
        [(1, 1), (1, 2), (3, 1), (1, 8192), (8192, 1), (8192, 8), (2, 8192), (513, 511)]
    {
        let camera = Camera::default_for(width, height);
        let end = sound(&wall, &camera);
        points.check(end == Ok(camera.pixels()), || format!("{width} x {height}: {end:?}"));
        let end = sound(&placed(&ball(24), [0.0; 3], [0.0; 3], 2.0), &camera);
        points.check(end.as_ref().is_ok_and(|seen| *seen > 0), || {
            format!("{width} x {height}: {end:?}")
        });
        let frame = Frame::render(&wall, &camera, Channels::Depth);
        // The front of the wall is at 0, which is 8 units from the camera.
        let right = frame.depth.iter().all(|d| (f64::from(*d) / 8.0 - 1.0).abs() < DEPTH_ERROR);
        points.check(right, || format!("{width} x {height}: {:?}", frame.depth.first()));
    }
    // The largest picture: the visible area of a disc, and the depth at its middle.
    let camera = Camera::default_for(8192, 8192);
    let frame = Frame::render(&ball(64), &camera, Channels::Depth);
    let middle = frame.depth[4096 * 8192 + 4096];
    points.check((middle - 7.0).abs() < 0.02, || format!("a depth of {middle}"));
    let seen = frame.mask().filter(|m| *m).count() as f64 / camera.pixels() as f64;
    // The outline of a sphere of radius 1 at distance 8 has radius 8 / sqrt(63) at the
    // depth of its centre, where the picture is 4.4 units wide.
    let expected = std::f64::consts::PI * (64.0 / 63.0) / (4.4 * 4.4);
    points.check((seen / expected - 1.0).abs() < 0.01, || {
        format!("a share of {seen}, expected {expected}")
    });
    points.finish();
}
