//! Objects as JSON, for other programs: in COCO's layout.

use super::{CLASSES, FoundObject};
use serde_json::{Value, json};

/// Returns the objects in a picture of this size, name and number as COCO annotations: box,
/// COCO's number of the class, and score.
pub fn coco(
    objects: &[FoundObject],
    (width, height): (u32, u32),
    name: &str,
    image_id: u64,
) -> Value {
    let annotation = |(i, o): (usize, &FoundObject)| {
        let [left, top, right, bottom] = o.bounds;
        let sides = [left, top, right - left, bottom - top].map(number);
        json!({
            "id": i + 1, "image_id": image_id, "category_id": CLASSES[o.class].1, "bbox": sides,
            "area": number((right - left) * (bottom - top)), "iscrowd": 0, "score": number(o.score),
        })
    };
    let annotations: Vec<Value> = objects.iter().enumerate().map(annotation).collect();
    let categories: Vec<Value> =
        CLASSES.iter().map(|(name, id)| json!({ "id": id, "name": name })).collect();
    json!({
        "images": [{ "id": image_id, "file_name": name, "width": width, "height": height }],
        "categories": categories,
        "annotations": annotations,
    })
}

/// Rounds to a thousandth.
fn number(x: f64) -> Value {
    json!(libm::round(x * 1000.0) / 1000.0)
}
