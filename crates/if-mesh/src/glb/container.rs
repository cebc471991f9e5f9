//! The chunks of a GLB file.

use super::error::ReadError;
use std::ops::Range;

const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

/// Where the parts of a file are.
#[derive(Clone, Debug)]
pub(super) struct Chunks {
    pub(super) json: Range<usize>,
    /// Empty if there is none.
    pub(super) bin: Range<usize>,
    /// After the stated length there is nothing of the file.
    pub(super) end: usize,
}

fn number(bytes: &[u8], at: usize, what: &'static str) -> Result<u32, ReadError> {
    let found = bytes.len() as u64;
    let word = bytes.get(at..at + 4).and_then(|word| word.try_into().ok());
    word.map(u32::from_le_bytes).ok_or(ReadError::Truncated { what, needed: at as u64 + 4, found })
}

/// Finds the chunks.
pub(super) fn chunks(bytes: &[u8]) -> Result<Chunks, ReadError> {
    if !bytes.starts_with(b"glTF") || number(bytes, 4, "the header")? != 2 {
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
    let mut bin = 0..0;
    if json.end < end {
        let (kind, range) = chunk(json.end)?;
        if kind == BIN {
            bin = range;
        }
    }
    Ok(Chunks { json, bin, end })
}

/// The file with other JSON.
pub(super) fn with_json(bytes: &[u8], chunks: &Chunks, json: &[u8]) -> Vec<u8> {
    let padding = json.len().next_multiple_of(4) - json.len();
    let rest = &bytes[chunks.json.end..chunks.end];
    let length = 20 + json.len() + padding + rest.len();
    let mut out = Vec::with_capacity(length);
    out.extend_from_slice(b"glTF");
    // A file of 4 GiB cannot be read, and the JSON does not grow by more than some digits.
    for word in [2, length as u32, (json.len() + padding) as u32, JSON] {
        out.extend_from_slice(&word.to_le_bytes());
    }
    out.extend_from_slice(json);
    out.resize(out.len() + padding, b' ');
    out.extend_from_slice(rest);
    out
}
