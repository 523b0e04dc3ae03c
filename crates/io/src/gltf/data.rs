//! Buffers and accessors: every range is checked before it is read.

use super::document::{Accessor, Document};
use crate::ReadError;
use base64::Engine as _;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use glam::DVec3;
use percent_encoding::percent_decode_str;
use std::borrow::Cow;

/// Exporters leave the padding out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The bytes of all buffers that were asked for.
pub(super) struct Data<'a> {
    document: &'a Document,
    binary: Option<&'a [u8]>,
    load: &'a mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    buffers: Vec<Option<Cow<'a, [u8]>>>,
}

impl<'a> Data<'a> {
    pub(super) fn new(
        document: &'a Document,
        binary: Option<&'a [u8]>,
        load: &'a mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    ) -> Self {
        Self {
            document,
            binary,
            load,
            buffers: vec![None; document.buffers.len()],
        }
    }

    /// Points: three floats, or three small integers as quantised meshes have.
    ///
    /// Returns them with the largest coordinate.
    pub(super) fn points(&mut self, accessor: usize, what: &str) -> Result<Vec<DVec3>, ReadError> {
        let accessor = self.accessor(accessor, what)?;
        if accessor.kind != "VEC3" {
            return Err(ReadError::whole(format!(
                "{what} is {} (allowed VEC3)",
                accessor.kind
            )));
        }
        let component = Component::new(accessor, what)?;
        let elements = self.elements(accessor, component, 3, what)?;
        let mut points = Vec::with_capacity(elements.n());
        for (i, bytes) in elements.iter().enumerate() {
            let size = component.size();
            let at = |k: usize| component.value(&bytes[k * size..], accessor.normalized);
            let point = DVec3::new(at(0), at(1), at(2));
            if !point.is_finite() {
                return Err(ReadError::whole(format!(
                    "{what}: vertex {i} is ({}, {}, {}) (allowed finite numbers)",
                    point.x, point.y, point.z
                )));
            }
            points.push(point);
        }
        Ok(points)
    }

    pub(super) fn indices(&mut self, accessor: usize, what: &str) -> Result<Vec<u32>, ReadError> {
        let accessor = self.accessor(accessor, what)?;
        let component = Component::new(accessor, what)?;
        if accessor.kind != "SCALAR"
            || !matches!(component, Component::U8 | Component::U16 | Component::U32)
        {
            return Err(ReadError::whole(format!(
                "{what} is {} of component type {} (allowed SCALAR of 5121, 5123 or 5125)",
                accessor.kind, accessor.component_type
            )));
        }
        let elements = self.elements(accessor, component, 1, what)?;
        Ok(elements
            .iter()
            .map(|bytes| component.value(bytes, false) as u32)
            .collect())
    }

    fn accessor(&self, accessor: usize, what: &str) -> Result<&'a Accessor, ReadError> {
        get(&self.document.accessors, accessor, "accessor", what)
    }

    /// The bytes of an accessor's elements.
    fn elements(
        &mut self,
        accessor: &Accessor,
        component: Component,
        n_components: usize,
        what: &str,
    ) -> Result<Elements<'_>, ReadError> {
        if accessor.sparse.is_some() {
            return Err(ReadError::whole(format!(
                "{what} is a sparse accessor, which is not read: export without"
            )));
        }
        let Some(view) = accessor.buffer_view else {
            return Err(ReadError::whole(format!(
                "{what} has no buffer view: is it compressed?"
            )));
        };
        let view = get(&self.document.buffer_views, view, "buffer view", what)?;
        let bytes = self.buffer(view.buffer, what)?;
        let bytes = range(bytes, view.byte_offset, view.byte_length).ok_or_else(|| {
            ReadError::whole(format!(
                "{what}: its buffer view asks for {} bytes from {}, but the buffer has {}",
                view.byte_length,
                view.byte_offset,
                bytes.len()
            ))
        })?;
        let size = component.size() * n_components;
        let stride = view.byte_stride.unwrap_or(size as u64);
        if stride < size as u64 {
            return Err(ReadError::whole(format!(
                "{what}: a stride of {stride} bytes (allowed from {size}, the size of an element)"
            )));
        }
        // The last element need not be followed by the gap of the stride.
        let needed = match accessor.count {
            0 => Some(0),
            n => stride
                .checked_mul(n - 1)
                .and_then(|bytes| bytes.checked_add(size as u64)),
        };
        let bytes = needed
            .and_then(|needed| range(bytes, accessor.byte_offset, needed))
            .ok_or_else(|| {
                ReadError::whole(format!(
                    "{what}: {} elements every {stride} bytes from {}, but the buffer view has {} bytes",
                    accessor.count,
                    accessor.byte_offset,
                    bytes.len()
                ))
            })?;
        Ok(Elements {
            bytes,
            size,
            stride: usize::try_from(stride).unwrap_or(usize::MAX),
        })
    }

    fn buffer(&mut self, index: usize, what: &str) -> Result<&[u8], ReadError> {
        let buffer = get(&self.document.buffers, index, "buffer", what)?;
        let bytes = match self.buffers[index].take() {
            Some(bytes) => bytes,
            None => {
                let bytes = self.loaded(index, buffer.uri.as_deref())?;
                if (bytes.len() as u64) < buffer.byte_length {
                    return Err(ReadError::whole(format!(
                        "buffer {index} has {} bytes, {} are needed: it is not whole",
                        bytes.len(),
                        buffer.byte_length
                    )));
                }
                bytes
            }
        };
        Ok(self.buffers[index].insert(bytes))
    }

    fn loaded(&mut self, index: usize, uri: Option<&str>) -> Result<Cow<'a, [u8]>, ReadError> {
        let Some(uri) = uri else {
            return match self.binary {
                Some(binary) if index == 0 => Ok(Cow::Borrowed(binary)),
                _ => Err(ReadError::whole(format!(
                    "buffer {index} has no URI, and the file has no binary chunk for it"
                ))),
            };
        };
        if let Some(data) = strip_scheme(uri, "data:") {
            return from_data_uri(data)
                .map(Cow::Owned)
                .map_err(|why| ReadError::whole(format!("buffer {index}: its data URI {why}")));
        }
        if uri.contains("://") {
            return Err(ReadError::whole(format!(
                "buffer {index} lies at '{uri}' (allowed files beside the scene, and data URIs)"
            )));
        }
        // Other programs do not all encode blanks, so the name as it stands is next.
        let name = percent_decode_str(uri).decode_utf8_lossy();
        (self.load)(&name)
            .or_else(|why| {
                if name == uri {
                    Err(why)
                } else {
                    (self.load)(uri)
                }
            })
            .map(Cow::Owned)
            .map_err(|why| {
                ReadError::whole(format!("buffer {index}: '{name}' could not be read: {why}"))
            })
    }
}

/// The element with this index, or an error that says who asked for it.
pub(super) fn get<'t, T>(
    list: &'t [T],
    index: usize,
    kind: &str,
    what: &str,
) -> Result<&'t T, ReadError> {
    list.get(index).ok_or_else(|| {
        ReadError::whole(format!(
            "{what}: {kind} {index}, but the file has {} of them (counted from 0)",
            list.len()
        ))
    })
}

/// Elements of `size` bytes, `stride` bytes apart.
struct Elements<'a> {
    bytes: &'a [u8],
    size: usize,
    stride: usize,
}

impl<'a> Elements<'a> {
    fn n(&self) -> usize {
        self.bytes.len().div_ceil(self.stride)
    }

    fn iter(&self) -> impl Iterator<Item = &'a [u8]> {
        let size = self.size;
        self.bytes
            .chunks(self.stride)
            .map(move |chunk| &chunk[..size])
    }
}

/// The kind of one number.
#[derive(Clone, Copy)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn new(accessor: &Accessor, what: &str) -> Result<Self, ReadError> {
        Ok(match accessor.component_type {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            other => {
                return Err(ReadError::whole(format!(
                    "{what}: component type {other} (allowed 5120 to 5123, 5125, 5126)"
                )));
            }
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The number at the start of `bytes`, which are as many at least as its size.
    fn value(self, bytes: &[u8], normalized: bool) -> f64 {
        let two = || [bytes[0], bytes[1]];
        let four = || [bytes[0], bytes[1], bytes[2], bytes[3]];
        let (value, largest) = match self {
            Self::I8 => (f64::from(bytes[0] as i8), f64::from(i8::MAX)),
            Self::U8 => (f64::from(bytes[0]), f64::from(u8::MAX)),
            Self::I16 => (f64::from(i16::from_le_bytes(two())), f64::from(i16::MAX)),
            Self::U16 => (f64::from(u16::from_le_bytes(two())), f64::from(u16::MAX)),
            Self::U32 => (f64::from(u32::from_le_bytes(four())), f64::from(u32::MAX)),
            Self::F32 => return f64::from(f32::from_le_bytes(four())),
        };
        if normalized {
            (value / largest).max(-1.0)
        } else {
            value
        }
    }
}

fn range(bytes: &[u8], offset: u64, length: u64) -> Option<&[u8]> {
    let start = usize::try_from(offset).ok()?;
    let end = start.checked_add(usize::try_from(length).ok()?)?;
    bytes.get(start..end)
}

fn strip_scheme<'t>(uri: &'t str, scheme: &str) -> Option<&'t str> {
    let head = uri.get(..scheme.len())?;
    head.eq_ignore_ascii_case(scheme)
        .then(|| &uri[scheme.len()..])
}

/// What follows `data:`: a media type, perhaps `;base64`, a comma, the data.
fn from_data_uri(rest: &str) -> Result<Vec<u8>, String> {
    let (head, data) = rest.split_once(',').ok_or("has no comma")?;
    let bytes: Vec<u8> = percent_decode_str(data).collect();
    if head.to_ascii_lowercase().ends_with(";base64") {
        BASE64
            .decode(bytes)
            .map_err(|error| format!("is not base64: {error}").to_lowercase())
    } else {
        Ok(bytes)
    }
}
