//! What the page draws while the user points out an object.

use super::client::{Page, Studio};
use serde_json::{Value, json};

const PROGRAM: &str = "include \"std/scene.pcad\" as scene; data photo: image;
assume x ~ normal(0, 1);";
const PEOPLE: &str = "include \"std/scene.pcad\" as scene; data photo: image;
let people = scene.people(photo); assume x ~ normal(0, 1);";

/// A studio with a session of a program that observes an example.
fn opened(program: &str, photo: &str) -> (Studio, Page) {
    let s = Studio::new(&[]);
    std::fs::write(s.folder.join("p.pcad"), program).unwrap();
    std::fs::copy(format!("examples/images/{photo}"), s.folder.join(photo)).unwrap();
    let mut page = s.page();
    page.ask("open", json!({ "program": "p.pcad", "observe": [photo] }));
    (s, page)
}

fn guess(page: &mut Page, hint: Value, quick: bool) -> Value {
    page.ask("guess", json!({ "session": 1, "hint": hint, "quick": quick }))["place"].take()
}

/// Whether a position is inside the best outline, by the even-odd rule.
fn is_inside(place: &Value, [x, y]: [f64; 2]) -> bool {
    let polygons: Vec<Vec<[f64; 2]>> =
        serde_json::from_value(place["outlines"][0].clone()).unwrap();
    let crossed = |polygon: &Vec<[f64; 2]>| {
        let sides = polygon.iter().zip(polygon.iter().cycle().skip(1));
        let left = |a: &[f64; 2], b: &[f64; 2]| {
            (a[1] <= y) != (b[1] <= y) && a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) < x
        };
        sides.filter(|(a, b)| left(a, b)).count()
    };
    polygons.iter().map(crossed).sum::<usize>() % 2 == 1
}

#[test]
fn a_box_and_an_axis_are_answered_with_outlines() {
    let (_s, mut page) = opened(PROGRAM, "coffee_cup.png");
    let bounds = json!([92.0, 9.0, 127.0, 144.0]);
    let axis = json!({ "foot": [150.0, 150.0], "top": [155.0, 12.0], "width": 125.0 });
    for (hint, source) in [(json!({ "box": bounds }), "box"), (json!({ "axis": axis }), "axis")] {
        for quick in [true, false] {
            let place = guess(&mut page, hint.clone(), quick);
            assert_eq!((&place["source"], &place["score"]), (&json!(source), &json!(1.0)));
            assert!(is_inside(&place, [150.0, 110.0]) && is_inside(&place, [155.0, 30.0]));
            assert!(!is_inside(&place, [20.0, 190.0]) && !is_inside(&place, [290.0, 30.0]));
            let count = place["outlines"].as_array().unwrap().len();
            assert_eq!(count, if quick { 1 } else { 2 }, "{place}");
        }
    }
    let now = page.ask("session", json!({ "session": 1 }));
    assert_eq!((&now["hint"]["box"], &now["undo"]), (&json!(null), &json!(null)));
}

#[test]
fn a_click_is_answered_with_what_is_seen_there() {
    let (_s, mut page) = opened(PROGRAM, "coffee_cup.png");
    for quick in [true, false] {
        assert!(guess(&mut page, json!({}), quick).is_null());
        let place = guess(&mut page, json!({ "at": [[150.0, 110.0]] }), quick);
        assert_eq!(place["source"], "cup");
        assert!(is_inside(&place, [150.0, 110.0]), "{place}");
    }
    // Where no object is left, regions are searched, but not quickly.
    let beside: Vec<[f64; 2]> = (0..40)
        .flat_map(|i| (0..26).map(move |j| [8.0 * f64::from(i), 8.0 * f64::from(j)]))
        .collect();
    let hint = json!({ "not": beside });
    assert!(guess(&mut page, hint.clone(), true).is_null());
    assert_eq!(guess(&mut page, hint, false)["source"], "region");
}

#[test]
fn an_outline_is_its_own_answer() {
    let (s, mut page) = opened(PROGRAM, "coffee_cup.png");
    let outline = json!([[100.0, 20.0], [210.5, 20.0], [150.0, 140.0]]);
    let place = guess(&mut page, json!({ "outline": outline, "at": [[9.0, 9.0]] }), true);
    assert_eq!((&place["source"], &place["outlines"]), (&json!("drawn"), &json!([[outline]])));
    std::fs::copy("examples/images/coffee_cup.png", s.folder.join("mask.png")).unwrap();
    let place = guess(&mut page, json!({ "mask": "mask.png" }), true);
    assert!(place["source"] == "drawn" && is_inside(&place, [107.0, 55.0]), "{place}");
    let said = page.refused("guess", json!({ "session": 1, "hint": { "mask": "../mask.png" } }));
    assert!(said.contains("../mask.png"), "{said}");
}

#[test]
fn a_click_chooses_a_person_where_the_program_looks_for_people() {
    let (_s, mut page) = opened(PEOPLE, "skier.jpg");
    let found = page.ask("enter", json!({ "session": 1, "text": "people[0].box" }));
    let text = found["text"].as_str().unwrap();
    let [x, y, w, h]: [f64; 4] = serde_json::from_str(text.trim()).unwrap();
    let place = guess(&mut page, json!({ "at": [[x + 0.5 * w, y + 0.4 * h]] }), true);
    assert_eq!((&place["source"], &place["box"]), (&json!("person"), &json!([x, y, w, h])));
    assert!(is_inside(&place, [x + 0.5 * w, y + 0.4 * h]), "{place}");
}

#[test]
fn a_hint_that_cannot_be_is_refused_and_the_next_is_answered() {
    let (_s, mut page) = opened(PROGRAM, "coffee_cup.png");
    let mut refused = |hint: Value| page.refused("guess", json!({ "session": 1, "hint": hint }));
    assert!(refused(json!({ "box": [900, 0, 5, 5] })).contains("outside the photograph"));
    assert!(refused(json!({ "box": [9, 0, -5, 5] })).contains("above 0"));
    assert!(refused(json!({ "outline": [[1, 1], [9, 9]] })).contains("at least 3 corners"));
    assert!(refused(json!({ "bax": [1, 0, 5, 5] })).contains("bax"));
    assert_eq!(guess(&mut page, json!({ "box": [92, 9, 127, 144] }), true)["source"], "box");
    page.ask("open", json!({ "program": "coin.pcad" }));
    let said = page.refused("guess", json!({ "session": 2, "hint": {} }));
    assert!(said.contains("no photograph"), "{said}");
}

#[test]
fn a_guess_does_not_wait_for_the_session() {
    let (s, mut page) = opened(PROGRAM, "coffee_cup.png");
    let mut other = s.page();
    let slow = json!({ "session": 1, "text": ":infer mh(@x) 100000000000" });
    page.send(tungstenite::Message::text(
        json!({ "id": 900, "method": "enter", "params": slow }).to_string(),
    ));
    std::thread::sleep(std::time::Duration::from_millis(300));
    assert_eq!(guess(&mut other, json!({ "box": [92, 9, 127, 144] }), false)["source"], "box");
    other.ask("interrupt", json!({ "session": 1 }));
}
