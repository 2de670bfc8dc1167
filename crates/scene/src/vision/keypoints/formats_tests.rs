//! Tests of the files that other tools write, by small files in their forms.

use super::{Keypoints, People};
use serde_json::{Value, json};

fn people(text: &str) -> People {
    People::parse(text.as_bytes()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn of(v: &Value) -> People {
    people(&v.to_string())
}

fn said(text: &str) -> String {
    People::parse(text.as_bytes()).unwrap_err().to_string()
}

fn only(v: &Value) -> Keypoints {
    of(v).pick(None, None).unwrap()
}

fn ids(p: &People) -> Vec<&str> {
    p.ids().collect()
}

/// The position and confidence of a joint, if it was detected.
fn at(k: &Keypoints, name: &str) -> Option<(f64, f64, f64)> {
    k.points().iter().find(|p| &*p.name == name).map(|p| (p.x, p.y, p.confidence))
}

/// `count` joints whose numbers tell their place: x = 10 + place, y = 20, the confidence 0.5.
fn flat(count: usize) -> Vec<f64> {
    (0..count).flat_map(|i| [10.0 + i as f64, 20.0, 0.5]).collect()
}

/// The photograph's name picks people of the picture of that name, never a number that happens to
/// be the same.
#[test]
fn the_photograph_is_no_number_of_a_person() {
    let one = |id: u32, image: u32, x: f64| {
        let joints: Vec<f64> = (0..17).flat_map(|i| [x, 50.0 + f64::from(i), 2.0]).collect();
        json!({ "id": id, "image_id": image, "category_id": 1, "keypoints": joints })
    };
    let coco = of(&json!({
        "images": [{ "id": 5, "file_name": "1.jpg" }, { "id": 6, "file_name": "2.jpg" }],
        "annotations": [one(1, 6, 60.0), one(7, 5, 70.0)],
    }));
    let nose = |k: Keypoints| at(&k, "nose").unwrap().0;
    assert_eq!(nose(coco.pick(None, Some("1")).unwrap()), 70.0);
    assert_eq!(nose(coco.pick(Some("1"), None).unwrap()), 60.0);
    assert!(coco.pick(None, Some("5")).is_err());
    let results = of(&json!([one(1, 139, 60.0), one(2, 785, 70.0)]));
    assert_eq!(nose(results.pick(None, Some("000000000785")).unwrap()), 70.0);
    assert!(results.pick(None, Some("1")).is_err());
    let people =
        json!({ "people": [{ "pose_keypoints_2d": flat(25) }, { "pose_keypoints_2d": flat(25) }] });
    assert!(of(&people).pick(None, Some("2")).is_err());
}

#[test]
fn a_picture_of_mmpose_with_its_meta_info() {
    let names: serde_json::Map<String, Value> = [("0", "nose"), ("1", "left_eye")]
        .map(|(k, v)| (k.to_owned(), v.into()))
        .into_iter()
        .collect();
    let instance =
        json!({ "keypoints": [[120.5, 80.0], [130.0, 70.0]], "keypoint_scores": [0.9, 0.8] });
    let k =
        only(&json!({ "meta_info": { "keypoint_id2name": names }, "instance_info": [instance] }));
    assert_eq!(at(&k, "l_eye"), Some((130.0, 70.0, 0.8)));
}

/// Fractions, with a joint beside the picture, whatever wrote them.
#[test]
fn bodies_of_two_pixels_are_fractions() {
    let x = |i: usize| 0.2 + 0.05 * i as f64;
    let joints: Vec<[f64; 2]> = (0..17).map(|i| [x(i), 0.5]).collect();
    let listed: Vec<f64> = joints.iter().flat_map(|[x, y]| [*x, *y, 0.9]).collect();
    for v in [
        json!([{ "keypoints": joints, "keypoint_scores": vec![0.9; 17] }]),
        json!([{ "image_id": 1, "keypoints": listed }]),
        json!({ "keypoints": [joints], "scores": [vec![0.9; 17]] }),
        json!({ "nose": [0.5, 0.1], "l_eye": [0.5, 0.1], "r_eye": [0.5, 0.1], "l_hip": [1.04, 0.9] }),
    ] {
        assert!(only(&v).is_normalised(), "{v}");
    }
    assert!(
        !only(&json!({ "nose": [1, 1], "l_eye": [1, 1], "r_eye": [1, 1], "l_hip": [5, 9] }))
            .is_normalised()
    );
    let pixels = format!("0 100 200 50 60{}", " 100 200 2".repeat(17));
    assert!(said(&pixels).contains("fractions"), "{}", said(&pixels));
}

#[test]
fn openpose_with_feet_hands_and_face() {
    let mut body = flat(25);
    body[3 * 22..].fill(0.0);
    let person = json!({
        "person_id": [-1], "pose_keypoints_2d": body, "face_keypoints_2d": flat(70),
        "hand_left_keypoints_2d": flat(21), "hand_right_keypoints_2d": [], "pose_keypoints_3d": [],
    });
    let k = only(&json!({ "version": 1.3, "people": [person] }));
    assert_eq!(k.points().len(), 22 + 70 + 21);
    assert_eq!(at(&k, "l_shoulder"), Some((15.0, 20.0, 0.5)));
    assert_eq!(at(&k, "l_big_toe"), Some((29.0, 20.0, 0.5)));
    assert_eq!(at(&k, "r_heel"), None, "0, 0, 0 is missing");
    assert_eq!(at(&k, "neck"), None, "OpenPose's neck is between the shoulders");
    assert_eq!(at(&k, "mid_shoulder"), Some((11.0, 20.0, 0.5)));
    assert_eq!(at(&k, "l_mouth"), Some((64.0, 20.0, 0.5)));
    assert_eq!(at(&k, "l_index_mcp"), Some((15.0, 20.0, 0.5)));
    assert!(!k.is_normalised());

    let person = json!({ "pose_keypoints": flat(18) });
    let p = of(&json!({ "people": [person, person] }));
    assert_eq!((ids(&p), p.pick(Some("2"), None).unwrap().points().len()), (vec!["1", "2"], 18));
    assert!(of(&json!({ "people": [] })).pick(None, None).unwrap().is_empty());

    let small: Vec<f64> = flat(18).chunks(3).flat_map(|c| [c[0] / 100.0, 0.2, 0.5]).collect();
    let k = only(&json!({ "people": [{ "pose_keypoints_2d": small }] }));
    assert!(k.is_normalised(), "--keypoint_scale 3");
    assert_eq!(k.position(&k.points()[0], (200, 100)), [20.0, 20.0]);
    let minus: Vec<f64> = small.chunks(3).flat_map(|c| [c[0] - 0.2, 0.2, 0.5]).collect();
    let message = said(&json!({ "people": [{ "pose_keypoints_2d": minus }] }).to_string());
    assert!(message.contains("not from -1 to 1, got a list of 1; run OpenPose with"), "{message}");
}

#[test]
fn alphapose_finds_the_picture() {
    let result = |image: &str, count: usize| json!({ "image_id": image, "keypoints": flat(count), "score": 3.1, "idx": [0.0] });
    let p = of(&json!([
        result("other.jpg", 17),
        result("a/skier.jpg", 26),
        result("two.png", 136),
        result("two.png", 68)
    ]));
    assert_eq!(ids(&p), ["other.jpg", "a/skier.jpg", "two.png:1", "two.png:2"]);
    for found in [p.pick(None, Some("skier")), p.pick(Some("skier.jpg"), None)] {
        let k = found.unwrap();
        assert_eq!((k.points().len(), at(&k, "r_heel")), (26, Some((35.0, 20.0, 0.5))));
    }
    assert_eq!(p.pick(Some("two.png:2"), None).unwrap().points().len(), 68);
    assert_eq!(
        p.pick(None, Some("two")).unwrap_err().message,
        "there are 2 people in the picture `two`: two.png:1, two.png:2"
    );
    for one in [
        json!({ "people": [{ "pose_keypoints_2d": flat(18) }] }),
        json!({ "bodies": [{ "joints": flat(18) }] }),
    ] {
        let p = of(&json!({ "other.jpg": one, "skier.jpg": one }));
        assert_eq!(p.pick(None, Some("skier")).unwrap().points().len(), 18);
        assert_eq!(only(&one).points().len(), 18, "a file for each picture");
    }
}

#[test]
fn mmpose_pictures_and_videos() {
    let instance = |count: usize| {
        let joints: Vec<_> = (0..count).map(|i| [10.0 + i as f64, 20.0]).collect();
        let mut scores = vec![1.2; count];
        scores[1] = -0.1;
        json!({ "keypoints": joints, "keypoint_scores": scores, "bbox": [[0, 0, 9, 9]], "bbox_score": 0.9 })
    };
    let k = only(&json!([instance(17)]));
    assert_eq!((at(&k, "nose"), at(&k, "l_eye")), (Some((10.0, 20.0, 1.0)), None));
    assert_eq!(only(&json!({ "predictions": [[instance(26)]] })).points().len(), 25);

    let names = json!({ "0": "left_shoulder", "1": "tail", "2": "right_big_toe" });
    let demo = json!({
        "meta_info": { "dataset_name": "own", "keypoint_id2name": names },
        "instance_info": [
            { "frame_id": 1, "instances": [instance(3)] },
            { "frame_id": 2, "instances": [instance(3), instance(3)] },
            { "frame_id": 3, "instances": [] },
        ],
    });
    let p = of(&demo);
    assert_eq!(ids(&p), ["1", "2:1", "2:2"]);
    let k = p.pick(Some("1"), None).unwrap();
    assert_eq!(at(&k, "r_big_toe"), Some((12.0, 20.0, 1.0)));
    let message = p.pick(None, Some("skier")).unwrap_err().to_string();
    assert!(message.starts_with("it contains 3 people: 1, 2:1, 2:2; none of them"), "{message}");
    let p = of(&json!([{ "frame_id": 0, "instances": [instance(133)] }]));
    assert_eq!(p.pick(None, None).unwrap().points().len(), 132);

    let deep = json!([{ "keypoints": [[1, 2, 3], [1, 2, 3]], "keypoint_scores": [1, 1] }]);
    let message = said(&deep.to_string());
    assert_eq!(
        message,
        "`[0].keypoints[0]` must be [x, y], a position in the picture, got a list of 3"
    );
}

#[test]
fn ultralytics_json_and_labels() {
    let person = |by: f64| {
        let mut x: Vec<f64> = (0..17).map(|i| (10.0 + f64::from(i)) / by).collect();
        let mut y = vec![20.0 / by; 17];
        (x[3], y[3]) = (0.0, 0.0);
        json!({ "name": "person", "class": 0, "confidence": 0.9, "box": { "x1": 0.1, "y1": 0, "x2": 0.5, "y2": 0.5 },
                "keypoints": { "x": x, "y": y, "visible": vec![0.25; 17] } })
    };
    let cup = json!({ "name": "cup", "class": 41, "confidence": 0.4, "box": {} });
    let k = only(&json!([cup, person(1.0)]));
    assert_eq!((k.points().len(), at(&k, "l_ear"), k.is_normalised()), (16, None, false));
    assert_eq!(at(&k, "r_ankle"), Some((26.0, 20.0, 0.25)));
    let k = only(&json!([person(100.0)]));
    assert_eq!(k.position(&k.points()[0], (200, 50)), [20.0, 10.0]);
    let p = of(&json!([[person(1.0)], [person(1.0), person(1.0)]]));
    assert_eq!(ids(&p), ["1", "2:1", "2:2"]);
    assert_eq!(ids(&of(&json!([[], [person(1.0)]]))), ["2"]);
    assert!(of(&json!([[], []])).is_empty());

    let joints = |each: &dyn Fn(i32) -> String| (0..17).map(each).collect::<String>();
    let three =
        joints(&|i| if i == 3 { " 0 0 0.1".into() } else { format!(" 0.{} 0.5 0.25", 10 + i) });
    for more in ["", " 0.9", " 0.9 7"] {
        let p = people(&format!("0 0.5 0.5 0.2 0.4{three}{more}\n"));
        let k = p.pick(None, None).unwrap();
        assert_eq!((k.points().len(), k.is_normalised()), (16, true));
        assert_eq!(at(&k, "r_ankle"), Some((0.26, 0.5, 0.25)));
    }
    let labels = joints(&|i| format!(" 0.{} 0.5 {}", 10 + i, i % 3));
    let k = people(&format!("\n0 0.5 0.5 0.2 0.4{labels}")).pick(None, None).unwrap();
    assert_eq!(
        (k.points().len(), at(&k, "r_eye")),
        (11, Some((0.12, 0.5, 1.0))),
        "0, 1, 2 of data sets"
    );
    let two = joints(&|i| format!(" 0.{} 0.5", 10 + i));
    let p = people(&format!("0 0.5 0.5 0.2 0.4{two}\r\n0 0.5 0.5 0.2 0.4{two}\r\n"));
    assert_eq!((ids(&p), p.pick(Some("2"), None).unwrap().points().len()), (vec!["1", "2"], 17));

    let message = said("0 0.5 0.5 0.2 0.4\n");
    assert!(message.starts_with("line 1 has 5 numbers; expected `class x y"), "{message}");
    let message = said(&format!("0 0.5 0.5 0.2 0.4{two}\n0 0.5 x 1"));
    assert_eq!(message, "line 2: `x` must be a number");
}

#[test]
fn rtmlib_arrays() {
    let k: Vec<Vec<[f64; 2]>> =
        (0..2).map(|p| (0..26).map(|i| [10.0 + f64::from(i), f64::from(p)]).collect()).collect();
    let s = vec![vec![1.07; 26]; 2];
    for v in [
        json!({ "keypoints": k, "scores": s }),
        json!({ "keypoints": k, "keypoint_scores": s }),
        json!([k, s]),
        json!(
            k.iter()
                .map(|p| p.iter().map(|[x, y]| [*x, *y, 1.07]).collect::<Vec<_>>())
                .collect::<Vec<_>>()
        ),
    ] {
        let p = of(&v);
        assert_eq!(ids(&p), ["1", "2"], "{v}");
        let found = p.pick(Some("2"), None).unwrap();
        assert_eq!((found.points().len(), at(&found, "r_heel")), (26, Some((35.0, 1.0, 1.0))));
    }
    for v in [
        json!({ "keypoints": [k[1]], "scores": [s[0]] }),
        json!({ "keypoints": k[1], "scores": s[0] }),
        json!(k[1]),
    ] {
        assert_eq!(only(&v).points().len(), 26, "{v}");
    }
    let message = said(&json!({ "keypoints": k, "scores": [s[0]] }).to_string());
    assert!(message.starts_with("`keypoints` must be as long as its confidences"), "{message}");
    // The confidences of RTMLib exceed 1, and so they do where users write their own file.
    assert_eq!(at(&only(&json!({ "nose": [1, 2, 1.07] })), "nose"), Some((1.0, 2.0, 1.0)));
}

#[test]
fn arrays_of_numpy() {
    use crate::vision::npy::f32_array;
    use std::io::{Cursor, Write as _};
    let positions = f32_array(&[2, 17, 2], (0..68).map(|i| 1.0 + i as f32));
    let scores = f32_array(&[2, 17], (0..34).map(|i| if i == 17 { f32::NAN } else { 1.5 }));
    let p = People::parse(&positions).unwrap();
    assert_eq!(at(&p.pick(Some("2"), None).unwrap(), "nose"), Some((35.0, 36.0, 1.0)));

    let archive = |names: [&str; 2]| {
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, array) in names.iter().zip([&positions, &scores]) {
            zip.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
            zip.write_all(array).unwrap();
        }
        zip.finish().unwrap().into_inner()
    };
    for names in [["keypoints.npy", "scores.npy"], ["arr_0.npy", "arr_1.npy"]] {
        let p = People::parse(&archive(names)).unwrap();
        let k = p.pick(Some("2"), None).unwrap();
        assert_eq!((at(&k, "nose"), at(&k, "l_eye")), (None, Some((37.0, 38.0, 1.0))));
    }
    let message = People::parse(&archive(["a.npy", "b.npy"])).unwrap_err().to_string();
    assert!(message.starts_with("the archive has no array `keypoints`, but `a.npy`, `b.npy`"));
    let large = f32_array(&[1_000_001], std::iter::repeat_n(0.0, 1_000_001));
    assert_eq!(
        People::parse(&large).unwrap_err().message,
        "an array has more than 1000000 numbers"
    );
    assert!(People::parse(&f32_array(&[0, 17, 2], [])).unwrap().is_empty());
    assert!(People::parse(b"\x89HDF\r\n\x1a\n").unwrap_err().to_string().contains("CSV"));
}

#[test]
fn coco_wholebody_annotations() {
    let annotation = json!({
        "id": 5, "image_id": 9, "category_id": 1, "keypoints": flat(17), "foot_kpts": flat(6),
        "face_kpts": vec![0.0; 204], "face_valid": false, "lefthand_kpts": flat(21), "righthand_kpts": flat(21),
    });
    let file = json!({
        "images": [{ "id": 9, "file_name": "skier.jpg", "width": 60, "height": 40 }],
        "annotations": [annotation],
        "categories": [{ "id": 1, "keypoints": ["nose"] }],
    });
    let k = of(&file).pick(None, Some("skier")).unwrap();
    assert_eq!((k.points().len(), k.size()), (17 + 6 + 42, Some((60, 40))));
    assert_eq!(at(&k, "r_big_toe"), Some((13.0, 20.0, 0.5)));
    assert_eq!(at(&k, "r_pinky_tip"), Some((30.0, 20.0, 0.5)));
    let k = only(&json!([{ "image_id": 9, "keypoints": flat(133), "score": 1 }]));
    assert_eq!(at(&k, "l_mouth"), Some((10.0 + 77.0, 20.0, 0.5)));
}

#[test]
fn mediapipe_in_every_interface() {
    let list = |visibility: Value, count: usize| -> Vec<Value> {
        let one = |i: usize| {
            let mut v = json!({ "x": i as f64 / 32.0, "y": 0.5, "z": 0 });
            if visibility != json!("none") {
                v["visibility"] = visibility.clone();
            }
            v
        };
        (0..count).map(one).collect()
    };
    let body = list(json!(0.25), 33);
    for v in [
        json!({ "landmark": body }),
        json!({ "poseLandmarks": body, "poseWorldLandmarks": body, "segmentationMask": {} }),
        json!({ "landmarks": [body], "worldLandmarks": [body] }),
        json!([{ "landmark": body }]),
        json!([{ "pose_landmarks": [body] }]),
        json!({ "pose_landmarks": [{ "landmark": body }] }),
    ] {
        let k = only(&v);
        assert_eq!((k.points().len(), k.is_normalised()), (33, true), "{v}");
        assert_eq!(at(&k, "r_foot_index"), Some((1.0, 0.5, 0.25)));
    }
    for (visibility, sure) in
        [(Value::Null, 1.0), (json!("none"), 1.0), (json!(0), 1.0), (json!(1.5), 1.0)]
    {
        let k = only(&json!({ "pose_landmarks": [list(visibility, 33)] }));
        assert_eq!(at(&k, "nose"), Some((0.0, 0.5, sure)));
    }
    let k = only(
        &json!({ "pose_landmarks": [body], "left_hand_landmarks": [list(json!("none"), 21)] }),
    );
    assert_eq!((k.points().len(), at(&k, "l_pinky_tip")), (54, Some((20.0 / 32.0, 0.5, 1.0))));
    let none =
        json!({ "poseLandmarks": [[]], "leftHandLandmarks": [[]], "rightHandLandmarks": [] });
    assert!(only(&none).is_empty());
    let frame = json!({ "pose_landmarks": [body, body] });
    assert_eq!(ids(&of(&json!([frame, frame]))), ["1:1", "1:2", "2:1", "2:2"]);
    let message = said(&json!({ "landmarks": [list(json!(1), 21)] }).to_string());
    assert!(message.contains("must be a list of 33 landmarks"), "{message}");
}

#[test]
fn tensorflow_js_poses() {
    let k = only(&json!([{ "score": 0.9, "keypoints": [
        { "x": 3, "y": 4, "score": 0.5, "name": "left_eye" },
        { "position": { "x": 5, "y": 6 }, "score": 0.25, "part": "rightWrist" },
    ] }]));
    assert_eq!(
        (at(&k, "l_eye"), at(&k, "r_wrist")),
        (Some((3.0, 4.0, 0.5)), Some((5.0, 6.0, 0.25)))
    );
}

#[test]
fn deeplabcut_tables() {
    let video = "scorer,net,net,net,net,net,net\nbodyparts,nose,nose,nose,left_hip,left_hip,left_hip\n\
                 coords,x,y,likelihood,x,y,likelihood\n0,1.5,2,0.9,3,4,0.25\n1,,,,5,6,0\n";
    let p = people(video);
    assert_eq!(ids(&p), ["0", "1"]);
    let k = p.pick(Some("0"), None).unwrap();
    assert_eq!((at(&k, "nose"), at(&k, "l_hip")), (Some((1.5, 2.0, 0.9)), Some((3.0, 4.0, 0.25))));
    assert!(p.pick(Some("1"), None).unwrap().is_empty());
    assert!(
        p.pick(None, Some("skier")).unwrap_err().message.starts_with("it contains 2 people: 0, 1")
    );

    let labels = "\u{feff}scorer,,,me,me\r\nbodyparts,,,nose,nose\r\ncoords,,,x,y\r\n\
                  labeled-data,run,img1.png,1,2\r\nlabeled-data,run,skier.png,3,4\r\n";
    let p = people(labels);
    assert_eq!(at(&p.pick(None, Some("skier")).unwrap(), "nose"), Some((3.0, 4.0, 1.0)));
    assert_eq!(at(&p.pick(Some("img1.png"), None).unwrap(), "nose"), Some((1.0, 2.0, 1.0)));

    let several = "scorer,s,s,s,s,s,s\nindividuals,a,a,a,b,b,b\nbodyparts,nose,nose,nose,nose,nose,nose\n\
                   coords,x,y,likelihood,x,y,likelihood\nlabeled-data/v/img0.png,1,2,,3,4,\nlabeled-data/v/img3.png,5,6,0.5,,,\n";
    let p = people(several);
    let path = "labeled-data/v/";
    assert_eq!(
        ids(&p),
        [format!("{path}img0.png:a"), format!("{path}img0.png:b"), format!("{path}img3.png")]
    );
    assert_eq!(at(&p.pick(None, Some("img3")).unwrap(), "nose"), Some((5.0, 6.0, 0.5)));
    assert!(p.pick(None, Some("img0")).unwrap_err().message.contains("2 people in the picture"));
    assert_eq!(
        said("scorer,s\nbodyparts,nose\ncoords,x\n0,word\n"),
        "line 4, column 2: `word` must be a number"
    );
    assert!(said("scorer,s\nbodyparts,nose\n0,1\n").contains("`coords` of DeepLabCut are missing"));
}

#[test]
fn sleap_tables() {
    let analysis = "track,frame_idx,instance.score,nose.x,nose.y,nose.score,tail base.x,tail base.y,tail base.score\n\
                    a,0,0.8,1,2,1.1,3,4,0.25\nb,0,0.8,5,6,0.9,,,0\na,3,0.8,7,8,0.9,,,0\n";
    let p = people(analysis);
    assert_eq!(ids(&p), ["0:a", "0:b", "3"]);
    let k = p.pick(Some("0:a"), None).unwrap();
    assert_eq!(
        (at(&k, "nose"), at(&k, "tail base")),
        (Some((1.0, 2.0, 1.0)), Some((3.0, 4.0, 0.25)))
    );
    assert_eq!(p.pick(Some("3"), None).unwrap().points().len(), 1);
    let sorted = "track,frame_idx,instance.score,nose.score,nose.x,nose.y\n,0,,,1,2\n,4,,,3,4\n";
    assert_eq!(at(&people(sorted).pick(Some("4"), None).unwrap(), "nose"), Some((3.0, 4.0, 1.0)));
    let frames =
        "frame_idx,inst0.track,inst0.nose.x,inst0.nose.y,inst1.nose.x,inst1.nose.y\n5,a,1,2,3,4\n";
    assert_eq!(ids(&people(frames)), ["5:0", "5:1"]);
    assert!(said("a,b\n1,2\n").contains("neither DeepLabCut's"));
    assert!(said("frame_idx,nose.x\n1,2\n").contains("nor SLEAP's"));
}

#[test]
fn what_pcadlang_writes_is_read() {
    // The third number is a standard deviation, of 5 pixels or of half a pixel.
    let own = json!({
        "keypoints": { "nose": [269.9, 39.8, 5.2], "l_hip": [1, 2, 0.5] }, "body": { "nose": [1, 2, 3] },
        "scene": {}, "best": { "nose": [1, 2] }, "seconds": 3.5,
    });
    let k = only(&own);
    assert_eq!(
        (at(&k, "nose"), at(&k, "l_hip")),
        (Some((269.9, 39.8, 1.0)), Some((1.0, 2.0, 1.0)))
    );
    let coco =
        json!([{ "image_id": "skier", "category_id": 1, "keypoints": flat(17), "score": 1 }]);
    assert_eq!(only(&coco).points().len(), 17);
}
