//! Inline images of iTerm2, which other terminals support too: a file in base64.

use base64::prelude::{BASE64_STANDARD, Engine as _};

/// Encodes a PNG for display at the cursor.
pub fn encode(png: &[u8]) -> String {
    format!(
        "\x1b]1337;File=inline=1;size={};preserveAspectRatio=1:{}\x07\n",
        png.len(),
        BASE64_STANDARD.encode(png)
    )
}

#[cfg(test)]
mod tests {
    use super::super::testing::{noise, png_of};
    use super::*;

    #[test]
    fn what_is_sent_is_the_picture() {
        let picture = noise(31, 17);
        let png = png_of(&picture);
        let sent = encode(&png);
        let body = sent
            .strip_prefix("\x1b]1337;File=")
            .and_then(|s| s.trim_end().strip_suffix('\x07'))
            .unwrap();
        let (settings, data) = body.split_once(':').unwrap();
        assert!(settings.contains("inline=1") && settings.contains(&format!("size={}", png.len())));
        assert_eq!(
            image::load_from_memory(&BASE64_STANDARD.decode(data).unwrap()).unwrap().to_rgb8(),
            picture
        );
    }
}
