//! People as JSON, for other programs and for `--keypoints`: in COCO's and in MediaPipe's
//! layout.

use super::{Landmark, Person};
use pcadlang_scene::vision::keypoints::{COCO, MEDIAPIPE};
use serde_json::{Map, Value, json};

/// Returns the people in a picture of this size, name and number as COCO annotations: 17 joints
/// with the visibility as third number, box and score. In addition, `landmarks` has all
/// 33 by name (x, y, visibility, standard deviation in pixels), and `metres` their
/// positions relative to the hips.
pub fn coco(people: &[Person], (width, height): (u32, u32), name: &str, image_id: u64) -> Value {
    let annotation = |(i, p): (usize, &Person)| {
        let [left, top, right, bottom] = p.bounds;
        let joints: Vec<Value> = COCO.iter().flat_map(|name| triple(p.landmark(name))).collect();
        json!({
            "id": i + 1, "image_id": image_id, "category_id": 1, "score": number(p.score), "num_keypoints": COCO.len(),
            "bbox": [number(left), number(top), number(right - left), number(bottom - top)],
            "keypoints": joints,
            "landmarks": by_name(p, |l| json!([number(l.at[0]), number(l.at[1]), number(l.visibility), number(l.spread)])),
            "metres": by_name(p, |l| l.metres.map(number).into_iter().collect()),
            "views": p.views, "agreeing": p.agreeing,
        })
    };
    let annotations: Vec<Value> = people.iter().enumerate().map(annotation).collect();
    json!({
        "images": [{ "id": image_id, "file_name": name, "width": width, "height": height }],
        "categories": [{ "id": 1, "name": "person", "keypoints": COCO }],
        "annotations": annotations,
    })
}

/// Returns the people in a picture of this size in MediaPipe's layout: 33 landmarks each,
/// as fractions of its width and height, and in metres relative to the hips.
pub fn mediapipe(people: &[Person], (width, height): (u32, u32)) -> Value {
    let each = |one: &dyn Fn(&Landmark) -> Value| -> Value {
        people.iter().map(|p| p.landmarks.iter().map(one).collect::<Value>()).collect()
    };
    json!({
        "pose_landmarks": each(&|l| json!({
            "x": share(l.at[0], width), "y": share(l.at[1], height), "visibility": number(l.visibility),
        })),
        "pose_world_landmarks": each(&|l| {
            let [x, y, z] = l.metres.map(number);
            json!({ "x": x, "y": y, "z": z, "visibility": number(l.visibility) })
        }),
    })
}

fn triple(l: Option<&Landmark>) -> [Value; 3] {
    match l {
        Some(l) => [number(l.at[0]), number(l.at[1]), number(l.visibility.max(0.001))],
        None => [0, 0, 0].map(Value::from),
    }
}

fn by_name(p: &Person, one: impl Fn(&Landmark) -> Value) -> Map<String, Value> {
    MEDIAPIPE.iter().zip(&p.landmarks).map(|(name, l)| ((*name).to_owned(), one(l))).collect()
}

/// Rounds to a thousandth.
fn number(x: f64) -> Value {
    json!(libm::round(x * 1000.0) / 1000.0)
}

fn share(x: f64, of: u32) -> Value {
    json!(libm::round(x / f64::from(of.max(1)) * 1e6) / 1e6)
}
