//! What a person should know about the meshes of an outfit. None of it stops the work.

use crate::outfit::{Layer, Outfit, box_distance, orientation_note};
use if_core::math::Real;
use if_mesh::validate::faults;
use rayon::prelude::*;

/// A garment whose box is farther from the body's than this is named, as a share of the body's height.
const APART: Real = 0.05;

/// Notes on all layers, the body first: a body that does not stand along y, garments that are not at
/// the body, and faults of meshes.
///
/// What is assumed of an open body is in
/// [`Verification::body_notes`](crate::report::Verification::body_notes).
pub fn notes(outfit: &Outfit) -> Vec<String> {
    let layers: Vec<&Layer> = outfit.layers().collect();
    let notes = layers.into_par_iter().flat_map_iter(|layer| named(layer, of_mesh(layer)));
    let notes = notes.collect::<Vec<_>>();
    of_outfit(outfit).chain(notes).collect()
}

/// Notes on how the layers lie, whatever files they come from.
pub(crate) fn of_outfit(outfit: &Outfit) -> impl Iterator<Item = String> + '_ {
    of_orientation(outfit).into_iter().chain(of_places(outfit))
}

/// A note if the body does not stand along y.
fn of_orientation(outfit: &Outfit) -> Option<String> {
    let body = &outfit.body;
    orientation_note(&body.mesh).map(|note| format!("`{}`: {note}", body.name))
}

/// A note for each garment that is not at the body.
fn of_places(outfit: &Outfit) -> impl Iterator<Item = String> + '_ {
    let body = outfit.body.mesh.surface_aabb();
    outfit.garments.iter().filter_map(move |garment| {
        let away = box_distance(&body, &garment.mesh.surface_aabb());
        (away > APART * body.size().max()).then(|| {
            format!(
                "`{}`: {away:.2} m from the body; is it in the same place and scale, with the same axis up?",
                garment.name
            )
        })
    })
}

/// Faults of a layer's mesh.
fn of_mesh(layer: &Layer) -> Vec<String> {
    faults(&layer.mesh).iter().map(ToString::to_string).collect()
}

/// Notes with the layer's name before each.
pub(crate) fn named(layer: &Layer, notes: Vec<String>) -> Vec<String> {
    notes.iter().map(|note| format!("`{}`: {note}", layer.name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::icosphere;

    #[test]
    fn faults_and_bodies_that_lie_are_noted_with_their_layer() {
        let ball = icosphere(1.0, 1);
        let lying = ball.vertices().iter().map(|p| Point::new(p.x, 0.1 * p.y, p.z)).collect();
        let triangles = [ball.triangles(), &ball.triangles()[..1]].concat();
        let twice = TriMesh::new(ball.vertices().to_vec(), triangles).unwrap();
        let body = Layer::new("body", ball.with_vertices(lying).unwrap());
        let found = notes(&Outfit { body, garments: vec![Layer::new("coat", twice)] });
        let [orientation, fault] = &found[..] else { panic!("{found:?}") };
        assert!(orientation.starts_with("`body`: the body is 2.00 m along "), "{orientation}");
        assert!(fault.starts_with("`coat`: "), "{fault}");
    }

    #[test]
    fn a_garment_beside_the_body_is_noted() {
        let ball = icosphere(1.0, 1);
        let beside = |x: f64| {
            let moved = ball.vertices().iter().map(|p| Point::new(p.x + x, p.y, p.z)).collect();
            Layer::new("hat", ball.with_vertices(moved).unwrap())
        };
        let noted = |x| {
            let body = Layer::new("body", ball.clone());
            notes(&Outfit { body, garments: vec![beside(x)] })
        };
        assert_eq!(noted(2.05), Vec::<String>::new());
        let found = noted(2.5);
        assert!(
            found.len() == 1 && found[0].starts_with("`hat`: 0.50 m from the body"),
            "{found:?}"
        );
    }
}
