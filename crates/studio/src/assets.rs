//! The files of the page, bundled ahead from `web/`.

use std::borrow::Cow;
use std::path::Path;

/// Name, type and contents of each file.
const ASSETS: [(&str, &str, &[u8]); 4] = [
    ("index.html", "text/html; charset=utf-8", include_bytes!("../../../web/dist/index.html")),
    ("studio.js", "text/javascript; charset=utf-8", include_bytes!("../../../web/dist/studio.js")),
    ("studio.css", "text/css; charset=utf-8", include_bytes!("../../../web/dist/studio.css")),
    ("licences.txt", "text/plain; charset=utf-8", include_bytes!("../../../web/dist/licences.txt")),
];

/// Returns the type and the contents of a file of the page. They are read from `folder`
/// if one is given, for those who work on the page.
pub fn find(name: &str, folder: Option<&Path>) -> Option<(&'static str, Cow<'static, [u8]>)> {
    let (name, kind, bytes) = ASSETS.iter().find(|(n, ..)| *n == name)?;
    let read = folder.and_then(|f| std::fs::read(f.join(name)).ok());
    Some((kind, read.map_or(Cow::Borrowed(*bytes), Cow::Owned)))
}
