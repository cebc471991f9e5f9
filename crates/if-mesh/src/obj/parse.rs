//! From the text of an OBJ file to vertices and faces, and where they stand in it.

use super::error::{Index, ReadError};
use super::{NormalLine, Span, User};
use crate::polygons::FaceList;
use if_core::math::{Point, Vector};
use std::io::{ErrorKind, Read};

/// Reads the whole text. A zero byte ends the attempt, so that a device that never ends does too.
pub(super) fn slurp(reader: &mut impl Read) -> Result<Vec<u8>, ReadError> {
    let mut text = Vec::new();
    let mut block = vec![0; 1 << 18];
    loop {
        let n = match reader.read(&mut block) {
            Ok(0) => return Ok(text),
            Ok(n) => n,
            Err(e) if e.kind() == ErrorKind::Interrupted => continue,
            Err(e) => return Err(e.into()),
        };
        if let Some(k) = block[..n].iter().position(|b| *b == 0) {
            return Err(ReadError::Binary { byte: (text.len() + k) as u64 });
        }
        if text.len() + n >= u32::MAX as usize {
            return Err(ReadError::TooLarge);
        }
        text.extend_from_slice(&block[..n]);
    }
}

pub(super) struct Parsed {
    pub(super) points: Vec<Point>,
    pub(super) vertices: Vec<Span>,
    pub(super) normals: Vec<NormalLine>,
    pub(super) faces: FaceList,
}

/// An `f` line: where its corners begin, and how many vertices, texture coordinates and normals
/// stand before it, from which negative indices count back.
struct Face {
    at: u32,
    before: [u32; 3],
}

/// Two passes: first vertices, normals and the places of faces, then the faces, which may name what
/// stands behind them.
pub(super) fn parse(text: &[u8]) -> Result<Parsed, ReadError> {
    let mut parsed = Parsed {
        points: Vec::new(),
        vertices: Vec::new(),
        normals: Vec::new(),
        faces: FaceList::default(),
    };
    let mut faces = Vec::new();
    let mut textures = 0;
    let mut words = Words { text, at: if text.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 } };
    while words.at < text.len() {
        match words.next().map(|w| words.bytes(w)) {
            Some(b"v") => {
                let (p, span) = words.numbers(
                    "v",
                    3,
                    &[0, 1, 3, 4],
                    "3, and behind them a weight or a colour at most",
                )?;
                if let Some(k) = p.iter().position(|x| !x.is_finite()) {
                    let (line, vertex, text) =
                        (words.line_of(span.start as usize), parsed.points.len(), p[k].to_string());
                    return Err(ReadError::NonFinite { line, vertex, text });
                }
                parsed.points.push(Point::new(p[0], p[1], p[2]));
                parsed.vertices.push(span);
            }
            Some(b"vn") => {
                let (n, span) = words.numbers("vn", 3, &[0], "3")?;
                parsed.normals.push(NormalLine {
                    span,
                    value: Vector::new(n[0], n[1], n[2]),
                    user: User::None,
                });
            }
            Some(b"vt") => {
                words.numbers("vt", 1, &[0, 1, 2], "1 to 3")?;
                textures += 1;
            }
            Some(b"f" | b"fo") => {
                let before = [parsed.points.len() as u32, textures, parsed.normals.len() as u32];
                faces.push(Face { at: words.at as u32, before });
                while words.next().is_some() {}
            }
            Some(b"l" | b"p" | b"vp") => while words.next().is_some() {}, // their lines may be continued too
            _ => {}
        }
        words.skip_line();
    }
    if parsed.points.is_empty() {
        return Err(ReadError::NoVertices);
    }
    let counts = [parsed.points.len() as u32, textures, parsed.normals.len() as u32];
    let mut corners = Vec::new();
    for face in faces {
        words.at = face.at as usize;
        corners.clear();
        while let Some(word) = words.next() {
            let [v, _, n] = words.corner(word, &face.before, &counts)?;
            let v = v.ok_or_else(|| words.bad_corner(word))?;
            corners.push(v);
            if let Some(n) = n {
                let user = &mut parsed.normals[n as usize].user;
                *user = if matches!(*user, User::None) || *user == User::One(v) {
                    User::One(v)
                } else {
                    User::Several
                };
            }
        }
        if corners.len() < 3 {
            return Err(ReadError::FaceTooShort {
                line: words.line_of(face.at as usize),
                corners: corners.len(),
            });
        }
        if !parsed.faces.push(&corners) {
            return Err(ReadError::TooLarge);
        }
    }
    Ok(parsed)
}

/// Everything that faces name, with all its numbers, and where faces stand: for texts that are
/// written anew.
#[derive(Default)]
pub(super) struct Listing {
    pub(super) vertices: Vec<Vec<f64>>,
    pub(super) textures: Vec<Vec<f64>>,
    pub(super) normals: Vec<Vec<f64>>,
    pub(super) faces: Vec<ListedFace>,
    /// Behind the last `v`, `vt` and `vn` line; 0 where there is none.
    pub(super) ends: [usize; 3],
    /// The first `l` or `p` line that counts backwards, from 1.
    pub(super) relative_line: Option<u64>,
}

/// An `f` line.
pub(super) struct ListedFace {
    /// From its keyword to its last corner, in bytes of the text.
    pub(super) start: usize,
    pub(super) end: usize,
    /// Indices of vertex, texture coordinate and normal, from 0.
    pub(super) corners: Vec<[Option<u32>; 3]>,
    /// Whether an index counts backwards.
    pub(super) is_relative: bool,
}

/// Lists a text that [`parse`] has read.
pub(super) fn listing(text: &[u8]) -> Result<Listing, ReadError> {
    let mut all = Listing::default();
    let mut words = Words { text, at: if text.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 } };
    let mut faces = Vec::new();
    while words.at < text.len() {
        if let Some(keyword) = words.next() {
            let kind = [&b"v"[..], b"vt", b"vn"].iter().position(|k| *k == words.bytes(keyword));
            let begin = words.at;
            let mut rest = Vec::new();
            while let Some(word) = words.next() {
                rest.push(word);
            }
            let is_relative = || rest.iter().any(|w| words.bytes(*w).contains(&b'-'));
            match (kind, words.bytes(keyword)) {
                (Some(kind), _) => {
                    let number = |w: &(usize, usize)| {
                        std::str::from_utf8(words.bytes(*w)).ok()?.parse::<f64>().ok()
                    };
                    let row = rest.iter().map_while(number).collect();
                    [&mut all.vertices, &mut all.textures, &mut all.normals][kind].push(row);
                    words.skip_line();
                    all.ends[kind] = words.at;
                    continue;
                }
                (None, b"f" | b"fo") => {
                    let before = [
                        all.vertices.len() as u32,
                        all.textures.len() as u32,
                        all.normals.len() as u32,
                    ];
                    let (start, end) = (keyword.0, rest.last().map_or(keyword.1, |w| w.1));
                    faces.push((
                        ListedFace { start, end, corners: vec![], is_relative: is_relative() },
                        rest,
                        before,
                    ));
                }
                (None, b"l" | b"p") if all.relative_line.is_none() && is_relative() => {
                    all.relative_line = Some(words.line_of(begin))
                }
                _ => {}
            }
        }
        words.skip_line();
    }
    let counts = [all.vertices.len() as u32, all.textures.len() as u32, all.normals.len() as u32];
    for (mut face, rest, before) in faces {
        face.corners = rest
            .into_iter()
            .map(|word| words.corner(word, &before, &counts))
            .collect::<Result<_, _>>()?;
        all.faces.push(face);
    }
    Ok(all)
}

/// Walks through the words of statements. A statement ends with its line, unless the line ends with
/// a backslash, or at a word that begins with `#`.
struct Words<'a> {
    text: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    /// The next word of this statement, as a range of the text.
    fn next(&mut self) -> Option<(usize, usize)> {
        loop {
            match self.text.get(self.at)? {
                b'\n' | b'#' => return None,
                b if b.is_ascii_whitespace() => self.at += 1,
                b'\\' if self.continued() > 0 => self.at += self.continued(),
                _ => break,
            }
        }
        let start = self.at;
        while let Some(b) = self.text.get(self.at)
            && !b.is_ascii_whitespace()
            && (*b != b'\\' || self.continued() == 0)
        {
            self.at += 1;
        }
        Some((start, self.at))
    }

    /// Bytes of a backslash and the line end behind it, or 0.
    fn continued(&self) -> usize {
        match &self.text[self.at..] {
            [b'\\', b'\n', ..] => 2,
            [b'\\', b'\r', b'\n', ..] => 3,
            _ => 0,
        }
    }

    fn skip_line(&mut self) {
        let rest = &self.text[self.at..];
        self.at += rest.iter().position(|b| *b == b'\n').map_or(rest.len(), |k| k + 1);
    }

    fn bytes(&self, word: (usize, usize)) -> &'a [u8] {
        &self.text[word.0..word.1]
    }

    /// The word as text, cut to what a message can hold.
    fn shown(&self, word: (usize, usize)) -> String {
        let bytes = self.bytes(word);
        String::from_utf8_lossy(&bytes[..bytes.len().min(40)]).into_owned()
    }

    /// Line of byte `at`, counted from 1. Only faults ask for it.
    fn line_of(&self, at: usize) -> u64 {
        1 + self.text[..at].iter().filter(|b| **b == b'\n').count() as u64
    }

    /// The numbers of the rest of the statement: `needed` ones, and behind them as many as `more`
    /// allows. At most the first three are returned.
    fn numbers(
        &mut self,
        keyword: &'static str,
        needed: usize,
        more: &[usize],
        expected: &'static str,
    ) -> Result<([f64; 3], Span), ReadError> {
        let mut values = [0.0; 3];
        let (begin, mut span, mut found) = (self.at, (self.at, self.at), 0);
        while let Some(word) = self.next() {
            let number =
                std::str::from_utf8(self.bytes(word)).ok().and_then(|t| t.parse::<f64>().ok());
            let Some(number) = number else {
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
    fn corner(
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
            let index: i64 = std::str::from_utf8(part)
                .ok()
                .and_then(|t| t.parse().ok())
                .ok_or_else(|| self.bad_corner(word))?;
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

    fn bad_corner(&self, word: (usize, usize)) -> ReadError {
        ReadError::Corner { line: self.line_of(word.0), text: self.shown(word) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_come_in_four_forms_and_count_from_both_ends() {
        let text =
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1 2/1 3//1\nf -3/-1/-1 -2 4\nv 5 5 5\n";
        let parsed = parse(text.as_bytes()).unwrap();
        assert_eq!(parsed.faces.triangles[..], [[0, 1, 2], [0, 1, 3]]);
        assert_eq!(parsed.normals[0].user, User::Several);
    }

    #[test]
    fn a_continued_line_is_one_statement_and_a_comment_is_not_continued() {
        let text =
            "\u{feff}v 0 \\\n 0 0\n# C:\\\nv 1 0 0\nv 0 1 0 # C:\\\nv 0 0 1\nf 1 \\\r\n2\\\n 3\n";
        let parsed = parse(text.as_bytes()).unwrap();
        assert_eq!(parsed.points.len(), 4);
        assert_eq!(parsed.faces.triangles[..], [[0, 1, 2]]);
    }
}
