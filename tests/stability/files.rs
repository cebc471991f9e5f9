//! Mesh files with bytes, words and lines changed, cut and doubled: read whole or refused, never a
//! panic.

use crate::cases::{Random, Tally, cases, check, finite, share};
use crate::index::placed;
use if_mesh::obj::Normals;
use if_mesh::ply::{CoordinateType, PlyMesh, WriteParams};
use if_mesh::{obj, ply};

const WORDS: [&str; 24] = [
    "nan",
    "-inf",
    "1e999",
    "1e-999",
    "-0",
    "99999999999999999999",
    "-1",
    "3.5",
    "",
    " ",
    "\n",
    "\r\n",
    "\\\n",
    "list",
    "uchar",
    "float",
    "double",
    "int64",
    "vertex",
    "face",
    "end_header",
    "f 1/1/1 2//2 -1",
    "property float x",
    "element face 18446744073709551615",
];

/// One to five changes.
pub fn mutated(r: &mut Random, file: &[u8]) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for _ in 0..1 + r.below(5) {
        let n = bytes.len();
        if n < 2 {
            break;
        }
        let (at, to) = (r.below(n), r.below(n));
        let (at, to) = (at.min(to), at.max(to));
        match r.below(7) {
            0 => bytes[at] = r.below(256) as u8,
            1 => bytes[at] ^= 1 << r.below(8),
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..to.min(at + 40))),
            4 => {
                let again = bytes[at..to.min(at + 200)].to_vec();
                bytes.splice(to..to, again);
            }
            5 => {
                let word = r.pick(&WORDS).as_bytes().to_vec();
                let end = (at + r.below(8)).min(n);
                bytes.splice(at..end, word);
            }
            _ => bytes.swap(at, to),
        }
    }
    bytes
}

fn ply_files(count: u32) -> Tally {
    cases("PLY files", count, |r| {
        let (mesh, _) = placed(r);
        let coordinates = r.pick(&[CoordinateType::Float, CoordinateType::Double]);
        let params = WriteParams { coordinates, ..WriteParams::default() };
        let mut file = Vec::new();
        ply::write(&PlyMesh::new(mesh.clone()), mesh.vertices(), &params, &mut file)
            .map_err(|e| e.to_string())?;
        if r.chance(0.5) {
            file = as_text(&mesh);
        }
        let bytes = mutated(r, &file);
        let streamed = ply::read(&bytes[..]).is_ok();
        match ply::read_bytes(&bytes) {
            Ok(read) => {
                check(streamed && finite(read.mesh.vertices()), || {
                    "a stream is read otherwise".into()
                })?;
                let mut again = Vec::new();
                ply::write(
                    &read,
                    read.mesh.vertices(),
                    &WriteParams { coordinates: CoordinateType::Double, ..params },
                    &mut again,
                )
                .map_err(|e| format!("cannot be written: {e}"))?;
                let second =
                    ply::read_bytes(&again).map_err(|e| format!("cannot be read again: {e}"))?;
                check(second.mesh == read.mesh, || {
                    "is another mesh when written and read again".into()
                })?;
                Ok("read")
            }
            Err(error) => check(!streamed && !error.to_string().is_empty(), || {
                "a stream is read otherwise".into()
            })
            .map(|()| "refused"),
        }
    })
}

fn as_text(mesh: &if_core::mesh::TriMesh) -> Vec<u8> {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nelement face {}\nproperty list \
         uchar int vertex_indices\nend_header\n",
        mesh.vertices().len(),
        mesh.triangles().len()
    );
    mesh.vertices().iter().for_each(|p| text += &format!("{} {} {}\n", p.x, p.y, p.z));
    mesh.triangles().iter().for_each(|t| text += &format!("3 {} {} {}\n", t[0], t[1], t[2]));
    text.into_bytes()
}

fn obj_files(count: u32) -> Tally {
    cases("OBJ files", count, |r| {
        let (mesh, _) = placed(r);
        let mut text = String::new();
        mesh.vertices()
            .iter()
            .for_each(|p| text += &format!("v {} {} {}\nvn 0 0 1\n", p.x, p.y, p.z));
        mesh.triangles().iter().for_each(|t| {
            text += &format!("f {}//{} {} {}\n", t[0] + 1, t[0] + 1, t[1] + 1, t[2] + 1)
        });
        let bytes = mutated(r, text.as_bytes());
        let Ok(read) = obj::read(&bytes[..]) else { return Ok("refused") };
        check(finite(read.mesh().vertices()), || "a coordinate is not finite".into())?;
        let moved: Vec<_> = read.mesh().vertices().iter().map(|p| p * 0.5).collect();
        let mut again = Vec::new();
        obj::write(&read, &moved, Normals::Follow, &mut again)
            .map_err(|e| format!("cannot be written: {e}"))?;
        let second = obj::read(&again[..]).map_err(|e| format!("cannot be read again: {e}"))?;
        let same = second.mesh().vertices() == moved
            && second.mesh().triangles() == read.mesh().triangles();
        check(same, || "is another mesh when written and read again".into())?;
        Ok("read")
    })
}

#[test]
fn spoiled_files_are_read_whole_or_refused() {
    for tally in [ply_files(3_000), obj_files(3_000)] {
        assert!(share(&tally, "read") > 0.02 && share(&tally, "refused") > 0.2, "{tally:?}");
    }
}

#[test]
#[ignore = "stress"]
fn many_spoiled_files_are_read_whole_or_refused() {
    ply_files(100_000);
    obj_files(100_000);
}
