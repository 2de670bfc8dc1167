//! The graphics protocol of kitty: a PNG in base64, in chunks of 4096 characters.

use base64::prelude::{BASE64_STANDARD, Engine as _};

/// The maximum length of a chunk; the protocol requires a multiple of 4.
const CHUNK: usize = 4096;

/// Encodes a PNG for display at the cursor.
pub fn encode(png: &[u8]) -> String {
    let data = BASE64_STANDARD.encode(png);
    let chunks: Vec<&str> =
        data.as_bytes().chunks(CHUNK).filter_map(|c| std::str::from_utf8(c).ok()).collect();
    let mut out = String::with_capacity(data.len() + 64 * chunks.len());
    for (i, chunk) in chunks.iter().enumerate() {
        let more = u8::from(i + 1 < chunks.len());
        // The first chunk has the format (PNG) and the action (display), and turns off
        // responses.
        let head = if i == 0 { "f=100,a=T,q=2," } else { "" };
        out += &format!("\x1b_G{head}m={more};{chunk}\x1b\\");
    }
    out.push('\n');
    out
}

#[cfg(test)]
mod tests {
    use super::super::testing::{noise, png_of};
    use super::*;

    #[test]
    fn what_is_sent_is_the_picture() {
        let picture = noise(90, 70);
        let sent = encode(&png_of(&picture));
        let mut data = String::new();
        let parts: Vec<&str> = sent.trim_end().split("\x1b\\").filter(|p| !p.is_empty()).collect();
        assert!(parts.len() > 1, "the picture takes several chunks");
        for (i, part) in parts.iter().enumerate() {
            let (control, chunk) = part.strip_prefix("\x1b_G").unwrap().split_once(';').unwrap();
            assert_eq!(control.ends_with("m=1"), i + 1 < parts.len());
            assert_eq!(control.contains("a=T"), i == 0);
            assert!(chunk.len() <= CHUNK && (chunk.len() % 4 == 0));
            data += chunk;
        }
        let back =
            image::load_from_memory(&BASE64_STANDARD.decode(&data).unwrap()).unwrap().to_rgb8();
        assert_eq!(back, picture);
    }
}
