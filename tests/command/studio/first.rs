//! From an empty folder to a run: what is missing is asked for, what is at hand is used.

use super::client::Studio;
use serde_json::json;

#[test]
fn a_program_that_needs_a_photograph_asks_for_it_and_gets_the_example() {
    let s = Studio::new(&[]);
    let mut page = s.page();
    let asks = page.ask("open", json!({ "program": "human.pcad" }));
    assert!(asks["session"].is_null() && asks["text"].as_str().unwrap().contains("data photo"));
    assert_eq!(asks["data"][0], json!({ "name": "photo", "kind": "image", "given": false }));

    let folder = page.ask("folder", json!({}));
    let programs = folder["programs"].as_array().unwrap();
    let human = programs.iter().find(|p| p["file"] == "human.pcad").unwrap();
    assert_eq!(human["example"], "skier.jpg");
    let photo = page.ask("example", json!({ "picture": "skier.jpg" }))["file"].clone();
    assert_eq!(photo, "pictures/skier.jpg");
    assert!(page.refused("example", json!({ "picture": "../x" })).contains("no example"));

    let opened = page.ask("open", json!({ "program": "human.pcad", "photo": photo }));
    assert_eq!(
        (&opened["photo"]["name"], &opened["is_prior"]),
        (&json!("pictures/skier.jpg"), &json!(true))
    );
    let id = opened["session"].clone();
    let said = page.answer("observe", json!({ "session": id, "observe": [] }));
    assert!(said["error"]["message"].as_str().unwrap().contains("without its photograph"));
    // Hints are for the page.
    std::fs::write(s.folder.join("open.pcad"), "param n: int; let x = n;").unwrap();
    let said = page.answer("open", json!({ "program": "open.pcad" }))["error"].to_string();
    assert!(said.contains("param n = 10") && !said.contains("--"), "{said}");
    // A mistake of the program itself is told as such.
    std::fs::write(s.folder.join("wrong.pcad"), "data photo: image; assume x ~ normal(0, [1][2]);")
        .unwrap();
    assert!(page.refused("open", json!({ "program": "wrong.pcad" })).contains("no element 2"));
}

#[test]
fn every_example_opens_its_programs() {
    let s = Studio::new(&[]);
    let mut page = s.page();
    let folder = page.ask("folder", json!({}));
    let mut opened = 0;
    for program in folder["programs"].as_array().unwrap() {
        let Some(example) = program["example"].as_str() else { continue };
        let photo = page.ask("example", json!({ "picture": example }))["file"].clone();
        let session = page.ask("open", json!({ "program": program["file"], "photo": photo }));
        assert!(session["photo"]["width"].is_u64(), "{session}");
        page.ask("close", json!({ "session": session["session"] }));
        opened += 1;
    }
    assert!(opened >= 9, "{opened}");
}

#[test]
fn the_photograph_at_hand_follows_the_text() {
    let s = Studio::new(&[]);
    let mut page = s.page();
    let photo = page.ask("example", json!({ "picture": "coffee_cup.png" }))["file"].clone();
    // A program without data works beside it.
    let opened = page.ask("open", json!({ "program": "coin.pcad", "photo": photo }));
    assert_eq!((&opened["observe"], &opened["photo"]), (&json!([]), &json!(null)));
    let id = opened["session"].clone();
    let replace = |text: &str| json!({ "session": id, "text": text, "photo": photo });
    let takes = "data photo: image; assume x ~ normal(0, 1); observe normal(x, 1) = photo.width;";
    let seen = page.ask("replace", replace(takes));
    assert_eq!(seen["observe"], json!(["photo=pictures/coffee_cup.png"]));
    let plain = "assume x ~ normal(0, 1); observe normal(x, 1) = 2;";
    assert_eq!(page.ask("replace", replace(plain))["observe"], json!([]));
    page.ask("enter", json!({ "session": id, "text": ":undo" }));
    assert_eq!(page.ask("session", json!({ "session": id }))["text"], takes);

    // Without a photograph it is a draw from the prior, which cannot be run.
    let missing = page.ask("observe", json!({ "session": id, "observe": [] }));
    assert_eq!(missing["data"][0]["given"], false);
    let refused = page.answer("run", json!({ "session": id }));
    let said = refused["error"].to_string();
    assert!(said.contains("`photo` is missing") && !said.contains("--"), "{said}");
    assert!(page.ask("runs", json!({}))["runs"].as_array().unwrap().is_empty());
}

#[test]
fn pages_hear_what_another_opens_and_closes() {
    let s = Studio::new(&["coin.pcad"]);
    let (mut page, mut other) = (s.page(), s.page());
    other.ask("folder", json!({}));
    let opened = page.ask("open", json!({ "program": "linreg.pcad" }));
    page.ask("close", json!({ "session": 1 }));
    other.ask("folder", json!({}));
    let of = |name: &str| other.events.iter().find(|e| e["event"] == name);
    let news = of("opened").unwrap();
    assert_eq!((&news["session"], &news["program"]), (&opened["session"], &json!("linreg.pcad")));
    assert_eq!(of("closed").unwrap()["session"], 1);
}
