//! Joints that a vertex follows in a file beyond the four that it keeps.

use if_core::math::Real;
use serde::Serialize;

/// Joints of each vertex that are kept.
const KEPT: usize = 4;

/// What is left out of a skin, as a vertex keeps the four joints with the largest weights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeftOut {
    /// Vertices that follow more than four joints in the file.
    pub vertices: usize,
    /// The largest share of a vertex's weights that is left out, from 0 to 1.
    pub largest: Real,
}

impl LeftOut {
    /// The joints of a vertex that are kept, by falling weight; what is left out is added to `found`.
    /// Weights of a joint that is listed more than once are summed first.
    pub(crate) fn cut(found: &mut Option<Self>, of_vertex: &[(usize, Real)]) -> Vec<(usize, Real)> {
        let mut all: Vec<(usize, Real)> = Vec::with_capacity(of_vertex.len());
        for (joint, weight) in of_vertex {
            match all.iter_mut().find(|(listed, _)| listed == joint) {
                Some((_, sum)) => *sum += weight,
                None => all.push((*joint, *weight)),
            }
        }
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        if all.len() > KEPT {
            let left = all.split_off(KEPT);
            let [left, kept] = [&left, &all].map(|of| of.iter().map(|(_, w)| w).sum::<Real>());
            let sum = kept + left;
            let share = if sum > 0.0 { left / sum } else { 0.0 };
            let (vertices, largest) = found.map_or((0, 0.0), |f| (f.vertices, f.largest));
            *found = Some(Self { vertices: vertices + 1, largest: share.max(largest) });
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_one_joint_are_summed_before_the_smallest_are_left_out() {
        // Joint 7 has the largest weight in two slots.
        let of = [(7, 0.2), (1, 0.15), (2, 0.15), (3, 0.15), (4, 0.15), (7, 0.2)];
        let mut found = None;
        assert_eq!(LeftOut::cut(&mut found, &of)[0], (7, 0.4));
        let one = found.unwrap();
        assert!(one.vertices == 1 && (one.largest - 0.15).abs() < 1e-12, "{one:?}");
        // Four joints in five slots are all kept.
        let mut none = None;
        let kept = LeftOut::cut(&mut none, &[of[0], of[1], of[2], of[3], of[5]]);
        assert_eq!((kept.len(), none), (4, None));
        // The next vertex loses more.
        LeftOut::cut(&mut found, &[0, 1, 2, 3, 4].map(|joint| (joint, 0.2)));
        let two = found.unwrap();
        assert!(two.vertices == 2 && (two.largest - 0.2).abs() < 1e-12, "{two:?}");
    }
}
