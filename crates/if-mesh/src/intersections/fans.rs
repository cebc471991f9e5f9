//! The triangles around each vertex, and whether they lie flat: then no two of them need be compared.

use if_core::intersect::{Fan, is_flat_fan};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use rayon::prelude::*;

/// Fans of up to so many triangles are joined by comparing all: that takes no memory.
const FEW: usize = 32;

/// The triangles around each vertex of a mesh, whatever its positions.
#[derive(Clone, Debug, Default)]
pub struct Fans {
    /// For each vertex the neighbours between which its triangles lie.
    around: Rows<[u32; 2]>,
    /// `None` where triangles are joined in other ways.
    kinds: Vec<Option<Fan>>,
}

impl Fans {
    /// The fans of a mesh.
    pub fn new(mesh: &TriMesh) -> Self {
        let corners = mesh
            .triangles()
            .iter()
            .flat_map(|[a, b, c]| [(*a, [*b, *c]), (*b, [*c, *a]), (*c, [*a, *b])]);
        let around = Rows::new(mesh.vertices().len(), corners);
        let kinds = (0..around.len()).map(|v| kind(around.of(v))).collect();
        Self { around, kinds }
    }

    /// Which of them are flat at the positions of `mesh`: of those of a triangle that `is_asked_for`.
    pub(super) fn flat(&self, mesh: &TriMesh, is_asked_for: impl Fn(u32) -> bool) -> FlatFans {
        let mut is_corner = vec![false; self.kinds.len()];
        for (_, corners) in (0..).zip(mesh.triangles()).filter(|(t, _)| is_asked_for(*t)) {
            corners.iter().for_each(|v| is_corner[*v as usize] = true);
        }
        let x = mesh.vertices();
        let is_flat = |(v, is_corner): (usize, &bool)| {
            let fan = self.around.of(v).iter().map(|pair| pair.map(|w| &x[w as usize]));
            *is_corner && self.kinds[v].is_some_and(|kind| is_flat_fan(kind, &x[v], fan))
        };
        FlatFans(is_corner.par_iter().enumerate().with_min_len(1024).map(is_flat).collect())
    }
}

/// How the triangles around a vertex are joined; `None` if two begin or end at one neighbour, or a fan
/// has more than one gap.
fn kind(around: &[[u32; 2]]) -> Option<Fan> {
    let last = if around.len() > FEW { last_of_many(around)? } else { last_of_few(around)? };
    match last {
        _ if around.is_empty() => None,
        0 => Some(Fan::Closed),
        1 => Some(Fan::Open),
        _ => None,
    }
}

/// The number of triangles after which no other begins; `None` if two begin or end at one neighbour.
fn last_of_few(around: &[[u32; 2]]) -> Option<usize> {
    let mut last = 0;
    for [begin, end] in around {
        let begins = |at: u32| around.iter().filter(|other| other[0] == at).count();
        if begins(*begin) > 1 || around.iter().filter(|other| other[1] == *end).count() > 1 {
            return None;
        }
        last += usize::from(begins(*end) == 0);
    }
    Some(last)
}

/// The same by sorting.
fn last_of_many(around: &[[u32; 2]]) -> Option<usize> {
    let [begins, ends] = [0, 1].map(|k| {
        let mut all: Vec<u32> = around.iter().map(|pair| pair[k]).collect();
        all.sort_unstable();
        all
    });
    let is_unique = |all: &[u32]| all.windows(2).all(|pair| pair[0] < pair[1]);
    let is_last = |end: &&u32| begins.binary_search(end).is_err();
    (is_unique(&begins) && is_unique(&ends)).then(|| ends.iter().filter(is_last).count())
}

/// For each vertex whether its fan is known to be flat.
pub(super) struct FlatFans(Vec<bool>);

impl FlatFans {
    /// Whether two triangles have a common corner whose fan is flat: then they meet nowhere else.
    #[inline]
    pub(super) fn part(&self, a: [u32; 3], b: [u32; 3]) -> bool {
        a.iter().any(|v| b.contains(v) && self.0[*v as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fans_are_closed_open_or_neither() {
        assert_eq!(kind(&[[1, 2], [2, 3], [3, 1]]), Some(Fan::Closed));
        assert_eq!(kind(&[[2, 3], [1, 2]]), Some(Fan::Open));
        // Two gaps, an edge of three triangles, a triangle that is turned around, and none.
        assert_eq!(kind(&[[1, 2], [3, 4]]), None);
        assert_eq!(kind(&[[1, 2], [2, 3], [2, 4]]), None);
        assert_eq!(kind(&[[1, 2], [3, 2]]), None);
        assert_eq!(kind(&[]), None);
    }

    #[test]
    fn fans_of_many_triangles_are_joined_as_those_of_few() {
        let open: Vec<[u32; 2]> = (0..40).map(|k| [7 * k % 41, 7 * (k + 1) % 41]).collect();
        let closed = [&open[..], &[[7 * 40 % 41, 0]]].concat();
        let gap = [&open[..20], &open[21..]].concat();
        let twice = [&open[..], &[[3, 50]]].concat();
        let expected = [Some(Fan::Open), Some(Fan::Closed), None, None];
        assert_eq!([&open, &closed, &gap, &twice].map(|fan| kind(fan)), expected);
        for fan in [open, closed, gap, twice] {
            assert_eq!(last_of_many(&fan), last_of_few(&fan));
        }
    }
}
