//! What may intersect in a clean state.

/// Pairs of triangles that may intersect.
#[derive(Clone, Debug, Default)]
pub(super) struct Tolerated {
    /// Own pairs of the rest state, sorted.
    pub(super) own: Vec<[u32; 2]>,
    /// For each triangle of a body that is kept whether it lies in a pinch; `None` if the body yields.
    pub(super) pinched: Option<Vec<bool>>,
    /// For each triangle of the body whether it may meet others of these; empty if none may.
    pub(super) let_go: Vec<bool>,
}

impl Tolerated {
    /// Whether two triangles, the smaller index first, may intersect.
    pub(super) fn permits(&self, pair: [u32; 2]) -> bool {
        let is_kept = |pinched: &Vec<bool>| {
            let [a, b] = pair.map(|t| t as usize);
            b < pinched.len() || pinched.get(a) == Some(&true)
        };
        self.own.binary_search(&pair).is_ok()
            || self.pinched.as_ref().is_some_and(is_kept)
            || pair.iter().all(|t| self.let_go.get(*t as usize) == Some(&true))
    }

    /// Those of the pairs that may not be.
    pub(super) fn left(&self, pairs: &[[u32; 2]]) -> Vec<[u32; 2]> {
        pairs.iter().filter(|pair| !self.permits(**pair)).copied().collect()
    }

    /// Whether a triangle of the body lies in a pinch.
    pub(super) fn is_pinched(&self, triangle: u32) -> bool {
        self.pinched.as_ref().is_some_and(|pinched| pinched[triangle as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pairs_of_two_triangles_that_were_let_go_may_meet() {
        // Of four triangles of a body and one of a garment.
        let tolerated = Tolerated { let_go: vec![false, true, true, false], ..Default::default() };
        let permitted =
            [[0, 3], [0, 1], [1, 2], [2, 3], [2, 4]].map(|pair| tolerated.permits(pair));
        assert_eq!(permitted, [false, false, true, false, false]);
        assert_eq!(tolerated.left(&[[0, 1], [1, 2]]), [[0, 1]]);
    }

    #[test]
    fn a_kept_body_meets_itself_anywhere_and_garments_in_its_pinches_alone() {
        let pinched = Some(vec![false, true, false]);
        let tolerated = Tolerated { pinched, own: vec![[3, 5]], ..Default::default() };
        // Of the body, of body and garment, of garments, and one that garments had at rest.
        let pairs = [[0, 2], [0, 3], [1, 3], [3, 4], [3, 5]];
        let permitted = pairs.map(|pair| tolerated.permits(pair));
        assert_eq!(permitted, [true, false, true, false, true]);
        assert_eq!([0, 1, 2].map(|t| tolerated.is_pinched(t)), [false, true, false]);
    }
}
