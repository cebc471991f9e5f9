//! Intersections that could not be removed.

use if_pipeline::report::{PairReport, Verification};
use miette::Diagnostic;

/// Intersections that could not be removed, between the two layers where most are left.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("outfit `{outfit}` is not free of intersections; the worst is left between `{outer}` and `{inner}` below it")]
#[diagnostic(
    code(ifg::unresolved),
    help("triangle pairs left there (inner, outer): {}; --write-unproven writes what was reached", list(triangles))
)]
pub(crate) struct Left {
    pub(crate) outfit: String,
    pub(crate) outer: String,
    pub(crate) inner: String,
    /// Some of the triangle pairs, where they are known.
    pub(crate) triangles: Vec<[u32; 2]>,
}

impl Left {
    /// What a verification has found, where it has found something.
    pub(crate) fn found(outfit: &str, after: &Verification) -> Option<Self> {
        let key = |p: &&PairReport| (p.pairs.total(), p.vertices_inside);
        let worst = after.pairs.iter().max_by_key(key).filter(|p| key(p) != (0, 0))?;
        let (outer, inner) = (worst.outer.clone(), worst.inner.clone());
        Some(Self { outfit: outfit.into(), outer, inner, triangles: vec![] })
    }
}

fn list(triangles: &[[u32; 2]]) -> String {
    /// More pairs than these say nothing more to a person.
    const SHOWN: usize = 8;
    let pairs: Vec<String> = triangles.iter().take(SHOWN).map(|[a, b]| format!("({a}, {b})")).collect();
    if triangles.is_empty() { "not listed".into() } else { pairs.join(" ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_pipeline::report::PairCount;

    #[test]
    fn the_worst_pair_of_layers_is_named_and_none_where_all_is_clean() {
        let pair = |outer: &str, crossing, vertices_inside| PairReport {
            inner: "body".into(),
            outer: outer.into(),
            pairs: PairCount { crossing, ..Default::default() },
            vertices_inside,
            vertices: 10,
            deepest: 0.0,
        };
        let found = |pairs| Left::found("o", &Verification { pairs, ..Default::default() });
        assert!(found(vec![pair("a", 0, 0)]).is_none());
        assert_eq!(found(vec![pair("a", 1, 0), pair("b", 3, 0), pair("c", 2, 9)]).unwrap().outer, "b");
        assert_eq!(found(vec![pair("a", 0, 1), pair("b", 0, 2)]).unwrap().outer, "b");
    }
}
