use pcadlang::diag::{IntoDiagnostic, SourceMap, render};
fn main() {
    for path in std::env::args().skip(1) {
        let text = std::fs::read_to_string(&path).unwrap();
        let mut map = SourceMap::new();
        let id = map.add(&path, &text);
        let (p, errors) = pcadlang::syntax::parse(&text, id);
        let d: Vec<_> = errors.into_iter().map(|e| e.into_diagnostic()).collect();
        println!("{}", render(&map, &d, false));
        if std::env::var("PRINT").is_ok() {
            println!("{}", pcadlang::syntax::print(&p));
        }
    }
}
