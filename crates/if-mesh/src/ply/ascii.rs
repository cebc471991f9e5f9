//! Records of text files: one on each line.

use super::error::{At, ReadError};
use super::source::Source;
use super::table::Table;
use std::io::Read;

/// Reads all records of an element. Lines without a value are skipped.
///
/// Numbers are parsed as the type in the header, so that a `float` of text equals the `float`
/// of a binary file.
pub(super) fn read<R: Read>(
    source: &mut Source<'_, R>,
    table: &mut Table<'_>,
) -> Result<(), ReadError> {
    let mut indices = Vec::new();
    while table.done < table.layout.count {
        let number = source.line_number() + 1;
        match source.line(usize::MAX)? {
            None => return Err(table.truncated(At::Line(number))),
            Some(line) if line.trim_ascii().is_empty() => {}
            Some(line) => record(line, At::Line(number), table, &mut indices)?,
        }
    }
    Ok(())
}

fn record(
    line: &[u8],
    at: At,
    table: &mut Table<'_>,
    indices: &mut Vec<i64>,
) -> Result<(), ReadError> {
    let mut words = Words { line, found: 0 };
    for k in 0..table.slots.len() {
        let property = &table.layout.properties[k];
        let value = |text: &[u8], expected, table: &Table<'_>| ReadError::Value {
            at,
            element: table.layout.name.clone(),
            record: table.done,
            property: property.name.clone(),
            text: String::from_utf8_lossy(&text[..text.len().min(40)]).into_owned(),
            expected,
        };
        let short = |found: u64, table: &Table<'_>| ReadError::ValueCount {
            at,
            element: table.layout.name.clone(),
            record: table.done,
            expected: found + 1,
            found,
        };
        let mut values = 1;
        if let Some(t) = property.length {
            let word = words.next().ok_or_else(|| short(words.found, table))?;
            let n: i64 = text(word).parse().map_err(|_| value(word, t, table))?;
            values = u64::try_from(n).map_err(|_| table.negative_length(at, k, n))?;
        }
        let is_face = table.faces.as_ref().is_some_and(|f| f.property == k);
        indices.clear();
        for _ in 0..values {
            let word = words.next().ok_or_else(|| short(words.found, table))?;
            let is_valid = if is_face {
                text(word).parse().map(|i| indices.push(i)).is_ok()
            } else {
                table.slots[k].values.push_text(text(word))
            };
            if !is_valid {
                return Err(value(word, property.scalar, table));
            }
        }
        match &mut table.faces {
            Some(faces) if is_face => faces.push(indices.iter().copied(), at)?,
            _ if property.length.is_some() => table.end_list(k)?,
            _ => {}
        }
    }
    let expected = words.found;
    while words.next().is_some() {}
    if words.found > expected {
        return Err(ReadError::ValueCount {
            at,
            element: table.layout.name.clone(),
            record: table.done,
            expected,
            found: words.found,
        });
    }
    table.done += 1;
    Ok(())
}

/// The words of a line, counted.
struct Words<'a> {
    line: &'a [u8],
    found: u64,
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.line.trim_ascii_start();
        if rest.is_empty() {
            self.line = rest;
            return None;
        }
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let (word, rest) = rest.split_at(end);
        self.line = rest;
        self.found += 1;
        Some(word)
    }
}

/// A word as text; empty, which is not a number, if it is not UTF-8.
fn text(word: &[u8]) -> &str {
    std::str::from_utf8(word).unwrap_or("")
}
