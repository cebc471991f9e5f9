//! Splitting triangles of an OBJ file.

use super::error::ReadError;
use super::listing::{Listing, listing};
use super::obj_mesh::ObjMesh;
use super::read::read;
use crate::attributes::Source;
use crate::split::{Part, SplitMesh};
use if_core::mesh::TriMesh;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The same file with its mesh split by `split`, at the positions of `mesh`.
///
/// New `v`, `vt` and `vn` lines follow the last ones of their kind, so that all indices stay valid.
/// A face with a split triangle is replaced by triangles in place. Texture coordinates and normals
/// of new corners, and numbers after the coordinates of new vertices, are interpolated.
///
/// # Errors
///
/// [`ReadError::RelativeLine`], or [`ReadError::TooLarge`] for a text of more than 4 GiB.
///
/// # Panics
///
/// If `split` belongs to a mesh with other triangles.
pub fn split(obj: &ObjMesh, split: &SplitMesh, mesh: &TriMesh) -> Result<ObjMesh, ReadError> {
    let old = listing(&obj.text)?;
    if let Some(line) = old.relative_line {
        return Err(ReadError::RelativeLine { line });
    }
    let end = if obj.text.windows(2).any(|w| w == b"\r\n") { "\r\n" } else { "\n" };
    let mut made = Made { textures: BTreeMap::new(), normals: BTreeMap::new(), old: &old };
    // Replacements of ranges of the text: start, end, new text.
    let mut edits: Vec<(usize, usize, String)> = Vec::new();
    let (mut triangle, mut next) = (0u32, 0);
    for face in &old.faces {
        let of = |k: usize| face.corners[k][0];
        let fan = (1..face.corners.len() - 1).map(|k| [0, k, k + 1]);
        let fan: Vec<[usize; 3]> = fan
            .filter(|[a, b, c]| of(*a) != of(*b) && of(*b) != of(*c) && of(*c) != of(*a))
            .collect();
        let last = triangle + fan.len() as u32;
        let parts = &split.parts[next..]
            [..split.parts[next..].iter().take_while(|p| p.parent < last).count()];
        let lines: Vec<String> = if parts.iter().all(Part::is_whole) {
            if face.is_relative { vec![line(face.corners.iter().copied())] } else { vec![] }
        } else {
            let part = |(k, part): (usize, &Part)| {
                let corners = fan[(part.parent - triangle) as usize].map(|c| face.corners[c]);
                let vertices = split.mesh.triangles()[next + k];
                line(
                    (0..3)
                        .map(|c| made.corner(vertices[c], &corners, &part.corners[c]))
                        .collect::<Vec<_>>(),
                )
            };
            parts.iter().enumerate().map(part).collect()
        };
        if !lines.is_empty() {
            edits.push((face.start, face.end, lines.join(end)));
        }
        triangle = last;
        next += parts.len();
    }
    assert_eq!(next, split.parts.len(), "a split of these triangles");
    let vertices = mesh.vertices().iter().zip(&split.sources).skip(old.vertices.len());
    let vertices = vertices
        .map(|(p, source)| numbers("v", p.iter().copied().chain(old.extra_numbers(source))));
    for (at, lines) in [
        (old.ends[0], vertices.collect::<Vec<_>>()),
        (old.ends[1], made.lines("vt", &made.textures, &old.textures, false)),
        (old.ends[2], made.lines("vn", &made.normals, &old.normals, true)),
    ] {
        if !lines.is_empty() {
            let open = at > 0 && obj.text[at - 1] != b'\n';
            edits.push((
                at,
                at,
                lines
                    .iter()
                    .fold(String::from(if open { end } else { "" }), |all, l| all + l + end),
            ));
        }
    }
    edits.sort_by_key(|e| (e.0, e.1));
    let mut text =
        Vec::with_capacity(obj.text.len() + edits.iter().map(|e| e.2.len()).sum::<usize>());
    let mut copied = 0;
    for (from, to, instead) in edits {
        text.extend_from_slice(&obj.text[copied..from]);
        text.extend_from_slice(instead.as_bytes());
        copied = to;
    }
    text.extend_from_slice(&obj.text[copied..]);
    read(&text[..])
}

/// Indices of `v`, `vt` and `vn` lines, from 0.
type Corner = [Option<u32>; 3];
/// Lines with their weights, to reuse equal means.
type Key = Vec<(u32, u64)>;

/// Texture coordinates and normals made for new corners.
struct Made<'a> {
    textures: BTreeMap<Key, u32>,
    normals: BTreeMap<Key, u32>,
    old: &'a Listing,
}

impl Made<'_> {
    /// The corner at `vertex` with these weights of the corners of a triangle.
    fn corner(&mut self, vertex: u32, of: &[Corner; 3], weights: &[f64; 3]) -> Corner {
        if let Some(k) = weights.iter().position(|w| *w == 1.0) {
            return of[k];
        }
        let mean = |kind: usize, made: &mut BTreeMap<Key, u32>, old: usize| {
            let mut key = Key::new();
            for (corner, w) in of.iter().zip(weights).filter(|(_, w)| **w > 0.0) {
                key.push((corner[kind]?, w.to_bits()));
            }
            key.sort_unstable();
            let index = (old + made.len()) as u32;
            Some(*made.entry(key).or_insert(index))
        };
        let (textures, normals) = (self.old.textures.len(), self.old.normals.len());
        [Some(vertex), mean(1, &mut self.textures, textures), mean(2, &mut self.normals, normals)]
    }

    /// The lines of the new means, in the order of their indices.
    fn lines(
        &self,
        keyword: &str,
        made: &BTreeMap<Key, u32>,
        old: &[Vec<f64>],
        unit: bool,
    ) -> Vec<String> {
        let mut sorted: Vec<(&Key, u32)> = made.iter().map(|(key, index)| (key, *index)).collect();
        sorted.sort_by_key(|e| e.1);
        let line = |key: &Key| {
            let parts: Vec<(u32, f64)> =
                key.iter().map(|(k, w)| (*k, f64::from_bits(*w))).collect();
            let mut mean = mean(&parts, old, 0);
            let length = mean.iter().map(|v| v * v).sum::<f64>().sqrt();
            if unit && length > 0.0 {
                mean.iter_mut().for_each(|v| *v /= length);
            }
            numbers(keyword, mean)
        };
        sorted.into_iter().map(|(key, _)| line(key)).collect()
    }
}

impl Listing {
    /// The numbers after the coordinates of a blended vertex.
    fn extra_numbers(&self, source: &Source) -> Vec<f64> {
        mean(&source.parts(), &self.vertices, 3)
    }
}

/// The weighted mean of rows of numbers from index `from` on, up to the shortest row.
fn mean(parts: &[(u32, f64)], rows: &[Vec<f64>], from: usize) -> Vec<f64> {
    let shortest = parts.iter().map(|(k, _)| rows[*k as usize].len()).min().unwrap_or(0);
    let total: f64 = parts.iter().map(|p| p.1).sum();
    (from..shortest)
        .map(|axis| parts.iter().map(|(k, w)| w * rows[*k as usize][axis]).sum::<f64>() / total)
        .collect()
}

fn numbers(keyword: &str, values: impl IntoIterator<Item = f64>) -> String {
    values.into_iter().fold(keyword.to_owned(), |mut line, v| {
        write!(line, " {v:?}").expect("writing to a String cannot fail");
        line
    })
}

fn line(corners: impl IntoIterator<Item = Corner>) -> String {
    corners.into_iter().fold("f".to_owned(), |mut line, [v, t, n]| {
        let one = |k: Option<u32>| k.map(|k| (u64::from(k) + 1).to_string()).unwrap_or_default();
        let all = [one(v), one(t), one(n)].join("/");
        line.push(' ');
        line.push_str(all.trim_end_matches('/'));
        line
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split::split as split_mesh;

    const SQUARES: &str = "# two squares, the second as triangles\r\no shirt\r\nv 0 0 0 1 0 0\r\nv 1 0 0 0 1 0\r\nv 1 1 0 0 1 0\r\nv 0 1 0 1 0 0\r\n\
        v 2 0 0 0 0 1\r\nv 2 1 0 0 0 1\r\nvt 0 0\r\nvt 1 0\r\nvt 1 1\r\nvt 0 1\r\nvt 0.5 0\r\nvn 0 0 1\r\ng front\r\nf 1/1/1 2/2/1 3/3/1 4/4/1 # a quad\r\n\
        usemtl red\r\nf -5/1 -2/2 -1/3\r\nf 2//1 6//1 \\\r\n 3//1\r\n";

    #[test]
    fn texture_coordinates_normals_colours_and_groups_are_kept() {
        let obj = read(SQUARES.as_bytes()).unwrap();
        let fine = split_mesh(&obj.mesh, &[false, false, false, true]).unwrap();
        let after = split(&obj, &fine, &fine.mesh).unwrap();
        assert_eq!(after.mesh(), &fine.mesh);
        let text = String::from_utf8(after.text().to_vec()).unwrap();
        let expected = "# two squares, the second as triangles\r\no shirt\r\nv 0 0 0 1 0 0\r\nv 1 0 0 0 1 0\r\nv 1 1 0 0 1 0\r\nv 0 1 0 1 0 0\r\n\
            v 2 0 0 0 0 1\r\nv 2 1 0 0 0 1\r\nv 1.0 0.5 0.0 0.0 1.0 0.0\r\nv 1.5 0.5 0.0 0.0 0.5 0.5\r\nv 1.5 1.0 0.0 0.0 0.5 0.5\r\n\
            vt 0 0\r\nvt 1 0\r\nvt 1 1\r\nvt 0 1\r\nvt 0.5 0\r\nvt 1.0 0.5\r\nvt 0.5 0.5\r\nvn 0 0 1\r\nvn 0.0 0.0 1.0\r\ng front\r\n\
            f 2/2/1 7/6/2 1/1/1\r\nf 7/6/2 3/3/1 1/1/1\r\nf 1/1/1 3/3/1 4/4/1 # a quad\r\nusemtl red\r\n";
        assert!(text.starts_with(expected), "{text}");
        assert!(text.ends_with("f 6/3 8/7 5/2\r\nf 8/7 2/1 5/2\r\nf 2//1 8//2 7//2\r\nf 8//2 6//1 9//2\r\nf 7//2 9//2 3//1\r\nf 8//2 9//2 7//2\r\n"), "{text}");
    }

    #[test]
    fn without_splits_only_relative_indices_change() {
        let obj = read(SQUARES.as_bytes()).unwrap();
        let same = split(&obj, &SplitMesh::none(&obj.mesh), &obj.mesh).unwrap();
        assert_eq!(
            String::from_utf8(same.text().to_vec()).unwrap(),
            SQUARES.replace("-5/1 -2/2 -1/3", "2/1 5/2 6/3")
        );
    }

    #[test]
    fn lines_with_relative_indices_are_rejected() {
        let text = SQUARES.to_owned() + "l -1 -2\n";
        let obj = read(text.as_bytes()).unwrap();
        let fault = split(&obj, &SplitMesh::none(&obj.mesh), &obj.mesh).unwrap_err();
        assert!(matches!(fault, ReadError::RelativeLine { line: 21 }), "{fault}");
    }
}
