//! What a step concerns: all that moves, what was pushed before, and what lies around these.

use super::equilibrium::Multipliers;
use super::scene::Scene;
use if_core::math::{Point, Real};

/// Displacement in a step, in metres, of what counts as at rest: a thousandth of the default gap.
const REST: Real = 1e-6;
/// Most rings of vertices around what moves.
const MOST_RINGS: usize = 20;

/// For each triangle whether a step from the first positions towards the second concerns it: it moves,
/// lies within `fading` metres of what does, over which displacements fade, or was pushed. Others may
/// lose a part of their gap, if a solution pulls them along all the same; exact verification sees
/// when all is lost.
pub(super) fn concerned(
    scene: &Scene,
    [from, to]: [&[Point]; 2],
    multipliers: &Multipliers,
    fading: Real,
) -> Vec<bool> {
    let moves = |(a, b): (&Point, &Point)| (b - a).norm_squared() > REST * REST;
    let mut is_concerned: Vec<bool> = from.iter().zip(to).map(moves).collect();
    let triangles = scene.mesh.triangles();
    let has = |of: &[bool], t: &[u32; 3]| t.iter().any(|v| of[*v as usize]);
    let rings = (fading / scene.shortest_mean_edge).ceil().min(MOST_RINGS as Real) as usize;
    for _ in 0..rings {
        if is_concerned.iter().all(|is| *is) {
            break;
        }
        let inner = is_concerned.clone();
        for t in triangles.iter().filter(|t| has(&inner, t)) {
            t.iter().for_each(|v| is_concerned[*v as usize] = true);
        }
    }
    for v in multipliers.pushed() {
        is_concerned[v as usize] = true;
    }
    triangles.iter().map(|t| has(&is_concerned, t)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::arm;
    use super::super::{WalkParams, Walker};
    use super::*;
    use if_core::math::Vector;
    use if_core::monitor::Silent;

    #[test]
    fn what_rests_far_from_what_moves_is_not_concerned() {
        let walker = Walker::new(&arm(), WalkParams::default()).unwrap();
        let (scene, x) = (&walker.scene, walker.positions());
        let by = |to: &[Point]| concerned(scene, [x, to], &Multipliers::default(), 0.03);
        assert!(!by(x).contains(&true));
        let hand = |p: &Point| if p.y > 0.28 { p + Vector::y() * 1e-3 } else { *p };
        let moved: Vec<Point> = x.iter().map(hand).collect();
        let found = by(&moved);
        for (t, is_concerned) in found.iter().enumerate() {
            let highest = scene.mesh.corners(t).map(|p| p.y).into_iter().fold(-1.0, Real::max);
            // Edges along the arm are 25 mm long.
            assert!(if highest > 0.28 { *is_concerned } else { !is_concerned || highest > 0.2 });
        }
        let pushed = [0, 1, 2, scene.starts[1] as u32];
        let multipliers = Multipliers::from_parts(Vec::new(), vec![(pushed, 1.0)]);
        let found = concerned(scene, [x, x], &multipliers, 0.03);
        let has = |t: &[u32; 3]| t.iter().any(|v| pushed.contains(v));
        assert!(found.iter().zip(scene.mesh.triangles()).all(|(is, t)| *is == has(t)));
    }

    #[test]
    fn an_approach_that_moves_a_part_leaves_the_rest_and_is_clean() {
        let mut walker = Walker::new(&arm(), WalkParams::default()).unwrap();
        let from = walker.rest().to_vec();
        // A patch of the sleeve is to go 9 mm inwards, through the skin 6 mm below.
        let skin = walker.scene.starts[1];
        let mut to = from.clone();
        for p in to[skin..].iter_mut().filter(|p| p.y.abs() < 0.05 && p.x > 0.03) {
            p.x -= 9e-3;
        }
        assert!(!walker.intersections(&to).unwrap().is_empty());
        let walked = walker.approach(&from, &to, &from, &mut Silent).unwrap();
        assert_eq!(walked.reached, 1.0);
        let now = walker.positions();
        assert!(walker.intersections(now).unwrap().is_empty());
        let (mut moved, mut rest) = (0, 0);
        for (a, b) in from.iter().zip(now).skip(skin) {
            if a.y.abs() < 0.05 && a.x > 0.03 {
                moved += usize::from((b - a).norm() > 2e-3);
            } else if a.y.abs() > 0.15 {
                assert!((b - a).norm() < 2e-5, "{a} {b}");
                rest += 1;
            }
        }
        assert!(moved > 10 && rest > 50, "{moved} {rest}");
        assert_eq!(from[..skin], now[..skin], "the body has no overlaps, and is held");
    }
}
