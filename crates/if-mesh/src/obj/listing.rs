//! A list of everything that the faces of an OBJ file refer to.

use super::error::ReadError;
use super::words::Words;

/// All vertices, texture coordinates, normals and faces of a text, with all numbers and positions:
/// for texts that are rewritten.
#[derive(Default)]
pub(super) struct Listing {
    pub(super) vertices: Vec<Vec<f64>>,
    pub(super) textures: Vec<Vec<f64>>,
    pub(super) normals: Vec<Vec<f64>>,
    pub(super) faces: Vec<ListedFace>,
    /// Positions after the last `v`, `vt` and `vn` line; 0 if there is none.
    pub(super) ends: [usize; 3],
    /// The first `l` or `p` line with relative indices, from 1.
    pub(super) relative_line: Option<u64>,
}

/// An `f` line.
pub(super) struct ListedFace {
    /// From its keyword to its last corner, in bytes of the text.
    pub(super) start: usize,
    pub(super) end: usize,
    /// Indices of vertex, texture coordinate and normal, from 0.
    pub(super) corners: Vec<[Option<u32>; 3]>,
    /// Whether an index is relative.
    pub(super) is_relative: bool,
}

/// Lists a text that [`parse`] has read.
pub(super) fn listing(text: &[u8]) -> Result<Listing, ReadError> {
    let mut all = Listing::default();
    let mut words = Words::new(text);
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
