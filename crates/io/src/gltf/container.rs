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
    if version != 2 {
        return Err(ReadError::whole(format!(
            "the container has version {version} (allowed 2)"
        )));
    }
    let length = number(bytes, 8)? as usize;
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
            b"JSON" if json.is_none() => json = Some(chunk),
            b"BIN\0" if json.is_some() && binary.is_none() => binary = Some(chunk),
            // The standard asks that other chunks be passed over.
            _ => {}
        }
        // Chunks end at multiples of four, also where one forgot to say so.
        at = (start + length).next_multiple_of(4);
    }
    let json = json.ok_or_else(|| ReadError::whole("there is no JSON chunk in it"))?;
    Ok(Container { json, binary })
}

fn number(bytes: &[u8], at: usize) -> Result<u32, ReadError> {
    match bytes.get(at..).and_then(<[u8]>::first_chunk) {
        Some(four) => Ok(u32::from_le_bytes(*four)),
        None => Err(ReadError::whole(format!(
            "byte {at}: the file ends within a header"
        ))),
    }
}
