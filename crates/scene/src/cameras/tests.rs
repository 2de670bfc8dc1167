//! Cameras of other tools see the corners of a cube where those tools say. The numbers were made
//! with OpenCV 5.0.0, pycolmap 4.2.1, Open3D 0.20.0, pyrealsense2 2.59.1 and trimesh 5.2.0.

use super::*;
use glam::DVec3;

/// Corners of the unit cube, z fastest.
fn corners() -> impl Iterator<Item = DVec3> {
    (0..8).map(|i| DVec3::new(f64::from(i / 4), f64::from(i / 2 % 2), f64::from(i % 2)) - 0.5)
}

fn read_at(name: &str, bytes: &[u8], asked: &Asked) -> Result<CameraFile, CameraError> {
    CameraFile::read(name, bytes, asked, &|other| Err(format!("cannot read {other}")))
}

fn read(text: &str) -> CameraFile {
    read_at("camera", text.as_bytes(), &Asked::default()).unwrap()
}

fn refusal(text: &str) -> String {
    read_at("camera", text.as_bytes(), &Asked::default()).unwrap_err().to_string()
}

fn named(picture: &str) -> Asked<'_> {
    Asked { picture: Some(picture), ..Asked::default() }
}

/// Where the photograph shows a point.
fn shown(file: &CameraFile, picture: Option<(u32, u32)>, p: DVec3) -> [f64; 2] {
    let Seen { camera, lens } = file.seen(picture).unwrap();
    let (x, y, depth) = camera.project(p);
    assert!(depth > 0.0);
    lens.map_or([x, y], |lens| lens.distorted([x, y]).unwrap())
}

/// Compares with a tool whose first pixel has its centre at `half`.
fn sees(file: &CameraFile, expected: &[[f64; 2]], half: f64) {
    for (p, [x, y]) in corners().zip(expected) {
        let [u, v] = shown(file, Some((640, 480)), p);
        let off = (u - x - half).hypot(v - y - half);
        assert!(off < 2e-4, "{p}: {u} {v}, not {x} {y}");
    }
}

#[test]
fn lenses_of_other_models_are_refused() {
    let k = r#""camera_matrix": [[500, 0, 320], [0, 500, 240], [0, 0, 1]], "width": 640, "height": 480"#;
    for (more, says) in [
        (r#""xi": 1.2, "distortion_coefficients": [0.1, 0, 0, 0]"#, "omnidirectional"),
        (r#""distortion_model": "whatever", "D": [0, 0, 0, 0, 0, 0, 0, 0]"#, "`whatever`"),
        (r#""model": 3, "coeffs": [0.1, 0, 0, 0, 0]"#, "a fisheye (ftheta)"),
        (r#""camera_model": "ds""#, "a fisheye (ds)"),
        (r#""skew": 3"#, "skew"),
        (
            r#""roi": {"x_offset": 100, "y_offset": 0, "width": 400, "height": 300}"#,
            "region of interest",
        ),
        (r#""binning_x": 2"#, "binned"),
    ] {
        let said = refusal(&format!("{{{k}, {more}}}"));
        assert!(said.contains(says), "{more}: {said}");
    }
    let roi = r#""roi": {"x_offset": 0, "y_offset": 0, "width": 640, "height": 480, "do_rectify": false}"#;
    assert!(!read(&format!("{{{k}, {roi}}}")).has_position());
    assert!(
        read_at("camera", format!("{{{k}}}").as_bytes(), &named("a")).is_err(),
        "a name of nothing"
    );
}

#[test]
fn positions_in_one_matrix() {
    let k = r#""K": [[500, 0, 320], [0, 500, 240], [0, 0, 1]]"#;
    let eye = |more: &str| read(&format!("{{{k}, {more}}}")).seen(None).unwrap().camera.eye;
    let at = DVec3::new(-1.0, -2.0, -5.0);
    assert_eq!(eye(r#""RT": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 5]]"#), at);
    assert_eq!(eye(r#""extrinsic": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 5], [0, 0, 0, 1]]"#), at);
    assert_eq!(eye(r#""c2w": [[1, 0, 0, -1], [0, 1, 0, -2], [0, 0, 1, -5], [0, 0, 0, 1]]"#), at);
}

/// One of two calibrated cameras, which are not in a world; one of a file with a fisheye.
#[test]
fn one_of_several_cameras() {
    let pair = r#"{"M1": [[500, 0, 320], [0, 500, 240], [0, 0, 1]], "D1": [0.1, 0, 0, 0],
        "M2": [[510, 0, 320], [0, 510, 240], [0, 0, 1]], "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "T": [1, 0, 0]}"#;
    let two = read_at("camera", pair.as_bytes(), &named("M2")).unwrap();
    assert!(!two.has_position() && two.seen(Some((640, 480))).unwrap().lens.is_none());
    assert!(refusal(pair).contains("M1, M2"));
    let kalibr = "cam0:\n  camera_model: pinhole\n  intrinsics: [500, 500, 320, 240]\n  resolution: [640, 480]\n\
        cam1:\n  camera_model: pinhole\n  distortion_model: equidistant\n  intrinsics: [500, 500, 320, 240]\n";
    assert!(read_at("camera", kalibr.as_bytes(), &named("cam0")).is_ok());
    assert!(refusal(kalibr).contains("equidistant"));
}

const OPENCV_YAML: &str = "%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 520.5, 0., 321.25, 0., 518.75, 239.5, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -2.8000000000000003e-01, 8.9999999999999997e-02,
       1.1999999999999999e-03, -6.9999999999999999e-04,
       -1.4999999999999999e-02 ]
rvec: !!opencv-nd-matrix
   sizes: [ 3 ]
   dt: d
   data: [ 1.7603108899781381, -0.11371451284094782, -0.482793494376712 ]
tvec: [ 0.1, -0.2, 4.0 ]
calibration_time: \"Sat 28 Nov\"
";

/// `cv2.projectPoints` with these numbers.
const BY_OPENCV: [[f64; 2]; 8] = [
    [286.0565, 314.6988],
    [229.9491, 187.1498],
    [313.0149, 272.1100],
    [269.4762, 169.5243],
    [417.9149, 271.2365],
    [363.7111, 132.2363],
    [418.1695, 235.4260],
    [375.7532, 126.4717],
];

/// The same without distortion.
const UNDISTORTED: [[f64; 2]; 8] = [
    [285.8267, 315.1938],
    [228.8952, 186.5103],
    [313.0082, 272.1402],
    [269.0634, 168.9343],
    [418.9967, 271.5623],
    [364.3611, 130.6097],
    [419.1712, 235.3622],
    [376.7358, 124.4422],
];

#[test]
fn opencv_as_yaml_and_json() {
    let yaml = read(OPENCV_YAML);
    sees(&yaml, &BY_OPENCV, 0.5);
    // OpenCV 5 writes another first line, and vectors as arrays of one axis.
    sees(&read(&OPENCV_YAML.replace("%YAML:1.0", "%YAML 1.2")), &BY_OPENCV, 0.5);
    let json = r#"{"image_width": 640, "image_height": 480,
        "camera_matrix": {"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d",
            "data": [ 520.5, 0.0, 321.25, 0.0, 518.75, 239.5, 0.0, 0.0, 1.0 ]},
        "distortion_coefficients": {"type_id": "opencv-nd-matrix", "sizes": [ 5 ], "dt": "d",
            "data": [ -0.28, 0.09, 0.0012, -0.0007, -0.015 ]},
        "rvec": [1.7603108899781381, -0.11371451284094782, -0.482793494376712], "tvec": [0.1, -0.2, 4]}"#;
    sees(&read(json), &BY_OPENCV, 0.5);
    // As written by hand from Python: lists of lists, other names; thin prisms.
    let by_hand = json
        .replace("camera_matrix", "mtx")
        .replace("distortion_coefficients", "dist_coeffs")
        .replace(
            "[ -0.28, 0.09, 0.0012, -0.0007, -0.015 ]",
            "[[-0.28, 0.09, 0.0012, -0.0007, -0.015, 0.01, 0.02, -0.003, 0.001, -0.002, 0.0005, 0.0008]]",
        );
    let twelve = [[286.0789, 314.6853], [230.0105, 187.1852], [313.0175, 272.1097]];
    sees(&read(&by_hand), &twelve, 0.5);
}

#[test]
fn ros_without_a_position_stands_at_the_default_view() {
    let text = "image_width: 640\nimage_height: 480\ncamera_name: narrow_stereo\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
        data: [520.5, 0, 321.25, 0, 518.75, 239.5, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  \
        cols: 5\n  data: [-0.28, 0.09, 0.0012, -0.0007, -0.015]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  \
        data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nprojection_matrix:\n  rows: 3\n  cols: 4\n  \
        data: [500, 0, 320, 0, 0, 500, 240, 0, 0, 0, 1, 0]\n";
    let file = read(text);
    assert!(!file.has_position());
    assert_eq!((file.format, &*file.model), ("OpenCV", "plumb_bob"));
    let Seen { camera, lens } = file.seen(None).unwrap();
    assert_eq!((camera.width, camera.height), (640, 480));
    assert_eq!(camera.forward, DVec3::NEG_Z);
    // 640 pixels show 4.4 units at z = 0.
    let (left, right) =
        (camera.unproject(0.0, 0.0, camera.eye.z), camera.unproject(640.0, 0.0, camera.eye.z));
    assert!((right.x - left.x - 4.4).abs() < 1e-9 && right.z.abs() < 1e-9);
    assert!(lens.is_some());
    let file = read_at(
        "c.yaml",
        text.as_bytes(),
        &Asked { at: Some(Standpoint::File), ..Asked::default() },
    )
    .unwrap();
    let camera = file.seen(None).unwrap().camera;
    assert_eq!((camera.eye, camera.up, camera.forward), (DVec3::ZERO, DVec3::NEG_Y, DVec3::Z));
    // With -y up, the same camera looks along -z.
    let world = FileFrame::new(crate::geom::UpAxis::MinusY, 0.001).unwrap();
    let file = read_at("c.yaml", text.as_bytes(), &Asked { world, ..Asked::default() }).unwrap();
    let camera = file.seen(None).unwrap().camera;
    assert_eq!((camera.eye, camera.up, camera.forward), (DVec3::ZERO, DVec3::Y, DVec3::NEG_Z));
    for fisheye in ["equidistant", "fisheye"] {
        assert!(
            refusal(&text.replace("plumb_bob", fisheye))
                .contains("undistort photograph and camera first")
        );
    }
}

const CAMERAS_TXT: &str = "# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
3 SIMPLE_RADIAL 640 480 500 320 240 -0.20000000000000001
5 OPENCV 640 480 520.5 518.75 321.75 240 -0.28000000000000003 0.089999999999999997 0.0011999999999999999 -0.00069999999999999999
6 FULL_OPENCV 640 480 520.5 518.75 321.75 240 -0.28 0.09 0.0012 -0.0007 -0.015 0.01 0.02 -0.003
7 OPENCV_FISHEYE 640 480 500 500 320 240 0.1 0.1 0.1 0.1
";
const QUATERNION: [f64; 4] =
    [0.61024374463977704, 0.76252164410146872, -0.049258217842845925, -0.20913379062160758];

fn images_txt() -> String {
    let mut text = "# Image list with two lines of data per image:\n".to_owned();
    for camera in [3, 5, 6, 7] {
        let q = QUATERNION.map(|x| x.to_string()).join(" ");
        text += &format!("1{camera} {q} 0.1 -0.2 4 {camera} left/photo {camera}.jpg\n\n");
    }
    text
}

/// The same in COLMAP's binary layout; the last picture has one point.
fn binary() -> (Vec<u8>, Vec<u8>) {
    let mut cameras = 1u64.to_le_bytes().to_vec();
    cameras.extend([5u32.to_le_bytes(), 4u32.to_le_bytes()].concat());
    cameras.extend([640u64.to_le_bytes(), 480u64.to_le_bytes()].concat());
    for x in [520.5, 518.75, 321.75, 240.0, -0.28, 0.09, 0.0012, -0.0007] {
        cameras.extend(f64::to_le_bytes(x));
    }
    let mut images = 2u64.to_le_bytes().to_vec();
    for (name, points) in [("b/2.png", 0u64), ("a/1.png", 1)] {
        images.extend(9u32.to_le_bytes());
        let shift = if points == 1 { [0.1, -0.2, 4.0] } else { [0.0; 3] };
        for x in QUATERNION.into_iter().chain(shift) {
            images.extend(f64::to_le_bytes(x));
        }
        images.extend(5u32.to_le_bytes());
        images.extend([name.as_bytes(), b"\0", &points.to_le_bytes()].concat());
        images.extend(vec![0; 24 * points as usize]);
    }
    (cameras, images)
}

const COLMAP_OPENCV: [[f64; 2]; 8] = [
    [286.5565, 315.1988],
    [230.4490, 187.6497],
    [313.5149, 272.6100],
    [269.9762, 170.0243],
    [418.4150, 271.7365],
    [364.2112, 132.7361],
    [418.6696, 235.9260],
    [376.2534, 126.9713],
];

#[test]
fn colmap_as_text() {
    let images = images_txt();
    let beside = |other: &str| match other {
        "images.txt" => Ok(images.clone().into_bytes()),
        _ => Err("missing".to_owned()),
    };
    let of =
        |asked: &Asked| CameraFile::read("m/cameras.txt", CAMERAS_TXT.as_bytes(), asked, &beside);
    let simple = [[286.1483, 312.5796], [232.0264, 189.3537], [312.0895, 271.4339]];
    let full = [[286.5661, 315.1783], [230.4906, 187.6736], [313.5153, 272.6086]];
    sees(&of(&named("left/photo 3.jpg")).unwrap(), &simple, 0.0);
    sees(&of(&named("photo 5.jpg")).unwrap(), &COLMAP_OPENCV, 0.0);
    // By the path of the photograph.
    let photo = Asked { photo: Some("/data/left/photo 6.jpg"), ..Asked::default() };
    let file = of(&photo).unwrap();
    sees(&file, &full, 0.0);
    assert_eq!((file.format, &*file.model), ("COLMAP (text)", "FULL_OPENCV"));
    let said = of(&named("photo 7.jpg")).unwrap_err().to_string();
    assert!(said.contains("OPENCV_FISHEYE") && said.contains("colmap image_undistorter"), "{said}");
    let said = of(&Asked::default()).unwrap_err().to_string();
    assert!(said.contains("FILE#NAME, one of left/photo 3.jpg"), "{said}");
    assert!(
        of(&named("photo 8.jpg")).unwrap_err().to_string().contains("no picture `photo 8.jpg`")
    );
    // The lenses alone, by number; and a file by its content.
    let alone = read_at("lens", CAMERAS_TXT.as_bytes(), &named("5")).unwrap();
    assert!(!alone.has_position() && alone.remarks[0].contains("images.txt"));
    let line = CAMERAS_TXT.replace(" 240 -0.2000", " -0.2000");
    assert!(
        read_at("cameras.txt", line.as_bytes(), &named("3"))
            .unwrap_err()
            .to_string()
            .contains("has 4")
    );
    let bad = CAMERAS_TXT.replace("5 OPENCV 640", "5 OPENCV wide");
    let said = read_at("cameras.txt", bad.as_bytes(), &named("3")).unwrap_err().to_string();
    assert!(said.contains("cameras.txt: line 4"), "{said}");
}

#[test]
fn colmap_as_binary() {
    let (cameras, images) = binary();
    let beside = |other: &str| match other {
        "cameras.bin" => Ok(cameras.clone()),
        _ => Err("missing".to_owned()),
    };
    let of = |images: &[u8]| CameraFile::read("images.bin", images, &named("1.png"), &beside);
    let file = of(&images).unwrap();
    sees(&file, &COLMAP_OPENCV, 0.0);
    assert_eq!((file.format, file.picture.as_deref()), ("COLMAP (binary)", Some("a/1.png")));
    for n in 0..images.len() {
        assert!(of(&images[..n]).is_err(), "{n}");
    }
    // A count without its entries takes no memory.
    let many = [&u64::MAX.to_le_bytes()[..], &images[8..]].concat();
    assert!(of(&many).unwrap_err().to_string().contains("truncated"));
}

#[test]
fn transforms_of_nerfs() {
    let text = r#"{"fl_x": 520.5, "fl_y": 518.75, "cx": 321.75, "cy": 240, "w": 640, "h": 480, "camera_model": "OPENCV",
        "k1": 0, "k2": 0, "p1": 0, "p2": 0, "frames": [
        {"file_path": "./images/frame_00001.png", "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 9], [0, 0, 0, 1]]},
        {"file_path": "./images/frame_00002.png",
         "transform_matrix": [[0.8, -0.36, 0.48, 2.0], [0.6, 0.48, -0.64, -2.5], [0, 0.8, 0.6, 2.2], [0, 0, 0, 1]]}]}"#;
    let of =
        |text: &str, asked: &Asked| read_at("transforms.json", text.as_bytes(), asked).unwrap();
    let photo = Asked { photo: Some("data/images/frame_00002.png"), ..Asked::default() };
    let file = of(text, &photo);
    let p = DVec3::splat(0.5);
    let near = |[x, y]: [f64; 2], [u, v]: [f64; 2]| {
        assert!((x - u).hypot(y - v) < 1e-6, "{x} {y}");
    };
    near(shown(&file, None, p), [407.07786885245895, 152.12431693989078]);
    // Blender's: an angle across, names without endings, a size by the photograph.
    let blender = text
        .replace(
            r#""fl_x": 520.5, "fl_y": 518.75, "cx": 321.75, "cy": 240, "w": 640, "h": 480,"#,
            r#""camera_angle_x": 0.9,"#,
        )
        .replace("frame_00002.png", "frame_00002");
    let file = of(&blender, &photo);
    near(shown(&file, Some((640, 480)), p), [428.59841895350615, 127.78163374804362]);
    // Their z is up; turned, the point is where +y is up.
    let world = FileFrame::new(crate::geom::UpAxis::Z, 2.0).unwrap();
    let file = of(text, &Asked { world, ..photo });
    near(shown(&file, None, DVec3::new(1.0, 1.0, -1.0)), [407.07786885245895, 152.12431693989078]);
    let fish = text.replace("OPENCV", "OPENCV_FISHEYE");
    assert!(refusal(&fish).contains("say which") || refusal(&fish).contains("fisheye"));
    let mirror = text.replace("[[1, 0, 0, 0]", "[[-1, 0, 0, 0]");
    let said = read_at("t", mirror.as_bytes(), &named("frame_00001.png")).unwrap_err().to_string();
    assert!(said.contains("mirror"), "{said}");
}

const ROTATION: [f64; 9] = [
    0.9076733711903686,
    0.18012426052921143,
    -0.3790571223453214,
    -0.33036608954935215,
    -0.2503524002059387,
    -0.9100450112972408,
    -0.25881904510252074,
    0.9512512425641978,
    -0.1677312594965203,
];

#[test]
fn bop_by_the_number_of_the_picture() {
    let r = ROTATION.map(|x| x.to_string()).join(", ");
    let text = format!(
        r#"{{"3": {{"cam_K": [1, 0, 2, 0, 1, 2, 0, 0, 1], "depth_scale": 0.1}},
        "12": {{"cam_K": [520.5, 0, 321.25, 0, 518.75, 239.5, 0, 0, 1], "cam_R_w2c": [{r}], "cam_t_w2c": [0.1, -0.2, 4],
         "depth_scale": 0.1}}}}"#
    );
    let photo = Asked { photo: Some("test/000048/rgb/000012.png"), ..Asked::default() };
    let file = read_at("scene_camera.json", text.as_bytes(), &photo).unwrap();
    sees(&file, &UNDISTORTED, 0.5);
    assert_eq!((file.format, file.picture.as_deref()), ("BOP", Some("12")));
    assert!(file.remarks.iter().any(|r| r.contains("scale = 10000")), "{:?}", file.remarks);
    // The data set's camera.json.
    let set = r#"{"cx": 321.25, "cy": 239.5, "depth_scale": 1.0, "fx": 520.5, "fy": 518.75, "height": 480, "width": 640}"#;
    let camera = read(set).seen(None).unwrap().camera;
    assert_eq!((camera.width, camera.height), (640, 480));
}

#[test]
fn open3d_column_by_column() {
    let columns = |m: &[f64], n: usize| {
        (0..n)
            .flat_map(|c| (0..n).map(move |r| m[r * n + c].to_string()))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let r = ROTATION;
    let e =
        [r[0], r[1], r[2], 0.1, r[3], r[4], r[5], -0.2, r[6], r[7], r[8], 4.0, 0.0, 0.0, 0.0, 1.0];
    let intrinsic = r#"{"height": 480, "intrinsic_matrix": [520.5, 0.0, 0.0, 0.0, 518.75, 0.0, 321.25, 239.5, 1.0], "width": 640}"#;
    let one = format!(
        r#"{{"class_name": "PinholeCameraParameters", "extrinsic": [{}], "intrinsic": {intrinsic},
        "version_major": 1, "version_minor": 0}}"#,
        columns(&e, 4)
    );
    sees(&read(&one), &UNDISTORTED, 0.5);
    let lens = read(intrinsic);
    assert_eq!((lens.format, lens.has_position()), ("Open3D", false));
    let path =
        format!(r#"{{"class_name": "PinholeCameraTrajectory", "parameters": [{one}, {one}]}}"#);
    sees(&read_at("t.json", path.as_bytes(), &named("1")).unwrap(), &UNDISTORTED, 0.5);
    assert!(refusal(&path).contains("FILE#NAME"));
    let rows = one.replace(&columns(&e, 4), &e.map(|x| x.to_string()).join(", "));
    assert!(refusal(&rows).contains("column by column"));
}

#[test]
fn realsense_and_kinect() {
    // rs2_project_point_to_pixel of [0.3, -0.2, 1]; "inverse" projects as "modified" does.
    let text = r#"{"width": 640, "height": 480, "ppx": 321.5, "ppy": 238.25, "fx": 600, "fy": 602,
        "model": "distortion.inverse_brown_conrady", "coeffs": [-0.28, 0.09, 0.0012, -0.0007, -0.015]}"#;
    let own = |text: &str| {
        let asked = Asked { at: Some(Standpoint::File), ..Asked::default() };
        shown(
            &read_at("i.json", text.as_bytes(), &asked).unwrap(),
            None,
            DVec3::new(0.3, -0.2, 1.0),
        )
    };
    for (model, [x, y]) in [
        ("inverse_brown_conrady", [495.0103759765625, 122.24823760986328]),
        ("modified_brown_conrady", [495.0103759765625, 122.24823760986328]),
        ("brown_conrady", [494.9992370605469, 122.25566864013672]),
    ] {
        let [u, v] = own(&text.replace("inverse_brown_conrady", model));
        assert!((u - x - 0.5).hypot(v - y - 0.5) < 1e-4, "{model} {u} {v}");
    }
    // Azure Kinect's parameters by name, one of two cameras of a file.
    let both = r#"{"color": {"fx": 600, "fy": 602, "cx": 321.5, "cy": 238.25, "k1": -0.28, "k2": 0.09, "k3": -0.015,
        "k4": 0, "k5": 0, "k6": 0, "codx": 0, "cody": 0, "p1": 0.0012, "p2": -0.0007},
        "depth": {"fx": 500, "fy": 500, "cx": 320, "cy": 288}}"#;
    assert!(refusal(both).contains("color, depth"));
    let asked = Asked { at: Some(Standpoint::File), ..named("color") };
    let file = read_at("k.json", both.as_bytes(), &asked).unwrap();
    let [u, v] = shown(&file, Some((640, 480)), DVec3::new(0.3, -0.2, 1.0));
    assert!((u - 495.49924).hypot(v - 122.75567) < 1e-4, "{u} {v}");
    assert!(refusal(&text.replace("inverse_brown_conrady", "kannala_brandt4")).contains("fisheye"));
    assert!(refusal(&text.replace("\"ppx\"", "\"px\"")).contains("cx and cy"));
}

#[test]
fn the_first_camera_of_gltf() {
    let text = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "cameras": [{"type": "perspective", "perspective": {"aspectRatio": 1.3333333, "yfov": 0.8172748568558728, "znear": 0.01}}],
        "nodes": [{"name": "rig", "children": [2]}, {"name": "spare", "camera": 0}, {"name": "cam", "camera": 0,
        "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 5, 1]}]}"#;
    let file = read_at("scene.gltf", text.as_bytes(), &named("cam")).unwrap();
    let Seen { camera, lens } = file.seen(Some((640, 480))).unwrap();
    assert_eq!((camera.eye, camera.forward, lens), (DVec3::new(0.0, 1.0, 5.0), DVec3::NEG_Z, None));
    // trimesh's matrix of the same camera has a focal length of 554.256907 pixels.
    let Projection::Pinhole { focal_px, cx, cy } = camera.projection else { unreachable!() };
    assert!((focal_px - 554.25690696).abs() < 1e-5 && (cx, cy) == (320.0, 240.0), "{focal_px}");
    let first = read_at("scene.gltf", text.as_bytes(), &Asked::default()).unwrap();
    assert_eq!((first.picture.as_deref(), first.remarks.len()), (Some("spare"), 1));
    let camera = first.seen(None).unwrap().camera;
    assert_eq!((camera.width, camera.height), (256, 192));
    assert!(refusal(&text.replace("\"camera\": 0", "\"x\": 0")).contains("no camera"));
}

#[test]
fn unequal_focal_lengths_make_another_picture() {
    // Anamorphic: twice as high as wide in the photograph.
    let text = r#"{"fx": 400, "fy": 800, "cx": 319.5, "cy": 239.5, "width": 640, "height": 480}"#;
    let Seen { camera, lens } = read(text).seen(None).unwrap();
    assert_eq!((camera.width, camera.height), (1280, 480));
    assert!(lens.is_some());
    // Nearly square: the same size; square: untouched.
    let seen = read(&text.replace("800", "401")).seen(None).unwrap();
    assert_eq!((seen.camera.width, seen.camera.height, seen.lens.is_some()), (640, 480, true));
    assert_eq!(read(&text.replace("800", "400")).seen(None).unwrap().lens, None);
    assert!(read(&text.replace("800", "9000")).seen(None).is_err());
}

#[test]
fn what_is_no_camera() {
    for (text, why) in [
        ("<?xml version=\"1.0\"?>", "XML is not read"),
        ("{}", "no `model`, and is not of another"),
        ("[1]", "one JSON object"),
        ("just words", "one JSON object"),
        ("a: &x [1]\nb: *x\n", "references"),
        ("a: [1, 2\nb", "line 3, column 1"),
        ("{\"fx\": 1", "not valid JSON"),
        ("camera_matrix: [1, 2]\n", "3 x 3"),
        ("camera_matrix: [500, 3, 320, 0, 500, 240, 0, 0, 1]\n", "skew"),
        ("camera_matrix: [500, 0, 0, 0, 500, 0, 320, 240, 1]\n", "row by row"),
        (
            "{\"fx\": 500, \"fy\": 500, \"cx\": 1, \"cy\": 1, \"coeffs\": [1, 2, 3]}",
            "3 coefficients",
        ),
    ] {
        assert!(refusal(text).contains(why), "{text}: {}", refusal(text));
    }
    let deep = format!("a: {}", "[".repeat(5000));
    assert!(
        refusal(&deep).contains("too deep") || refusal(&deep).contains("line 1"),
        "{}",
        refusal(&deep)
    );
    assert!(refusal("a:\n - b:\n").contains("no `model`"));
    assert!(read_at("x", &[0xff, 0xfe, 0, 1], &Asked::default()).is_err());
    let own = r#"{"model": "pinhole", "position": [0, 0, 8], "looks_along": [0, 0, -1], "up": [0, 1, 0],
        "image": [64, 48], "focal_px": 100}"#;
    assert_eq!(read(own).seen(Some((9, 9))).unwrap().camera.width, 64);
    let world = FileFrame::new(crate::geom::UpAxis::Z, 1.0).unwrap();
    assert!(read_at("x", own.as_bytes(), &Asked { world, ..Asked::default() }).is_err());
}
