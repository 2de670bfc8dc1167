//! Limbs that are dragged over the photograph.

use super::client::{Page, Studio};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A studio with the example of a person.
fn opened() -> (Studio, Page) {
    let s = Studio::new(&[]);
    std::fs::copy("examples/images/skier.jpg", s.folder.join("skier.jpg")).unwrap();
    let mut page = s.page();
    page.ask("open", json!({ "program": "human.pcad", "observe": ["skier.jpg"] }));
    (s, page)
}

fn joints(page: &mut Page) -> BTreeMap<String, [f64; 2]> {
    named(&page.ask("joints", json!({ "session": 1 }))["joints"])
}

fn named(joints: &Value) -> BTreeMap<String, [f64; 2]> {
    let all = joints.as_array().unwrap().iter();
    all.map(|j| {
        let at: [f64; 2] = serde_json::from_value(j["at"].clone()).unwrap();
        (j["name"].as_str().unwrap().to_owned(), at)
    })
    .collect()
}

/// The values of all choices with their tags.
fn choices(page: &mut Page) -> BTreeMap<String, (Value, Value)> {
    let all = page.ask("choices", json!({ "state": { "session": 1 } }));
    let all = all["choices"].as_array().unwrap().iter();
    let of = |c: &Value| (c["value"].clone(), c["tags"].clone());
    all.map(|c| (c["address"].as_str().unwrap().to_owned(), of(c))).collect()
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[test]
fn a_dragged_wrist_goes_where_it_is_pulled_by_the_pose_alone() {
    let (_s, mut page) = opened();
    let (before, began) = (choices(&mut page), joints(&mut page));
    // Towards the pelvis, so that the arm need not stretch.
    let (wrist, pelvis) = (began["l_wrist"], began["pelvis"]);
    let part = 40.0 / distance(wrist, pelvis);
    let mut to = wrist;
    let mut last = Value::Null;
    for i in 1..=10 {
        let by = part * f64::from(i) / 10.0;
        to = [0, 1].map(|c| wrist[c] + by * (pelvis[c] - wrist[c]));
        let pull = json!({ "session": 1, "joint": "l_wrist", "at": to, "drag": i > 1 });
        last = page.ask("pull", pull);
    }
    let ends = joints(&mut page);
    assert_eq!(ends, named(&last["joints"]));
    assert!(distance(ends["l_wrist"], to) < 3.0, "{:?} is not at {to:?}", ends["l_wrist"]);
    for still in ["nose", "r_wrist", "r_ankle", "l_ankle", "l_hip", "r_shoulder"] {
        assert!(distance(ends[still], began[still]) < 4.0, "{still} moved");
    }
    let after = choices(&mut page);
    let changed: Vec<_> = before.iter().filter(|(a, v)| after[*a] != **v).collect();
    assert!(!changed.is_empty());
    for (address, (_, tags)) in changed {
        assert!(tags.as_array().unwrap().contains(&json!("pose")), "{address} changed");
    }
    // The whole drag is one change.
    let undone = page.ask("enter", json!({ "session": 1, "text": ":undo" }));
    assert!(undone["text"].as_str().unwrap().starts_with("undone: drag of l_wrist"), "{undone}");
    assert_eq!(choices(&mut page), before);
}

#[test]
fn the_pelvis_takes_the_body_along() {
    let (_s, mut page) = opened();
    let (before, began) = (choices(&mut page), joints(&mut page));
    let to = [began["pelvis"][0] + 30.0, began["pelvis"][1] - 10.0];
    for i in 0..5 {
        page.ask("pull", json!({ "session": 1, "joint": "pelvis", "at": to, "drag": i > 0 }));
    }
    let ends = joints(&mut page);
    assert!(distance(ends["pelvis"], to) < 3.0, "{:?} is not at {to:?}", ends["pelvis"]);
    let nose = [began["nose"][0] + 30.0, began["nose"][1] - 10.0];
    assert!(distance(ends["nose"], nose) < 10.0, "{:?} is not at {nose:?}", ends["nose"]);
    let after = choices(&mut page);
    for (address, (value, tags)) in &before {
        let is_pose = tags.as_array().unwrap().contains(&json!("pose"));
        assert!(!is_pose || after[address].0 == *value, "{address} changed");
    }
}

#[test]
fn a_joint_that_cannot_be_pulled_is_refused_and_nothing_changes() {
    let (s, mut page) = opened();
    let before = choices(&mut page);
    let pull = |joint: &str, at: Value| json!({ "session": 1, "joint": joint, "at": at });
    let answer = page.answer("pull", pull("l_wirst", json!([1, 2])));
    assert!(answer["error"]["hint"].as_str().unwrap().contains("l_wrist"), "{answer}");
    page.refused("pull", pull("l_wrist", json!([1])));
    page.refused("pull", pull("l_wrist", json!([null, 0])));
    assert_eq!(choices(&mut page), before);
    // Far outside the picture the arm points there, and the state stays possible.
    let far = page.ask("pull", pull("l_wrist", json!([1e9, -1e9])));
    assert!(far["log_joint"].is_f64(), "{far}");
    std::fs::write(
        s.folder.join("marked.pcad"),
        "include \"std/scene.pcad\" as scene;
        assume a ~ normal(0, 1); freeze @a;
        let s = scene.landmarks(scene.sphere(1), { tip: [a, 0, 0] });
        let view = scene.render(s); observe normal(a, 1) = 0;",
    )
    .unwrap();
    page.ask("open", json!({ "program": "marked.pcad" }));
    let said = page.refused("pull", json!({ "session": 2, "joint": "tip", "at": [10, 10] }));
    assert!(said.contains("no choice"), "{said}");
    page.ask("open", json!({ "program": "coin.pcad" }));
    assert_eq!(page.ask("joints", json!({ "session": 3 }))["joints"], json!([]));
    page.refused("pull", json!({ "session": 3, "joint": "tip", "at": [10, 10] }));
}
