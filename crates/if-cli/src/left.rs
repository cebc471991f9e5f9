//! Intersections that could not be removed.

use if_pipeline::report::{PairReport, Verification};
use miette::Diagnostic;

/// Intersections that could not be removed, and the two layers where most are left.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error(
    "outfit `{outfit}`: {pairs} intersecting triangle pairs and {inside} vertices on a wrong side are left, \
     most of them of `{outer}` over `{inner}`"
)]
#[diagnostic(code(ifg::unresolved), help("{}--write-unproven writes what was reached", list(triangles)))]
pub(crate) struct Left {
    outfit: String,
    /// Of all layers.
    pairs: usize,
    /// Of all layers.
    inside: usize,
    outer: String,
    inner: String,
    /// Some of the triangle pairs of these two, where they are known: (inner, outer).
    triangles: Vec<[u32; 2]>,
}

impl Left {
    /// What a verification has found, where it has found something.
    pub(crate) fn found(outfit: &str, after: &Verification, triangles: Vec<[u32; 2]>) -> Option<Self> {
        let key = |p: &&PairReport| (p.pairs.total(), p.vertices_inside);
        let worst = after.pairs.iter().max_by_key(key).filter(|p| key(p) != (0, 0))?;
        Some(Self {
            outfit: outfit.into(),
            pairs: after.total_pairs(),
            inside: after.total_inside(),
            outer: worst.outer.clone(),
            inner: worst.inner.clone(),
            triangles,
        })
    }
}

fn list(triangles: &[[u32; 2]]) -> String {
    /// More pairs than these say nothing more to a person.
    const SHOWN: usize = 8;
    if triangles.is_empty() {
        return String::new();
    }
    let pairs: Vec<String> = triangles.iter().take(SHOWN).map(|[inner, outer]| format!("({inner}, {outer})")).collect();
    format!("look at the triangles (inner, outer) {}; ", pairs.join(" "))
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
        let found = |pairs| Left::found("o", &Verification { pairs, ..Default::default() }, vec![]);
        assert!(found(vec![pair("a", 0, 0)]).is_none());
        let text = found(vec![pair("a", 1, 0), pair("b", 3, 5)]).unwrap().to_string();
        assert!(text.contains("4 intersecting") && text.contains("5 vertices") && text.contains("`b` over `body`"), "{text}");
        assert_eq!(found(vec![pair("a", 1, 0), pair("b", 3, 0), pair("c", 2, 9)]).unwrap().outer, "b");
        assert_eq!(found(vec![pair("a", 0, 1), pair("b", 0, 2)]).unwrap().outer, "b");
    }
}
