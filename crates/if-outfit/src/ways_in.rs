//! Ways in below a garment that encloses one by one two parts of the body that another spans.
//!
//! Where a coat spans arm and trunk, the nearest ways in below a shirt with higher armpits lead into
//! its sleeve on one side and into its trunk on the other: pressed in there, the coat would stretch
//! across the gap between both all the same. The ends of its bridges ([`crate::bridges`]) go up to
//! the armpit instead, and draw the cloth beside them along.

use crate::bridges::{Bridge, bridges, way_to};
use crate::obstacle::{HOPELESS, Obstacle};
use crate::outfit::Outfit;
use crate::way::Way;
use if_core::edges::Edges;
use if_core::geodesic::Neighbours;
use if_core::math::{Point, Real, unit_or_zero};
use if_mesh::index::Bvh;
use if_mesh::solid::ClosedLayer;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Of a garment with more bridges this many are led up, evenly chosen: the others are drawn along.
const MOST: usize = 1000;

/// The ways of the garment with index `inner` in below the one with index `outer`.
pub(crate) struct WaysIn {
    pub(crate) inner: usize,
    pub(crate) outer: usize,
    /// By vertices, ascending.
    pub(crate) ways: Vec<Way>,
}

/// For each of the `obstacles` of `outfit` that may be overcome the ways in; `closed` are its body and
/// garments but the outermost, closed.
pub(crate) fn ways_in(
    outfit: &Outfit,
    obstacles: &[Obstacle],
    closed: &[Arc<ClosedLayer>],
) -> Vec<WaysIn> {
    let skin = &outfit.body.mesh;
    let mut neighbours = None;
    let mut all = Vec::new();
    for obstacle in obstacles.iter().filter(|obstacle| !obstacle.is_hopeless()) {
        let index = |name: &str| outfit.garments.iter().position(|g| g.name == name);
        let (Some(inner), Some(outer)) = (index(&obstacle.inner), index(&obstacle.outer)) else {
            continue;
        };
        let along_skin =
            neighbours.get_or_insert_with(|| Neighbours::new(&Edges::new(skin), skin.vertices()));
        let garment = &outfit.garments[inner].mesh;
        let layer = &closed[inner + 1];
        let bridges = bridges(garment, layer, &closed[0], skin, along_skin, MOST);
        let ways = ways_of(&bridges, &Bvh::new(&outfit.garments[outer].mesh));
        all.push(WaysIn { inner, outer, ways });
    }
    all
}

/// For the ends of those `bridges` that the garment in `outer` is in the way of: the way towards the
/// junction as far as that garment, or if that is too long, the way along the normal. Of several the
/// shortest.
fn ways_of(bridges: &[Bridge], outer: &Bvh) -> Vec<Way> {
    let mut shortest = BTreeMap::<u32, (Real, Way)>::new();
    for bridge in bridges.iter().filter(|bridge| bridge.lift(outer).is_some()) {
        for (&vertex, [p, _]) in bridge.vertices.iter().zip(&bridge.ends) {
            let way = |to: Point| {
                let length = way_to(outer, p, &to).filter(|length| *length < HOPELESS)?;
                let direction = unit_or_zero(&(to - p));
                Some((length, Way { vertex, direction, point: p + direction * length }))
            };
            let Some(found) = way(bridge.junction).or_else(|| way(bridge.beyond(p))) else {
                continue;
            };
            let known = shortest.entry(vertex).or_insert(found);
            if found.0 < known.0 {
                *known = found;
            }
        }
    }
    shortest.into_values().map(|(_, way)| way).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::obstacle::obstacles;
    use crate::obstacle::tests::worn;
    use crate::params::ResolveParams;
    use crate::resolve::resolve;
    use crate::verify::verify_layers;
    use if_body::mannequin::Garment;
    use if_core::monitor::Silent;

    #[test]
    fn the_armpits_of_a_coat_are_led_up_into_a_shirt() {
        let outfit = worn([Garment::Coat, Garment::Tshirt]);
        let (found, closed) = verify_layers(&outfit, None);
        let ways = ways_in(&outfit, &obstacles(&outfit, &found, &closed), &closed);
        let [ways] = &ways[..] else { panic!("of the coat under the T-shirt") };
        assert_eq!([ways.inner, ways.outer], [0, 1]);
        assert!(ways.ways.len() > 20 && ways.ways.is_sorted_by(|a, b| a.vertex < b.vertex));
        let shirt = ClosedLayer::garment(&outfit.garments[1].mesh, &closed[0], &outfit.body.mesh);
        let is_inside = |p| shirt.sided(&p, 0.0).is_some_and(|s| s.distance < 0.0);
        for way in &ways.ways {
            let p = outfit.garments[0].mesh.vertices()[way.vertex as usize];
            assert!(way.left(&p) > 0.0, "{way:?}");
            assert!(!is_inside(p) && is_inside(way.point + way.direction * 1e-3), "{way:?}");
        }
        let up = ways.ways.iter().filter(|way| way.direction.y > 0.0).count();
        assert!(2 * up > ways.ways.len(), "{up} of {}", ways.ways.len());
    }

    #[test]
    fn a_coat_is_lifted_below_a_jacket_where_that_leaves_less() {
        let mut params = ResolveParams::default();
        params.effort.rounds = 18;
        // Put on once, and once more with denser samples, intersections remain.
        let outfit = worn([Garment::Coat, Garment::Jacket]);
        let resolved = resolve(&outfit, &params, &mut Silent).expect("it ends clean when lifted");
        let ways_in = resolved.report.layers[0].strategies.ways_in;
        assert!(ways_in > 20, "{ways_in}");
    }
}
