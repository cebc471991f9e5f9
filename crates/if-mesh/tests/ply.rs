//! PLY files from outside: what is read and written survives, and what is malformed is refused.

use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_mesh::ply::{self, Column, CoordinateType, Keep, PlyMesh, Property, ReadError, WriteParams};

/// A wavy square of `2 n²` triangles.
fn sheet(n: u32) -> TriMesh {
    let step = 1.0 / f64::from(n);
    let mut v = Vec::new();
    let mut t = Vec::new();
    for y in 0..=n {
        for x in 0..=n {
            let (x, y) = (f64::from(x) * step, f64::from(y) * step);
            v.push(Point::new(x, y, 0.1 * (7.0 * x).sin() * (5.0 * y).cos()).map(|c| f64::from(c as f32)));
        }
    }
    for y in 0..n {
        for x in 0..n {
            let a = y * (n + 1) + x;
            t.push([a, a + 1, a + n + 2]);
            t.push([a, a + n + 2, a + n + 1]);
        }
    }
    TriMesh::new(v, t).unwrap()
}

fn written(ply: &PlyMesh, params: &WriteParams) -> Vec<u8> {
    let mut bytes = Vec::new();
    ply::write(ply, ply.mesh.vertices(), params, &mut bytes).unwrap();
    bytes
}

#[test]
#[ignore = "stress"]
fn a_million_triangles_are_read_and_written_in_milliseconds() {
    use std::time::Instant;
    let mesh = sheet(708);
    let weights = (0..mesh.vertices().len()).map(|k| k as f32).collect();
    let mut skinned = PlyMesh::new(mesh.clone());
    skinned.vertex_properties = vec![Property::new("w0", Column::F32(weights))];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sheet.ply");
    let best = |f: &mut dyn FnMut()| {
        let time = |_| {
            let start = Instant::now();
            f();
            start.elapsed().as_secs_f64() * 1e3
        };
        (0..15).map(time).fold(f64::INFINITY, f64::min)
    };
    for ply in [PlyMesh::new(mesh), skinned] {
        for coordinates in [CoordinateType::Float, CoordinateType::Double] {
            let params = WriteParams { coordinates, ..WriteParams::default() };
            let write = best(&mut || ply::write_path(&ply, ply.mesh.vertices(), &params, &path).unwrap());
            let bytes = std::fs::read(&path).unwrap();
            let from_path = best(&mut || assert_eq!(ply::read_path(&path).unwrap().mesh.triangles().len(), 1_002_528));
            let from_memory = best(&mut || assert_eq!(ply::read_bytes(&bytes).unwrap().mesh.triangles().len(), 1_002_528));
            println!(
                "{coordinates:?}, {} properties, {:.1} MB: read {from_path:.1} ms (from memory {from_memory:.1}), write {write:.1} ms",
                ply.vertex_properties.len(),
                bytes.len() as f64 / 1e6,
            );
        }
    }
}
