//! Sessions under the studio: what the page shows and changes.

use super::client::Studio;
use serde_json::{Value, json};

const CUP: &str = "include \"std/scene.pcad\" as scene;
assume r ~ uniform(0.2, 1); assume up ~ flip(0.5); assume n ~ poisson(3);
let view = scene.render(scene.sphere(r));
observe normal(r, 0.1) = 0.5 as seen;";

fn text(v: &Value) -> &str {
    v.as_str().unwrap()
}

#[test]
fn a_choice_is_dragged_and_the_drag_undone_at_once() {
    let s = Studio::new(&["lathe.pcad"]);
    let mut page = s.page();
    let opened = page.ask("session", json!({ "session": 1 }));
    assert_eq!((&opened["program"], &opened["undo"]), (&json!("lathe.pcad"), &json!(null)));
    assert!(text(&opened["note"]).contains("is not given") && opened["has_view"] == true);
    let state = json!({ "session": 1 });
    let choices = page.ask("choices", json!({ "state": state }));
    let all = choices["choices"].as_array().unwrap();
    let is_free = |c: &&Value| c["value"].is_f64() && !c["scale"].is_null();
    let one = all.iter().find(is_free).unwrap_or_else(|| panic!("{choices}"));
    let (address, value) = (&one["address"], one["value"].as_f64().unwrap());
    let picture = |page: &mut super::client::Page| {
        page.ask("picture", json!({ "state": state, "layer": "scene", "size": 128 }))
    };
    assert_eq!(picture(&mut page)["type"], "image/png");
    let mut last = Value::Null;
    for i in 1..=10 {
        let to = value + 0.01 * f64::from(i);
        last = page
            .ask("assign", json!({ "session": 1, "address": address, "value": to, "drag": i > 1 }));
        assert!(picture(&mut page)["bytes"].as_u64().unwrap() > 100);
    }
    assert_ne!(last["log_joint"], choices["log_joint"]);
    let undone = page.ask("enter", json!({ "session": 1, "text": ":undo" }));
    assert!(text(&undone["text"]).starts_with("undone: :set"), "{undone}");
    let now = page.ask("choices", json!({ "state": state }));
    assert_eq!(now["log_joint"], choices["log_joint"], "one undo for the whole drag");
    let again = page.ask("session", json!({ "session": 1 }));
    assert!(again["undo"].is_null() && again["redo"].is_string());
    assert!(page.events.iter().any(|e| e["event"] == "session" && e["session"] == 1));
}

#[test]
fn every_answer_of_a_session() {
    let s = Studio::new(&[]);
    std::fs::write(s.folder.join("cup.pcad"), CUP).unwrap();
    let mut page = s.page();
    let opened = page.answer("open", json!({ "program": "cup.pcad" }));
    let Some(id) = opened["result"].get("session").cloned() else { panic!("{opened}") };
    let state = json!({ "session": id });
    let c = page.ask("choices", json!({ "state": state }));
    let of = |c: &Value, name: &str| {
        c["choices"].as_array().unwrap().iter().find(|x| x["address"] == name).unwrap().clone()
    };
    let r = of(&c, "@r");
    assert_eq!(
        (&r["low"], &r["high"], &r["family"]),
        (&json!(0.2), &json!(1.0), &json!("uniform"))
    );
    assert!(of(&c, "@up")["value"].is_boolean() && c["observed"][0]["address"] == "@seen");
    assert_eq!(page.ask("choices", json!({ "state": state, "select": "up" }))["total"], 1);

    // Values that do not fit change nothing.
    let assign = |v: Value| json!({ "session": id, "address": "@r", "value": v });
    for wrong in [json!(5), json!("a"), json!([1, 2]), json!(null)] {
        page.refused("assign", assign(wrong));
    }
    assert_eq!(of(&page.ask("choices", json!({ "state": state })), "@r")["value"], r["value"]);
    page.ask("assign", assign(json!(0.5)));

    let mesh = page.ask("mesh", json!({ "state": state }));
    let (v, t) = (mesh["vertices"].as_u64().unwrap(), mesh["triangles"].as_u64().unwrap());
    assert_eq!(mesh["bytes"].as_u64().unwrap(), (24 * v + 12 * t + 2 * t).next_multiple_of(4));
    assert!(page.refused("mesh", json!({ "state": state, "limit": 1 })).contains("triangles"));
    let camera = page.ask("camera", json!({ "state": state }));
    assert!(camera["fov_y"].as_f64().unwrap() > 1.0);
    for layer in ["scene", "depth", "normals", "regions", "contours", "mask", "overlay"] {
        page.ask("picture", json!({ "state": state, "layer": layer, "size": 64 }));
    }
    for layer in ["photo", "photo_contours", "residuals", "joints", "shadow"] {
        page.refused("picture", json!({ "state": state, "layer": layer, "size": 64 }));
    }
    for size in [0, 5000] {
        page.refused("picture", json!({ "state": state, "layer": "depth", "size": size }));
    }
    let from = json!({ "eye": [3, 3, 3], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y": 40 });
    page.ask("picture", json!({ "state": state, "layer": "scene", "size": 64, "camera": from }));
    let nowhere = json!({ "eye": [0, 0, 0], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y": 40 });
    page.refused(
        "picture",
        json!({ "state": state, "layer": "scene", "size": 64, "camera": nowhere }),
    );

    // The prompt.
    let enter = |text: &str| json!({ "session": id, "text": text });
    assert_eq!(text(&page.ask("enter", enter("1 + 2"))["text"]), "3\n");
    assert_eq!(page.ask("enter", enter(":render"))["picture"], true);
    page.ask("enter", enter(":render a.png"));
    assert!(s.folder.join("a.png").is_file());
    page.ask("enter", enter(":save mine"));
    std::fs::write(s.folder.join("theirs.pcad"), "").unwrap();
    let confirm = page.ask("enter", enter(":save theirs"));
    assert!(text(&confirm["confirm"]["then"]).starts_with(":save!"));
    assert!(
        text(&page.ask("why", json!({ "session": id, "address": "@r" }))["text"]).contains("@seen")
    );
    let words = page.ask("complete", json!({ "session": id, "text": ":fl", "at": 3 }));
    assert_eq!(words["words"][0]["word"], ":flip");
    let error = page.answer("enter", enter("assume y ~ norml(0, 1);"));
    let d = &error["error"]["diagnostics"][0];
    assert_eq!((&d["line"], &d["column"]), (&json!(4), &json!(11)), "{error}");
    page.refused("enter", enter(":edit"));

    // Another text of the program.
    let replaced = page.ask(
        "replace",
        json!({ "session": id, "text": format!("{CUP}\nassume z ~ normal(0, 1);") }),
    );
    assert!(text(&replaced["text"]).contains("assume z"));
    let broken = page.answer("replace", json!({ "session": id, "text": "assume é ~ ;" }));
    assert_eq!(broken["error"]["diagnostics"][0]["severity"], "error");
    // An edited program is saved before a run.
    page.ask("run", json!({ "session": id, "settings": { "steps": 50, "chains": 1 } }));
    assert!(std::fs::read_to_string(s.folder.join("cup.pcad")).unwrap().contains("assume z"));
    page.wait("runs/cup", &["done"]);
    // The run is opened as a session; its best state is there.
    let reopened = page.ask("open", json!({ "run": "runs/cup" }));
    assert_eq!(reopened["program"], "cup.pcad");
    let film = page.ask("export", json!({ "run": "runs/cup", "kind": "film.png" }));
    let bytes = std::fs::read(s.folder.join(text(&film["file"]))).unwrap();
    assert!(bytes.starts_with(b"\x89PNG") && bytes.windows(4).any(|w| w == b"acTL"));
    page.ask("export", json!({ "run": "runs/cup", "kind": "film.glb" }));
    page.refused("export", json!({ "run": "runs/cup", "kind": "film.avi" }));
    page.ask("close", json!({ "session": id }));
    page.refused("session", json!({ "session": id }));
}

#[test]
fn a_photograph_is_sent_and_observed() {
    let s = Studio::new(&[]);
    let picture = std::fs::read("examples/images/table_lamp.png").unwrap();
    let mut request = format!(
        "POST /pictures?token={}&name=lamp.png HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nConnection: close\r\nContent-Length: {}\r\n\r\n",
        s.token, s.port, picture.len()
    )
    .into_bytes();
    request.extend(&picture);
    use std::io::{Read, Write};
    let mut stream = std::net::TcpStream::connect(("127.0.0.1", s.port)).unwrap();
    stream.write_all(&request).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.ends_with("{\"file\":\"pictures/lamp.png\"}"), "{answer}");
    let mut page = s.page();
    assert_eq!(page.ask("folder", json!({}))["pictures"], json!(["pictures/lamp.png"]));
    let id = page.ask("open", json!({ "program": "lathe.pcad" }))["session"].clone();
    let seen = page.ask("observe", json!({ "session": id, "observe": ["pictures/lamp.png"] }));
    assert_eq!(seen["photo"]["name"], "pictures/lamp.png");
    for layer in ["photo", "photo_contours", "residuals", "overlay"] {
        page.ask("picture", json!({ "state": { "session": id }, "layer": layer, "size": 96 }));
    }
}

#[test]
fn a_hint_reaches_the_program_and_its_runs() {
    let s = Studio::new(&[]);
    let program = "include \"std/scene.pcad\" as scene; data photo: image;
        let h = scene.hint(photo); let n = len(h.outline) + len(h.at) + len(h.not);
        let top = if len(h.axis) > 0 { h.axis.top } else { [] };
        assume x ~ normal(0, 1); observe normal(x, 1) = 0;
        infer { repeat 4 { mh(@x); collect h.box, top, n; } }";
    std::fs::write(s.folder.join("p.pcad"), program).unwrap();
    std::fs::copy("examples/images/table_lamp.png", s.folder.join("lamp.png")).unwrap();
    std::fs::copy("examples/images/table_lamp.png", s.folder.join("mask.png")).unwrap();
    let mut page = s.page();
    let opened = page.ask("open", json!({ "program": "p.pcad", "observe": ["lamp.png"] }));
    let id = &opened["session"];
    assert_eq!(opened["hint"]["box"], json!(null));
    let hint = json!({
        "mask": "mask.png", "outline": [[1.0, 1.0], [40.0, 1.0], [40.0, 40.0]],
        "box": [1.0, 2.0, 30.0, 40.5],
        "axis": { "foot": [20.0, 60.0], "top": [21.0, 3.0], "width": 9.0 },
        "at": [[20.0, 20.0]], "not": [[3.0, 3.0], [4.0, 4.0]],
    });
    let said = page.ask("hint", json!({ "session": id, "hint": hint }));
    assert_eq!((&said["hint"], &said["undo"]), (&hint, &json!("another hint")));
    let entered = page.ask("enter", json!({ "session": id, "text": "concat(h.box, top, [n])" }));
    assert!(text(&entered["text"]).contains("[1, 2, 30, 40.5, 21, 3, 6]"), "{entered}");
    let begun = json!({ "session": id, "settings": { "chains": 1 } });
    let run = page.ask("run", begun)["run"].clone();
    let run = run.as_str().unwrap();
    assert_eq!(page.wait(run, &["done", "failed"])["state"], "done");
    let record = std::fs::read_to_string(s.folder.join(run).join("run.json")).unwrap();
    assert!(record.contains("\"1,2,30,40.5\"") && record.contains("mask.png"), "{record}");
    assert_eq!(page.ask("open", json!({ "run": run }))["hint"], hint);

    let wrong = |hint: Value| json!({ "session": id, "hint": hint });
    let says = page.refused("hint", wrong(json!({ "box": [9999, 0, 5, 5] })));
    assert!(says.contains("outside the photograph"), "{says}");
    page.refused("hint", wrong(json!({ "bax": [1, 0, 5, 5] })));
    page.refused("hint", wrong(json!({ "mask": "../mask.png" })));
    // Other data, and an empty hint, are without it.
    assert_eq!(page.ask("hint", wrong(json!({})))["hint"], opened["hint"]);
    page.ask("hint", wrong(hint));
    let other = page.ask("observe", json!({ "session": id, "observe": ["lamp.png"] }));
    assert_eq!(other["hint"], opened["hint"]);
}

#[test]
fn an_endless_command_is_interrupted_and_the_session_goes_on() {
    let s = Studio::new(&["coin.pcad"]);
    let mut page = s.page();
    // More requests of the busy session than are done at a time.
    let slow = json!({ "session": 1, "text": ":infer mh(@heads) 100000000000" });
    page.send(tungstenite::Message::text(
        json!({ "id": 900, "method": "enter", "params": slow }).to_string(),
    ));
    for id in 901..920 {
        let look =
            json!({ "id": id, "method": "choices", "params": { "state": { "session": 1 } } });
        page.send(tungstenite::Message::text(look.to_string()));
    }
    std::thread::sleep(std::time::Duration::from_millis(500));
    let stop = json!({ "id": 950, "method": "interrupt", "params": { "session": 1 } });
    page.send(tungstenite::Message::text(stop.to_string()));
    let mut answered = std::collections::BTreeSet::new();
    while answered.len() < 21 {
        let Some(tungstenite::Message::Text(text)) = page.next() else { panic!("closed") };
        let value: Value = serde_json::from_str(&text).unwrap();
        if let Some(id) = value["id"].as_u64() {
            if id == 900 {
                assert!(
                    value["result"]["text"].as_str().unwrap().contains("stopped early"),
                    "{value}"
                );
            }
            answered.insert(id);
        }
    }
    assert_eq!(text(&page.ask("enter", json!({ "session": 1, "text": "1 + 1" }))["text"]), "2\n");
}
