use super::*;
use if_body::mannequin::{Garment, MannequinParams, garment};
use if_core::math::Point;
use if_core::monitor::Silent;
use if_core::shapes::Sphere;
use if_mesh::baked::BakeParams;
use if_mesh::ply::{Column, Property};

fn shirt() -> TriMesh {
    garment(Garment::Tshirt, &MannequinParams { resolution: 0.7, overlap: 0.0 })
}

fn body_ref() -> BodyRef {
    BodyRef { name: "mannequin".into(), sha256: "0".repeat(64) }
}

/// As a file holds it: UVs at the corners, colours, a material for each face.
fn beside() -> Beside {
    let mesh = shirt();
    let (n, m) = (mesh.vertices().len(), mesh.triangles().len());
    let byte = |k: usize| (k % 251) as u8;
    let texcoord = Property {
        name: "texcoord".into(),
        values: Column::F32((0..6 * m).map(|k| k as f32 * 0.5).collect()),
        lists: Some((0..=m as u32).map(|k| 6 * k).collect()),
    };
    Beside::of(&PlyMesh {
        vertex_properties: vec![Property::new("red", Column::U8((0..n).map(byte).collect()))],
        face_properties: vec![
            texcoord,
            Property::new("material", Column::I32((0..m as i32).collect())),
        ],
        comments: vec!["TextureFile shirt.png".into()],
        ..PlyMesh::new(mesh)
    })
}

fn write_shirt(writer: &FolderWriter, name: &str) -> Result<AssetInfo, AssetError> {
    let mesh = shirt();
    let n = mesh.vertices().len();
    let skin =
        SkinWeights::new(vec![[3, 200, 0, 0]; n], vec![[0.25, 0.75, 0.0, 0.0]; n], 256).unwrap();
    let ball = Sphere { center: Point::new(0.0, 1.0, 0.0), radius: 0.2 };
    let baked =
        Baked::new(&ball, &BakeParams { cell: 0.02, ..Default::default() }, &mut Silent).unwrap();
    let provenance = Provenance {
        source: "mannequin".into(),
        licence: vec!["CC0\n1.0".into()],
        ..Default::default()
    };
    let parts = Parts {
        name,
        hint: LayerHint::of_name("tshirt"),
        body: &body_ref(),
        mesh: &mesh,
        skin: Some(&skin),
        beside: Some(&beside()),
        provenance: &provenance,
        network: Some(b"weights"),
        baked: Some(&baked),
    };
    write(writer, &parts)
}

#[test]
fn an_asset_is_read_as_it_was_written() {
    let root = tempfile::tempdir().unwrap();
    let writer = FolderWriter::open(root.path()).unwrap().unwrap();
    let info = write_shirt(&writer, "a_tshirt").unwrap();
    let asset = read(&root.path().join("a_tshirt")).unwrap();
    assert_eq!(asset.info, info);
    assert_eq!(asset.mesh.triangles(), shirt().triangles());
    assert_eq!(asset.mesh.vertices(), ply::quantise(shirt().vertices(), CoordinateType::Float));
    assert_eq!(asset.skin.as_ref().unwrap().joints()[5], [3, 200, 0, 0]);
    let file = asset.file();
    let given = beside().file(file.mesh.clone(), asset.skin.as_ref());
    assert_eq!(
        (&file.vertex_properties, &file.face_properties),
        (&given.vertex_properties, &given.face_properties)
    );
    assert_eq!(file.vertex_properties.len(), 9, "the colour, four joints and weights");
    assert_eq!(file.comments, ["TextureFile shirt.png", "licence CC0 1.0"]);
    assert_eq!(asset.network().unwrap().unwrap(), b"weights");
    assert!(asset.baked().unwrap().is_some());
    // Neck, two sleeves and hem.
    assert_eq!(info.openings.len(), 4);
    assert!(info.openings[0].length > 0.6 && info.openings[3].length > 0.1, "{:?}", info.openings);
    // The same parts give the same bytes.
    write_shirt(&writer, "again").unwrap();
    for file in [GARMENT, BAKED, NETWORK, THUMBNAIL] {
        let of = |name: &str| fs::read(root.path().join(name).join(file)).unwrap();
        assert!(of("a_tshirt") == of("again"), "{file}");
    }
}

#[test]
fn invalid_assets_are_errors_that_say_why() {
    let root = tempfile::tempdir().unwrap();
    let writer = FolderWriter::open(root.path()).unwrap().unwrap();
    for name in ["", ".hidden", "a/b", "..", "a.", "ä", &"x".repeat(65)] {
        assert!(matches!(write_shirt(&writer, name), Err(AssetError::Name { .. })), "{name}");
    }
    let folder = root.path().join("shirt");
    let fresh = || write_shirt(&writer, "shirt").unwrap();
    let edit = |from: &str, to: &str| {
        fresh();
        let text = fs::read_to_string(folder.join(INFO)).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(folder.join(INFO), text.replacen(from, to, 1)).unwrap();
        read(&folder).unwrap_err()
    };
    assert!(matches!(read(&root.path().join("none")), Err(AssetError::Io { .. })));
    assert!(matches!(
        edit("\"asset\": 1", "\"asset\": 7"),
        AssetError::Version { found: Some(7), .. }
    ));
    assert!(matches!(edit("\"asset\": 1,", ""), AssetError::Version { found: None, .. }));
    assert!(matches!(edit("\"name\"", "\"nom\""), AssetError::Json { .. }));
    assert!(matches!(edit("{", "{{"), AssetError::Json { .. }));
    assert!(matches!(edit("garment.ply", "../x.ply"), AssetError::Name { .. }));
    assert!(matches!(edit("\"vertices\": ", "\"vertices\": 1"), AssetError::Counts { .. }));
    for (file, is_lazy) in [(GARMENT, false), (NETWORK, true), (BAKED, true)] {
        fresh();
        let path = folder.join(file);
        let mut bytes = fs::read(&path).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        fs::write(&path, bytes).unwrap();
        let asset = read(&folder);
        assert_eq!(asset.is_ok(), is_lazy, "{file}");
        let error = asset.and_then(|a| a.network().and(a.baked().map(drop))).unwrap_err();
        assert!(
            matches!(error, AssetError::Changed { .. }) && error.to_string().contains(file),
            "{error}"
        );
        fs::remove_file(&path).unwrap();
        let error = read(&folder).and_then(|a| a.network().and(a.baked().map(drop))).unwrap_err();
        assert!(matches!(error, AssetError::Io { .. }), "{error}");
    }
}
