//! From the text of an OBJ file to vertices and faces, with their positions in the text.

use super::error::ReadError;
use super::obj_mesh::{NormalLine, Span, User};
use super::words::Words;
use crate::polygons::FaceList;
use if_core::math::{Point, Vector};
use rayon::prelude::*;
use std::collections::HashSet;

/// Minimum size of a part of a text that is read in parallel to others, in bytes: it takes about a
/// millisecond.
const PART: usize = 1 << 18;

/// Surface and positions of numbers of a text.
#[derive(Default)]
pub(super) struct Parsed {
    pub(super) points: Vec<Point>,
    pub(super) vertices: Vec<Span>,
    pub(super) normals: Vec<NormalLine>,
    pub(super) faces: FaceList,
    /// Names of the objects (`o`) that have faces.
    pub(super) objects: Vec<String>,
}

/// An `f` line: where its corners begin, and the numbers of vertices, texture coordinates and normals
/// before it in its part, to which negative indices are relative.
struct Face {
    at: u32,
    before: [u32; 3],
}

/// The statements of a part of a text.
#[derive(Default)]
struct Statements {
    points: Vec<Point>,
    vertices: Vec<Span>,
    normals: Vec<NormalLine>,
    textures: u32,
    faces: Vec<Face>,
    /// Name of each `o` line, and the number of faces before it in the part.
    objects: Vec<(String, usize)>,
}

/// The corners of the faces of a part.
#[derive(Default)]
struct Corners {
    /// Vertices of all faces.
    vertices: Vec<u32>,
    /// Number of corners of each face.
    counts: Vec<u32>,
    /// Normals of corners, with the corners' vertices.
    normals: Vec<[u32; 2]>,
}

/// Two passes: first vertices, normals and the positions of faces, then the faces, which may refer to
/// later vertices. Each pass reads the parts of the text in parallel; the result is the same for any
/// parts.
pub(super) fn parse(text: &[u8]) -> Result<Parsed, ReadError> {
    parse_parts(Words::parts(text, PART))
}

fn parse_parts(mut parts: Vec<Words<'_>>) -> Result<Parsed, ReadError> {
    let mut parsed = Parsed::default();
    let mut faces = Vec::new();
    let mut counts = [0u32; 3];
    let (mut objects, mut face_count) = (Vec::new(), 0);
    // All are read before the first error is returned, so that it is the first of the text.
    let read: Vec<_> = parts.par_iter_mut().map(statements).collect();
    for part in read {
        let mut part = part.map_err(|error| error.after(parsed.points.len()))?;
        objects.extend(part.objects.into_iter().map(|(name, at)| (name, face_count + at)));
        face_count += part.faces.len();
        faces.push((counts, part.faces));
        counts[0] += part.points.len() as u32;
        counts[1] += part.textures;
        counts[2] += part.normals.len() as u32;
        parsed.points.append(&mut part.points);
        parsed.vertices.append(&mut part.vertices);
        parsed.normals.append(&mut part.normals);
    }
    if parsed.points.is_empty() {
        return Err(ReadError::NoVertices);
    }
    parsed.objects = with_faces(objects, face_count);
    let parts = parts.par_iter_mut().zip(&faces);
    let read: Vec<_> = parts.map(|(words, faces)| corners(words, faces, &counts)).collect();
    for part in read {
        let part = part?;
        for [n, v] in part.normals {
            let user = &mut parsed.normals[n as usize].user;
            *user = if matches!(*user, User::None) || *user == User::One(v) {
                User::One(v)
            } else {
                User::Several
            };
        }
        let mut start = 0;
        for count in part.counts {
            let end = start + count as usize;
            if !parsed.faces.push(&part.vertices[start..end]) {
                return Err(ReadError::TooLarge);
            }
            start = end;
        }
    }
    Ok(parsed)
}

/// The names of the objects that have faces, each once; `faces` is the number of faces of the text.
fn with_faces(objects: Vec<(String, usize)>, faces: usize) -> Vec<String> {
    let ends: Vec<usize> = objects.iter().skip(1).map(|o| o.1).chain([faces]).collect();
    let mut names: Vec<String> = Vec::new();
    let mut seen = HashSet::new();
    for ((name, start), end) in objects.into_iter().zip(ends) {
        if end > start && seen.insert(name.clone()) {
            names.push(name);
        }
    }
    names
}

/// The first pass over a part. An error counts vertices from the first of the part.
fn statements(words: &mut Words<'_>) -> Result<Statements, ReadError> {
    let mut part = Statements::default();
    while words.at < words.text.len() {
        match words.next().map(|w| words.bytes(w)) {
            Some(b"v") => {
                let (p, span) = words.numbers(
                    "v",
                    3,
                    &[0, 1, 3, 4],
                    "3, optionally followed by a weight or a colour",
                )?;
                if let Some(k) = p.iter().position(|x| !x.is_finite()) {
                    let (line, vertex, text) =
                        (words.line_of(span.start as usize), part.points.len(), p[k].to_string());
                    return Err(ReadError::NonFinite { line, vertex, text });
                }
                part.points.push(Point::new(p[0], p[1], p[2]));
                part.vertices.push(span);
            }
            Some(b"vn") => {
                let (n, span) = words.numbers("vn", 3, &[0], "3")?;
                let value = Vector::new(n[0], n[1], n[2]);
                part.normals.push(NormalLine { span, value, user: User::None });
            }
            Some(b"vt") => {
                words.numbers("vt", 1, &[0, 1, 2, 3], "1 to 4")?;
                part.textures += 1;
            }
            Some(b"f" | b"fo") => {
                let before = [part.points.len() as u32, part.textures, part.normals.len() as u32];
                part.faces.push(Face { at: words.at as u32, before });
                words.skip_words();
            }
            // Their lines may be continued.
            Some(b"o") => part.objects.push((words.rest_of_line(), part.faces.len())),
            Some(b"l" | b"p" | b"vp") => words.skip_words(),
            _ => {}
        }
        words.skip_line();
    }
    Ok(part)
}

/// The second pass over the faces of a part. Before the part the text has as many vertices, texture
/// coordinates and normals as `first`, and `counts` in all.
fn corners(
    words: &mut Words<'_>,
    (first, faces): &([u32; 3], Vec<Face>),
    counts: &[u32; 3],
) -> Result<Corners, ReadError> {
    let mut part = Corners::default();
    part.counts.reserve(faces.len());
    part.vertices.reserve(3 * faces.len());
    for face in faces {
        let before = [0, 1, 2].map(|k| first[k] + face.before[k]);
        words.at = face.at as usize;
        let start = part.vertices.len();
        while let Some(word) = words.next() {
            let [v, _, n] = words.corner(word, &before, counts)?;
            let v = v.ok_or_else(|| words.bad_corner(word))?;
            part.vertices.push(v);
            part.normals.extend(n.map(|n| [n, v]));
        }
        let corners = part.vertices.len() - start;
        if corners < 3 {
            return Err(ReadError::FaceTooShort { line: words.line_of(face.at as usize), corners });
        }
        part.counts.push(corners as u32);
    }
    Ok(part)
}

impl ReadError {
    /// The same error in a text with so many vertices before.
    fn after(self, vertices: usize) -> Self {
        match self {
            Self::NonFinite { line, vertex, text } => {
                Self::NonFinite { line, vertex: vertex + vertices, text }
            }
            error => error,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_have_four_forms_and_relative_indices() {
        let text =
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1 2/1 3//1\nf -3/-1/-1 -2 4\nv 5 5 5\n";
        let parsed = parse(text.as_bytes()).unwrap();
        assert_eq!(parsed.faces.triangles[..], [[0, 1, 2], [0, 1, 3]]);
        assert_eq!(parsed.normals[0].user, User::Several);
    }

    #[test]
    fn lines_are_continued_and_comments_are_not() {
        let text =
            "\u{feff}v 0 \\\n 0 0\n# C:\\\nv 1 0 0\nv 0 1 0 # C:\\\nv 0 0 1\nf 1 \\\r\n2\\\n 3\n";
        let parsed = parse(text.as_bytes()).unwrap();
        assert_eq!(parsed.points.len(), 4);
        assert_eq!(parsed.faces.triangles[..], [[0, 1, 2]]);
    }

    #[test]
    fn objects_are_those_with_faces() {
        let text = "o empty\no the body \r\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no jeans#2\nf 3 2 1\no\tlast\n";
        assert_eq!(parse(text.as_bytes()).unwrap().objects, ["the body", "jeans#2"]);
        let one = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no a\nf 1 2 3\no a\nf 1 2 3";
        assert_eq!(parse(one.as_bytes()).unwrap().objects, ["a"]);
    }

    #[test]
    fn a_text_in_parts_gives_what_the_whole_gives() {
        let good = "\u{feff}o one\nv 0 \\\n 0 0\r\n# C:\\\nv 1 0 0\nvt 0 0\nvn 0 0 1\nv 0 1 0 # C:\\\nv 0 0 1\nvt 1\n\
            f 1 \\\r\n2\\\n 3\nf -4/-2/-1 -3//1 -2/2 -1\no two 2\no\nvn 0 1 0\nl 1 2 \\\n3\nf 1//2 2//2 4//-1\nv 9 9 9";
        let faults = [
            "",
            "\nv 1 nan 0\nv inf 0 0",
            "\nf 1 2 6\nf 1 2",
            "\nf 1 2\nf 1 2 7",
            "\nf 1 2 x\nv 1 2",
            "\nf -6 1 2",
            "\nvn 1",
            "\nvt",
            "\nv 1 2 3 4 5",
            "\nf 1 2 3/4/5/6",
            "\nf 1 2 \\",
        ];
        for fault in faults {
            for text in [good.to_owned() + fault, fault.to_owned() + "\n" + good] {
                let show = |parts: Vec<Words<'_>>| match parse_parts(parts) {
                    Ok(p) => {
                        let Parsed { points, vertices, normals, faces, objects } = p;
                        format!("{points:?} {vertices:?} {normals:?} {faces:?} {objects:?}")
                    }
                    Err(e) => e.to_string(),
                };
                let text = text.as_bytes();
                let whole = show(vec![Words::new(text)]);
                for least in [1, 2, 3, 7, 20, 50, 1000] {
                    let parts = Words::parts(text, least);
                    assert!(parts.len() > 8 || least > 2);
                    assert_eq!(show(parts), whole, "{least}");
                }
            }
        }
    }
}
