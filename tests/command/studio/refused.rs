//! Requests that are refused: of others, out of the folder, too large, too many, malformed.

use super::client::{Page, Studio};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;
use tungstenite::Message;

fn status(answer: &str) -> &str {
    answer.split_whitespace().nth(1).unwrap_or("no answer")
}

#[test]
fn without_the_token_nothing_of_the_user_is_served() {
    let s = Studio::new(&[]);
    std::fs::write(s.folder.join("secret.json"), "{}").unwrap();
    // The page itself holds nothing.
    let page = s.get("/");
    assert_eq!(status(&page), "200");
    assert!(page.contains("content-security-policy: default-src 'none'"), "{page}");
    for asset in ["/studio.js", "/studio.css", "/licences.txt"] {
        assert_eq!(status(&s.get(asset)), "200", "{asset}");
    }
    assert_eq!(status(&s.get("/report.js")), "404");
    assert_eq!(status(&s.get(&format!("/files/secret.json?token={}", s.token))), "200");
    let wrong = s.token.replace(|c: char| c.is_ascii_digit(), "a");
    for token in
        ["", "?token=", "?token=1", &format!("?token={wrong}"), &format!("?token={}0", s.token)]
    {
        assert_eq!(status(&s.get(&format!("/files/secret.json{token}"))), "401", "{token}");
        for socket in ["/socket", "/language"] {
            assert_eq!(Page::connect(s.port, &format!("{socket}{token}"), None).err(), Some(401));
        }
        let upload = format!(
            "POST /pictures{token} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Length: 3\r\nConnection: close\r\n\r\nabc",
            s.port
        );
        assert_eq!(status(&s.raw(&upload)), "401");
    }
}

#[test]
fn other_pages_and_other_names_are_refused() {
    let s = Studio::new(&[]);
    let path = format!("/socket?token={}", s.token);
    let own = format!("http://127.0.0.1:{}", s.port);
    assert!(Page::connect(s.port, &path, Some(&own)).is_ok());
    for origin in ["http://evil.example", "null", "http://127.0.0.1:1", "https://127.0.0.1"] {
        assert_eq!(Page::connect(s.port, &path, Some(origin)).err(), Some(403), "{origin}");
    }
    for host in ["evil.example", "127.0.0.1.evil.example:80", ""] {
        let request = format!("GET / HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
        assert_eq!(status(&s.raw(&request)), "403", "{host}");
    }
}

#[test]
fn no_path_leads_out_of_the_folder() {
    let s = Studio::new(&[]);
    #[cfg(unix)]
    std::os::unix::fs::symlink("/etc", s.folder.join("link")).unwrap();
    for path in
        ["../x", "%2e%2e/x", "..%2fx", "a/..%2f..%2fx", "%2fetc/passwd", "link/passwd", "a%00b"]
    {
        let answer = s.get(&format!("/files/{path}?token={}", s.token));
        assert!(["403", "404", "400"].contains(&status(&answer)), "{path}: {answer}");
        assert!(!answer.contains("root:"), "{path}");
    }
    let mut page = s.page();
    for file in ["../x.pcad", "/etc/x.pcad", "link/x.pcad", ""] {
        for (method, params) in [
            ("read", json!({ "file": file })),
            ("write", json!({ "file": file, "text": "" })),
            ("open", json!({ "program": file })),
            ("open", json!({ "program": "coin.pcad", "observe": [format!("{file}.png")] })),
            ("open", json!({ "run": file })),
            ("evaluation", json!({ "folder": file })),
        ] {
            if (method, file) != ("open", "") {
                let said = page.refused(method, params);
                assert!(
                    said.contains("opened folder") || file.is_empty(),
                    "{method} {file}: {said}"
                );
            }
        }
    }
    assert!(page.refused("write", json!({ "file": "run.json", "text": "" })).contains(".pcad"));
    // What is typed at the prompt is confined, too.
    let id = page.ask("open", json!({ "program": "coin.pcad" }))["session"].clone();
    for text in
        [":save ../x", ":load /etc/x", ":render ../x.png", "export heads to \"/tmp/x.txt\";"]
    {
        let said = page.refused("enter", json!({ "session": id, "text": text }));
        assert!(said.contains("not a file of this folder"), "{text}: {said}");
    }
}

#[test]
fn large_uploads_are_refused_before_they_are_read() {
    let s = Studio::new(&[]);
    let head = format!(
        "POST /pictures?token={}&name=a.png HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nConnection: close\r\n",
        s.token, s.port
    );
    let answer = s.raw(&format!("{head}Content-Length: {}\r\n\r\n", 1u64 << 30));
    assert_eq!(status(&answer), "413", "{answer}");
    assert!(answer.contains("64 MiB"), "{answer}");
    // Without a length, a gigabyte in pieces is cut off as well.
    let mut stream = TcpStream::connect(("127.0.0.1", s.port)).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    stream.write_all(format!("{head}Transfer-Encoding: chunked\r\n\r\n").as_bytes()).unwrap();
    let piece = [b"100000\r\n".to_vec(), vec![0; 1 << 20], b"\r\n".to_vec()].concat();
    let sent = (0..1024).take_while(|_| stream.write_all(&piece).is_ok()).count();
    assert!(sent < 200, "{sent} MiB were taken");
    let answer = s.raw(&format!("{head}Content-Length: 3\r\n\r\nabc"));
    assert!(status(&answer) == "400" && answer.contains("a.png"), "no picture: {answer}");
    assert!(!s.folder.join("pictures/a.png").exists());
}

#[test]
fn malformed_frames_are_answered_and_the_socket_stays() {
    let s = Studio::new(&[]);
    let mut page = s.page();
    let next = |page: &mut Page| -> Value {
        loop {
            let Some(Message::Text(text)) = page.next() else { panic!("closed") };
            let value: Value = serde_json::from_str(&text).unwrap();
            if value.get("event").is_none() {
                return value;
            }
        }
    };
    for text in ["", "{", "[]", "7", "null", "{\"id\":1}", "{\"id\":\"1\",\"method\":\"runs\"}"] {
        page.send(Message::text(text));
        let said = next(&mut page);
        assert!(said["error"]["message"].is_string(), "{text}: {said}");
    }
    page.send(Message::binary(vec![0, 1, 2]));
    assert!(next(&mut page)["error"]["message"].as_str().unwrap().contains("text frames"));
    page.send(Message::text(format!("{{\"id\":2,\"method\":\"{}\"}}", "x".repeat(1 << 20))));
    assert_eq!(next(&mut page)["id"], 2);
    let deep = format!(
        "{{\"id\":3,\"method\":\"read\",\"params\":{}{}}}",
        "[".repeat(100_000),
        "]".repeat(100_000)
    );
    page.send(Message::text(deep));
    assert!(next(&mut page)["error"].is_object());
    assert!(page.refused("fly", json!({})).contains("no method"));
    assert!(page.refused("session", json!({ "session": 99 })).contains("not open"));
    assert!(
        page.refused("picture", json!({ "state": {}, "layer": "depth", "size": 64 }))
            .contains("state")
    );
    page.ask("folder", json!({}));
    // A frame beyond the limit closes the socket, and only this one.
    let mut other = s.page();
    let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        page.send(Message::text("x".repeat(17 << 20)));
    }));
    while page.next().is_some() {}
    other.ask("folder", json!({}));
}

#[test]
fn connections_beyond_the_limit_are_told_so() {
    let s = Studio::new(&[]);
    let connect = || {
        let stream = TcpStream::connect(("127.0.0.1", s.port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        stream
    };
    let mut idle: Vec<TcpStream> = (0..256).map(|_| connect()).collect();
    // The server takes connections in order: the next one is beyond.
    let mut said = String::new();
    for _ in 0..20 {
        let mut more = connect();
        said.clear();
        let _ = more.read_to_string(&mut said);
        assert!(
            said.starts_with("HTTP/1.1 503") && said.contains("too many connections"),
            "{said}"
        );
    }
    idle.truncate(100);
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(status(&s.get("/")), "200");
}

/// 10,000 connections, one after another, with at most 256 open.
#[test]
#[ignore = "ten thousand connections take half a minute"]
fn ten_thousand_connections() {
    let s = Studio::new(&[]);
    let mut open = std::collections::VecDeque::new();
    let mut refused = 0;
    for _ in 0..10_000 {
        let Ok(stream) = TcpStream::connect(("127.0.0.1", s.port)) else {
            refused += 1;
            continue;
        };
        open.push_back(stream);
        if open.len() > 900 {
            open.pop_front();
        }
    }
    drop(open);
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(status(&s.get("/")), "200", "{refused} were refused by the system");
    s.page().ask("folder", json!({}));
}
