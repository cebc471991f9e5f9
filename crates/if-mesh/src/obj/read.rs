//! The OBJ reader.

use super::error::ReadError;
use super::obj_mesh::ObjMesh;
use super::parse::{Parsed, parse};
use crate::polygons::FaceList;
use if_core::mesh::{FinitePoints, TriMesh};
use std::io::{ErrorKind, Read};

/// Reads an OBJ file from any source, to its end.
///
/// # Errors
///
/// [`ReadError`], with the line. Unknown statements are kept and ignored.
///
/// # Examples
///
/// ```
/// let obj = if_mesh::obj::read(&b"# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n"[..])?;
/// assert_eq!(obj.mesh().triangles(), [[0, 1, 2], [0, 2, 3]]);
/// # Ok::<(), if_mesh::obj::ReadError>(())
/// ```
pub fn read(reader: impl Read) -> Result<ObjMesh, ReadError> {
    parsed(text_of(reader)?)
}

/// As [`read`], of a text in memory.
pub(crate) fn read_text(text: Vec<u8>) -> Result<ObjMesh, ReadError> {
    if let Some(byte) = zero(&text) {
        return Err(ReadError::Binary { byte });
    }
    if text.len() >= u32::MAX as usize { Err(ReadError::TooLarge) } else { parsed(text) }
}

/// Position of the first zero byte.
fn zero(bytes: &[u8]) -> Option<u64> {
    let at = || bytes.iter().position(|b| *b == 0).map(|at| at as u64);
    bytes.contains(&0).then(at).flatten() // `contains` is much faster than `position`
}

fn parsed(text: Vec<u8>) -> Result<ObjMesh, ReadError> {
    let Parsed { points, vertices, normals, faces, objects } = parse(&text)?;
    let FaceList { triangles, polygons, collapsed } = faces;
    Ok(ObjMesh {
        mesh: TriMesh::from_parts(FinitePoints::new(points)?, triangles)?,
        polygons,
        collapsed,
        objects,
        text,
        vertices,
        normals,
    })
}

/// Reads the whole text. A zero byte is an error, which also stops on endless devices.
fn text_of(mut reader: impl Read) -> Result<Vec<u8>, ReadError> {
    let mut text = Vec::new();
    let mut block = vec![0; 1 << 18];
    loop {
        let n = match reader.read(&mut block) {
            Ok(0) => return Ok(text),
            Ok(n) => n,
            Err(e) if e.kind() == ErrorKind::Interrupted => continue,
            Err(e) => return Err(e.into()),
        };
        if let Some(k) = zero(&block[..n]) {
            return Err(ReadError::Binary { byte: text.len() as u64 + k });
        }
        if text.len() + n >= u32::MAX as usize {
            return Err(ReadError::TooLarge);
        }
        text.extend_from_slice(&block[..n]);
    }
}
