//! A few vertices inside, of which no triangle intersects, are moved straight out.

use super::{Repair, SEPARATION, is_clear};
use crate::progress::GarmentProgress;
use crate::workpiece::{SettleError, Workpiece};
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_mesh::outward::Outward;
use if_mesh::solid::ClosedLayer;
use std::ops::ControlFlow;

/// So few vertices are led out singly.
const FEW: usize = 12;
/// Maximum number of steps of a vertex.
const STEPS: u32 = 40;

/// Moves each of a few vertices straight out of all layers. The motion is kept only if the garment
/// is then clean.
pub(crate) struct VertexEscape;

impl Repair for VertexEscape {
    fn apply(
        &mut self,
        work: &mut Workpiece<'_>,
        _: &mut GarmentProgress<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        let found = &work.remaining;
        let alone = found.pairs.is_empty() && found.new_own.is_empty();
        if !(work.is_repairing() && alone && (1..=FEW).contains(&found.inside.len())) {
            return Ok(ControlFlow::Continue(()));
        }
        let before = work.cloth.x.clone();
        let inside = found.inside.clone();
        let most = lead_out(work, &inside);
        work.contacts.moved(most);
        let (mesh, remaining) = work.verified(work.cloth.stored());
        if remaining.is_clean() {
            (work.mesh, work.remaining) = (mesh, remaining);
            work.counts.escaped_vertices += inside.len();
        } else {
            work.cloth.x = before;
        }
        work.tree.refit(&work.cloth.x);
        Ok(ControlFlow::Continue(()))
    }
}

/// Moves the vertices `inside` out, where a way leads out. Returns the largest motion.
fn lead_out(work: &mut Workpiece<'_>, inside: &[u32]) -> Real {
    let scene = work.scene;
    let cloth = &mut work.cloth;
    let mut most: Real = 0.0;
    for &v in inside {
        let p = cloth.x[v as usize];
        let neighbours = cloth.neighbours.of(v).iter();
        let around: Vec<Point> = neighbours.map(|(u, _)| cloth.x[*u as usize]).collect();
        let step = scene.params.effort.separation_step;
        if let Some(q) = way_out(&p, &around, scene.below, scene.outward, step) {
            most = most.max((q - p).norm());
            cloth.x[v as usize] = q;
        }
    }
    most
}

/// The first point, in steps of `step` metres, where vertex `p` with neighbours `around` is
/// [`SEPARATION`] outside all layers. The directions are the coarse way out, the nearest ways and
/// that to the neighbours. `None` if none leads out.
fn way_out(
    p: &Point,
    around: &[Point],
    below: &[&ClosedLayer],
    outward: &Outward,
    step: Real,
) -> Option<Point> {
    let nearest = below
        .iter()
        .filter_map(|l| l.sided(p, SEPARATION))
        .filter(|s| s.distance < 0.0)
        .map(|s| s.normal);
    let middle = around.iter().map(|q| q - p).sum::<Vector>();
    let ways: Vec<Vector> =
        outward.direction(p).into_iter().chain(nearest).chain([unit_or_zero(&middle)]).collect();
    (1..STEPS).find_map(|k| {
        let far = Real::from(k) * step;
        ways.iter().map(|w| p + w * far).find(|q| is_clear(q, below, SEPARATION))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::tests::{apply, with_band};
    use if_core::mesh::TriMesh;

    #[test]
    fn an_island_inside_the_body_comes_out_at_once() {
        // A triangle of 4 mm, 3 mm below the surface: nothing intersects.
        let island = [[0.0, 0.297, 0.0], [0.004, 0.297, 0.0], [0.0, 0.297, 0.004]];
        let with_island = |band: &TriMesh| {
            let n = band.vertices().len() as u32;
            let vertices = [band.vertices(), &island.map(Point::from)].concat();
            TriMesh::new(vertices, [band.triangles(), &[[n, n + 2, n + 1]]].concat()).unwrap()
        };
        with_band(0.31, with_island, |work| {
            work.verify();
            assert_eq!((work.remaining.pairs.len(), work.remaining.inside.len()), (0, 3));
            apply(&mut VertexEscape, work);
            assert_eq!(work.remaining.inside.len(), 3, "not before repairs begin");
            work.round = work.scene.params.effort.settle_rounds;
            apply(&mut VertexEscape, work);
            assert!(work.remaining.is_clean());
            assert_eq!(work.counts.escaped_vertices, 3);
            assert!(work.cloth.x.iter().rev().take(3).all(|p| p.coords.norm() > 0.3));
        });
    }
}
