//! What a person should know about the meshes of an outfit. None of it stops the work.

use crate::outfit::{Layer, Outfit, box_distance, orientation_note};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
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

/// Share of a garment's box in the body's, grown by [`APART`], below which the garment lies beside the body.
const BESIDE: Real = 0.3;
/// Share of a box that is turned by 90° about x, above which the garment is in place then.
const IN_PLACE: Real = 0.9;

/// A note for each garment that is not at the body.
fn of_places(outfit: &Outfit) -> impl Iterator<Item = String> + '_ {
    let body = outfit.body.mesh.surface_aabb();
    outfit.garments.iter().filter_map(move |garment| {
        let own = garment.mesh.surface_aabb();
        let away = box_distance(&body, &own);
        if is_turned(&body, &own) {
            return Some(format!(
                "`{}`: it lies beside the body, and turned by 90° about x it would lie on it; is z up in one of the \
                 files? From Blender PLY comes with z up by default, OBJ and glTF with y up: export all with y up",
                garment.name
            ));
        }
        (away > APART * body.size().max()).then(|| {
            format!(
                "`{}`: {away:.2} m from the body; is it in the same place and scale, with the same axis up?",
                garment.name
            )
        })
    })
}

/// Whether a garment lies beside the body and would be in place if it were turned by 90° about x, by their boxes.
fn is_turned(body: &Aabb, garment: &Aabb) -> bool {
    let body = body.inflated(APART * body.size().max());
    let turned = |sign: Real| {
        let turned = |p: &Point| Point::new(p.x, -sign * p.z, sign * p.y);
        Aabb::from_points(&[turned(&garment.min), turned(&garment.max)])
    };
    share_inside(&body, garment) < BESIDE
        && [1.0, -1.0].iter().any(|sign| share_inside(&body, &turned(*sign)) > IN_PLACE)
}

/// The share of a box that lies in another one; of a flat one, of its area.
fn share_inside(outer: &Aabb, inner: &Aabb) -> Real {
    let along = |k: usize| {
        let common = inner.max[k].min(outer.max[k]) - inner.min[k].max(outer.min[k]);
        let size = inner.size()[k];
        if size > 0.0 { common.max(0.0) / size } else { Real::from(u8::from(common >= 0.0)) }
    };
    (0..3).map(along).product()
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
    use if_core::math::Vector;
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
    fn a_garment_with_another_axis_up_is_noted_and_what_stands_aside_is_not() {
        let ellipsoid = |middle: [Real; 3], half: [Real; 3]| {
            let ball = icosphere(1.0, 1);
            let put = |p: &Point| {
                Point::from(p.coords.component_mul(&Vector::from(half))) + Vector::from(middle)
            };
            ball.with_vertices(ball.vertices().iter().map(put).collect()).unwrap()
        };
        let body = || Layer::new("body", ellipsoid([0.0, 0.85, 0.0], [0.45, 0.85, 0.16]));
        let noted = |middle, half| {
            let garment = Layer::new("garment", ellipsoid(middle, half));
            let found = notes(&Outfit { body: body(), garments: vec![garment] });
            found.iter().any(|note| note.contains("turned by 90° about x"))
        };
        // Jeans, a shirt and a coat with z up, and with -z up.
        for sign in [1.0, -1.0] {
            assert!(noted([0.0, 0.0, sign * 0.5], [0.2, 0.14, 0.5]));
            assert!(noted([0.0, 0.02, sign * 1.2], [0.45, 0.15, 0.3]));
            assert!(noted([0.0, 0.0, sign * 0.9], [0.45, 0.2, 0.6]));
        }
        // In place: jeans, shoes, a hat, a wide skirt, a train, a bag at the side, wings, a backpack.
        for (middle, half) in [
            ([0.0, 0.5, 0.0], [0.2, 0.5, 0.14]),
            ([0.0, 0.05, 0.05], [0.2, 0.06, 0.18]),
            ([0.0, 1.75, 0.0], [0.2, 0.12, 0.22]),
            ([0.0, 0.5, 0.0], [0.9, 0.5, 0.9]),
            ([0.0, 0.05, -1.5], [0.5, 0.05, 1.4]),
            ([0.6, 0.8, 0.0], [0.15, 0.2, 0.2]),
            ([0.0, 1.2, -0.5], [0.9, 0.5, 0.4]),
            ([0.0, 1.2, -0.35], [0.2, 0.25, 0.12]),
        ] {
            assert!(!noted(middle, half), "{middle:?} {half:?}");
        }
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
