//! The OBJ writer.

use super::error::WriteError;
use super::obj_mesh::{ObjMesh, User};
use crate::normals::{Normals, Turns};
use if_core::math::Point;
use std::io::Write;

/// Bytes per call of the writer.
const BLOCK: usize = 1 << 18;

/// Writes the text of the file with the vertices at `positions`, in the file's units.
///
/// # Errors
///
/// Positions of another number or not finite, and errors of `writer`.
pub fn write(
    obj: &ObjMesh,
    positions: &[Point],
    normals: Normals,
    mut writer: impl Write,
) -> Result<(), WriteError> {
    let before = obj.mesh.vertices();
    obj.mesh.check_positions(positions)?;
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
        // Both are in the order of the text: take the earlier one.
        let next = match (moved.peek(), turned.peek()) {
            (Some(a), Some(b)) if b.0.start < a.0.start => turned.next(),
            (None, _) => turned.next(),
            _ => moved.next(),
        };
        let Some((span, p)) = next else { break };
        out.extend_from_slice(&obj.text[copied..span.start as usize]);
        // Debug writes the shortest digits that are read back as the same number.
        write!(out, "{:?} {:?} {:?}", p.x, p.y, p.z)?;
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
    use crate::obj::read;
    use if_core::mesh::MeshError;

    const QUADS: &str = "# made by hand\r\nmtllib a b.mtl\r\no shirt\r\n  v 0 0 0 1 0 0\r\nv\t1.0000 0 \\\r\n  0\r\nv 1 1e0 0 # top\r\n\
        v 0 1 0\r\nv 9 9 9\r\nvt 0.5\r\nvt 1 1\r\nvn 0 0 1\r\nvn 0.6 0 0.8\r\nvn 0 1 0\r\ng front\r\nusemtl red\r\ns 1\r\n\
        f 1/1/1 2/2/2 3//3 4//3\r\nl 1 2\r\ncurv 0 1 \\\r\n";

    fn again(obj: &ObjMesh, positions: &[Point], normals: Normals) -> String {
        let mut out = Vec::new();
        write(obj, positions, normals, &mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn without_moves_the_text_is_written_byte_for_byte() {
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
    fn a_normal_of_one_vertex_rotates_with_it_and_a_shared_one_stays() {
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
    fn positions_of_another_number_or_not_finite_are_rejected() {
        let obj = read(QUADS.as_bytes()).unwrap();
        let mut bad = obj.mesh().vertices().to_vec();
        bad[3].z = f64::NAN;
        let fault = write(&obj, &bad, Normals::Keep, Vec::new()).unwrap_err();
        assert!(matches!(fault, WriteError::Mesh(MeshError::NonFinite { vertex: 3, axis: 2, .. })));
        assert!(write(&obj, &bad[..4], Normals::Keep, Vec::new()).is_err());
    }
}
