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
