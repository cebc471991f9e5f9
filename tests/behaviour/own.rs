//! Intersections of a garment with itself are removed.

use crate::scenes::{assert_clean, mannequin};
use if_body::mannequin::Garment;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_outfit::outfit::Outfit;
use if_outfit::resolve::{GoalParams, Own, ResolveParams, resolve};
use if_outfit::verify::verify;
use std::collections::BTreeMap;

/// The garment with a patch sewn on its front, 8 cm wide, whose lower half lies behind the cloth.
fn with_patch(mesh: &TriMesh) -> TriMesh {
    let front = |p: &&Point| p.x.abs() < 0.02;
    let middle = mesh.vertices().iter().filter(front).max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
    let normals = mesh.vertex_normals();
    let mut vertices = mesh.vertices().to_vec();
    let mut triangles = mesh.triangles().to_vec();
    let mut copies = BTreeMap::new();
    for t in mesh.triangles() {
        if t.iter().any(|v| (mesh.vertices()[*v as usize] - middle).norm() > 0.08) {
            continue;
        }
        triangles.push(t.map(|v| {
            *copies.entry(v).or_insert_with(|| {
                let p = mesh.vertices()[v as usize];
                let height = 0.05 * (p.y - middle.y) + 0.0004;
                vertices.push(p + normals[v as usize] * height);
                vertices.len() as u32 - 1
            })
        }));
    }
    assert!(copies.len() > 20, "{}", copies.len());
    TriMesh::new(vertices, triangles).unwrap()
}

fn patched() -> Outfit {
    let mut outfit = mannequin(&[Garment::Tshirt, Garment::Jacket], 0.002);
    outfit.garments[1].mesh = with_patch(&outfit.garments[1].mesh);
    outfit
}

#[test]
fn a_patch_that_passes_through_its_garment_comes_out() {
    let outfit = patched();
    let given = verify(&outfit).unwrap().own_pairs;
    assert!(given[0] == 0 && given[1] > 5, "{given:?}");
    let outcome = resolve(&outfit, &ResolveParams::default(), &mut Silent);
    let result = assert_clean(&outfit, outcome);
    assert_eq!(verify(&result.outfit).unwrap().own_pairs, [0, 0]);
    let jacket = &result.report.layers[1];
    assert_eq!((jacket.own_pairs.before, jacket.own_pairs.after), (given[1], 0));
    assert_eq!(jacket.strategies.untangled_own_pairs, given[1]);
    assert!(jacket.strategies.untangling_rounds > 0 && jacket.kept_own_pairs.is_empty());
    assert!(jacket.strain.rms < 0.1, "{:?}", jacket.strain);
}

#[test]
fn they_stay_where_that_is_asked_for() {
    let outfit = patched();
    let goal = GoalParams { own: Own::Keep, ..Default::default() };
    let params = ResolveParams { goal, ..Default::default() };
    let result = assert_clean(&outfit, resolve(&outfit, &params, &mut Silent));
    let jacket = &result.report.layers[1];
    assert!(jacket.own_pairs.after > 0 && jacket.own_pairs.new == 0);
    assert_eq!(jacket.strategies.untangling_rounds, 0);
}
