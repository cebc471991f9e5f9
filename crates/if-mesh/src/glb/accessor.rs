//! Numbers of the binary chunk.

use super::document::{Document, entry};
use super::error::ReadError;
use if_core::math::Real;
use std::ops::Range;

/// Where the elements of an accessor are in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elements {
    /// Its index in the document.
    pub(super) accessor: usize,
    /// Byte of the first element.
    start: usize,
    /// Bytes from one element to the next.
    stride: usize,
    pub(super) count: usize,
    component: Component,
    components: usize,
    normalized: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: u32) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

/// What the elements must be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    pub(super) what: &'static str,
    /// The type's name in the format.
    pub(super) kind: &'static str,
    pub(super) is_whole: bool,
    pub(super) expected: &'static str,
}

impl Elements {
    /// The elements of an accessor, which are all in the file.
    pub(super) fn find(
        document: &Document,
        bin: &Range<usize>,
        accessor: usize,
        wanted: &Wanted,
    ) -> Result<Self, ReadError> {
        let about = entry(&document.accessors, "accessor", accessor)?;
        let component = Component::of(about.component_type);
        let is_kind = match component {
            Some(Component::F32) => !wanted.is_whole,
            Some(Component::I8 | Component::I16) if wanted.is_whole => false,
            // Whole numbers stand for shares from 0 to 1.
            Some(_) => wanted.is_whole || about.normalized,
            None => false,
        };
        let (Some(component), true, true) = (component, is_kind, about.kind == wanted.kind) else {
            let found = format!("{} of component type {}", about.kind, about.component_type);
            let (what, expected) = (wanted.what, wanted.expected);
            return Err(ReadError::Accessor { accessor, what, expected, found });
        };
        let (Some(view), None) = (about.buffer_view, &about.sparse) else {
            return Err(ReadError::Sparse { accessor });
        };
        let view = entry(&document.buffer_views, "buffer view", view)?;
        let buffer = entry(&document.buffers, "buffer", view.buffer)?;
        if view.buffer != 0 || buffer.uri.is_some() {
            return Err(ReadError::External { buffer: view.buffer });
        }
        let components = match wanted.kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let size = components * component.bytes();
        let stride = view.byte_stride.unwrap_or(size).max(1);
        if stride < size {
            let found = format!("elements of {size} bytes every {stride} bytes");
            let (what, expected) = (wanted.what, wanted.expected);
            return Err(ReadError::Accessor { accessor, what, expected, found });
        }
        // Bytes of the view, and of the chunk.
        let of_view = match about.count {
            0 => 0,
            count => ((count - 1).saturating_mul(stride))
                .saturating_add(size.saturating_add(about.byte_offset)),
        };
        let of_chunk = of_view.saturating_add(view.byte_offset);
        if of_view > view.byte_length || of_chunk > bin.len() {
            let found = bin.len().saturating_sub(view.byte_offset).min(view.byte_length);
            let (what, needed) = (wanted.what, of_view as u64);
            return Err(ReadError::Truncated { what, needed, found: found as u64 });
        }
        let start = bin.start.saturating_add(view.byte_offset).saturating_add(about.byte_offset);
        let normalized = about.normalized;
        let count = about.count;
        Ok(Self { accessor, start, stride, count, component, components, normalized })
    }

    /// The byte where an element begins.
    pub(super) fn at(&self, element: usize) -> usize {
        self.start + element * self.stride
    }

    /// Whether these are the floats that positions and normals must be to be written.
    pub(super) fn is_float(&self) -> bool {
        self.component == Component::F32
    }

    /// The numbers of an element.
    pub(super) fn values<const N: usize>(&self, bytes: &[u8], element: usize) -> [Real; N] {
        debug_assert_eq!(N, self.components);
        let size = self.component.bytes();
        std::array::from_fn(|k| {
            let at = self.at(element) + k * size;
            self.scaled(self.number(&bytes[at..at + size]))
        })
    }

    /// A whole number.
    pub(super) fn index(&self, bytes: &[u8], element: usize) -> u32 {
        let at = self.at(element);
        match self.component {
            Component::U8 => u32::from(bytes[at]),
            Component::U16 => u32::from(u16::from_le_bytes([bytes[at], bytes[at + 1]])),
            _ => u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]),
        }
    }

    fn number(&self, b: &[u8]) -> Real {
        match self.component {
            Component::I8 => Real::from(b[0] as i8),
            Component::U8 => Real::from(b[0]),
            Component::I16 => Real::from(i16::from_le_bytes([b[0], b[1]])),
            Component::U16 => Real::from(u16::from_le_bytes([b[0], b[1]])),
            Component::U32 => Real::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            Component::F32 => Real::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        }
    }

    fn scaled(&self, x: Real) -> Real {
        match self.component {
            _ if !self.normalized => x,
            Component::I8 => (x / 127.0).max(-1.0),
            Component::U8 => x / 255.0,
            Component::I16 => (x / 32767.0).max(-1.0),
            Component::U16 => x / 65535.0,
            Component::U32 | Component::F32 => x,
        }
    }
}
