//! A client plays requests against `pcadlang lsp`.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdout, Command, Stdio};

struct Client {
    server: Child,
    out: BufReader<ChildStdout>,
    sent: i64,
    /// Messages that were not answers, in order.
    notes: Vec<Value>,
}

const URI: &str = "file:///nowhere/line.pcad";
const TEXT: &str = "param scale = 2 \"of the prior\";
fn line(x, slope) { slope * x }
assume slope ~ normal(0, scale);
// é: columns after this are counted in units of 16 bits
for i in 0 .. 3 { observe normal(line(i, slope), 1) = i as y; }
let \u{e9}t = 1;
infer { repeat 100 { mh(@slope); } }
";

impl Client {
    fn new() -> Client {
        let mut server = Command::new(env!("CARGO_BIN_EXE_pcadlang"))
            .arg("lsp")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let out = BufReader::new(server.stdout.take().unwrap());
        let mut client = Client { server, out, sent: 0, notes: Vec::new() };
        let answer = client.request("initialize", json!({ "capabilities": {} }));
        assert_eq!(answer["result"]["capabilities"]["positionEncoding"], "utf-16");
        client.send(json!({ "method": "initialized", "params": {} }));
        client
    }

    fn send(&mut self, mut message: Value) {
        message["jsonrpc"] = "2.0".into();
        let text = message.to_string();
        let to = self.server.stdin.as_mut().unwrap();
        write!(to, "Content-Length: {}\r\n\r\n{text}", text.len()).unwrap();
        to.flush().unwrap();
    }

    fn receive(&mut self) -> Value {
        let mut length = 0;
        loop {
            let mut line = String::new();
            assert!(self.out.read_line(&mut line).unwrap() > 0, "the server is gone");
            if let Some(n) = line.to_lowercase().strip_prefix("content-length:") {
                length = n.trim().parse().unwrap();
            }
            if line.trim().is_empty() {
                break;
            }
        }
        let mut bytes = vec![0; length];
        self.out.read_exact(&mut bytes).unwrap();
        serde_json::from_slice(&bytes).unwrap()
    }

    fn request(&mut self, method: &str, params: Value) -> Value {
        self.sent += 1;
        let id = self.sent;
        self.send(json!({ "id": id, "method": method, "params": params }));
        loop {
            let message = self.receive();
            if message["id"] == id {
                return message;
            }
            self.notes.push(message);
        }
    }

    /// A request about the document, which must succeed.
    fn ask(&mut self, method: &str, mut params: Value) -> Value {
        params["textDocument"] = json!({ "uri": URI });
        let answer = self.request(method, params);
        assert!(answer.get("error").is_none(), "{method}: {answer}");
        answer["result"].clone()
    }

    fn open(&mut self, text: &str) -> Value {
        let document = json!({ "uri": URI, "languageId": "pcad", "version": 1, "text": text });
        self.send(json!({
            "method": "textDocument/didOpen", "params": { "textDocument": document },
        }));
        self.mistakes()
    }

    fn change(&mut self, version: i64, text: &str) -> Value {
        let params = json!({
            "textDocument": { "uri": URI, "version": version }, "contentChanges": [{ "text": text }],
        });
        self.send(json!({ "method": "textDocument/didChange", "params": params }));
        self.mistakes()
    }

    /// The next list of mistakes.
    fn mistakes(&mut self) -> Value {
        let message = self.receive();
        assert_eq!(message["method"], "textDocument/publishDiagnostics", "{message}");
        message["params"].clone()
    }

    fn end(mut self) {
        assert!(self.request("shutdown", Value::Null)["result"].is_null());
        self.send(json!({ "method": "exit" }));
        assert!(self.server.wait().unwrap().success());
    }
}

fn at(line: u32, character: u32) -> Value {
    json!({ "position": { "line": line, "character": character } })
}

fn lines(places: &Value) -> Vec<u64> {
    places
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["range"]["start"]["line"].as_u64().unwrap())
        .collect()
}

#[test]
fn a_client_plays_requests() {
    let mut c = Client::new();
    assert_eq!(c.open(TEXT)["diagnostics"].as_array().unwrap().len(), 1, "é is no letter of names");
    let text = TEXT.replace("\u{e9}t", "et").replace("slope * x", "slope*x");
    assert_eq!(c.change(2, &text)["diagnostics"], json!([]));

    let hover = |c: &mut Client, line, column| {
        c.ask("textDocument/hover", at(line, column))["contents"]["value"].to_string()
    };
    assert!(hover(&mut c, 2, 17).contains("The normal distribution."));
    assert!(hover(&mut c, 2, 26).contains("of the prior"));
    assert!(hover(&mut c, 1, 4).contains("function `line`"));
    assert!(hover(&mut c, 4, 20).contains("observe"));
    assert_eq!(hover(&mut c, 3, 1), "null");

    let definition = c.ask("textDocument/definition", at(4, 35));
    assert_eq!(
        (&definition["uri"], &definition["range"]["start"]["line"]),
        (&json!(URI), &json!(1))
    );
    assert!(c.ask("textDocument/definition", at(2, 17)).is_null());
    let mut params = at(2, 8);
    params["context"] = json!({ "includeDeclaration": true });
    assert_eq!(lines(&c.ask("textDocument/references", params.clone())), [2, 4, 6]);
    params["context"] = json!({ "includeDeclaration": false });
    assert_eq!(lines(&c.ask("textDocument/references", params)), [4, 6]);
    assert_eq!(lines(&c.ask("textDocument/documentHighlight", at(1, 11))), [1, 1]);

    let prepared = c.ask("textDocument/prepareRename", at(2, 8));
    assert_eq!(prepared["placeholder"], "slope");
    let mut params = at(2, 8);
    params["newName"] = "gradient".into();
    let edits = c.ask("textDocument/rename", params)["changes"][URI].clone();
    assert_eq!(lines(&edits), [2, 4, 6]);
    assert_eq!(edits[2]["range"]["start"]["character"], 25, "without the @");

    let symbols = c.ask("textDocument/documentSymbol", json!({}));
    let names: Vec<&str> =
        symbols.as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["scale", "line", "slope", "y", "et"]);

    let labels = |items: Value| -> Vec<String> {
        let all = items.as_array().unwrap().iter();
        all.map(|i| i["label"].as_str().unwrap().to_owned()).collect()
    };
    assert!(labels(c.ask("textDocument/completion", at(2, 18))).contains(&"normal".to_owned()));
    assert!(labels(c.ask("textDocument/completion", at(6, 25))).contains(&"@slope".to_owned()));
    let whole = json!({ "range": { "start": { "line": 0, "character": 0 }, "end": { "line": 9, "character": 0 } } });
    assert_eq!(labels(c.ask("textDocument/inlayHint", whole)), ["@slope: all numbers"]);

    let tokens = c.ask("textDocument/semanticTokens/full", json!({}));
    let data = tokens["data"].as_array().unwrap();
    assert!(data.len() > 100 && data.len().is_multiple_of(5));
    assert_eq!(data[..5], [0, 0, 5, 0, 0].map(Value::from), "the keyword `param`");

    let options = json!({ "options": { "tabSize": 2, "insertSpaces": true } });
    assert_eq!(c.ask("textDocument/formatting", options.clone()).as_array().unwrap().len(), 1);
    let formatted = pcadlang_syntax::format(&text).unwrap();
    assert_eq!(c.change(3, &formatted)["diagnostics"], json!([]));
    assert_eq!(c.ask("textDocument/formatting", options), json!([]));

    // Mistakes have hints, in the units of the editor.
    let wrong = "/* 𝄞 */ assume x ~ norml(0, 1);";
    let found = c.change(4, wrong)["diagnostics"][0].clone();
    assert_eq!(found["range"]["start"], json!({ "line": 0, "character": 20 }));
    assert!(found["message"].as_str().unwrap().contains("did you mean `normal`?"));
    assert_eq!(c.change(5, "let x = 1;")["diagnostics"], json!([]));

    // What does not fit is refused, and the server goes on.
    for (method, params) in [
        (
            "textDocument/hover",
            json!({ "textDocument": { "uri": "file:///other.pcad" }, "position": { "line": 0, "character": 0 } }),
        ),
        ("textDocument/hover", json!([1, 2])),
        (
            "textDocument/rename",
            json!({ "textDocument": { "uri": URI }, "position": { "line": 0, "character": 4 }, "newName": "let" }),
        ),
        ("workspace/nothing", json!({})),
    ] {
        let answer = c.request(method, params);
        assert!(answer["error"]["message"].as_str().is_some_and(|m| !m.is_empty()), "{answer}");
    }
    assert!(hover(&mut c, 0, 4).contains("value `x`"));
    c.send(json!({
        "method": "textDocument/didClose", "params": { "textDocument": { "uri": URI } },
    }));
    assert_eq!(
        c.request(
            "textDocument/hover",
            json!({ "textDocument": { "uri": URI }, "position": { "line": 0, "character": 0 } })
        )["error"]["code"],
        -32602
    );
    c.end();
}

/// Mistakes in an included file are shown there, and disappear with the document.
#[test]
fn included_files_have_their_own_mistakes() {
    let folder = crate::common::folder::Folder::new("lsp");
    folder.write("part.pcad", "let a = nothing_here;\n");
    let part = format!("file://{}", folder.path().join("part.pcad").display());
    let main = format!("file://{}", folder.path().join("main.pcad").display());
    let mut c = Client::new();
    let document = json!({ "uri": main, "languageId": "pcad", "version": 1, "text": "include \"part.pcad\";" });
    c.send(json!({ "method": "textDocument/didOpen", "params": { "textDocument": document } }));
    let notes = [c.mistakes(), c.mistakes()];
    let of = |uri: &str| {
        let found = notes.iter().find(|n| n["uri"] == uri).unwrap_or_else(|| panic!("{notes:?}"));
        found["diagnostics"].as_array().unwrap().len()
    };
    assert_eq!((of(&part), of(&main)), (1, 0));
    folder.write("part.pcad", "let a = 1;\n");
    c.send(json!({
        "method": "textDocument/didSave", "params": { "textDocument": { "uri": part } },
    }));
    for note in [c.mistakes(), c.mistakes()] {
        assert_eq!(note["diagnostics"], json!([]), "mended on the disk");
    }
    folder.write("part.pcad", "let a = nothing_here;\n");
    c.send(json!({
        "method": "textDocument/didSave", "params": { "textDocument": { "uri": part } },
    }));
    let notes = [c.mistakes(), c.mistakes()];
    assert_eq!(notes.iter().filter(|n| n["diagnostics"] != json!([])).count(), 1);
    c.send(json!({
        "method": "textDocument/didClose", "params": { "textDocument": { "uri": main } },
    }));
    let cleared = c.mistakes();
    assert_eq!((&cleared["uri"], &cleared["diagnostics"]), (&json!(part), &json!([])));
    c.end();
}

/// The signature of the call around the cursor, with the argument that is being written.
#[test]
fn signatures_follow_the_cursor() {
    let text = "fn line(x, slope) { slope * x }
let a = line(1, [2, 3]);
let b = map(fn(i) { i }, [max(1, (2 + 3)), \"x(,\"]);
assume c ~ truncated_normal(0, sd = 1);
";
    let mut c = Client::new();
    c.open(text);
    let mut help = |line: u32, before: &str| -> Option<(String, String)> {
        let column = text.lines().nth(line as usize).unwrap().find(before).unwrap() as u32;
        let found = c.ask("textDocument/signatureHelp", at(line, column + before.len() as u32));
        let signature = found.get("signatures")?[0].clone();
        let label = signature["label"].as_str().unwrap().to_owned();
        let active = signature["activeParameter"].as_u64().unwrap() as usize;
        let place = &signature["parameters"][active]["label"];
        let part = place.as_array().map_or(String::new(), |place| {
            let [from, to] = [0, 1].map(|i| place[i].as_u64().unwrap() as usize);
            label.chars().skip(from).take(to - from).collect()
        });
        Some((label, part))
    };
    let is = |label: &str, part: &str| Some((label.to_owned(), part.to_owned()));
    assert_eq!(help(1, "line("), is("line(x, slope)", "x"));
    assert_eq!(help(1, "line(1, [2, "), is("line(x, slope)", "slope"));
    assert_eq!(help(2, "max(1, (2 + 3"), is("max(x, …)", "x"));
    assert_eq!(help(1, "let a"), None);
    let (label, part) = help(3, "truncated_normal(0, sd = ").unwrap();
    assert!(label.starts_with("truncated_normal(") && part.starts_with("sd"), "{label} {part}");
    c.end();
}
