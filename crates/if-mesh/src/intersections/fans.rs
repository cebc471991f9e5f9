//! The triangles around each vertex, and whether they lie flat: then no two of them need be compared.

use if_core::intersect::{Fan, is_flat_fan};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

/// Most triangles of a fan: to join them takes the square of their number.
const MOST: usize = 32;

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

    /// Which of them are flat at some positions.
    pub(super) fn at<'a>(&'a self, x: &'a [Point]) -> FlatFans<'a> {
        let known = (0..self.kinds.len()).map(|_| AtomicU8::new(UNKNOWN)).collect();
        FlatFans { fans: self, x, known }
    }
}

/// How the triangles around a vertex are joined; `None` if two begin or end at one neighbour, or a fan
/// has more than one gap.
fn kind(around: &[[u32; 2]]) -> Option<Fan> {
    if around.is_empty() || around.len() > MOST {
        return None;
    }
    let mut ends = 0;
    for [begin, end] in around {
        let begins = |at: u32| around.iter().filter(|other| other[0] == at).count();
        let is_last = begins(*end) == 0;
        if begins(*begin) > 1 || around.iter().filter(|other| other[1] == *end).count() > 1 {
            return None;
        }
        ends += usize::from(is_last);
    }
    match ends {
        0 => Some(Fan::Closed),
        1 => Some(Fan::Open),
        _ => None,
    }
}

const UNKNOWN: u8 = 0;
const FLAT: u8 = 1;
const OTHER: u8 = 2;

/// Fans at some positions. Each is looked at when it is asked for first.
pub(super) struct FlatFans<'a> {
    fans: &'a Fans,
    x: &'a [Point],
    known: Vec<AtomicU8>,
}

impl FlatFans<'_> {
    /// Whether two triangles have a common corner whose fan is flat: then they meet nowhere else.
    #[inline]
    pub(super) fn part(&self, a: [u32; 3], b: [u32; 3]) -> bool {
        a.iter().any(|v| b.contains(v) && self.is_flat(*v))
    }

    #[inline]
    fn is_flat(&self, v: u32) -> bool {
        // Whoever comes first finds the same.
        match self.known[v as usize].load(Relaxed) {
            UNKNOWN => self.look(v as usize),
            known => known == FLAT,
        }
    }

    #[cold]
    #[inline(never)]
    fn look(&self, v: usize) -> bool {
        let corners = self.fans.around.of(v).iter();
        let corners = corners.map(|pair| pair.map(|w| &self.x[w as usize]));
        let is_flat = self.fans.kinds[v].is_some_and(|kind| is_flat_fan(kind, &self.x[v], corners));
        self.known[v].store(if is_flat { FLAT } else { OTHER }, Relaxed);
        is_flat
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
        let many: Vec<[u32; 2]> = (0..=MOST as u32).map(|k| [k, k + 1]).collect();
        assert_eq!(kind(&many), None);
    }
}
