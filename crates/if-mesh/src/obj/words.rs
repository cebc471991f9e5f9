//! Words of the statements of an OBJ file.

use super::error::{Index, ReadError};
use super::numbers::{float, integer};
use super::obj_mesh::Span;
use std::io::BufRead;

/// A tokenizer of statements. A statement ends with its line, unless the line ends with a backslash,
/// or at a word that begins with `#`.
pub(super) struct Words<'a> {
    pub(super) text: &'a [u8],
    /// Position in the text, in bytes.
    pub(super) at: usize,
}

impl<'a> Words<'a> {
    /// The words of a text, without its byte-order mark.
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { text, at: if text.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 } }
    }

    /// The words of a text in parts of at least `least` bytes, which end between statements. Ranges
    /// and lines are those of the whole text.
    pub(super) fn parts(text: &'a [u8], least: usize) -> Vec<Self> {
        let mut parts = vec![Self::new(text)];
        let mut at = least;
        while let Some(k) = text.get(at..).and_then(|rest| rest.iter().position(|b| *b == b'\n')) {
            let end = at + k + 1;
            at = end;
            // A line that ends with a backslash may be continued.
            let line = text[..end - 1].strip_suffix(b"\r").unwrap_or(&text[..end - 1]);
            if line.ends_with(b"\\") || end == text.len() {
                continue;
            }
            let last = parts.last_mut().expect("there is at least one");
            last.text = &text[..end];
            parts.push(Self { text, at: end });
            at += least;
        }
        parts
    }

    /// The next word of this statement, as a range of the text.
    #[inline]
    pub(super) fn next(&mut self) -> Option<(usize, usize)> {
        loop {
            match self.text.get(self.at)? {
                b'\n' | b'#' => return None,
                b if b.is_ascii_whitespace() => self.at += 1,
                b'\\' if self.continued() > 0 => self.at += self.continued(),
                _ => break,
            }
        }
        let start = self.at;
        loop {
            let rest = &self.text[self.at..];
            let end = rest.iter().position(|b| b.is_ascii_whitespace() || *b == b'\\');
            self.at += end.unwrap_or(rest.len());
            if self.text.get(self.at) != Some(&b'\\') || self.continued() > 0 {
                return Some((start, self.at));
            }
            self.at += 1;
        }
    }

    /// Bytes of a backslash and the line end after it, or 0.
    fn continued(&self) -> usize {
        match &self.text[self.at..] {
            [b'\\', b'\n', ..] => 2,
            [b'\\', b'\r', b'\n', ..] => 3,
            _ => 0,
        }
    }

    /// The text up to the end of the line, without spaces around it.
    pub(super) fn rest_of_line(&self) -> String {
        let line = self.text[self.at..self.line_end()].trim_ascii();
        String::from_utf8_lossy(line).into_owned()
    }

    pub(super) fn skip_line(&mut self) {
        self.at = self.line_end();
    }

    /// Skips the other words of this statement.
    pub(super) fn skip_words(&mut self) {
        let line = self.text[self.at..self.line_end()].trim_ascii_end();
        if line.ends_with(b"\\") {
            while self.next().is_some() {} // the line may be continued
        } else {
            self.at += line.len();
        }
    }

    /// Where the next line begins.
    fn line_end(&self) -> usize {
        // The standard library's search for a byte is much faster than `position`.
        let mut rest = &self.text[self.at..];
        self.at + rest.skip_until(b'\n').expect("bytes in memory can be read")
    }

    pub(super) fn bytes(&self, word: (usize, usize)) -> &'a [u8] {
        &self.text[word.0..word.1]
    }

    /// The word as text, truncated for messages.
    fn shown(&self, word: (usize, usize)) -> String {
        let bytes = self.bytes(word);
        String::from_utf8_lossy(&bytes[..bytes.len().min(40)]).into_owned()
    }

    /// Line of byte `at`, from 1. Linear in the text: for error messages.
    pub(super) fn line_of(&self, at: usize) -> u64 {
        1 + self.text[..at].iter().filter(|b| **b == b'\n').count() as u64
    }

    /// The numbers of the rest of the statement: `needed` numbers, followed by as many as `more`
    /// allows. At most the first three are returned.
    pub(super) fn numbers(
        &mut self,
        keyword: &'static str,
        needed: usize,
        more: &[usize],
        expected: &'static str,
    ) -> Result<([f64; 3], Span), ReadError> {
        let mut values = [0.0; 3];
        let (begin, mut span, mut found) = (self.at, (self.at, self.at), 0);
        while let Some(word) = self.next() {
            let Some(number) = float(self.bytes(word)) else {
                return Err(ReadError::Value {
                    line: self.line_of(word.0),
                    keyword,
                    text: self.shown(word),
                });
            };
            if found == 0 {
                span.0 = word.0;
            }
            if found < 3 {
                values[found] = number;
                span.1 = word.1;
            }
            found += 1;
        }
        if found < needed || !more.contains(&(found - needed)) {
            return Err(ReadError::ValueCount {
                line: self.line_of(begin),
                keyword,
                expected,
                found,
            });
        }
        Ok((values, Span { start: span.0 as u32, end: span.1 as u32 }))
    }

    /// The indices of a corner, from 0.
    pub(super) fn corner(
        &self,
        word: (usize, usize),
        before: &[u32; 3],
        counts: &[u32; 3],
    ) -> Result<[Option<u32>; 3], ReadError> {
        let mut indices = [None; 3];
        for (k, part) in self.bytes(word).split(|b| *b == b'/').enumerate() {
            if k > 2 {
                return Err(self.bad_corner(word));
            }
            if part.is_empty() {
                continue;
            }
            let index = integer(part).ok_or_else(|| self.bad_corner(word))?;
            if index == 0 && k > 0 {
                continue; // none, as some programs write it
            }
            let absolute =
                if index < 0 { index.saturating_add(before[k].into()) } else { index - 1 };
            if index == 0 || absolute < 0 || absolute >= counts[k].into() {
                let what = [Index::Vertex, Index::Texture, Index::Normal][k];
                let count = if index < 0 { before[k] } else { counts[k] } as usize;
                return Err(ReadError::Index { line: self.line_of(word.0), what, index, count });
            }
            indices[k] = Some(absolute as u32);
        }
        Ok(indices)
    }

    pub(super) fn bad_corner(&self, word: (usize, usize)) -> ReadError {
        ReadError::Corner { line: self.line_of(word.0), text: self.shown(word) }
    }
}
