//! The container of a glTF file: the chunks of a GLB, and buffers within the file, in
//! other files, or in `data:` URIs.

use super::extensions;
use super::json::{Document, Node};
use crate::geom::GeomError;
use base64::Engine as _;
use base64::alphabet::STANDARD;
use base64::engine::general_purpose::{GeneralPurpose, NO_PAD};
use std::borrow::Cow;

/// Reads a file named relative to the glTF file; the error is a message.
pub type Read<'a> = dyn Fn(&str) -> Result<Vec<u8>, String> + 'a;

/// The maximum number of buffers of a file.
const MOST_BUFFERS: usize = 1024;
fn invalid(message: impl Into<String>) -> GeomError {
    GeomError::invalid(message)
}

/// True if a file is glTF: a GLB, JSON with the key `asset`, or a name that ends in
/// `.gltf` or `.glb`.
pub fn is_gltf(file: &str, bytes: &[u8]) -> bool {
    #[derive(serde::Deserialize)]
    struct Head {
        asset: Option<serde::de::IgnoredAny>,
    }
    let ending = file.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
    bytes.starts_with(b"glTF")
        || matches!(&*ending, "gltf" | "glb")
        || serde_json::from_slice::<Head>(bytes).is_ok_and(|h| h.asset.is_some())
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let four: [u8; 4] = bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
    usize::try_from(u32::from_le_bytes(four)).ok()
}

/// Returns the document, and the binary chunk that follows it in a GLB.
pub(super) fn open(bytes: &[u8]) -> Result<(Document, Option<&[u8]>), GeomError> {
    let (text, bin) = if bytes.starts_with(b"glTF") { chunks(bytes)? } else { (bytes, None) };
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let document: Document = serde_json::from_slice(text)
        .map_err(|e| invalid(format!("cannot read the glTF file: {e}")))?;
    let version = &document.asset.version;
    if !version.starts_with("2.") {
        return Err(invalid(format!("only glTF version 2 is supported, not {version}")));
    }
    extensions::check(&document)?;
    Ok((document, bin))
}

fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), GeomError> {
    let short = || invalid("the GLB file is truncated");
    let version = word(bytes, 4).ok_or_else(short)?;
    if version != 2 {
        return Err(invalid(format!("only GLB version 2 is supported, not {version}")));
    }
    let bytes = bytes.get(..word(bytes, 8).ok_or_else(short)?).ok_or_else(short)?;
    let chunk = |at: usize| -> Option<(&[u8], &[u8], usize)> {
        let end = at.checked_add(8)?.checked_add(word(bytes, at)?)?;
        Some((bytes.get(at + 4..at + 8)?, bytes.get(at + 8..end)?, end))
    };
    let (kind, text, end) = chunk(12).ok_or_else(short)?;
    if kind != b"JSON" {
        return Err(invalid("the GLB file does not start with a chunk of JSON"));
    }
    if end >= bytes.len() {
        return Ok((text, None));
    }
    let (kind, bin, _) = chunk(end).ok_or_else(short)?;
    Ok((text, (kind == b"BIN\0").then_some(bin)))
}

/// Returns the contents of every buffer, each at least as long as it declares; those that stand
/// for compressed views are empty.
pub(super) fn buffers<'a>(
    document: &Document,
    bin: Option<&'a [u8]>,
    read: &Read,
) -> Result<Vec<Cow<'a, [u8]>>, GeomError> {
    let count = document.buffers.len();
    if count > MOST_BUFFERS {
        return Err(invalid(format!(
            "the glTF file has {count} buffers; at most {MOST_BUFFERS} are supported"
        )));
    }
    let mut all = Vec::with_capacity(count);
    for (i, b) in document.buffers.iter().enumerate() {
        if b.extensions.meshopt.as_ref().is_some_and(|m| m.fallback) {
            all.push(Cow::Borrowed(&[][..]));
            continue;
        }
        let bytes: Cow<[u8]> = match (&b.uri, bin) {
            (None, Some(bin)) if i == 0 => Cow::Borrowed(bin),
            (None, _) => return Err(invalid(format!("buffer {i} of the glTF file has no URI"))),
            (Some(uri), _) => Cow::Owned(match uri.strip_prefix("data:") {
                Some(rest) => data(rest)
                    .ok_or_else(|| invalid(format!("buffer {i} of the glTF file is not base64")))?,
                None if uri.contains("://") => {
                    return Err(invalid(format!(
                        "buffer {i} of the glTF file is at {uri}: only files are supported"
                    )));
                }
                None => read(&unescaped(uri)).map_err(invalid)?,
            }),
        };
        if bytes.len() < b.byte_length {
            let (has, says) = (bytes.len(), b.byte_length);
            return Err(invalid(format!(
                "buffer {i} of the glTF file has {has} bytes, but declares {says}"
            )));
        }
        all.push(bytes);
    }
    Ok(all)
}

/// Decodes the part of a URI after `data:`.
fn data(rest: &str) -> Option<Vec<u8>> {
    let (kind, text) = rest.split_once(',')?;
    if kind.ends_with(";base64") { base64(text) } else { None }
}

/// Decodes base64 (RFC 4648, section 4); padding is optional.
fn base64(text: &str) -> Option<Vec<u8>> {
    const LENIENT: GeneralPurpose =
        GeneralPurpose::new(&STANDARD, NO_PAD.with_decode_allow_trailing_bits(true));
    LENIENT.decode(text.trim_end_matches('=')).ok()
}

/// Decodes percent escapes such as `%20` in a path.
fn unescaped(uri: &str) -> String {
    let (bytes, mut out, mut i) = (uri.as_bytes(), Vec::with_capacity(uri.len()), 0);
    while let Some(c) = bytes.get(i) {
        let hex = bytes.get(i + 1..i + 3).and_then(|h| std::str::from_utf8(h).ok());
        match hex.and_then(|h| u8::from_str_radix(h, 16).ok()) {
            Some(x) if *c == b'%' => {
                out.push(x);
                i += 3;
            }
            _ => {
                out.push(*c);
                i += 1;
            }
        }
    }
    String::from_utf8(out).unwrap_or_else(|_| uri.to_owned())
}

/// Returns the name of a node in messages.
pub(super) fn name_of(node: &Node, number: usize) -> String {
    match &node.name {
        Some(name) if !name.is_empty() => name.clone(),
        _ => format!("node_{number}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_as_in_the_rfc() {
        let known = ["", "f", "fo", "foo", "foob", "fooba", "foobar"];
        let coded = ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"];
        for (k, c) in known.iter().zip(coded) {
            assert_eq!(base64(c).as_deref(), Some(k.as_bytes()));
        }
        let f = || Some(b"f".to_vec());
        assert_eq!((base64("Zm9v!"), base64("Zm9vY")), (None, None));
        // Neither the padding nor the bits that no byte needs are looked at.
        assert_eq!((base64("Zg"), base64("Zg="), base64("Zh==")), (f(), f(), f()));
        assert_eq!((base64("Z=g="), base64("Zm9v\n")), (None, None));
        assert_eq!(base64("+/+/").as_deref(), Some(&[0xfb, 0xff, 0xbf][..]));
        assert_eq!(unescaped("a%20b%2.bin%"), "a b%2.bin%");
    }

    #[test]
    fn files_are_told_apart() {
        assert!(is_gltf("a", b"glTF"));
        assert!(is_gltf("a.json", br#" {"scene": 0, "asset": {"version": "2.0"}}"#));
        assert!(is_gltf("a.GLB", b"") && is_gltf("a.gltf", b"{"));
        assert!(
            !is_gltf("a.rig.json", br#"{"mesh": "a.obj", "joints": []}"#)
                && !is_gltf("gl.obj", b"v 0 0 0")
        );
    }
}
