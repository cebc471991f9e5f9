//! A buffered reader that returns pieces of any size, and holds little more than one.

use std::borrow::Cow;
use std::io::{self, Empty, ErrorKind, Read};

/// Bytes per read: some thousand records, which stay in the second-level cache until they are
/// decoded.
const BLOCK: usize = 1 << 18;

/// A buffered reader with a position. Its buffer grows only to the size of the largest piece that was
/// requested *and* exists: a false count cannot make it grow.
pub(super) struct Source<'a, R> {
    inner: R,
    /// The whole input, if it is in memory already.
    buffer: Cow<'a, [u8]>,
    start: usize,
    end: usize,
    offset: u64,
    line: u64,
}

impl<'a> Source<'a, Empty> {
    /// A source of bytes in memory, which are not copied.
    pub(super) fn of(bytes: &'a [u8]) -> Self {
        Self {
            inner: io::empty(),
            buffer: Cow::Borrowed(bytes),
            start: 0,
            end: bytes.len(),
            offset: 0,
            line: 0,
        }
    }

    /// Splits off the next `n` bytes as a source of its own, which keeps its position in the whole.
    /// `None` if fewer are left.
    pub(super) fn split_off(&mut self, n: usize) -> Option<Self> {
        let end = self.start.checked_add(n).filter(|end| *end <= self.end)?;
        let first = Self { inner: io::empty(), buffer: self.buffer.clone(), end, ..*self };
        self.consume(n);
        Some(first)
    }
}

impl<R: Read> Source<'_, R> {
    pub(super) fn new(inner: R) -> Self {
        Self { inner, buffer: Cow::Owned(vec![0; BLOCK]), start: 0, end: 0, offset: 0, line: 0 }
    }

    /// Bytes consumed so far.
    pub(super) fn offset(&self) -> u64 {
        self.offset
    }

    /// Lines consumed so far by [`Source::line`].
    pub(super) fn line_number(&self) -> u64 {
        self.line
    }

    /// The buffered bytes, up to a block: at least `n` unless the input ends before.
    pub(super) fn peek(&mut self, n: usize) -> io::Result<&[u8]> {
        while self.end - self.start < n && self.fill()? {}
        let there = &self.buffer[self.start..self.end];
        Ok(&there[..there.len().min(n.max(BLOCK))])
    }

    /// Consumes `n` bytes that [`Source::peek`] has returned.
    pub(super) fn consume(&mut self, n: usize) {
        debug_assert!(n <= self.end - self.start, "only what was seen can be consumed");
        self.start += n;
        self.offset += n as u64;
    }

    /// The next line without its end (`\n` or `\r\n`); `None` at the end of the input. A line of
    /// more than `limit` bytes is cut there.
    pub(super) fn line(&mut self, limit: usize) -> io::Result<Option<&[u8]>> {
        let mut seen = 0;
        let (length, next) = loop {
            let rest = &self.buffer[self.start..self.end];
            if let Some(k) = rest[seen..].iter().position(|b| *b == b'\n') {
                break (seen + k, seen + k + 1);
            }
            seen = rest.len();
            if seen > limit || !self.fill()? {
                break (seen, seen);
            }
        };
        if next == 0 {
            return Ok(None);
        }
        let from = self.start;
        self.consume(next);
        self.line += 1;
        let line = &self.buffer[from..from + length];
        Ok(Some(line.strip_suffix(b"\r").unwrap_or(line)))
    }

    /// Reads more; `false` at the end of the input.
    fn fill(&mut self) -> io::Result<bool> {
        let Cow::Owned(buffer) = &mut self.buffer else { return Ok(false) };
        if self.start == self.end {
            (self.start, self.end) = (0, 0);
        }
        if self.end == buffer.len() {
            if self.start > 0 {
                buffer.copy_within(self.start..self.end, 0);
                (self.start, self.end) = (0, self.end - self.start);
            } else {
                buffer.resize(2 * buffer.len(), 0);
            }
        }
        loop {
            match self.inner.read(&mut buffer[self.end..]) {
                Ok(n) => {
                    self.end += n;
                    return Ok(n > 0);
                }
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(e),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reader that gives at most three bytes at a time.
    struct Drip<'a>(&'a [u8]);

    impl Read for Drip<'_> {
        fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
            let n = self.0.len().min(out.len()).min(3);
            out[..n].copy_from_slice(&self.0[..n]);
            self.0 = &self.0[n..];
            Ok(n)
        }
    }

    #[test]
    fn lines_with_any_ending_are_counted() {
        let mut source = Source::new(Drip(b"one\r\ntwo\n\nlast"));
        for expected in [&b"one"[..], b"two", b"", b"last"] {
            assert_eq!(source.line(99).unwrap().unwrap(), expected);
        }
        assert!(source.line(99).unwrap().is_none());
        assert_eq!((source.line_number(), source.offset()), (4, 14));
    }

    #[test]
    fn pieces_larger_than_the_buffer_are_returned_whole_and_the_end_is_detected() {
        let data: Vec<u8> = (0..BLOCK + 1000).map(|k| k as u8).collect();
        let mut source = Source::new(&data[..]);
        source.peek(10).unwrap();
        source.consume(10);
        assert_eq!(source.peek(BLOCK + 500).unwrap()[..BLOCK + 500], data[10..BLOCK + 510]);
        assert_eq!(source.peek(usize::MAX).unwrap().len(), BLOCK + 990);
        assert!(source.buffer.len() <= 4 * BLOCK);
    }

    #[test]
    fn bytes_in_memory_are_returned_in_blocks() {
        let data: Vec<u8> = (0..2 * BLOCK).map(|k| k as u8).collect();
        let mut source = Source::of(&data);
        assert_eq!(source.peek(1).unwrap(), &data[..BLOCK]);
        source.consume(10);
        assert_eq!(source.peek(BLOCK + 1).unwrap(), &data[10..BLOCK + 11]);
        assert_eq!(source.peek(usize::MAX).unwrap(), &data[10..]);
        let mut first = source.split_off(100).unwrap();
        assert_eq!([first.offset(), source.offset()], [10, 110]);
        assert_eq!(first.peek(usize::MAX).unwrap(), &data[10..110]);
        assert_eq!(source.peek(usize::MAX).unwrap(), &data[110..]);
        assert!(source.split_off(2 * BLOCK).is_none() && source.split_off(usize::MAX).is_none());
    }

    #[test]
    fn an_endless_line_is_cut() {
        let mut source = Source::new(io::repeat(b'a'));
        assert!(source.line(1000).unwrap().unwrap().len() <= BLOCK);
    }
}
