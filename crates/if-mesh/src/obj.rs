//! OBJ files: read for their surface, and written again with nothing changed but the vertices that
//! moved.
//!
//! [`read`] keeps the whole text. [`write()`] copies it, and replaces the coordinates on `v` lines of
//! vertices that moved (and, see [`Normals`], the normals that turn with them) by the shortest
//! decimals that are read back as the same `f64`. So UVs, groups, materials, smoothing groups,
//! polygons, comments, colours behind the coordinates, line ends and the order of everything
//! survive byte for byte.
//!
//! The vertices of the mesh are all `v` lines in the file's order, used by a face or not.
//!
//! `tobj` is the foreign tool in the tests, and not the reader: it numbers vertices anew in the
//! order of their use and drops unused ones, which would lose the order; it rounds to `f32`, knows
//! no continued lines, refuses a `vt` of one number, names no line in its errors, and overflows on
//! some relative indices.

mod error;
mod materials;
mod parse;
mod split;
mod to_ply;

pub use crate::normals::Normals;
pub use error::{Index, ReadError, WriteError};
pub use materials::textures;
pub use split::{SplitError, split};
pub use to_ply::{Lost, to_ply};

use crate::normals::Turns;
use crate::polygons::{FaceList, Polygons};
use if_core::math::{Point, Vector};
use if_core::mesh::{FinitePoints, MeshError, TriMesh};
use std::io::{Read, Write};

/// A mesh with the text of its OBJ file.
#[derive(Clone, Debug)]
pub struct ObjMesh {
    mesh: TriMesh,
    polygons: Option<Polygons>,
    collapsed: Vec<u32>,
    text: Vec<u8>,
    /// The three coordinates on each `v` line.
    vertices: Vec<Span>,
    /// The three coordinates on each `vn` line.
    normals: Vec<NormalLine>,
}

/// Bytes of the text from the first of three numbers to the last.
#[derive(Clone, Copy, Debug)]
struct Span {
    start: u32,
    end: u32,
}

#[derive(Clone, Copy, Debug)]
struct NormalLine {
    span: Span,
    value: Vector,
    user: User,
}

/// Which vertices use a normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum User {
    None,
    One(u32),
    Several,
}

impl ObjMesh {
    /// All `v` lines in the file's order, in the file's units, and the faces as triangles. Weights
    /// and colours behind the coordinates are not looked at.
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// The `f` lines as they stand, where they are not the triangles of the mesh: a face of n
    /// corners is a fan of n − 2 triangles round its first corner.
    pub fn polygons(&self) -> Option<&Polygons> {
        self.polygons.as_ref()
    }

    /// Indices of `f` lines that use a vertex twice. The triangles of their fans that do so are not
    /// in the mesh; the lines are written again.
    pub fn collapsed(&self) -> &[u32] {
        &self.collapsed
    }

    /// The file, byte for byte.
    pub fn text(&self) -> &[u8] {
        &self.text
    }

    /// What stands on the `mtllib` lines: a file name that may hold spaces, or several names
    /// between spaces. Paths start at the folder of the file.
    pub fn material_libraries(&self) -> Vec<String> {
        materials::libraries(&self.text)
    }

    /// Number of `vn` lines that several vertices use. They cannot turn with any one vertex, so
    /// [`write()`] keeps them as they stand: stale where vertices moved.
    pub fn shared_normals(&self) -> usize {
        self.normals.iter().filter(|n| n.user == User::Several).count()
    }
}

/// Reads an OBJ file from any source, to its end.
///
/// # Errors
///
/// [`ReadError`], with the line. Statements that are not known here are kept and not looked at.
///
/// # Examples
///
/// ```
/// let obj = if_mesh::obj::read(&b"# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n"[..])?;
/// assert_eq!(obj.mesh().triangles(), [[0, 1, 2], [0, 2, 3]]);
/// # Ok::<(), if_mesh::obj::ReadError>(())
/// ```
pub fn read(mut reader: impl Read) -> Result<ObjMesh, ReadError> {
    let text = parse::slurp(&mut reader)?;
    let parse::Parsed { points, vertices, normals, faces } = parse::parse(&text)?;
    let FaceList { triangles, polygons, collapsed } = faces;
    Ok(ObjMesh {
        mesh: TriMesh::from_parts(FinitePoints::new(points)?, triangles)?,
        polygons,
        collapsed,
        text,
        vertices,
        normals,
    })
}

/// Bytes handed to the writer at once.
const BLOCK: usize = 1 << 18;

/// Writes the text again with the vertices at `positions`, in the file's units.
///
/// # Errors
///
/// Positions that do not fit or are not finite, and what `writer` returns.
pub fn write(
    obj: &ObjMesh,
    positions: &[Point],
    normals: Normals,
    mut writer: impl Write,
) -> Result<(), WriteError> {
    let before = obj.mesh.vertices();
    if positions.len() != before.len() {
        return Err(MeshError::VertexCount { expected: before.len(), got: positions.len() }.into());
    }
    for (vertex, p) in positions.iter().enumerate() {
        if let Some(axis) = (0..3).find(|&axis| !p[axis].is_finite()) {
            return Err(MeshError::NonFinite { vertex, axis, value: p[axis] }.into());
        }
    }
    let turns = match normals {
        Normals::Follow if !obj.normals.is_empty() => Turns::new(&obj.mesh, positions),
        _ => None,
    };
    let moved = (0..before.len())
        .filter(|&v| before[v] != positions[v])
        .map(|v| (obj.vertices[v], positions[v].coords));
    let turned = obj.normals.iter().filter_map(|n| match n.user {
        User::One(v) => Some((n.span, turns.as_ref()?.turned(v as usize, &n.value)?)),
        _ => None,
    });
    let (mut moved, mut turned) = (moved.peekable(), turned.peekable());
    let mut out = Vec::with_capacity(BLOCK + 128);
    let mut copied = 0;
    loop {
        // Both run through the text in order: take the earlier one.
        let next = match (moved.peek(), turned.peek()) {
            (Some(a), Some(b)) if b.0.start < a.0.start => turned.next(),
            (None, _) => turned.next(),
            _ => moved.next(),
        };
        let Some((span, p)) = next else { break };
        out.extend_from_slice(&obj.text[copied..span.start as usize]);
        write!(out, "{:?} {:?} {:?}", p.x, p.y, p.z)?; // Debug: the shortest digits, with an exponent where it is short
        copied = span.end as usize;
        if out.len() >= BLOCK {
            writer.write_all(&out)?;
            out.clear();
        }
    }
    writer.write_all(&out)?;
    writer.write_all(&obj.text[copied..])?;
    writer.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUADS: &str = "# made by hand\r\nmtllib a b.mtl\r\no shirt\r\n  v 0 0 0 1 0 0\r\nv\t1.0000 0 \\\r\n  0\r\nv 1 1e0 0 # top\r\n\
        v 0 1 0\r\nv 9 9 9\r\nvt 0.5\r\nvt 1 1\r\nvn 0 0 1\r\nvn 0.6 0 0.8\r\nvn 0 1 0\r\ng front\r\nusemtl red\r\ns 1\r\n\
        f 1/1/1 2/2/2 3//3 4//3\r\nl 1 2\r\ncurv 0 1 \\\r\n";

    fn again(obj: &ObjMesh, positions: &[Point], normals: Normals) -> String {
        let mut out = Vec::new();
        write(obj, positions, normals, &mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn what_has_not_moved_is_written_byte_for_byte() {
        let obj = read(QUADS.as_bytes()).unwrap();
        assert_eq!(obj.mesh().vertices().len(), 5);
        assert_eq!(obj.polygons().unwrap().face(0), [0, 1, 2, 3]);
        assert_eq!(again(&obj, obj.mesh().vertices(), Normals::Follow), QUADS);
    }

    #[test]
    fn only_the_coordinates_of_moved_vertices_change() {
        let obj = read(QUADS.as_bytes()).unwrap();
        let mut moved = obj.mesh().vertices().to_vec();
        moved[0].x = 0.1 + 0.2;
        moved[1].y = -1e-9;
        let expected = QUADS.replace("v 0 0 0 1 0 0", "v 0.30000000000000004 0.0 0.0 1 0 0");
        let expected = expected.replace("v\t1.0000 0 \\\r\n  0", "v\t1.0 -1e-9 0.0");
        assert_eq!(again(&obj, &moved, Normals::Keep), expected);
        assert_eq!(read(expected.as_bytes()).unwrap().mesh().vertices(), moved);
    }

    #[test]
    fn a_normal_of_one_vertex_turns_with_it_and_a_shared_one_stays() {
        let obj = read(QUADS.as_bytes()).unwrap();
        assert_eq!(obj.shared_normals(), 1);
        let turned: Vec<Point> =
            obj.mesh().vertices().iter().map(|p| Point::new(p.x, -p.z, p.y)).collect();
        let text = again(&obj, &turned, Normals::Follow);
        let normals: Vec<&str> = text.lines().filter(|l| l.starts_with("vn")).collect();
        assert_eq!(normals[2], "vn 0 1 0");
        let value = |l: &str| -> Vec<f64> {
            l.split_whitespace().skip(1).map(|w| w.parse().unwrap()).collect()
        };
        for (line, expected) in [(normals[0], [0.0, -1.0, 0.0]), (normals[1], [0.6, -0.8, 0.0])] {
            approx::assert_relative_eq!(value(line)[..], expected[..], epsilon = 1e-15);
        }
    }

    #[test]
    fn positions_that_do_not_fit_are_refused() {
        let obj = read(QUADS.as_bytes()).unwrap();
        let mut bad = obj.mesh().vertices().to_vec();
        bad[3].z = f64::NAN;
        let fault = write(&obj, &bad, Normals::Keep, Vec::new()).unwrap_err();
        assert!(matches!(fault, WriteError::Mesh(MeshError::NonFinite { vertex: 3, axis: 2, .. })));
        assert!(write(&obj, &bad[..4], Normals::Keep, Vec::new()).is_err());
    }
}
