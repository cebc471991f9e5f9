//! The container: named arrays of f32 behind a JSON header, checked before it is used.

use super::{Header, ReadError, VERSION};
use safetensors::tensor::{Metadata, TensorInfo, TensorView};
use safetensors::{Dtype, SafeTensorError};
use std::collections::HashMap;
use std::io::{self, Read, Write};

/// Longest file that is read: sixteen times the largest grid's checkpoint.
const LONGEST: u64 = 1 << 36;
/// Longest header that is read, as in every other reader of safetensors.
const LONGEST_HEADER: u64 = 100_000_000;
/// Key of the metadata.
const KEY: &str = "if_neural";

/// An array to be written.
pub(super) struct Named<'a> {
    pub(super) name: String,
    pub(super) shape: Vec<usize>,
    pub(super) data: &'a [f32],
}

/// Writes arrays; the same bytes for the same arrays.
pub(super) fn write(
    writer: &mut impl Write,
    header: &Header,
    parts: &[Named<'_>],
) -> io::Result<()> {
    let bytes: Vec<Vec<u8>> =
        parts.iter().map(|p| p.data.iter().flat_map(|v| v.to_le_bytes()).collect()).collect();
    let views = parts.iter().zip(&bytes).map(|(p, b)| {
        TensorView::new(Dtype::F32, p.shape.clone(), b)
            .map(|view| (p.name.as_str(), view))
            .map_err(io::Error::other)
    });
    let views = views.collect::<io::Result<Vec<_>>>()?;
    // One entry: a map of several would be written in an order that changes.
    let metadata = HashMap::from([(KEY.to_owned(), serde_json::to_string(header)?)]);
    let file = safetensors::serialize(views, Some(metadata)).map_err(io::Error::other)?;
    writer.write_all(&file)
}

/// A file in memory.
pub(super) struct Tensors {
    metadata: Metadata,
    /// The bytes after the header.
    data: Vec<u8>,
}

impl Tensors {
    /// Checks the header before the data are read. No more data are read than it announces.
    pub(super) fn read(mut reader: impl Read) -> Result<Self, ReadError> {
        let fault = |e: SafeTensorError| ReadError::Header { message: e.to_string() };
        let mut next = |count: u64| {
            let mut bytes = Vec::new();
            reader.by_ref().take(count).read_to_end(&mut bytes).map(|_| bytes)
        };
        let length: [u8; 8] =
            next(8)?.try_into().map_err(|_| fault(SafeTensorError::HeaderTooSmall))?;
        let length = u64::from_le_bytes(length);
        if length > LONGEST_HEADER {
            return Err(fault(SafeTensorError::HeaderTooLarge));
        }
        let header = next(length)?;
        if header.len() as u64 != length {
            return Err(fault(SafeTensorError::InvalidHeaderLength));
        }
        let metadata: Metadata = serde_json::from_slice(&header)
            .map_err(|e| fault(SafeTensorError::InvalidHeaderDeserialization(e)))?;
        let expected = metadata.data_len() as u64;
        if expected > LONGEST - length {
            return Err(ReadError::TooLarge { limit: LONGEST });
        }
        // One byte more shows a file that goes on.
        let data = next(expected + 1)?;
        if data.len() as u64 != expected {
            return Err(fault(SafeTensorError::MetadataIncompleteBuffer));
        }
        Ok(Self { metadata, data })
    }

    pub(super) fn header(&self, wanted: &'static str) -> Result<Header, ReadError> {
        let text = self
            .metadata
            .metadata()
            .as_ref()
            .and_then(|m| m.get(KEY))
            .ok_or(ReadError::NoMetadata)?;
        let fault = |e: serde_json::Error| ReadError::Metadata { message: e.to_string() };
        // The version first: the rest of a later one may be unknown.
        let value: serde_json::Value = serde_json::from_str(text).map_err(fault)?;
        let version = value.get("version").and_then(serde_json::Value::as_u64).unwrap_or(0);
        if version == 0 {
            return Err(ReadError::Metadata { message: "`version` is missing".into() });
        }
        if version > u64::from(VERSION) {
            return Err(ReadError::Version { found: version.min(u64::from(u32::MAX)) as u32 });
        }
        let header: Header = serde_json::from_value(value).map_err(fault)?;
        if header.kind != wanted {
            return Err(ReadError::Kind { found: header.kind, wanted });
        }
        Ok(header)
    }

    fn find(&self, name: &str) -> Option<(&TensorInfo, &[u8])> {
        let info = self.metadata.info(name)?;
        let (from, to) = info.data_offsets;
        Some((info, self.data.get(from..to)?))
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.metadata.info(name).is_some()
    }

    /// Appends an array of the given shape.
    pub(super) fn append(
        &self,
        name: &str,
        shape: &[usize],
        to: &mut Vec<f32>,
    ) -> Result<(), ReadError> {
        let (info, data) =
            self.find(name).ok_or_else(|| ReadError::Missing { name: name.to_owned() })?;
        if info.shape != shape {
            return Err(ReadError::Shape {
                name: name.to_owned(),
                found: info.shape.clone(),
                expected: shape.to_vec(),
            });
        }
        if info.dtype != Dtype::F32 {
            return Err(ReadError::Type {
                name: name.to_owned(),
                found: format!("{:?}", info.dtype),
            });
        }
        to.extend(data.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)));
        Ok(())
    }
}
