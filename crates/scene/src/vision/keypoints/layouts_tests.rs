//! Tests of the result of each layout, and of the messages for invalid files.

use crate::vision::keypoints::{COCO, Keypoints, MEDIAPIPE, People, split_id};
use serde_json::{Value, json};

fn parse(v: &Value) -> People {
    People::parse(v.to_string().as_bytes()).unwrap()
}

fn said(v: &Value) -> String {
    People::parse(v.to_string().as_bytes()).unwrap_err().to_string()
}

fn points(k: &Keypoints) -> Vec<(&str, f64, f64, f64)> {
    k.points().iter().map(|p| (&*p.name, p.x, p.y, p.confidence)).collect()
}

#[test]
fn one_person_by_names() {
    let expected = [("nose", 1.0, 2.0, 0.5), ("l_hip", 3.0, 4.5, 1.0), ("tail", -1.0, 0.0, 0.0)];
    let joints =
        json!({ "nose": [1, 2, 0.5], "left_hip": [3, 4.5], "l_eye": null, "tail": [-1, 0, 0] });
    for v in [joints.clone(), json!({ "keypoints": joints, "seconds": 0.1 })] {
        assert_eq!(points(&parse(&v).pick(None, Some("any")).unwrap()), expected);
    }
    let sized = json!({ "keypoints": joints, "width": 640, "height": 480 });
    assert_eq!(parse(&sized).pick(None, None).unwrap().size(), Some((640, 480)));
    for nobody in [
        json!(null),
        json!([]),
        json!({}),
        json!({ "keypoints": null }),
        json!({ "pose_landmarks": [] }),
    ] {
        assert!(parse(&nobody).pick(None, None).unwrap().is_empty(), "{nobody}");
    }
}

#[test]
fn many_by_id() {
    let p = parse(
        &json!({ "a": { "keypoints": { "nose": [1, 2] } }, "b": { "keypoints": null }, "c": null }),
    );
    assert_eq!(p.ids().collect::<Vec<_>>(), ["a", "b", "c"]);
    assert_eq!(points(&p.pick(Some("a"), Some("b")).unwrap()), [("nose", 1.0, 2.0, 1.0)]);
    assert!(p.pick(None, Some("b")).unwrap().is_empty());
    assert_eq!(
        p.pick(Some("d"), None).unwrap_err().to_string(),
        "no person has the id `d`; there are a, b, c"
    );
    let choose = "add `#` and an id to the file name to choose one";
    assert_eq!(
        p.pick(None, None).unwrap_err().to_string(),
        format!("it contains 3 people: a, b, c; {choose}")
    );
    let message = p.pick(None, Some("photo")).unwrap_err().to_string();
    assert_eq!(
        message,
        format!(
            "it contains 3 people: a, b, c; none of them has the name of the picture, `photo`; {choose}"
        )
    );
    let many: Value = (0..9)
        .map(|i| (format!("p{i}"), json!({ "keypoints": {} })))
        .collect::<serde_json::Map<_, _>>()
        .into();
    let message = parse(&many).pick(None, None).unwrap_err().message;
    assert_eq!(message, "it contains 9 people: p0, p1, p2, p3, p4, … 9 in all");
    assert_eq!(split_id("a/b.json#id 1"), ("a/b.json", Some("id 1")));
    assert_eq!(split_id("a#b/c.json"), ("a#b/c.json", None));
    assert_eq!(split_id("a/b.csv#c/d.png:e"), ("a/b.csv", Some("c/d.png:e")));
    assert_eq!((split_id("c.json#"), split_id("#c")), (("c.json#", None), ("#c", None)));
}

fn triples(at: f64, v: f64) -> Vec<f64> {
    (0..17).flat_map(|i| [at + f64::from(i), 10.0, if i == 3 { 0.0 } else { v }]).collect()
}

#[test]
fn coco_annotations_and_results() {
    let file = json!({
        "images": [{ "id": 7, "file_name": "x/000000000007.jpg", "width": 60, "height": 40 }, { "id": 8, "file_name": "b.jpg" }],
        "annotations": [
            { "id": 70, "image_id": 7, "category_id": 1, "keypoints": triples(0.0, 2.0) },
            { "id": 8, "image_id": 8, "category_id": 1, "keypoints": triples(1.0, 1.0) },
            { "id": 81, "image_id": 8, "category_id": 1, "keypoints": triples(2.0, 1.0) },
            { "id": 82, "image_id": 8, "bbox": [0, 0, 1, 1] },
            { "id": 90, "image_id": 9, "category_id": 5, "keypoints": [1, 2, 1, 3, 4, 0.25] },
        ],
        "categories": [{ "id": 1, "keypoints": COCO.map(|n| n.replace("l_", "left_")) }, { "id": 5, "keypoints": ["a", "b"] }],
    });
    let p = parse(&file);
    assert_eq!(p.ids().collect::<Vec<_>>(), ["70", "8", "81", "90"]);
    for of in
        [p.pick(Some("70"), None), p.pick(None, Some("000000000007")), p.pick(Some("7"), None)]
    {
        let of = of.unwrap();
        assert_eq!((of.size(), of.points().len()), (Some((60, 40)), 16));
        assert_eq!(points(&of)[1], ("l_eye", 1.0, 10.0, 1.0));
        assert!(of.points().iter().all(|p| &*p.name != "l_ear"), "v = 0 is missing");
    }
    assert_eq!(points(&p.pick(Some("8"), None).unwrap())[0].1, 1.0, "a person's id goes first");
    let message = p.pick(None, Some("b")).unwrap_err().message;
    assert_eq!(message, "there are 2 people in the picture `b`: 8, 81");
    assert_eq!(
        points(&p.pick(Some("90"), None).unwrap()),
        [("a", 1.0, 2.0, 1.0), ("b", 3.0, 4.0, 0.25)]
    );

    let result = |image: Value, at: f64| json!({ "image_id": image, "score": 0.9, "keypoints": triples(at, 0.5) });
    let p = parse(&json!([result(json!(3), 0.0), result(json!("q"), 1.0), result(json!(3), 2.0)]));
    assert_eq!(p.ids().collect::<Vec<_>>(), ["3:1", "q", "3:2"]);
    assert_eq!(points(&p.pick(None, Some("q")).unwrap())[0], ("nose", 1.0, 10.0, 0.5));
}

#[test]
fn mediapipe_landmarks() {
    let list: Vec<Value> = (0..33)
        .map(|i| json!({ "x": f64::from(i) / 32.0, "y": 0.5, "z": 0, "visibility": 0.25 }))
        .collect();
    for v in [
        json!({ "pose_landmarks": list }),
        json!({ "landmarks": [list] }),
        json!({ "pose_landmarks": { "landmark": list } }),
        json!(list),
        json!([list]),
    ] {
        let k = parse(&v).pick(None, None).unwrap();
        assert!(k.is_normalised() && k.points().len() == 33);
        let last = &k.points()[32];
        assert_eq!((&*last.name, last.confidence), ("r_foot_index", 0.25));
        assert_eq!(k.position(last, (200, 100)), [200.0, 50.0]);
    }
    assert_eq!(parse(&json!([list, list])).ids().collect::<Vec<_>>(), ["1", "2"]);
    let by_id = parse(&json!({ "a": { "pose_landmarks": list }, "b": { "pose_landmarks": null } }));
    assert_eq!(by_id.pick(Some("a"), None).unwrap().points().len(), MEDIAPIPE.len());
    assert!(by_id.pick(Some("b"), None).unwrap().is_empty());
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    let mut short = triples(0.0, 1.0);
    short.pop();
    let mut odd: Vec<Value> = triples(0.0, 1.0).into_iter().map(Value::from).collect();
    odd[4] = json!("x");
    for (v, expected) in [
        (
            json!({ "nose": [1] }),
            "`nose` must be [x, y] or [x, y, confidence], or null if it was not found, got a list of 1",
        ),
        (
            json!({ "a": { "keypoints": { "nose": 3 } } }),
            "`a.keypoints.nose` must be [x, y] or [x, y, confidence], or null if it was not found, got 3",
        ),
        (json!({ "nose": [1, null] }), "`nose[1]` must be a number of pixels, got null"),
        (json!({ "nose": [1, 2, -0.5] }), "`nose[2]` must be a confidence of at least 0, got -0.5"),
        (
            json!({ "l_hip": [1, 2], "left_hip": [1, 2] }),
            "`left_hip` must be given only once, but `l_hip` also occurs in another spelling, got a list of 2",
        ),
        (
            json!({ "a": { "keypoints": {} }, "b": 3 }),
            "`b` must be an object with `keypoints`, got 3",
        ),
        (
            json!({ "a": { "keypoints": 3 } }),
            "`a.keypoints` must be joints, or null if nobody was found, got 3",
        ),
        (json!({ "annotations": 3 }), "`annotations` must be a list of annotations, got 3"),
        (
            json!([{ "keypoints": short }]),
            "`[0].keypoints` must be a list of x, y and confidence of each joint, got a list of 50",
        ),
        (json!([{ "keypoints": odd }]), "`[0].keypoints[4]` must be a number, got \"x\""),
        (
            json!({ "landmarks": [{ "x": 1 }] }),
            "`landmarks` must be a list of 33 landmarks {\"x\": …, \"y\": …, \"visibility\": …}, got a list of 1",
        ),
        (json!({ "landmarks": 1 }), "`landmarks` must be a list of 33 landmarks, got 1"),
    ] {
        assert_eq!(said(&v), expected);
    }
    for v in [json!(3), json!("x"), json!([3]), json!({ "a": 1 })] {
        let message = said(&v);
        assert!(
            message.starts_with(
                "the file must be one person's {\"nose\": [x, y, confidence], …}, people by id"
            ),
            "{message}"
        );
    }
    let nan = People::parse(b"{\"nose\": [NaN, 1]}").unwrap_err().to_string();
    assert_eq!(nan, "not JSON: expected value at line 1 column 11");
    assert!(People::parse(b"{\"nose\": [1e999, 1]}").is_err() && People::parse(b"").is_err());
}

#[test]
fn unknown_lists_of_joints_name_the_known_ones() {
    let flat = |count: usize| json!([{ "keypoints": vec![7.0; 3 * count] }]);
    for count in [15, 16, 17, 18, 19, 23, 25, 26, 33, 68, 133, 134, 136] {
        assert_eq!(parse(&flat(count)).pick(None, None).unwrap().points().len(), count);
    }
    let message = said(&flat(14));
    assert!(
        message.starts_with(
            "no known list of joints is as long as `[0].keypoints`, which has 14; known are \
             15 OpenPose MPI, 16 MPII, 17 COCO, "
        ) && message
            .contains("136 Halpe Full-Body; name others, {\"nose\": [x, y, confidence], …}"),
        "{message}"
    );
    assert!(said(&json!([3])).contains("25 OpenPose BODY_25"), "{}", said(&json!([3])));
}

#[test]
fn the_detections_of_the_development_pictures() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/humans/baselines/mediapipe_full.json"
    );
    let Ok(bytes) = std::fs::read(path) else { return };
    let p = People::parse(&bytes).unwrap();
    assert_eq!(p.len(), 25);
    let k = p.pick(None, Some("coco_535506_441444")).unwrap();
    assert_eq!((k.points().len(), points(&k)[0]), (17, ("nose", 216.19, 172.29, 1.0)));
    assert!(p.pick(Some("coco_151938_451988"), None).unwrap().is_empty(), "nobody was found there");
}
