//! OBJ files from outside: what is read is what a foreign reader reads, everything survives, and
//! what is malformed is refused with its line.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // also in what the tests share

use if_core::math::Point;
use if_mesh::obj::{self, Normals, ObjMesh};
use proptest::prelude::*;

/// Every statement that garment files have, in no order that would help.
const SHIRT: &str = "# Blender 4.2\r\nmtllib my shirt.mtl\no Shirt\nv 0 0 0 1 0.5 0.25\nv 1.000000 0 0\nv 1 1 0\nvt 0 0\nvt 1 0 0\nvt 1\nvn 0 0 1\n\
    vn 0.0000 0.6 0.8\nv 0 1 0 1.0\nv -5 -5 -5\nusemtl cotton\ns 1\ng front body\nf 1/1/1 2/2/1 3/3/2 4//2\nf 1 3 4\nusemtl silk\nf -5//1 -4//1 -3//2\n\
    l 1 2 3\np 5\nvp 0.5 1 \\\n2\ncurv2 1 2\nf 1 2 \\\n  3 4 \\\n 5 # five corners\n# the end\\";

fn again(obj: &ObjMesh, positions: &[Point]) -> Vec<u8> {
    let mut out = Vec::new();
    obj::write(obj, positions, Normals::Follow, &mut out).unwrap();
    out
}

#[test]
fn every_statement_survives_and_only_numbers_change() {
    let shirt = obj::read(SHIRT.as_bytes()).unwrap();
    assert_eq!(shirt.mesh().vertices().len(), 5);
    assert_eq!(
        shirt.polygons().unwrap().iter().map(<[u32]>::len).collect::<Vec<_>>(),
        [4, 3, 3, 5]
    );
    assert_eq!(again(&shirt, shirt.mesh().vertices()), SHIRT.as_bytes());
    let moved: Vec<Point> =
        shirt.mesh().vertices().iter().map(|p| Point::new(p.x / 3.0, p.y, 1e-7 - p.x)).collect();
    let text = String::from_utf8(again(&shirt, &moved)).unwrap();
    let second = obj::read(text.as_bytes()).unwrap();
    assert_eq!(second.mesh().vertices(), moved);
    assert_eq!(second.polygons(), shirt.polygons());
    let rest = |text: &str| -> Vec<String> {
        text.lines()
            .filter(|l| !l.starts_with("v ") && !l.starts_with("vn "))
            .map(str::to_owned)
            .collect()
    };
    assert_eq!(rest(&text), rest(SHIRT));
    assert!(text.contains(" 1 0.5 0.25\n"), "colours stay behind their vertices");
}

/// A sheet of quads with UVs and normals, in two groups, as a modeller writes it.
fn sheet(n: usize) -> String {
    let mut text = String::from("# sheet\n");
    for k in 0..n * n {
        let (x, y) = ((k % n) as f64 * 0.01, (k / n) as f64 * 0.01);
        text += &format!("v {x:.6} {y:.6} {:.6}\n", (31.0 * x).sin() * (17.0 * y).cos() * 0.02);
        text += &format!("vt {:.4} {:.4}\nvn 0.0000 0.0000 1.0000\n", x, y);
    }
    for k in 0..n * (n - 1) {
        if k == n * (n / 2) {
            text += "g upper\nusemtl second\n";
        }
        if k % n != n - 1 {
            let corner = |v: usize| format!("{0}/{0}/{0}", v + 1);
            text += &format!(
                "f {} {} {} {}\n",
                corner(k),
                corner(k + 1),
                corner(k + n + 1),
                corner(k + n)
            );
        }
    }
    text
}

#[test]
fn a_foreign_reader_sees_the_same_triangles() {
    let text = sheet(12);
    let ours = obj::read(text.as_bytes()).unwrap();
    let moved: Vec<Point> = ours
        .mesh()
        .vertices()
        .iter()
        .map(|p| p + if_core::math::Vector::new(0.1, -0.2, p.x))
        .collect();
    for (bytes, positions) in
        [(text.clone().into_bytes(), ours.mesh().vertices()), (again(&ours, &moved), &moved[..])]
    {
        let options =
            tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
        let (models, _) =
            tobj::load_obj_buf(&mut &bytes[..], &options, |_| Err(tobj::LoadError::OpenFileFailed))
                .unwrap();
        assert_eq!(models.len(), 2);
        let theirs: Vec<[f32; 3]> = models
            .iter()
            .flat_map(|m| {
                m.mesh
                    .indices
                    .iter()
                    .map(|&i| [0, 1, 2].map(|k| m.mesh.positions[3 * i as usize + k]))
            })
            .collect();
        let corners = ours.mesh().triangles().as_flattened();
        let expected: Vec<[f32; 3]> = corners
            .iter()
            .map(|&v| positions[v as usize].coords.map(|x| x as f32).into())
            .collect();
        assert_eq!(theirs, expected);
        assert_eq!(models[1].mesh.texcoords.len() / 2, models[1].mesh.positions.len() / 3);
    }
}

#[test]
fn what_other_programs_write_beside_positions_does_not_matter() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0 0 1\nvt -nan(ind) 1.#QNAN\nvn -1.#IND nan nan(0x8)\n\
        f 1/1/0 2/0/1 3/2/1\n";
    let obj = obj::read(text.as_bytes()).unwrap();
    assert_eq!(obj.mesh().triangles(), [[0, 1, 2]]);
    let fault = obj::read(&b"v 0 0 -nan(ind)\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"[..]).unwrap_err();
    assert!(fault.to_string().contains("coordinate NaN"), "{fault}");
}

#[test]
fn every_malformed_file_is_refused_with_its_line() {
    let dots = |rest: &str| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{rest}").into_bytes();
    #[rustfmt::skip]
    let table: Vec<(&str, Vec<u8>, &str)> = vec![
        ("nothing", vec![], "no `v` line"),
        ("only comments", b"# empty\n\n".to_vec(), "no `v` line"),
        ("another format", b"solid cube\nfacet normal 0 0 1\n".to_vec(), "no `v` line"),
        ("faces without vertices", b"f 1 2 3\n".to_vec(), "no `v` line"),
        ("bytes", vec![0; 100], "byte 0 is zero"),
        ("UTF-16", "v 0 0 0\n".encode_utf16().flat_map(u16::to_le_bytes).collect(), "store it as UTF-8"),
        ("two coordinates", dots("v 1 2\n"), "line 4: `v` has 2 numbers, expected 3"),
        ("no coordinate", dots("v\n"), "line 4: `v` has 0 numbers"),
        ("half a colour", dots("v 1 2 3 0.5 0.5\n"), "line 4: `v` has 5 numbers"),
        ("too many numbers", dots("v 1 2 3 4 5 6 7 8\n"), "line 4: `v` has 8 numbers"),
        ("a word", dots("v 1 two 3\n"), "line 4: \"two\" after `v` is not a valid number"),
        ("a comma", dots("v 1,5 2 3\n"), "\"1,5\" after `v` is not a valid number"),
        ("a word for a colour", dots("v 1 2 3 red 0 0\n"), "\"red\" after `v`"),
        ("not a number", dots("v 1 NaN 3\n"), "line 4: vertex 3 (0 is the first) has the coordinate NaN"),
        ("infinite", dots("v 1 2 1e999\n"), "line 4: vertex 3 (0 is the first) has the coordinate inf"),
        ("a short normal", dots("vn 0 1\n"), "line 4: `vn` has 2 numbers"),
        ("a normal of words", dots("vn up up up\n"), "after `vn` is not a valid number"),
        ("an empty texture coordinate", dots("vt\n"), "line 4: `vt` has 0 numbers"),
        ("a face of two", dots("# face\nf 1 2\n"), "line 5: the face has 2 corners"),
        ("a face of none", dots("f\n"), "line 4: the face has 0 corners"),
        ("index zero", dots("f 0 1 2\n"), "line 4: vertex 0 does not exist; there are 3, and 1 is the first"),
        ("an index too large", dots("f 1 2 3\nf 1 2 4\n"), "line 5: vertex 4 does not exist; there are 3"),
        ("far too large", dots("f 1 2 99999999999\n"), "vertex 99999999999 does not exist"),
        ("beyond 64 bits", dots("f 1 2 99999999999999999999999\n"), "corner \"99999999999999999999999\" of the face is not of the form"),
        ("too far back", dots("f -1 -2 -4\n"), "line 4: vertex -4 does not exist; there are 3"),
        ("back to the end of numbers", dots("f -1 -2 -9223372036854775808\n"), "vertex -9223372036854775808 does not exist"),
        ("back before later vertices", b"v 0 0 0\nf -1 -2 -3\nv 1 0 0\nv 0 1 0\n".to_vec(), "line 2: vertex -2 does not exist; there are 1"),
        ("a texture that is not there", dots("f 1/1 2/1 3/1\n"), "line 4: texture coordinate 1 does not exist; there are 0"),
        ("a texture far back", dots("vt 0 0\nf 1/-5/ 2/1 3/1\n"), "line 5: texture coordinate -5 does not exist"),
        ("a normal that is not there", dots("f 1//2 2//1 3//1\n"), "line 4: normal 2 does not exist"),
        ("a word for a corner", dots("f one two three\n"), "line 4: corner \"one\" of the face is not of the form v, v/vt"),
        ("a real corner", dots("f 1.0 2.0 3.0\n"), "corner \"1.0\""),
        ("a corner without vertex", dots("vt 0 0\nf /1 2/1 3/1\n"), "line 5: corner \"/1\""),
        ("four parts", dots("f 1//// 2 3\n"), "corner \"1////\""),
        ("bytes that are no text", [&dots("f ")[..], b"\xff\xfe 2 3\n"].concat(), "line 4: corner"),
        ("a continued line at the end", dots("f 1 2 \\"), "line 4: corner \"\\\\\""),
        ("a fault on a continued line", dots("f 1 \\\n 2 \\\n x\n"), "line 6: corner \"x\""),
    ];
    assert!(table.len() >= 15);
    let mut wrong = Vec::new();
    for (name, bytes, part) in &table {
        let fault = obj::read(&bytes[..]).expect_err(name).to_string();
        if !fault.contains(part) {
            wrong.push(format!("{name}: {fault}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(obj::read(std::io::repeat(0)).is_err(), "a device that never ends");
}

#[test]
fn a_face_that_uses_a_vertex_twice_is_kept_and_reported() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 2 3\nf 1 1 2\n";
    let obj = obj::read(text.as_bytes()).unwrap();
    assert_eq!(obj.mesh().triangles(), [[0, 1, 2]]);
    assert_eq!(obj.collapsed(), [0, 1]);
    assert_eq!(again(&obj, obj.mesh().vertices()), text.as_bytes());
}

proptest! {
    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = obj::read(&bytes[..]);
        let _ = obj::read(&[b"v 0 0 0\nv 1 0 0\nf ", &bytes[..]].concat()[..]);
    }

    #[test]
    fn a_good_file_with_some_bytes_changed_never_panics(
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop::sample::select(&b"\xff\\\n\r 0-9e./#vfn"[..])), 1..8),
        cut in any::<prop::sample::Index>(),
        cuts in any::<bool>(),
    ) {
        let mut bytes = SHIRT.as_bytes().to_vec();
        for (at, to) in changes {
            let k = at.index(bytes.len());
            bytes[k] = to;
        }
        if cuts {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok(obj) = obj::read(&bytes[..]) {
            prop_assert_eq!(&again(&obj, obj.mesh().vertices()), &bytes);
            let moved: Vec<Point> = obj.mesh().vertices().iter().map(|p| Point::new(p.y - 1.0, 0.3 * p.x, p.z)).collect();
            let second = obj::read(&again(&obj, &moved)[..]).unwrap();
            prop_assert_eq!(second.mesh().vertices(), &moved[..]);
            prop_assert_eq!(second.mesh().triangles(), obj.mesh().triangles());
        }
    }

    #[test]
    fn moved_coordinates_are_read_back_as_the_same_bits(x in any::<f64>(), y in any::<f64>()) {
        prop_assume!(x.is_finite() && y.is_finite());
        let obj = obj::read(&b"v 1 2 3\nv 4 5 6\nv 7 8 9\nf 1 2 3\n"[..]).unwrap();
        let moved = [Point::new(x, y, -x), Point::new(y, x, 1.0), Point::new(0.1, -0.0, y)];
        let second = obj::read(&again(&obj, &moved)[..]).unwrap();
        for (a, b) in second.mesh().vertices().iter().zip(&moved) {
            prop_assert_eq!(a.coords.map(f64::to_bits), b.coords.map(f64::to_bits));
        }
    }
}

#[test]
#[ignore = "stress"]
fn a_million_triangles_of_text_take_less_than_a_second() {
    use std::time::Instant;
    let text = sheet(708);
    let start = Instant::now();
    let obj = obj::read(text.as_bytes()).unwrap();
    let read = start.elapsed();
    let moved: Vec<Point> = obj.mesh().vertices().iter().map(|p| p * 1.01).collect();
    let start = Instant::now();
    let out = again(&obj, &moved);
    let written = start.elapsed();
    assert!(obj.mesh().triangles().len() > 990_000);
    println!("{} MB: read {read:.0?}, write {written:.0?}", out.len() / 1_000_000);
    // Five times that, for machines that are busy.
    assert!(read.as_secs_f64() < 5.0 && written.as_secs_f64() < 5.0);
}
