//! Programs that see through the cameras of files: what a lens distorts is taken out of what was
//! observed, once, and the lens of a photograph is that of its default view.

use pcadlang::{Program, Value};
use pcadlang_library::scene::{CameraValue, DepthValue, ImageValue, KeypointsValue, MaskValue};
use pcadlang_scene::cameras::{Asked, CameraFile, Seen};
use pcadlang_scene::render::{Camera, Projection};
use pcadlang_scene::vision::keypoints::{Keypoint, Keypoints};
use pcadlang_scene::vision::{DepthMap, Hint, Mask, Photo, npy, photo};

const PROGRAM: &str = "include \"std/scene.pcad\" as scene;
data seen: mask; data deep: depth; data photo: image; data joints: keypoints;
assume x ~ normal(0, 1);
assume view = scene.render(scene.affine(translate = [x, 0.9, 0]) * scene.sphere(0.8));
observe scene.mask(view, eps_in = 0.02, eps_out = 0.02, size = 160) = seen;";

/// A barrel, as a wide lens has it.
const LENS: &str = "camera_matrix: [150, 0, 79.5, 0, 150, 59.5, 0, 0, 1]
distortion_coefficients: [-0.3, 0.1, 0, 0]
image_width: 160
image_height: 120
";

fn file(text: &str) -> CameraFile {
    let alone = |_: &str| Err("missing".to_owned());
    CameraFile::read("camera.yaml", text.as_bytes(), &Asked::default(), &alone).unwrap()
}

/// What the lens sees of the sphere at 1.2.
fn distorted(seen: &Seen) -> Vec<bool> {
    let lens = seen.lens.clone().unwrap();
    let centre = glam::DVec3::new(1.2, 0.9, 0.0);
    let camera = &seen.camera;
    let sees = |i: u32, j: u32| {
        let at = lens.undistorted([f64::from(i) + 0.5, f64::from(j) + 0.5]).unwrap();
        let ray = (camera.unproject(at[0], at[1], 1.0) - camera.eye).normalize();
        let to = centre - camera.eye;
        (to - ray * to.dot(ray)).length() < 0.8
    };
    (0..120).flat_map(|j| (0..160).map(move |i| (i, j))).map(|(i, j)| sees(i, j)).collect()
}

fn observed(program: Program, on: &[bool]) -> Program {
    let mask = Mask::new(160, 120, on.to_vec()).unwrap();
    let depth = on.iter().map(|on| if *on { 4.0 } else { f32::INFINITY }).collect();
    let depth = DepthMap::new(160, 120, depth).unwrap();
    let grey = |on: &bool| [if *on { 255 } else { 0 }; 3];
    let pixels = on.iter().flat_map(grey).collect();
    let photo = Photo::from_rgb(image::RgbImage::from_raw(160, 120, pixels).unwrap()).unwrap();
    let joint = Keypoint::new("nose", [130.5, 20.5], 1.0);
    let hint = Hint { at: vec![[130.5, 20.5]], ..Hint::default() };
    program
        .observe("seen", Value::object(MaskValue::new(mask)))
        .observe("deep", Value::object(DepthValue::new(depth)))
        .observe("photo", Value::object(ImageValue::photo(photo).with_hint(hint)))
        .observe("joints", Value::object(KeypointsValue(Keypoints::new(vec![joint]).unwrap())))
}

#[test]
fn what_was_observed_is_undistorted_once() {
    let seen = file(LENS).seen(None).unwrap();
    let on = distorted(&seen);
    let program = observed(Program::parse(PROGRAM).unwrap().camera_file(file(LENS)), &on);
    let get = |name: &str| program.adapted(name).unwrap().unwrap();
    let truth = |i: u32, j: u32| {
        let ray = (seen.camera.unproject(f64::from(i) + 0.5, f64::from(j) + 0.5, 1.0)
            - seen.camera.eye)
            .normalize();
        let to = glam::DVec3::new(1.2, 0.9, 0.0) - seen.camera.eye;
        (to - ray * to.dot(ray)).length() < 0.8
    };
    let truth: Vec<bool> =
        (0..120).flat_map(|j| (0..160).map(move |i| (i, j))).map(|(i, j)| truth(i, j)).collect();
    let truth = Mask::new(160, 120, truth).unwrap();
    let mask = get("seen");
    let mask = &mask.downcast::<MaskValue>().unwrap().mask;
    assert!(mask.overlap(&truth) > 0.98, "{}", mask.overlap(&truth));
    let raw = Mask::new(160, 120, on).unwrap();
    assert!(raw.overlap(&truth) < 0.9, "{}", raw.overlap(&truth));
    let deep = get("deep");
    let deep = &deep.downcast::<DepthValue>().unwrap().depth;
    assert!(deep.data().iter().zip(mask.data()).all(|(d, on)| (*d == 4.0) == *on));
    let photo = get("photo");
    let image = photo.downcast::<ImageValue>().unwrap();
    let white = image.as_photo().unwrap().rgb().pixels().map(|p| p.0[0] > 127).collect();
    assert!(Mask::new(160, 120, white).unwrap().overlap(&truth) > 0.97);
    let joints = get("joints");
    let joints = &joints.downcast::<KeypointsValue>().unwrap().0;
    let [x, y] = joints.position(&joints.points()[0], (160, 120));
    let [u, v] = seen.lens.as_ref().unwrap().undistorted([130.5, 20.5]).unwrap();
    assert!((x - u).hypot(y - v) < 1e-9 && (x - 130.5).hypot(y - 20.5) > 3.0, "{x} {y}");
    assert_eq!(image.hint().at, [[u, v]]);
    // The same picture each time the program is compiled, so that nothing is detected again.
    let again = program.adapted("photo").unwrap().unwrap();
    let photo_of =
        |v: &Value| v.downcast::<ImageValue>().unwrap().as_photo().unwrap().rgb().as_ptr();
    assert_eq!(photo_of(&photo), photo_of(&again));
}

#[test]
fn the_true_place_is_found_through_a_lens() {
    let seen = file(LENS).seen(None).unwrap();
    let program =
        observed(Program::parse(PROGRAM).unwrap().camera_file(file(LENS)), &distorted(&seen));
    let text = "\ninfer { warmup 300 { drift(@x); } repeat 300 { drift(@x); collect x; } }";
    let model = program.edited(&format!("{PROGRAM}{text}")).unwrap().compile().unwrap();
    let found = model.run(&pcadlang::RunOptions::default(), 1, 1).unwrap();
    let x = found.quantity("x").unwrap().summary.mean;
    assert!((x - 1.2).abs() < 0.02, "{x}");
}

/// A JPEG of a camera with a 35 mm equivalent of 27 mm.
fn with_exif(width: u32, height: u32) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(width, height).write_to(&mut out, image::ImageFormat::Jpeg).unwrap();
    let jpeg = out.into_inner();
    let entry = |tag: u16, kind: u16, value: u32| {
        [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &1u32.to_le_bytes(), &value.to_le_bytes()]
            .concat()
    };
    let body = [
        b"Exif\0\0II\x2a\0\x08\0\0\0\x01\0".as_slice(),
        &entry(0x8769, 4, 26),
        &[0; 4],
        &[1, 0],
        &entry(0xA405, 3, 27),
        &[0; 4],
    ]
    .concat();
    let length = (body.len() as u16 + 2).to_be_bytes();
    [&jpeg[..2], &[0xff, 0xe1], &length, &body, &jpeg[2..]].concat()
}

#[test]
fn the_lens_of_a_photograph_moves_the_default_view() {
    let program = "include \"std/scene.pcad\" as scene; data photo: image;
        let view = scene.render(scene.sphere(1)); sample view.camera.position; sample photo.focal; sample photo.focal_sd;";
    let of = |bytes: &[u8]| {
        let photo = photo::decode(bytes, &Default::default()).unwrap();
        let photo = Value::object(ImageValue::photo(photo));
        let model = Program::parse(program).unwrap().observe("photo", photo).compile().unwrap();
        let mut trace = model.simulate(1, 0).unwrap();
        let samples = model.code().samples.clone();
        let values = trace.query(&samples, Default::default()).unwrap();
        values.iter().flat_map(|v| v.numbers()).collect::<Vec<f64>>()
    };
    // 27 mm of a diagonal of 43.27: 0.78 of the longer side, so 4.4 units fill it from 3.43.
    let stated = of(&with_exif(80, 60));
    let focal = 27.0 / 43.2666 * 1.25;
    assert!(
        (stated[2] - 4.4 * focal).abs() < 1e-3 && (stated[3] - focal).abs() < 1e-4,
        "{stated:?}"
    );
    assert_eq!(stated[4], 0.05);
    // A crop: as before, to the last bit.
    assert_eq!(of(&with_exif(80, 70)), [0.0, 0.0, 8.0, 1.818, 0.4]);
    let Camera { projection: Projection::Pinhole { focal_px, .. }, .. } =
        Camera::default_by(80, 60, focal)
    else {
        unreachable!()
    };
    assert!((focal_px - 80.0 * focal).abs() < 1e-9);
}

#[test]
fn a_program_may_name_a_camera_itself() {
    let folder = std::env::temp_dir().join(format!("pcadlang_camera_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let depth = npy::f32_array(&[2, 2], [1.0; 4]);
    std::fs::write(folder.join("d.npy"), depth).unwrap();
    std::fs::write(
        folder.join("k.json"),
        r#"{"fx": 50, "fy": 50, "cx": 31.5, "cy": 23.5, "width": 64, "height": 48}"#,
    )
    .unwrap();
    let text = "include \"std/scene.pcad\" as scene; data eye = camera(\"k.json\", at = \"file\", up = \"-y\");
        let view = scene.render(scene.sphere(1), camera = eye); sample view.camera.position;";
    std::fs::write(folder.join("p.pcad"), text).unwrap();
    let model = Program::open(folder.join("p.pcad").to_str().unwrap()).unwrap().compile().unwrap();
    let value = model.code().globals.get("eye").cloned().unwrap();
    let eye = model.simulate(1, 0).unwrap().query(&[value], Default::default()).unwrap();
    let camera = eye[0].downcast::<CameraValue>().unwrap().0;
    assert_eq!((camera.eye, camera.forward), (glam::DVec3::ZERO, glam::DVec3::NEG_Z));
    std::fs::remove_dir_all(&folder).unwrap();
}
