//! Malformed PLY files are refused with the place of the fault: no panic, no hang, no memory for
//! records that are not there.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // also in what the tests share

use if_mesh::ply::{self, PlyMesh};
use proptest::prelude::*;

const VERTEX: &str = "property float x\nproperty float y\nproperty float z\n";
const FACE: &str = "property list uchar int vertex_indices\n";

/// A text file of `v` vertices and `f` faces by its header, with this payload.
fn ascii(v: &str, f: &str, payload: &str) -> Vec<u8> {
    format!("ply\nformat ascii 1.0\nelement vertex {v}\n{VERTEX}element face {f}\n{FACE}end_header\n{payload}").into_bytes()
}

/// A binary file with this header behind the line `format`, and this payload.
fn binary(header: &str, payload: &[u8]) -> Vec<u8> {
    let mut bytes =
        format!("ply\nformat binary_little_endian 1.0\n{header}end_header\n").into_bytes();
    bytes.extend_from_slice(payload);
    bytes
}

/// Three vertices, 36 bytes.
fn three() -> Vec<u8> {
    [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// A binary file of three vertices, and faces from raw bytes.
fn faces(count: u64, bytes: &[u8]) -> Vec<u8> {
    binary(
        &format!("element vertex 3\n{VERTEX}element face {count}\n{FACE}"),
        &[three(), bytes.to_vec()].concat(),
    )
}

fn face(corners: &[i32]) -> Vec<u8> {
    let mut bytes = vec![corners.len() as u8];
    bytes.extend(corners.iter().flat_map(|c| c.to_le_bytes()));
    bytes
}

/// A good binary file.
fn good() -> Vec<u8> {
    faces(2, &[face(&[0, 1, 2]), face(&[2, 1, 0])].concat())
}

const DOT: &str = "0 0 0\n1 0 0\n0 1 0\n";

#[test]
fn every_malformed_file_is_refused_with_its_place() {
    let header = |text: &str| text.as_bytes().to_vec();
    let after_format =
        |text: &str| format!("ply\nformat ascii 1.0\n{text}end_header\n").into_bytes();
    let list_of = |t: &str, n: &[u8]| {
        binary(
            &format!(
                "element vertex 3\n{VERTEX}element face 1\nproperty list {t} int vertex_indices\n"
            ),
            &[&three(), n].concat(),
        )
    };
    #[rustfmt::skip]
    let table: Vec<(&str, Vec<u8>, &str)> = vec![
        // The header.
        ("nothing", vec![], "the file is empty"),
        ("another format", header("solid cube\nfacet normal 0 0 1\n"), "line 1 is \"solid cube\""),
        ("bytes", vec![0xff; 100], "a PLY file begins with a line `ply`"),
        ("capitals", header("PLY\nformat ascii 1.0\nend_header\n"), "line 1 is \"PLY\""),
        ("the first line only", header("ply\n"), "no line `end_header`"),
        ("a header without end", header("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"), "no line `end_header` within 55 bytes"),
        ("an endless header", [b"ply\n".to_vec(), b"comment x\n".repeat(200_000)].concat(), "no line `end_header`"),
        ("an endless line", [b"ply\ncomment ".to_vec(), vec![b'x'; 3_000_000]].concat(), "no line `end_header`"),
        ("no format", header("ply\nelement vertex 0\nproperty float x\nend_header\n"), "needs a line `format"),
        ("an unknown format", header("ply\nformat binary_middle_endian 1.0\nend_header\n"), "line 2 of the header is invalid"),
        ("an unknown version", header("ply\nformat ascii 2.0\nend_header\n"), "needs a line `format ascii 1.0`"),
        ("two formats", after_format("format binary_big_endian 1.0\n"), "line 3 of the header is invalid"),
        ("an unknown statement", after_format("elements vertex 3\n"), "is invalid: \"elements vertex 3\""),
        ("an unknown type", after_format("element vertex 1\nproperty quad x\n"), "line 4 of the header is invalid"),
        ("a property of nothing", after_format("property float x\n"), "line 3 of the header is invalid"),
        ("an element without count", after_format("element vertex\n"), "is invalid: \"element vertex\""),
        ("a negative count", ascii("-3", "1", DOT), "is invalid: \"element vertex -3\""),
        ("a count in words", ascii("three", "1", DOT), "is invalid: \"element vertex three\""),
        ("a count beyond 64 bits", ascii("99999999999999999999999", "1", DOT), "line 3 of the header is invalid"),
        ("an element twice", after_format(&format!("element vertex 0\n{VERTEX}element vertex 1\n{VERTEX}")), "line 7: the header has a second element `vertex`"),
        ("a property twice", after_format("element vertex 0\nproperty float x\nproperty int x\n"), "line 5: element `vertex` has a second property `x`"),
        ("records of no bytes", after_format("element vertex 4000000000000\n"), "no property, but claims 4000000000000 records"),
        ("unknown records of no bytes", binary(&format!("element vertex 3\n{VERTEX}element void 18446744073709551615\n"), &three()), "`void` has no property"),
        ("a list with a broken length", list_of("float", &[]), "length as float; it must be an integer"),
        // What is missing in it.
        ("no vertices", after_format(&format!("element face 0\n{FACE}")), "no element `vertex`"),
        ("no z", after_format("element vertex 0\nproperty float x\nproperty float y\n"), "has none for z"),
        ("x is a list", after_format("element vertex 0\nproperty list uchar float x\nproperty float y\nproperty float z\n"), "has none for x"),
        ("faces without vertices", binary(&format!("element vertex 3\n{VERTEX}element face 2\nproperty uchar red\n"), &[&three()[..], &[1, 2]].concat()), "no list `vertex_indices`"),
        ("indices are no list", binary(&format!("element vertex 3\n{VERTEX}element face 1\nproperty int vertex_indices\n"), &[&three()[..], &[0; 4]].concat()), "no list `vertex_indices`"),
        ("indices are floats", binary(&format!("element vertex 3\n{VERTEX}element face 1\nproperty list uchar float vertex_indices\n"), &[&three()[..], &[3; 13]].concat()), "values of type float"),
        ("strips", binary(&format!("element vertex 3\n{VERTEX}element tristrips 1\n{FACE}"), &[&three()[..], &face(&[0, 1, 2])].concat()), "`tristrips`, which are not supported"),
        // Counts that cannot be true.
        ("terabytes of vertices", binary(&format!("element vertex 400000000000\n{VERTEX}"), &three()), "400000000000 records of element `vertex`, at least 4800000000000 bytes, but only 36 bytes"),
        ("all counts there are", binary(&format!("element vertex 18446744073709551615\n{VERTEX}"), &three()), "but only 36 bytes follow"),
        ("terabytes of faces", faces(1 << 50, &face(&[0, 1, 2])), "records of element `face`"),
        ("terabytes of text", ascii("3", "99999999999", DOT), "records of element `face`"),
        ("one vertex too many", ascii("4", "1", "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), "line 13: record 3 of element `vertex` has 4 values, expected 3"),
        ("one vertex too few", ascii("2", "1", "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), "line 12: face 0 has 0 corners"),
        ("a face too few", ascii("3", "1", "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 2\n"), "line 14: data follows the last record"),
        ("a byte too many", [good(), vec![7]].concat(), "data follows the last record"),
        // The end comes early.
        ("no payload", faces(0, &[])[..170].to_vec(), "the file is cut off or its header is wrong"),
        ("cut off in a vertex", binary(&format!("element vertex 3\n{VERTEX}"), &three()[..30]), "but only 30 bytes follow"),
        ("cut off in a face", good()[..good().len() - 1].to_vec(), "in record 1 of element `face`"),
        ("cut off in the text", ascii("3", "2", "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), "the file ends at line 14, in record 1 of element `face`"),
        ("a list of 4 billion", list_of("uint", &[0xff; 8]), "in record 0 of element `face`"),
        ("a list of 2⁶³", list_of("uint64", &[&(1u64 << 63).to_le_bytes()[..], &[0; 8]].concat()), "in record 0 of element `face`"),
        ("a negative list", list_of("char", &[0xff; 13]), "list `vertex_indices` of record 0 of element `face` has the length -1"),
        ("a negative list of text", ascii("3", "1", &format!("{DOT}-3 0 1 2\n")), "line 13: list `vertex_indices`"),
        ("a huge list of text", ascii("3", "1", &format!("{DOT}999999999999 0 1 2\n")), "has 4 values, expected 5"),
        // Indices.
        ("a face without vertices", b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n3 0 1 2\n".to_vec(), "corner 0 of face 0 names vertex 0, but there are no vertices"),
        ("an index too large", faces(1, &face(&[0, 1, 3])), "corner 2 of face 0 names vertex 3, but the vertices are 0 to 2"),
        ("an index too large in the second face", faces(2, &[face(&[0, 1, 2]), face(&[0, 1, 2_000_000_000])].concat()), "corner 2 of face 1 names vertex 2000000000"),
        ("a negative index", faces(1, &face(&[0, -1, 2])), "corner 1 of face 0 names vertex -1"),
        ("a negative index of text", ascii("3", "1", &format!("{DOT}3 0 1 -2\n")), "line 13: corner 2 of face 0 names vertex -2"),
        ("a face of two", faces(1, &face(&[0, 1])), "face 0 has 2 corners; a face needs at least 3"),
        ("a face of none", faces(1, &face(&[])), "face 0 has 0 corners"),
        ("a face of a point cloud", binary(&format!("element vertex 0\n{VERTEX}element face 1\n{FACE}"), &face(&[0, 0, 0])), "corner 0 of face 0 names vertex 0"),
        // Numbers.
        ("not a number", ascii("3", "0", "0 0 0\n1 nan 0\n0 1 0\n"), "vertex 1: coordinate y is NaN"),
        ("infinite", ascii("3", "0", "0 0 0\n1 0 0\n0 1 -inf\n"), "vertex 2: coordinate z is -inf"),
        ("too large for its type", ascii("3", "0", "0 0 0\n1 0 0\n1e39 1 0\n"), "vertex 2: coordinate x is inf"),
        ("not a number in bytes", binary(&format!("element vertex 1\n{VERTEX}"), &[0, 0, 0, 0, 0, 0, 0xc0, 0x7f, 0, 0, 0, 0]), "vertex 0: coordinate y is NaN"),
        ("a word", ascii("3", "0", "0 0 0\n1 zero 0\n0 1 0\n"), "line 11: `y` of record 1 of element `vertex` is \"zero\""),
        ("the mark of a Windows program", ascii("3", "0", "0 0 0\n1 -1.#IND 0\n0 1 0\n"), "vertex 1: coordinate y is NaN"),
        ("a comma", ascii("3", "0", "0,5 0 0\n1 0 0\n0 1 0\n"), "\"0,5\", which is not a valid number of type float"),
        ("half an index", ascii("3", "1", &format!("{DOT}3 0 1 1.5\n")), "\"1.5\", which is not a valid number of type int32"),
        ("an index beyond 64 bits", ascii("3", "1", &format!("{DOT}3 0 1 99999999999999999999\n")), "not a valid number of type int32"),
        ("too few values", ascii("3", "0", "0 0 0\n1 0\n0 1 0\n"), "line 11: record 1 of element `vertex` has 2 values, expected 3"),
        ("binary behind a text header", [ascii("3", "0", ""), three()].concat(), "which is not a valid number"),
        ("text behind a binary header", binary(&format!("element vertex 3\n{VERTEX}element face 1\n{FACE}"), format!("{DOT}3 0 1 2\n").as_bytes()), "the file is cut off"),
    ];
    assert!(table.len() >= 40);
    let mut wrong = Vec::new();
    for (name, bytes, part) in &table {
        let fault = ply::read_bytes(bytes).expect_err(name).to_string();
        if !fault.contains(part) {
            wrong.push(format!("{name}: {fault}"));
        }
        // From a stream, whose size nobody knows, the fault may be found later, but it is found.
        ply::read(&bytes[..]).expect_err(name);
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_good_file_is_good() {
    assert_eq!(ply::read_bytes(&good()).unwrap().mesh.triangles().len(), 2);
    let cloud = ply::read_bytes(&binary(&format!("element vertex 3\n{VERTEX}"), &three())).unwrap();
    assert!(cloud.mesh.triangles().is_empty());
    assert!(ply::read_bytes(&ascii("0", "0", "")).unwrap().mesh.vertices().is_empty());
}

#[test]
fn a_face_that_uses_a_vertex_twice_is_kept_and_reported() {
    let bytes = faces(3, &[face(&[0, 1, 2]), face(&[0, 1, 1]), face(&[0, 1, 1, 2])].concat());
    let read = ply::read_bytes(&bytes).unwrap();
    assert_eq!(read.mesh.triangles(), [[0, 1, 2], [0, 1, 2]]);
    assert_eq!(read.collapsed, [1, 2]);
    let mut again = Vec::new();
    ply::write(&read, read.mesh.vertices(), &ply::WriteParams::default(), &mut again).unwrap();
    assert_eq!(ply::read_bytes(&again).unwrap(), read);
}

#[test]
fn a_stream_that_claims_terabytes_ends_at_its_end() {
    for header in [
        format!("element vertex 400000000000\n{VERTEX}"),
        format!("element vertex 3\n{VERTEX}element face 1000000000000\n{FACE}"),
    ] {
        let fault = ply::read(&binary(&header, &three())[..]).unwrap_err().to_string();
        assert!(fault.contains("the file ends at byte"), "{fault}");
    }
}

#[test]
fn devices_that_never_end_are_refused() {
    assert!(ply::read(std::io::repeat(0)).is_err());
    let bytes = good();
    let endless = std::io::Read::chain(&bytes[..], std::io::repeat(b' '));
    assert!(ply::read(endless).unwrap_err().to_string().contains("data follows"));
}

/// A good file of the kind `k`.
fn seed(k: usize) -> Vec<u8> {
    match k {
        0 => good(),
        1 => ascii("4", "2", "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n4 3 2 1 0\n"),
        _ => {
            let mut ply: PlyMesh = ply::read_bytes(&seed(1)).unwrap();
            let lists = Some(vec![0, 1, 1, 3, 4]);
            ply.vertex_properties.push(ply::Property {
                name: "l".into(),
                values: ply::Column::I16(vec![1, 2, 3, 4]),
                lists,
            });
            ply.comments.push("a comment".into());
            let mut bytes = Vec::new();
            ply::write(&ply, ply.mesh.vertices(), &ply::WriteParams::default(), &mut bytes)
                .unwrap();
            bytes
        }
    }
}

proptest! {
    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        let _ = ply::read_bytes(&bytes);
        let _ = ply::read_bytes(&[b"ply\n", &bytes[..]].concat());
        let _ = ply::read_bytes(&binary(&format!("element vertex 3\n{VERTEX}element face 4\n{FACE}"), &bytes));
        let _ = ply::read_bytes(&ascii("3", "4", &String::from_utf8_lossy(&bytes)));
    }

    #[test]
    fn a_good_file_with_some_bytes_changed_never_panics(
        kind in 0..3usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop::sample::select(&b"\x00\x01\x03\xff 0-9e.\nlistpropertyelement"[..])), 1..8),
        cut in any::<prop::sample::Index>(),
        cuts in any::<bool>(),
    ) {
        let mut bytes = seed(kind);
        for (at, to) in changes {
            let k = at.index(bytes.len());
            bytes[k] = to;
        }
        if cuts {
            bytes.truncate(cut.index(bytes.len()));
        }
        let sized = ply::read_bytes(&bytes);
        let streamed = ply::read(&bytes[..]);
        // Debug text, because NaN among the properties differs from itself.
        prop_assert_eq!(sized.is_ok(), streamed.is_ok());
        if let (Ok(a), Ok(b)) = (&sized, &streamed) {
            prop_assert_eq!(format!("{a:?}"), format!("{b:?}"));
            let mut out = Vec::new();
            let params = ply::WriteParams { coordinates: a.coordinates, ..Default::default() };
            let written = ply::write(a, a.mesh.vertices(), &params, &mut out);
            prop_assert!(written.is_ok(), "{:?}", written);
            let again = ply::read_bytes(&out).unwrap();
            prop_assert_eq!(format!("{:?}", again.mesh), format!("{:?}", a.mesh));
            prop_assert_eq!(&again.polygons, &a.polygons);
        }
    }
}
