//! Vertices are pushed along the gradient of the field, each by itself.

use crate::baselines::Left;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::solid::{ClosedLayer, ClothedField};
use rayon::prelude::*;

/// Pushes every vertex inside the field once, `p ← p − φ ∇φ / |∇φ|²`. Where the gradient is zero
/// nothing moves.
pub fn naive(garment: &TriMesh, field: &impl SignedDistance) -> Vec<Point> {
    let zero = |_: usize| 0.0;
    pushed(garment.vertices(), field, zero)
}

/// Where clearances grow while intersections are left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Inflate {
    /// At all vertices: the garment is blown up as a whole.
    #[default]
    Everywhere,
    /// At the vertices of triangles that intersect, and at vertices inside.
    WhereLeft,
}

/// How [`inflated`] pushes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InflateParams {
    /// Where clearances grow.
    pub inflate: Inflate,
    /// The first clearance, in metres.
    pub first: Real,
    /// Factor on a clearance from round to round; above 1.
    pub factor: Real,
    /// Gives up where a clearance would be more than this, in metres.
    pub last: Real,
    /// Pushes to one clearance: after a push another part of the field may be nearest.
    pub pushes: usize,
}

impl Default for InflateParams {
    fn default() -> Self {
        Self { inflate: Inflate::Everywhere, first: 0.5e-3, factor: 1.3, last: 0.1, pushes: 4 }
    }
}

/// What became of an inflated garment.
#[derive(Clone, Debug, PartialEq)]
pub struct Inflated {
    /// Its positions: clean ones, or those with the least left.
    pub positions: Vec<Point>,
    /// The largest clearance they were pushed to, in metres.
    pub clearance: Real,
    /// Rounds.
    pub rounds: usize,
    /// Intersecting pairs and vertices inside that are left; both 0 where the baseline succeeds.
    pub left: [usize; 2],
}

/// Pushes every vertex of the input outside a clearance of the layers `below`, the clearance
/// growing until exact verification finds neither intersecting triangles nor vertices inside, or
/// the clearance is at its end.
///
/// ```text
/// repeat
///     p ← input;  `pushes` times: p ← p + (δ − φ) ∇φ / |∇φ|²  where φ < δ
///     verify exactly; clean: return p
///     δ ← factor · δ   everywhere, or where something is left
/// ```
///
/// # Panics
///
/// If `factor` is not above 1, or `first` not above 0: the loop would not end.
pub fn inflated(garment: &TriMesh, below: &[&ClosedLayer], params: &InflateParams) -> Inflated {
    assert!(
        params.factor > 1.0 && params.first > 0.0,
        "clearances must grow: factor {}, first {}",
        params.factor,
        params.first
    );
    let field = ClothedField::new(below.to_vec());
    let mut clearances = vec![params.first; garment.vertices().len()];
    let mut best: Option<Inflated> = None;
    for round in 1.. {
        let mut positions = garment.vertices().to_vec();
        for _ in 0..params.pushes {
            positions = pushed(&positions, &field, |v| clearances[v]);
        }
        let mesh =
            garment.with_vertices(positions).expect("pushes along unit gradients stay finite");
        let left = Left::new(&mesh, below);
        let count = [left.pairs.len(), left.inside.len()];
        let clearance = clearances.iter().copied().fold(0.0, Real::max);
        if best.as_ref().is_none_or(|b| count.iter().sum::<usize>() < b.left.iter().sum()) {
            best = Some(Inflated {
                positions: mesh.vertices().to_vec(),
                clearance,
                rounds: round,
                left: count,
            });
        }
        if left.is_clean() || clearance * params.factor > params.last {
            break;
        }
        match params.inflate {
            Inflate::Everywhere => clearances.iter_mut().for_each(|c| *c *= params.factor),
            Inflate::WhereLeft => {
                let of_pairs =
                    left.pairs.iter().flat_map(|(_, p)| garment.triangles()[p.b as usize]);
                let mut grow: Vec<u32> = of_pairs.chain(left.inside.iter().copied()).collect();
                grow.sort_unstable();
                grow.dedup();
                grow.into_iter().for_each(|v| clearances[v as usize] *= params.factor);
            }
        }
    }
    best.expect("the first round has a result")
}

/// One push of every vertex v to φ ≥ `clearance(v)`.
pub(super) fn pushed(
    x: &[Point],
    field: &impl SignedDistance,
    clearance: impl Fn(usize) -> Real + Sync,
) -> Vec<Point> {
    let push = |(v, p): (usize, &Point)| {
        let s = field.sample(p);
        let (lack, slope) = (clearance(v) - s.distance, s.gradient.norm_squared());
        if lack > 0.0 && slope > 0.0 { p + s.gradient * (lack / slope) } else { *p }
    };
    x.par_iter().enumerate().with_min_len(64).map(push).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::scene::{RADIUS, ball, belt};
    use if_core::shapes::Sphere;

    #[test]
    fn a_naive_push_brings_vertices_to_the_surface_and_leaves_triangles_inside() {
        let (ball, belt) = (ball(), belt());
        let after = naive(&belt, &Sphere { center: Point::origin(), radius: RADIUS });
        let on = after.iter().zip(belt.vertices()).filter(|(p, q)| p != q).count();
        assert_eq!(on, 5 * 60);
        assert!(after.iter().all(|p| p.coords.norm() > RADIUS - 1e-12));
        let after = naive(&belt, &ClothedField::new(vec![&ball]));
        assert!(!Left::new(&belt.with_vertices(after).unwrap(), &[&ball]).pairs.is_empty());
    }

    #[test]
    fn an_inflated_push_ends_clean_and_the_local_one_moves_less() {
        let (ball, belt) = (ball(), belt());
        let everywhere = inflated(&belt, &[&ball], &InflateParams::default());
        let local = inflated(
            &belt,
            &[&ball],
            &InflateParams { inflate: Inflate::WhereLeft, ..Default::default() },
        );
        let moved =
            |x: &[Point]| x.iter().zip(belt.vertices()).map(|(p, q)| (p - q).norm()).sum::<Real>();
        for result in [&everywhere, &local] {
            assert_eq!(result.left, [0, 0]);
            assert!(
                Left::new(&belt.with_vertices(result.positions.clone()).unwrap(), &[&ball])
                    .is_clean()
            );
        }
        assert!(everywhere.rounds > 1 && moved(&local.positions) <= moved(&everywhere.positions));
    }

    #[test]
    fn inflation_that_may_not_grow_gives_up_with_the_count_left() {
        let result = inflated(
            &belt(),
            &[&ball()],
            &InflateParams { first: 1e-6, last: 1e-6, ..Default::default() },
        );
        assert_eq!((result.rounds, result.left[1]), (1, 0));
        assert!(result.left[0] > 0);
    }

    #[test]
    fn a_garment_that_is_clear_stays_bit_for_bit() {
        let belt = belt();
        let small = Sphere { center: Point::origin(), radius: 0.1 };
        assert_eq!(naive(&belt, &small), belt.vertices());
    }
}
