//! The binary container: a header, the JSON, and a buffer.

use crate::ReadError;

/// The parts of a GLB file.
pub(super) struct Container<'a> {
    pub(super) json: &'a [u8],
    pub(super) binary: Option<&'a [u8]>,
}

/// Is it a GLB file by its first bytes?
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    bytes.starts_with(b"glTF")
}

/// Takes a GLB file apart.
///
/// # Errors
///
/// Another version than 2, or chunks that are longer than the file.
pub(super) fn open(bytes: &[u8]) -> Result<Container<'_>, ReadError> {
    let version = number(bytes, 4)?;
    if version == 1 {
        return Err(ReadError::whole(
            "this is glTF 1.0, as a binary file; only 2.0 is read: convert the file, or export it again",
        ));
    }
    if version != 2 {
        return Err(ReadError::whole(format!(
            "the container has version {version} (allowed 2)"
        )));
    }
    let length = number(bytes, 8)? as usize;
    // A program that forgets to pad may count what it should have padded.
    let length = if length > bytes.len() && length - bytes.len() < 4 {
        bytes.len()
    } else {
        length
    };
    if length > bytes.len() || length < 12 {
        return Err(ReadError::whole(format!(
            "the file has {} bytes, its header says {length}: it is not whole",
            bytes.len()
        )));
    }
    let bytes = &bytes[..length];
    let mut json = None;
    let mut binary = None;
    let mut at = 12;
    while at < bytes.len() {
        let length = number(bytes, at)? as usize;
        let kind = number(bytes, at + 4)?.to_le_bytes();
        let start = at + 8;
        // The last one may lack its padding.
        let left = bytes.len().saturating_sub(start);
        let length = if length > left && length - left < 4 {
            left
        } else {
            length
        };
        let Some(chunk) = start
            .checked_add(length)
            .and_then(|end| bytes.get(start..end))
        else {
            return Err(ReadError::whole(format!(
                "byte {at}: a chunk of {length} bytes, but {} are left",
                bytes.len() - start
            )));
        };
        match &kind {
            // Padded with blanks; with zeros by some.
            b"JSON" if json.is_none() => json = Some(without_zeros(chunk)),
            b"BIN\0" if json.is_some() && binary.is_none() => binary = Some(chunk),
            // The standard asks that other chunks be passed over.
            _ => {}
        }
        at = next_chunk(bytes, start + length);
    }
    let json = json.ok_or_else(|| ReadError::whole("there is no JSON chunk in it"))?;
    if json.iter().all(|byte| byte.is_ascii_whitespace()) {
        return Err(ReadError::whole("the JSON chunk of the file is empty"));
    }
    Ok(Container { json, binary })
}

fn without_zeros(chunk: &[u8]) -> &[u8] {
    let n = chunk
        .iter()
        .rposition(|&byte| byte != 0)
        .map_or(0, |last| last + 1);
    &chunk[..n]
}

/// Where the chunk after one that ends at `end` starts: chunks end at multiples of four,
/// also where one forgot to say so; or forgot to pad, and the next follows at once.
fn next_chunk(bytes: &[u8], end: usize) -> usize {
    let padded = end.next_multiple_of(4);
    let fits = |at: usize| {
        let length = number(bytes, at).ok()?;
        let kind = number(bytes, at + 4).ok()?.to_le_bytes();
        let is_known = [*b"BIN\0", *b"JSON"].contains(&kind);
        Some(is_known && at + 8 + length as usize <= bytes.len())
    };
    if padded != end && fits(padded) != Some(true) && fits(end) == Some(true) {
        end
    } else {
        padded
    }
}

fn number(bytes: &[u8], at: usize) -> Result<u32, ReadError> {
    match bytes.get(at..).and_then(<[u8]>::first_chunk) {
        Some(four) => Ok(u32::from_le_bytes(*four)),
        None => Err(ReadError::whole(format!(
            "byte {at}: the file ends within a header"
        ))),
    }
}
