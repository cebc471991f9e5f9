//! From the text of an OBJ file to vertices and faces, with their positions in the text.

use super::error::ReadError;
use super::obj_mesh::{NormalLine, Span, User};
use super::words::Words;
use crate::polygons::FaceList;
use if_core::math::{Point, Vector};

/// Surface and positions of numbers of a text.
pub(super) struct Parsed {
    pub(super) points: Vec<Point>,
    pub(super) vertices: Vec<Span>,
    pub(super) normals: Vec<NormalLine>,
    pub(super) faces: FaceList,
}

/// An `f` line: where its corners begin, and the numbers of vertices, texture coordinates and normals
/// before it, to which negative indices are relative.
struct Face {
    at: u32,
    before: [u32; 3],
}

/// Two passes: first vertices, normals and the positions of faces, then the faces, which may refer to
/// later vertices.
pub(super) fn parse(text: &[u8]) -> Result<Parsed, ReadError> {
    let mut parsed = Parsed {
        points: Vec::new(),
        vertices: Vec::new(),
        normals: Vec::new(),
        faces: FaceList::default(),
    };
    let mut faces = Vec::new();
    let mut textures = 0;
    let mut words = Words::new(text);
    while words.at < text.len() {
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
            // Skipped word by word: their lines may be continued.
            Some(b"l" | b"p" | b"vp") => while words.next().is_some() {},
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
}
