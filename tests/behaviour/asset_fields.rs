//! `Fields::Assets`: Algorithm 1 reads the φ of a wardrobe's assets.

use if_body::align::carried_field;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::meshes::{icosphere, tube};
use if_garments::outfit::report::LayerField;
use if_garments::pipeline::asset::{LayerHint, Parts, Provenance};
use if_garments::pipeline::wardrobe::combination::Combination;
use if_garments::pipeline::wardrobe::dresser::Dresser;
use if_garments::pipeline::wardrobe::matching::{
    self, Fields, MatchParams, MatchResult, Read, State,
};
use if_garments::pipeline::wardrobe::{NewBody, Wardrobe};
use if_mesh::baked::BakeParams;
use if_mesh::ply::{PlyMesh, WriteParams, write_path};
use if_outfit::Method;
use std::fs;
use std::path::Path;

/// A tube round the y axis, its lower end at −`down`.
fn band(radius: f64, height: f64, down: f64) -> TriMesh {
    let tube = tube(radius, height, 24, 5, false);
    let lowered = tube.vertices().iter().map(|p| Point::new(p.x, p.y - down, p.z)).collect();
    tube.with_vertices(lowered).unwrap()
}

/// Two balls as bodies, and on the first a belt with φ and a wide tube without.
fn filled(root: &Path) -> Wardrobe {
    let mut wardrobe = Wardrobe::open(root).unwrap();
    let ball = icosphere(0.1, 2);
    let other = ball.with_vertices(ball.vertices().iter().map(|p| p * 1.01).collect()).unwrap();
    for (name, mesh) in [("ball", &ball), ("other", &other)] {
        let path = root.join(format!("{name}.ply"));
        write_path(&PlyMesh::new(mesh.clone()), mesh.vertices(), &WriteParams::default(), &path)
            .unwrap();
        wardrobe.add_body(&NewBody::new(name, &path)).unwrap();
    }
    let [belt, wide] = [band(0.104, 0.06, 0.03), band(0.102, 0.08, 0.04)];
    let cells = BakeParams { cell: 0.01, accuracy: f64::INFINITY, ..Default::default() };
    let phi = carried_field(&ball, &belt, &cells, &mut Silent).unwrap();
    let own = wardrobe.body_info("ball").unwrap().reference();
    for (name, mesh, baked) in [("belt", &belt, Some(&phi)), ("wide", &wide, None)] {
        let parts = Parts {
            name,
            hint: LayerHint::of_name(name),
            body: &own,
            mesh,
            skin: None,
            beside: None,
            provenance: &Provenance::default(),
            network: None,
            baked,
        };
        wardrobe.add(&parts).unwrap();
    }
    wardrobe
}

fn matched(wardrobe: &Wardrobe, body: &str, params: &MatchParams) -> MatchResult {
    let garments = ["belt", "wide"].map(String::from).into();
    let outfit = Combination { body: body.into(), garments };
    let dresser = Dresser::new(wardrobe, Default::default());
    matching::run(&dresser, &outfit, params, &mut Silent).unwrap().result
}

#[test]
fn algorithm_1_reads_the_phi_of_assets_on_their_own_body() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let mut by_meshes = MatchParams { picture_height: 0, ..Default::default() };
    by_meshes.resolve.effort.method = Method::Paper;
    let by_assets = MatchParams { fields: Fields::Assets, ..by_meshes.clone() };
    let run = |body: &str, params: &MatchParams| {
        let found = matched(&wardrobe, body, params);
        assert_eq!(found.state, State::Clean, "{:?}", found.error);
        let read: Vec<Read> = found.fields.iter().map(|f| f.read).collect();
        let layers = found.report.unwrap().layers;
        (read, layers[1].algorithm1.as_ref().unwrap().below.clone(), found.key)
    };
    let (mesh, given) = (LayerField::Mesh, LayerField::Given);
    let of_meshes = run("ball", &by_meshes);
    assert_eq!((of_meshes.0, of_meshes.1), (vec![], vec![mesh, mesh]));
    let of_assets = run("ball", &by_assets);
    assert_eq!(of_assets.0, [Read::Bake, Read::MeshWithoutPhi]);
    assert_eq!(of_assets.1, [mesh, given]);
    assert_ne!(of_meshes.2, of_assets.2, "results by other fields have other keys");
    let elsewhere = run("other", &by_assets);
    assert_eq!(elsewhere.0, [Read::MeshOnOtherBody, Read::MeshWithoutPhi]);
    assert_eq!(elsewhere.1, [mesh, mesh]);
}

#[test]
fn fields_that_cannot_be_read_are_errors() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let mut params =
        MatchParams { picture_height: 0, fields: Fields::Assets, ..Default::default() };
    // The default method does not read fields.
    assert_eq!(params.validate().unwrap_err().name, "fields");
    params.resolve.effort.method = Method::Paper;
    fs::write(root.path().join("garments/belt/phi.baked"), "changed").unwrap();
    let found = matched(&wardrobe, "ball", &params);
    assert_eq!((found.state, found.error.unwrap().kind.as_str()), (State::Failed, "asset"));
}
