//! From the bytes of a text file to its text.
//!
//! UTF-8 is read, UTF-16 that begins with its mark, and Latin-1, in which many names of
//! old files are: every byte is the character of that number, so nothing is lost.

/// A text, and whether it was in UTF-8.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Text {
    /// What it says, without a mark at its start.
    pub text: String,
    /// What it was read as, if not UTF-8.
    pub encoding: Option<&'static str>,
}

impl Text {
    /// A note for the user, if there is something to say of a file of this name.
    #[must_use]
    pub fn note(&self, name: &str) -> Option<String> {
        let encoding = self.encoding?;
        Some(format!("'{name}' is not UTF-8: read as {encoding}"))
    }
}

/// Reads bytes as text.
///
/// # Errors
///
/// If they are no text in any of these encodings: zero bytes in what is not UTF-16, or half
/// a character.
pub fn decoded(bytes: &[u8]) -> Result<Text, String> {
    let wide = match bytes {
        [0xff, 0xfe, rest @ ..] => Some((rest, u16::from_le_bytes as fn([u8; 2]) -> u16)),
        [0xfe, 0xff, rest @ ..] => Some((rest, u16::from_be_bytes as fn([u8; 2]) -> u16)),
        _ => None,
    };
    if let Some((rest, unit)) = wide {
        let (units, half) = rest.as_chunks::<2>();
        let text = char::decode_utf16(units.iter().map(|&pair| unit(pair)));
        let text: Result<String, _> = text.collect();
        return match text {
            Ok(text) if half.is_empty() => Ok(Text {
                text,
                encoding: Some("UTF-16"),
            }),
            _ => Err("begins as UTF-16 text, and is none".to_owned()),
        };
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(Text {
            text: text.to_owned(),
            encoding: None,
        }),
        Err(_) if bytes.contains(&0) => Err("is not text: there are zero bytes in it".to_owned()),
        Err(_) => Ok(Text {
            text: bytes.iter().map(|&byte| char::from(byte)).collect(),
            encoding: Some("Latin-1"),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_in_every_encoding() {
        let name = "Büro 1½";
        let latin: Vec<u8> = name.chars().map(|c| u8::try_from(c).unwrap()).collect();
        let little = [0xfeff].into_iter().chain(name.encode_utf16());
        let little: Vec<u8> = little.flat_map(u16::to_le_bytes).collect();
        let big = [0xfeff].into_iter().chain(name.encode_utf16());
        let big: Vec<u8> = big.flat_map(u16::to_be_bytes).collect();
        let marked = format!("\u{feff}{name}").into_bytes();
        for (bytes, encoding) in [
            (name.as_bytes().to_vec(), None),
            (marked, None),
            (latin, Some("Latin-1")),
            (little, Some("UTF-16")),
            (big, Some("UTF-16")),
        ] {
            let text = decoded(&bytes).unwrap();
            assert_eq!((text.text.as_str(), text.encoding), (name, encoding));
            assert_eq!(text.note("a.obj").is_some(), encoding.is_some());
        }
    }

    #[test]
    fn what_is_no_text_is_refused() {
        for bytes in [&b"\xff\xfea"[..], b"\xfe\xff\xd8\x00\x00a", b"\x80\0a"] {
            assert!(decoded(bytes).is_err(), "{bytes:?}");
        }
    }
}
