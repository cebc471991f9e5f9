//! Numbers of buffers.

use super::document::{Accessor, Document, Sparse, entry};
use super::error::ReadError;
use super::source::{Place, Source};
use if_core::math::Real;

/// Where the elements of an accessor are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elements {
    /// Its index in the document.
    pub(super) accessor: usize,
    /// The buffer of their bytes.
    pub(super) buffer: usize,
    /// The buffer of the file: another one if the accessor was decoded.
    pub(super) home: usize,
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

const SPARSE_INDICES: Wanted = Wanted {
    what: "indices of a sparse accessor",
    kind: "SCALAR",
    is_whole: true,
    expected: "unsigned whole numbers",
};

impl Elements {
    /// The elements of an accessor, which are all in the file. A sparse one is decoded.
    pub(super) fn find(
        document: &Document,
        source: &mut Source,
        accessor: usize,
        wanted: &Wanted,
    ) -> Result<Self, ReadError> {
        let about = entry(&document.accessors, "accessor", accessor)?;
        let component = Component::of(about.component_type);
        let is_kind = match component {
            Some(Component::F32) => !wanted.is_whole,
            Some(Component::I8 | Component::I16) if wanted.is_whole => false,
            // Whole numbers stand for shares from 0 to 1, or for quantised coordinates.
            Some(Component::U32) => wanted.is_whole,
            Some(_) => wanted.is_whole || about.normalized || document.is_quantized(),
            None => false,
        };
        let (Some(component), true, true) = (component, is_kind, about.kind == wanted.kind) else {
            let found = format!("{} of component type {}", about.kind, about.component_type);
            let (what, expected) = (wanted.what, wanted.expected);
            return Err(ReadError::Accessor { accessor, what, expected, found });
        };
        let components = match wanted.kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let of = Layout { accessor, wanted, component, components };
        let plain = match about.buffer_view {
            Some(view) => {
                let (offset, count) = (about.byte_offset, about.count);
                Some(of.at(document, source, view, offset, count, about.normalized)?)
            }
            None => None,
        };
        match (plain, &about.sparse) {
            (Some(plain), None) => Ok(plain),
            (None, None) => Err(ReadError::NoData { accessor }),
            (plain, Some(sparse)) => of.decode(document, source, (about, sparse), plain),
        }
    }

    /// The byte of the buffer where an element begins.
    pub(super) fn at(&self, element: usize) -> usize {
        self.start + element * self.stride
    }

    /// Whether these are floats of the file, in whose place others can be written.
    pub(super) fn is_float_in_place(&self) -> bool {
        self.component == Component::F32 && self.buffer == self.home
    }

    /// Whether directions can be written in their place.
    pub(super) fn is_direction_in_place(&self) -> bool {
        let is_signed = self.normalized && matches!(self.component, Component::I8 | Component::I16);
        self.buffer == self.home && (self.component == Component::F32 || is_signed)
    }

    /// The numbers of an element.
    pub(super) fn values<const N: usize>(&self, source: &Source, element: usize) -> [Real; N] {
        self.values_in(source.buffer(self.buffer), element)
    }

    /// The numbers of an element, of the bytes of its buffer.
    pub(super) fn values_in<const N: usize>(&self, bytes: &[u8], element: usize) -> [Real; N] {
        debug_assert_eq!(N, self.components);
        let size = self.component.bytes();
        std::array::from_fn(|k| {
            let at = self.at(element) + k * size;
            self.scaled(self.number(&bytes[at..at + size]))
        })
    }

    /// Writes the numbers of an element, in its place.
    pub(super) fn put(&self, bytes: &mut [u8], element: usize, numbers: [Real; 3]) {
        let size = self.component.bytes();
        for (k, x) in numbers.into_iter().enumerate() {
            let at = self.at(element) + k * size;
            let to = &mut bytes[at..at + size];
            match self.component {
                Component::I8 => to.copy_from_slice(&((x * 127.0).round() as i8).to_le_bytes()),
                Component::I16 => to.copy_from_slice(&((x * 32767.0).round() as i16).to_le_bytes()),
                _ => to.copy_from_slice(&(x as f32).to_le_bytes()),
            }
        }
    }

    /// A whole number.
    pub(super) fn index(&self, source: &Source, element: usize) -> u32 {
        let bytes = source.buffer(self.buffer);
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

/// The numbers of an accessor, wherever they are.
struct Layout<'a> {
    accessor: usize,
    wanted: &'a Wanted,
    component: Component,
    components: usize,
}

impl Layout<'_> {
    fn size(&self) -> usize {
        self.components * self.component.bytes()
    }

    /// `count` elements of a view, from a byte of it on.
    fn at(
        &self,
        document: &Document,
        source: &Source,
        view: usize,
        offset: usize,
        count: usize,
        normalized: bool,
    ) -> Result<Elements, ReadError> {
        let view = entry(&document.buffer_views, "buffer view", view)?;
        entry(&document.buffers, "buffer", view.buffer)?;
        if *source.place(view.buffer) == Place::Missing {
            return Err(ReadError::External { buffer: view.buffer });
        }
        let (what, size) = (self.wanted.what, self.size());
        let stride = view.byte_stride.unwrap_or(size).max(1);
        if stride < size {
            let found = format!("elements of {size} bytes every {stride} bytes");
            let (accessor, expected) = (self.accessor, self.wanted.expected);
            return Err(ReadError::Accessor { accessor, what, expected, found });
        }
        // Bytes of the view, and of the buffer.
        let of_view = match count {
            0 => 0,
            count => (count - 1).saturating_mul(stride).saturating_add(size.saturating_add(offset)),
        };
        let of_buffer = of_view.saturating_add(view.byte_offset);
        let length = source.buffer(view.buffer).len();
        if of_view > view.byte_length || of_buffer > length {
            let found = length.saturating_sub(view.byte_offset).min(view.byte_length);
            let needed = of_view as u64;
            return Err(ReadError::Truncated { what, needed, found: found as u64 });
        }
        Ok(Elements {
            accessor: self.accessor,
            buffer: view.buffer,
            home: view.buffer,
            start: view.byte_offset.saturating_add(offset),
            stride,
            count,
            component: self.component,
            components: self.components,
            normalized,
        })
    }

    /// The elements of a sparse accessor: those of `plain`, or zeros, with others in place of some.
    fn decode(
        &self,
        document: &Document,
        source: &mut Source,
        (about, sparse): (&Accessor, &Sparse),
        plain: Option<Elements>,
    ) -> Result<Elements, ReadError> {
        let (accessor, size) = (self.accessor, self.size());
        let code = sparse.indices.component_type;
        let Some(component) = Component::of(code)
            .filter(|c| matches!(c, Component::U8 | Component::U16 | Component::U32))
        else {
            let (what, expected) = (SPARSE_INDICES.what, SPARSE_INDICES.expected);
            let found = format!("component type {code}");
            return Err(ReadError::Accessor { accessor, what, expected, found });
        };
        let of_indices = Layout { accessor, wanted: &SPARSE_INDICES, component, components: 1 };
        let found = &sparse.indices;
        let indices = of_indices.at(
            document,
            source,
            found.buffer_view,
            found.byte_offset,
            sparse.count,
            false,
        )?;
        let found = &sparse.values;
        let values =
            self.at(document, source, found.buffer_view, found.byte_offset, sparse.count, false)?;
        let mut bytes = source.decoded(about.count.saturating_mul(size))?;
        if let Some(plain) = plain {
            let from = source.buffer(plain.buffer);
            for (k, to) in bytes.chunks_exact_mut(size).enumerate() {
                to.copy_from_slice(&from[plain.at(k)..plain.at(k) + size]);
            }
        }
        for k in 0..sparse.count {
            let index = indices.index(source, k) as usize;
            if index >= about.count {
                let (what, count) = ("element of a sparse accessor", about.count);
                return Err(ReadError::Index { what, index, count });
            }
            let from = &source.buffer(values.buffer)[values.at(k)..values.at(k) + size];
            bytes[index * size..(index + 1) * size].copy_from_slice(from);
        }
        let home = plain.map_or(values.buffer, |plain| plain.home);
        let buffer = source.push(bytes);
        let (count, normalized) = (about.count, about.normalized);
        Ok(Elements { buffer, home, start: 0, stride: size, count, normalized, ..values })
    }
}
