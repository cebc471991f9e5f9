//! PLY files from outside: what is read and written survives, and a foreign tool agrees.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // also in what the tests share

use if_core::math::{Point, Vector};
use if_core::mesh::TriMesh;
use if_mesh::ply::{
    self, Column, CoordinateType, Keep, PlyMesh, Property, WriteError, WriteParams,
};
use if_mesh::polygons::Polygons;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{self as foreign, Addable, DefaultElement, Encoding, Ply};
use ply_rs_bw::writer::Writer;

/// A wavy square of `2 n²` triangles, with coordinates that `f32` holds.
fn sheet(n: u32) -> TriMesh {
    let step = 1.0 / f64::from(n);
    let mut v = Vec::new();
    let mut t = Vec::new();
    for y in 0..=n {
        for x in 0..=n {
            let (x, y) = (f64::from(x) * step, f64::from(y) * step);
            v.push(
                Point::new(x, y, 0.1 * (7.0 * x).sin() * (5.0 * y).cos())
                    .map(|c| f64::from(c as f32)),
            );
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

/// Faces before vertices, an element nobody knows, lists everywhere, every type, mixed numbers of
/// corners.
const ODD: &str = "ply\r\nformat ascii 1.0\r\ncomment one\r\nobj_info two\r\nelement face 3\r\nproperty uchar flags\r\n\
    property list uchar uint vertex_index\r\nproperty list uchar float texcoord\r\nelement camera 1\r\nproperty int64 id\r\n\
    property list int short dims\r\nelement vertex 5\r\nproperty double quality\r\nproperty float z\r\nproperty float y\r\nproperty float x\r\n\
    property list uchar ushort joints\r\nproperty uint64 key\r\nproperty char c\r\nproperty ushort s\r\ncomment three\r\nend_header\r\n\
    7 3 0 1 2 2 0.5 0.25\r\n8 4 0 1 2 3 0\r\n9 5 4 3 2 1 0 1 -1\r\n-9007199254740993 2 640 -480\r\n\
    1e-3 .5 1. +0 2 1 2 18446744073709551615 -128 65535\r\n2 1 0 0 0 5 6 0\r\n\r\n3 0 1 0 1 9 6 7 1\r\n4 0 0 1 0 7 8 2\r\n5 1 1 1 0 8 9 3\r\n\r\n";

#[test]
fn everything_of_an_odd_file_survives_a_round_trip() {
    let first = ply::read_bytes(ODD.as_bytes()).unwrap();
    assert_eq!(first.mesh.vertices()[0], Point::new(0.0, 1.0, 0.5));
    assert_eq!(
        first.mesh.triangles(),
        [[0, 1, 2], [0, 1, 2], [0, 2, 3], [4, 3, 2], [4, 2, 1], [4, 1, 0]]
    );
    assert_eq!(first.coordinates, CoordinateType::Float);
    assert_eq!(first.comments, ["one", "three"]);
    assert_eq!(first.obj_info, ["two"]);
    assert_eq!(
        first.vertex_property("key").unwrap().values,
        Column::U64(vec![u64::MAX, 5, 6, 7, 8])
    );
    let joints = first.vertex_property("joints").unwrap();
    assert_eq!(joints.lists, Some(vec![0, 2, 2, 3, 3, 3]));
    assert_eq!(first.face_properties[1].range(2), 2..3);
    assert_eq!(
        first.other_elements[0].properties[0].values,
        Column::I64(vec![-9_007_199_254_740_993])
    );
    let second = ply::read_bytes(&written(&first, &WriteParams::default())).unwrap();
    assert_eq!(first, second);
    assert_eq!(written(&first, &WriteParams::default()), written(&second, &WriteParams::default()));
}

#[test]
fn polygons_are_made_from_code_and_refused_with_other_triangles() {
    let sheet = sheet(2);
    let quads: Vec<[u32; 4]> =
        sheet.triangles().chunks(2).map(|t| [t[0][0], t[0][1], t[0][2], t[1][2]]).collect();
    let polygons = Polygons::new(&quads).unwrap();
    assert_eq!(polygons.triangles(), sheet.triangles());
    let made = PlyMesh { polygons: Some(polygons), ..PlyMesh::new(sheet.clone()) };
    let again = ply::read_bytes(&written(&made, &WriteParams::default())).unwrap();
    assert_eq!((&again.mesh, &again.polygons), (&made.mesh, &made.polygons));
    // As many triangles, turned over.
    let turned = sheet.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect();
    let stale = PlyMesh { mesh: TriMesh::new(sheet.vertices().to_vec(), turned).unwrap(), ..made };
    let error =
        ply::write(&stale, sheet.vertices(), &WriteParams::default(), &mut Vec::new()).unwrap_err();
    assert!(
        matches!(error, WriteError::Polygons { polygon_triangles: 8, triangles: 8 }),
        "{error}"
    );
    assert_eq!(Polygons::new([&[0, 1, 2][..], &[0, 1]]), Err(1));
}

#[test]
fn portable_files_hold_what_meshio_reads_and_nothing_else() {
    let first = ply::read_bytes(ODD.as_bytes()).unwrap();
    let portable = written(&first, &WriteParams { keep: Keep::Portable, ..WriteParams::default() });
    let second = ply::read_bytes(&portable).unwrap();
    assert_eq!((&second.mesh, &second.polygons), (&first.mesh, &first.polygons));
    let names: Vec<&str> = second.vertex_properties.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["quality", "key", "c", "s"]);
    assert!(second.face_properties.is_empty() && second.other_elements.is_empty());
    let header = String::from_utf8_lossy(&portable[..portable.len().min(600)]).into_owned();
    assert!(
        header.contains("format binary_little_endian 1.0\n")
            && header.contains("property double key\n"),
        "{header}"
    );
    assert!(
        header.contains("element face 3\nproperty list uint8 int32 vertex_indices\nend_header\n"),
        "{header}"
    );
}

#[test]
fn signed_shorts_of_vertices_are_widened_for_meshio() {
    let mut first = PlyMesh::new(sheet(1));
    first.vertex_properties.push(Property::new("id", Column::I16(vec![-1, 2, i16::MIN, i16::MAX])));
    let second = ply::read_bytes(&written(&first, &WriteParams::default())).unwrap();
    assert_eq!(second.vertex_properties[0].values, Column::I32(vec![-1, 2, -32768, 32767]));
}

#[test]
fn the_three_formats_give_the_same_mesh() {
    // The foreign writer writes each format, and our reader reads it.
    let mesh = sheet(5);
    let mut theirs = Ply::<DefaultElement>::new();
    let mut vertex = foreign::ElementDef::new("vertex".into());
    for axis in ["x", "y", "z"] {
        let t = foreign::PropertyType::Scalar(foreign::ScalarType::Float);
        vertex.properties.add(foreign::PropertyDef::new(axis.into(), t));
    }
    let mut face = foreign::ElementDef::new("face".into());
    let t = foreign::PropertyType::List(foreign::ScalarType::UInt, foreign::ScalarType::UShort);
    face.properties.add(foreign::PropertyDef::new("vertex_index".into(), t));
    theirs.header.elements.add(vertex);
    theirs.header.elements.add(face);
    let point = |p: &Point| -> DefaultElement {
        [("x", p.x), ("y", p.y), ("z", p.z)]
            .map(|(n, v)| (n.into(), foreign::Property::Float(v as f32)))
            .into_iter()
            .collect()
    };
    let corners = |t: &[u32; 3]| -> DefaultElement {
        [(
            "vertex_index".into(),
            foreign::Property::ListUShort(t.iter().map(|&v| v as u16).collect()),
        )]
        .into_iter()
        .collect()
    };
    theirs.payload.insert("vertex".into(), mesh.vertices().iter().map(point).collect());
    theirs.payload.insert("face".into(), mesh.triangles().iter().map(corners).collect());
    for encoding in [Encoding::Ascii, Encoding::BinaryLittleEndian, Encoding::BinaryBigEndian] {
        theirs.header.encoding = encoding;
        let mut bytes = Vec::new();
        Writer::new().write_ply(&mut bytes, &mut theirs).unwrap();
        assert_eq!(ply::read_bytes(&bytes).unwrap().mesh, mesh, "{encoding}");
        assert_eq!(ply::read(&bytes[..]).unwrap().mesh, mesh, "{encoding}");
    }
}

#[test]
fn a_foreign_reader_reads_what_we_write() {
    let mut ours = PlyMesh::new(sheet(4));
    let count = ours.mesh.vertices().len();
    ours.vertex_properties.push(Property::new("label", Column::U8((0..count as u8).collect())));
    let theirs = Parser::<DefaultElement>::new()
        .read_ply(&mut &written(&ours, &WriteParams::default())[..])
        .unwrap();
    assert_eq!(theirs.payload["vertex"].len(), count);
    for (k, (row, p)) in theirs.payload["vertex"].iter().zip(ours.mesh.vertices()).enumerate() {
        assert_eq!(row["y"], foreign::Property::Float(p.y as f32));
        assert_eq!(row["label"], foreign::Property::UChar(k as u8));
    }
    for (row, t) in theirs.payload["face"].iter().zip(ours.mesh.triangles()) {
        assert_eq!(row["vertex_indices"].to_u32_list().unwrap(), t);
    }
}

#[test]
fn a_piecewise_reader_gives_the_same_as_one_block() {
    /// Gives 7 bytes at a time.
    struct Drip<'a>(&'a [u8]);
    impl std::io::Read for Drip<'_> {
        fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
            let n = self.0.len().min(out.len()).min(7);
            out[..n].copy_from_slice(&self.0[..n]);
            self.0 = &self.0[n..];
            Ok(n)
        }
    }
    let bytes = written(&PlyMesh::new(sheet(30)), &WriteParams::default());
    assert_eq!(ply::read(Drip(&bytes)).unwrap(), ply::read_bytes(&bytes).unwrap());
    assert_eq!(ply::read(Drip(ODD.as_bytes())).unwrap(), ply::read_bytes(ODD.as_bytes()).unwrap());
}

#[test]
fn large_files_give_the_same_from_memory_as_from_a_stream_also_where_they_are_damaged() {
    let ply = PlyMesh::new(sheet(200));
    let good = written(&ply, &WriteParams::default());
    assert!(
        good.len() > 1 << 20,
        "as many bytes as it takes to read vertices and faces at the same time"
    );
    let vertices = good.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let faces = vertices + 12 * ply.mesh.vertices().len();
    let nan = f32::NAN.to_le_bytes();
    let vertex = |v: usize, axis: usize| (vertices + 12 * v + 4 * axis, &nan[..]);
    let face = |t: usize, bytes: &'static [u8]| (faces + 13 * t, bytes);
    let far = &[3, 0, 0, 0, 0, 1, 0, 0, 0, 0xff, 0xff, 0xff, 0x7f];
    let twice = &[3, 7, 0, 0, 0, 1, 0, 0, 0, 7, 0, 0, 0];
    for (damage, part) in [
        (vec![], None),
        (vec![face(70_000, twice), face(2, twice)], None),
        (vec![vertex(30_000, 1), vertex(9_000, 2)], Some("vertex 9000: coordinate z is NaN")),
        (vec![face(70_000, far), face(512, far)], Some("corner 2 of face 512")),
        (vec![vertex(3, 0), face(513, far)], Some("corner 2 of face 513")),
        (vec![vertex(3, 0), face(511, twice)], Some("vertex 3: coordinate x is NaN")),
    ] {
        let mut bytes = good.clone();
        damage.iter().for_each(|(at, to)| bytes[*at..at + to.len()].copy_from_slice(to));
        let threads = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        let all = [
            ply::read(&bytes[..]),
            threads(1).install(|| ply::read_bytes(&bytes)),
            threads(3).install(|| ply::read_bytes(&bytes)),
        ];
        match part {
            None => assert!(
                all.iter().flatten().filter(|read| Some(*read) == all[0].as_ref().ok()).count()
                    == 3
            ),
            Some(part) => {
                let texts = all.map(|read| read.unwrap_err().to_string());
                assert!(
                    texts[0].contains(part) && texts.iter().all(|t| *t == texts[0]),
                    "{texts:?}"
                );
            }
        }
    }
}

#[test]
fn coordinates_are_read_back_as_they_were_foretold() {
    let mesh = sheet(3);
    let moved: Vec<Point> =
        mesh.vertices().iter().map(|p| p + Vector::new(0.1, -1e-9, 1.0 / 3.0)).collect();
    for coordinates in [CoordinateType::Float, CoordinateType::Double] {
        let mut bytes = Vec::new();
        let params = WriteParams { coordinates, ..WriteParams::default() };
        ply::write(&PlyMesh::new(mesh.clone()), &moved, &params, &mut bytes).unwrap();
        let again = ply::read_bytes(&bytes).unwrap();
        assert_eq!(again.mesh.vertices(), ply::quantise(&moved, coordinates));
        assert_eq!(again.coordinates, coordinates);
    }
    assert_eq!(ply::quantise(mesh.vertices(), CoordinateType::Float), mesh.vertices());
}

#[test]
fn normals_of_vertices_turn_with_the_surface() {
    let mut ply = PlyMesh::new(sheet(3));
    let normals = ply.mesh.vertex_normals();
    for (axis, name) in ["nx", "ny", "nz"].into_iter().enumerate() {
        ply.vertex_properties.push(Property::new(
            name,
            Column::F32(normals.iter().map(|n| n[axis] as f32).collect()),
        ));
    }
    let turned: Vec<Point> =
        ply.mesh.vertices().iter().map(|p| Point::new(p.x, -p.z, p.y)).collect();
    let mut bytes = Vec::new();
    ply::write(&ply, &turned, &WriteParams::default(), &mut bytes).unwrap();
    let again = ply::read_bytes(&bytes).unwrap();
    for (y, n) in again.vertex_property("ny").unwrap().values.to_f64().iter().zip(&normals) {
        approx::assert_relative_eq!(*y, -n.z, epsilon = 1e-7); // a unit in the last place of f32
    }
    // As whole numbers, the longest of which is 127.
    for (property, axis) in ply.vertex_properties.iter_mut().zip(0..) {
        property.values =
            Column::I8(normals.iter().map(|n| (127.0 * n[axis]).round() as i8).collect());
    }
    let mut bytes = Vec::new();
    ply::write(&ply, &turned, &WriteParams::default(), &mut bytes).unwrap();
    let again = ply::read_bytes(&bytes).unwrap();
    for (y, n) in again.vertex_property("ny").unwrap().values.to_f64().iter().zip(&normals) {
        assert!((*y + 127.0 * n.z).abs() <= 1.5, "{y} {n}");
    }
}

#[test]
fn what_cannot_be_written_is_refused_before_the_first_byte() {
    let good = PlyMesh::new(sheet(2));
    let count = good.mesh.vertices().len();
    let with = |p: Property| {
        let mut ply = good.clone();
        ply.vertex_properties.push(p);
        ply
    };
    let short = with(Property::new("label", Column::U8(vec![0; 3])));
    let twice = with(Property::new("x", Column::U8(vec![0; count])));
    let words = with(Property::new("two words", Column::U8(vec![0; count])));
    let lists = with(Property {
        name: "l".into(),
        values: Column::U8(vec![]),
        lists: Some(vec![0; count - 1]),
    });
    let mut nan = good.mesh.vertices().to_vec();
    nan[4].y = f64::NAN;
    let mut far = good.mesh.vertices().to_vec();
    far[4].y = -1e39;
    for (ply, positions, part) in [
        (&short, good.mesh.vertices(), "3 records, expected 9"),
        (&twice, good.mesh.vertices(), "`x` cannot name"),
        (&words, good.mesh.vertices(), "`two words` cannot name"),
        (&lists, good.mesh.vertices(), "7 records, expected 9"),
        (&good, &nan[..], "vertex 4: coordinate y is NaN"),
        (&good, &far[..], "vertex 4: coordinate -1e39 is too large"),
        (&good, &nan[..8], "8 positions for a mesh of 9"),
    ] {
        let mut bytes = Vec::new();
        let fault = ply::write(ply, positions, &WriteParams::default(), &mut bytes)
            .unwrap_err()
            .to_string();
        assert!(fault.contains(part), "{fault}");
        assert!(bytes.is_empty());
    }
}

#[test]
fn a_disk_that_fills_up_is_an_error() {
    struct Full(usize);
    impl std::io::Write for Full {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            if self.0 == 0 {
                return Err(std::io::ErrorKind::StorageFull.into());
            }
            let n = bytes.len().min(self.0);
            self.0 -= n;
            Ok(n)
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let ply = PlyMesh::new(sheet(20));
    for room in [0, 10, 300, 3000, 6000] {
        let fault =
            ply::write(&ply, ply.mesh.vertices(), &WriteParams::default(), Full(room)).unwrap_err();
        assert!(matches!(fault, WriteError::Io(e) if e.kind() == std::io::ErrorKind::StorageFull));
    }
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
    // Processor time of this thread, where Linux tells it: a busy machine does not change it much.
    let cpu = || {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
        text.split_whitespace()
            .next()
            .and_then(|w| w.parse().ok())
            .map_or(f64::NAN, |ns: f64| ns * 1e-6)
    };
    let times = |f: &mut dyn FnMut()| {
        let mut all: Vec<[f64; 2]> = (0..21)
            .map(|_| {
                let (start, before) = (Instant::now(), cpu());
                f();
                [start.elapsed().as_secs_f64() * 1e3, cpu() - before]
            })
            .collect();
        let first = all[0];
        all.sort_by(|a, b| a[1].total_cmp(&b[1]));
        format!("{:.1} cpu, {:.1} wall (first {:.1} cpu)", all[10][1], all[10][0], first[1])
    };
    for ply in [PlyMesh::new(mesh), skinned] {
        for coordinates in [CoordinateType::Float, CoordinateType::Double] {
            let params = WriteParams { coordinates, ..WriteParams::default() };
            let write =
                times(&mut || ply::write_path(&ply, ply.mesh.vertices(), &params, &path).unwrap());
            let bytes = std::fs::read(&path).unwrap();
            let from_path = times(&mut || {
                assert_eq!(ply::read_path(&path).unwrap().mesh.triangles().len(), 1_002_528)
            });
            let from_memory = times(&mut || {
                assert_eq!(ply::read_bytes(&bytes).unwrap().mesh.triangles().len(), 1_002_528)
            });
            // No reader is faster than making room for the result and filling it.
            let copied = times(&mut || {
                drop(std::hint::black_box((
                    ply.mesh.vertices().to_vec(),
                    ply.mesh.triangles().to_vec(),
                )))
            });
            println!(
                "{coordinates:?}, {} properties, {:.1} MB, ms: read {from_path}, from memory {from_memory}, write {write}, a copy of the \
                 result {copied}",
                ply.vertex_properties.len(),
                bytes.len() as f64 / 1e6,
            );
        }
    }
}
