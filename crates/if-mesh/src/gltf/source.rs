//! A file as it was read, and the buffers that hold its numbers.

use super::document::Document;
use super::error::ReadError;
use super::uri::{self, Uri};
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

/// Accessors that are decoded may take this many times the bytes of the file.
const DECODED: usize = 16;

/// Reads a file beside the glTF file, by its relative path.
pub(super) type Beside<'a> = &'a dyn Fn(&Path) -> io::Result<Vec<u8>>;

/// A file and its buffers.
#[derive(Clone, Debug)]
pub(super) struct Source {
    /// The file.
    pub(super) bytes: Vec<u8>,
    /// Where its JSON is.
    pub(super) json: Range<usize>,
    /// Where its binary chunk is, if it is a GLB file; empty if it has none.
    bin: Option<Range<usize>>,
    /// After the stated length there is nothing of the file.
    end: usize,
    /// Those of the document, then accessors that were decoded.
    buffers: Vec<Buffer>,
}

/// Bytes that accessors refer to.
#[derive(Clone, Debug, PartialEq)]
struct Buffer {
    place: Place,
    /// Empty if they are in the binary chunk.
    bytes: Vec<u8>,
}

/// Where a buffer is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Place {
    /// In the binary chunk.
    Chunk,
    /// In a data URI that begins with this.
    Embedded(String),
    /// In a file, by its path from the folder of the glTF file.
    Beside(PathBuf),
    /// Nowhere: a placeholder of an extension.
    Missing,
    /// Only in memory: an accessor that was decoded.
    Decoded,
}

impl Source {
    /// Finds the parts of a file, without its buffers.
    pub(super) fn new(bytes: Vec<u8>) -> Result<Self, ReadError> {
        let buffers = Vec::new();
        if bytes.starts_with(b"glTF") {
            let (json, bin, end) = chunks(&bytes)?;
            return Ok(Self { bytes, json, bin: Some(bin), end, buffers });
        }
        let text = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
        if text != Some(&b'{') {
            return Err(ReadError::Magic);
        }
        let end = bytes.len();
        Ok(Self { bytes, json: 0..end, bin: None, end, buffers })
    }

    /// Finds the buffers of the document.
    pub(super) fn load(
        &mut self,
        document: &Document,
        beside: Beside<'_>,
    ) -> Result<(), ReadError> {
        for (k, about) in document.buffers.iter().enumerate() {
            let buffer = match &about.uri {
                None if k == 0 && self.bin.as_ref().is_some_and(|bin| !bin.is_empty()) => {
                    Buffer { place: Place::Chunk, bytes: Vec::new() }
                }
                None => Buffer { place: Place::Missing, bytes: Vec::new() },
                Some(uri) => match uri::parse(uri) {
                    Ok(Uri::Data { start, bytes }) => {
                        Buffer { place: Place::Embedded(start), bytes }
                    }
                    Ok(Uri::Path(path)) => {
                        let bytes = beside(&path).map_err(|source| ReadError::Beside {
                            buffer: k,
                            path: path.clone(),
                            source,
                        })?;
                        Buffer { place: Place::Beside(path), bytes }
                    }
                    Err(expected) => {
                        let uri = uri::shortened(uri);
                        return Err(ReadError::Uri { buffer: k, uri, expected });
                    }
                },
            };
            self.buffers.push(buffer);
            let found = self.buffer(k).len();
            if self.buffers[k].place != Place::Missing && found < about.byte_length {
                let (what, needed) = ("a buffer", about.byte_length as u64);
                return Err(ReadError::Truncated { what, needed, found: found as u64 });
            }
        }
        Ok(())
    }

    /// Whether it is a GLB file.
    pub(super) fn is_binary(&self) -> bool {
        self.bin.is_some()
    }

    /// The bytes of a buffer.
    pub(super) fn buffer(&self, k: usize) -> &[u8] {
        match (&self.buffers[k], &self.bin) {
            (Buffer { place: Place::Chunk, .. }, Some(bin)) => &self.bytes[bin.clone()],
            (buffer, _) => &buffer.bytes,
        }
    }

    pub(super) fn place(&self, k: usize) -> &Place {
        &self.buffers[k].place
    }

    /// The numbers of the buffers in files beside this one.
    pub(super) fn buffers_beside(&self) -> impl Iterator<Item = usize> {
        let is_beside = |(_, buffer): &(usize, &Buffer)| matches!(buffer.place, Place::Beside(_));
        self.buffers.iter().enumerate().filter(is_beside).map(|(k, _)| k)
    }

    /// The buffers in files beside this one.
    pub(super) fn beside(&self) -> impl Iterator<Item = (&Path, &[u8])> {
        self.buffers.iter().filter_map(|buffer| match &buffer.place {
            Place::Beside(path) => Some((path.as_path(), &buffer.bytes[..])),
            _ => None,
        })
    }

    /// Bytes of the file and of the files beside it.
    pub(super) fn size(&self) -> usize {
        let beside: usize = self.beside().map(|(_, bytes)| bytes.len()).sum();
        self.bytes.len().saturating_add(beside)
    }

    /// Whether both were read from the same bytes.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let stored =
            |source: &Self| source.buffers.iter().take_while(|b| b.place != Place::Decoded).count();
        let [a, b] = [self, other].map(|source| &source.buffers[..stored(source)]);
        self.bytes == other.bytes && a == b
    }

    /// Room for a decoded accessor of so many bytes, as a new buffer.
    pub(super) fn decoded(&mut self, bytes: usize) -> Result<Vec<u8>, ReadError> {
        let decoded = self.buffers.iter().filter(|buffer| buffer.place == Place::Decoded);
        let used: usize = decoded.map(|buffer| buffer.bytes.len()).sum();
        if used.saturating_add(bytes) > self.size().saturating_mul(DECODED) {
            return Err(ReadError::TooMuch { what: "of sparse accessors" });
        }
        Ok(vec![0; bytes])
    }

    /// Adds a decoded accessor, and returns its buffer.
    pub(super) fn push(&mut self, bytes: Vec<u8>) -> usize {
        self.buffers.push(Buffer { place: Place::Decoded, bytes });
        self.buffers.len() - 1
    }

    /// The file with other JSON, and another binary chunk if one is given; `None` beyond 4 GiB.
    pub(super) fn with(&self, json: &[u8], chunk: Option<&[u8]>) -> Option<Vec<u8>> {
        let Some(bin) = &self.bin else { return Some(json.to_vec()) };
        let mut out = Vec::with_capacity(json.len() + self.end);
        out.extend_from_slice(b"glTF");
        out.extend_from_slice(&2u32.to_le_bytes());
        out.extend_from_slice(&[0; 4]);
        push_chunk(&mut out, JSON, json, b' ')?;
        match chunk {
            Some(chunk) => {
                push_chunk(&mut out, BIN, chunk, 0)?;
                out.extend_from_slice(&self.bytes[bin.end..self.end]);
            }
            None => out.extend_from_slice(&self.bytes[self.json.end..self.end]),
        }
        let length = u32::try_from(out.len()).ok()?;
        out[8..12].copy_from_slice(&length.to_le_bytes());
        Some(out)
    }
}

fn push_chunk(out: &mut Vec<u8>, kind: u32, bytes: &[u8], padding: u8) -> Option<()> {
    let length = bytes.len().next_multiple_of(4);
    out.extend_from_slice(&u32::try_from(length).ok()?.to_le_bytes());
    out.extend_from_slice(&kind.to_le_bytes());
    out.extend_from_slice(bytes);
    out.resize(out.len() + length - bytes.len(), padding);
    Some(())
}

fn number(bytes: &[u8], at: usize, what: &'static str) -> Result<u32, ReadError> {
    let found = bytes.len() as u64;
    let word = bytes.get(at..at + 4).and_then(|word| word.try_into().ok());
    word.map(u32::from_le_bytes).ok_or(ReadError::Truncated { what, needed: at as u64 + 4, found })
}

/// Where the JSON and the binary chunk of a GLB file are, and where it ends.
fn chunks(bytes: &[u8]) -> Result<(Range<usize>, Range<usize>, usize), ReadError> {
    if number(bytes, 4, "the header")? != 2 {
        return Err(ReadError::Magic);
    }
    let end = number(bytes, 8, "the header")? as usize;
    let whole = bytes.get(..end).ok_or(ReadError::Truncated {
        what: "the file",
        needed: end as u64,
        found: bytes.len() as u64,
    })?;
    let chunk = |at: usize| -> Result<(u32, Range<usize>), ReadError> {
        let length = number(whole, at, "a chunk")? as usize;
        let kind = number(whole, at + 4, "a chunk")?;
        let range = at + 8..at + 8 + length;
        if range.end > whole.len() {
            let (needed, found) = (range.end as u64, whole.len() as u64);
            return Err(ReadError::Truncated { what: "a chunk", needed, found });
        }
        Ok((kind, range))
    };
    let (kind, json) = chunk(12)?;
    if kind != JSON {
        return Err(ReadError::NoJson);
    }
    let mut bin = json.end..json.end;
    if json.end < end {
        let (kind, range) = chunk(json.end)?;
        if kind == BIN {
            bin = range;
        }
    }
    Ok((json, bin, end))
}
