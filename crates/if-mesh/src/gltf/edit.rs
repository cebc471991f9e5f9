//! Changes of a file: bytes of its buffers, accessors in another form, and the JSON that describes
//! them.

use super::document::QUANTIZATION;
use super::error::WriteError;
use super::source::{Place, Source};
use super::uri;
use if_core::math::Real;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The component type of single-precision numbers.
const F32: u32 = 5126;
/// The beginning of the URIs of buffers that were in files of their own.
const EMBEDDED: &str = "data:application/octet-stream;base64,";

/// Where buffers go that a file has in other files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beside {
    /// Into files beside it, of the names that it gives.
    Files,
    /// Into the file itself, which then needs no other.
    Embedded,
}

/// A glTF file and the buffers in files beside it, as they will be stored.
#[derive(Clone, Debug, PartialEq)]
pub struct GltfFiles {
    /// The file.
    pub bytes: Vec<u8>,
    /// The files beside it: each one's path from the folder of the file, and its bytes.
    pub beside: Vec<(PathBuf, Vec<u8>)>,
}

/// A file being changed.
pub(super) struct Edit<'a> {
    source: &'a Source,
    /// Buffers that have changed.
    buffers: BTreeMap<usize, Vec<u8>>,
    /// The JSON, once it has changed.
    document: Option<Value>,
    /// Whether accessors have another form than before.
    has_replaced: bool,
}

impl<'a> Edit<'a> {
    pub(super) fn new(source: &'a Source) -> Self {
        Self { source, buffers: BTreeMap::new(), document: None, has_replaced: false }
    }

    /// The bytes of a buffer of the file.
    pub(super) fn bytes(&mut self, buffer: usize) -> &mut Vec<u8> {
        self.buffers.entry(buffer).or_insert_with(|| self.source.buffer(buffer).to_vec())
    }

    fn document(&mut self) -> Result<&mut Value, WriteError> {
        let document = match self.document.take() {
            Some(document) => document,
            // The reader has parsed it, but not what it does not need.
            None => serde_json::from_slice(&self.source.bytes[self.source.json.clone()])?,
        };
        Ok(self.document.insert(document))
    }

    /// The description of an accessor.
    pub(super) fn accessor(&mut self, accessor: usize) -> Result<&mut Value, WriteError> {
        Ok(&mut self.document()?["accessors"][accessor])
    }

    /// Removes the animations.
    pub(super) fn drop_animations(&mut self) -> Result<(), WriteError> {
        let had = self.document.is_some();
        let entries = self.document()?.as_object_mut();
        let dropped = entries.and_then(|entries| entries.shift_remove("animations"));
        if dropped.is_none() && !had {
            self.document = None; // nothing changed
        }
        Ok(())
    }

    /// Stores the elements of an accessor as single-precision numbers, at the end of a buffer.
    pub(super) fn replace<const N: usize>(
        &mut self,
        accessor: usize,
        buffer: usize,
        rows: &[[Real; N]],
    ) -> Result<(), WriteError> {
        let bytes = self.bytes(buffer);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        let start = bytes.len();
        for x in rows.as_flattened() {
            bytes.extend_from_slice(&(*x as f32).to_le_bytes());
        }
        let end = bytes.len();
        self.has_replaced = true;
        let document = self.document()?;
        document["buffers"][buffer]["byteLength"] = json!(end);
        let view = json!({
            "buffer": buffer, "byteOffset": start, "byteLength": end - start, "target": 34962,
        });
        // A view that nothing else uses is replaced.
        let old = document["accessors"][accessor]["bufferView"].as_u64();
        let old = old.filter(|old| uses(document, *old) == 1).map(|old| old as usize);
        let views = document["bufferViews"].as_array_mut().ok_or(WriteError::Overlap)?;
        let index = old.unwrap_or(views.len());
        match old {
            Some(old) => views[old] = view,
            None => views.push(view),
        }
        let about = document["accessors"][accessor].as_object_mut().ok_or(WriteError::Overlap)?;
        about.insert("bufferView".into(), json!(index));
        about.insert("componentType".into(), json!(F32));
        for key in ["byteOffset", "normalized", "sparse"] {
            about.shift_remove(key);
        }
        Ok(())
    }

    fn embed(&mut self, buffer: usize, start: &str, bytes: &[u8]) -> Result<(), WriteError> {
        self.document()?["buffers"][buffer]["uri"] = json!(uri::data(start, bytes));
        Ok(())
    }

    /// The file with its changes.
    pub(super) fn finish(mut self, to: Beside) -> Result<GltfFiles, WriteError> {
        if self.has_replaced {
            drop_quantization(self.document()?);
        }
        let (source, mut chunk) = (self.source, None);
        let mut beside: Vec<_> =
            source.beside().map(|(path, bytes)| (path.to_path_buf(), bytes.to_vec())).collect();
        let mut changed = std::mem::take(&mut self.buffers);
        if to == Beside::Embedded {
            beside.clear();
            for buffer in source.buffers_beside() {
                let bytes = changed.remove(&buffer);
                let bytes = bytes.as_deref().unwrap_or_else(|| source.buffer(buffer));
                self.embed(buffer, EMBEDDED, bytes)?;
            }
        }
        for (buffer, bytes) in changed {
            match source.place(buffer) {
                Place::Chunk => chunk = Some(bytes),
                Place::Embedded(start) => self.embed(buffer, start, &bytes)?,
                Place::Beside(path) => {
                    // Two buffers of one file have both been changed, or the check finds it.
                    beside.iter_mut().filter(|(other, _)| other == path).for_each(|(_, old)| {
                        old.clone_from(&bytes);
                    });
                }
                Place::Missing | Place::Decoded => return Err(WriteError::Overlap),
            }
        }
        let Some(document) = self.document else {
            return Ok(GltfFiles { bytes: source.bytes.clone(), beside });
        };
        let json = document.to_string();
        let bytes = source.with(json.as_bytes(), chunk.as_deref()).ok_or(WriteError::TooLarge)?;
        Ok(GltfFiles { bytes, beside })
    }
}

/// How often the document refers to a buffer view.
fn uses(value: &Value, view: u64) -> usize {
    match value {
        Value::Object(entries) => (entries.iter())
            .map(|(key, value)| match value.as_u64() {
                Some(index) => usize::from(key == "bufferView" && index == view),
                None => uses(value, view),
            })
            .sum(),
        Value::Array(items) => items.iter().map(|item| uses(item, view)).sum(),
        _ => 0,
    }
}

/// Removes the extension for quantised attributes from the lists if none is left.
fn drop_quantization(document: &mut Value) {
    if is_quantized(document) {
        return;
    }
    let Some(entries) = document.as_object_mut() else { return };
    for key in ["extensionsUsed", "extensionsRequired"] {
        let Some(list) = entries.get_mut(key).and_then(Value::as_array_mut) else { continue };
        list.retain(|name| name != QUANTIZATION);
        if list.is_empty() {
            entries.shift_remove(key);
        }
    }
}

/// Whether an attribute of a mesh is in a form that the format has only with the extension.
fn is_quantized(document: &Value) -> bool {
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let accessors = &document["accessors"];
    let needs = |(name, accessor): (&String, &Value)| {
        let about = accessor.as_u64().map(|k| &accessors[k as usize]).unwrap_or(&Value::Null);
        let code = about["componentType"].as_u64();
        let is_share = about["normalized"] == json!(true) && matches!(code, Some(5121 | 5123));
        match name.as_str() {
            "POSITION" | "NORMAL" | "TANGENT" => code != Some(F32.into()),
            name if name.starts_with("TEXCOORD_") => code != Some(F32.into()) && !is_share,
            _ => false,
        }
    };
    let primitives =
        list(&document["meshes"]).into_iter().flat_map(|mesh| list(&mesh["primitives"]));
    primitives.into_iter().any(|primitive| {
        let of = |value: &Value| value.as_object().is_some_and(|all| all.iter().any(needs));
        of(&primitive["attributes"]) || list(&primitive["targets"]).iter().any(of)
    })
}
