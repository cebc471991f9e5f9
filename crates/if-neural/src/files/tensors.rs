//! The container: named arrays of f32 behind a JSON header, checked before it is believed.

use super::{Header, ReadError, VERSION};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::collections::HashMap;
use std::io::{self, Read, Write};

/// Longest file that is read: sixteen times the largest grid's checkpoint.
const LONGEST: u64 = 1 << 36;
/// Key of the metadata.
const KEY: &str = "if_neural";

/// An array to be written.
pub(super) struct Named<'a> {
    pub(super) name: String,
    pub(super) shape: Vec<usize>,
    pub(super) data: &'a [f32],
}

/// Writes arrays; the same bytes for the same arrays.
pub(super) fn write(writer: &mut impl Write, header: &Header, parts: &[Named<'_>]) -> io::Result<()> {
    let bytes: Vec<Vec<u8>> = parts.iter().map(|p| p.data.iter().flat_map(|v| v.to_le_bytes()).collect()).collect();
    let views = parts.iter().zip(&bytes).map(|(p, b)| {
        TensorView::new(Dtype::F32, p.shape.clone(), b).map(|view| (p.name.as_str(), view)).map_err(io::Error::other)
    });
    let views = views.collect::<io::Result<Vec<_>>>()?;
    // One entry: a map of several would be written in an order that changes.
    let metadata = HashMap::from([(KEY.to_owned(), serde_json::to_string(header)?)]);
    let file = safetensors::serialize(views, Some(metadata)).map_err(io::Error::other)?;
    writer.write_all(&file)
}

/// A file in memory.
pub(super) struct Tensors {
    bytes: Vec<u8>,
    metadata: Option<String>,
}

impl Tensors {
    pub(super) fn read(reader: impl Read) -> Result<Self, ReadError> {
        let mut bytes = Vec::new();
        reader.take(LONGEST + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > LONGEST {
            return Err(ReadError::TooLarge { limit: LONGEST });
        }
        let header = |e: safetensors::SafeTensorError| ReadError::Header { message: e.to_string() };
        SafeTensors::deserialize(&bytes).map_err(header)?;
        let (_, metadata) = SafeTensors::read_metadata(&bytes).map_err(header)?;
        let metadata = metadata.metadata().as_ref().and_then(|m| m.get(KEY)).cloned();
        Ok(Self { bytes, metadata })
    }

    pub(super) fn header(&self, wanted: &'static str) -> Result<Header, ReadError> {
        let text = self.metadata.as_ref().ok_or(ReadError::NoMetadata)?;
        let fault = |e: serde_json::Error| ReadError::Metadata { message: e.to_string() };
        // The version first: a later one may have anything beside it.
        let value: serde_json::Value = serde_json::from_str(text).map_err(fault)?;
        let version = value.get("version").and_then(serde_json::Value::as_u64).unwrap_or(0);
        if version == 0 || version > u64::from(VERSION) {
            return Err(ReadError::Version { found: version.min(u64::from(u32::MAX)) as u32 });
        }
        let header: Header = serde_json::from_value(value).map_err(fault)?;
        if header.kind != wanted {
            return Err(ReadError::Kind { found: header.kind, wanted });
        }
        Ok(header)
    }

    fn view(&self, name: &str) -> Option<TensorView<'_>> {
        // Parsed once before; the header is short.
        SafeTensors::deserialize(&self.bytes).ok()?.tensor(name).ok()
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.view(name).is_some()
    }

    /// Appends an array of the given shape.
    pub(super) fn append(&self, name: &str, shape: &[usize], to: &mut Vec<f32>) -> Result<(), ReadError> {
        let view = self.view(name).ok_or_else(|| ReadError::Missing { name: name.to_owned() })?;
        if view.shape() != shape {
            return Err(ReadError::Shape { name: name.to_owned(), found: view.shape().to_vec(), expected: shape.to_vec() });
        }
        if view.dtype() != Dtype::F32 {
            return Err(ReadError::Type { name: name.to_owned(), found: format!("{:?}", view.dtype()) });
        }
        to.extend(view.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)));
        Ok(())
    }
}
