//! Intersections that could not be removed.

use if_outfit::report::{PairReport, ResolveReport};
use miette::Diagnostic;

/// Intersections that could not be removed, with the two layers where most are left, and those that
/// a garment got with itself.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("outfit `{outfit}`: {} left", told(worst.as_ref(), own))]
#[diagnostic(
    code(ifg::unresolved),
    help("{}--write-unproven writes what was reached", list(triangles))
)]
pub(crate) struct Left {
    outfit: String,
    worst: Option<Worst>,
    /// Garments that intersect themselves more than they did, and in how many more pairs.
    own: Vec<(String, usize)>,
    /// Some of the triangle pairs of the worst two layers, where they are known: (inner, outer).
    triangles: Vec<[u32; 2]>,
}

/// What is left between layers, and where most of it is.
#[derive(Debug)]
struct Worst {
    /// Of all layers.
    pairs: usize,
    /// Of all layers.
    inside: usize,
    outer: String,
    inner: String,
}

impl Left {
    /// What is not proven of an outfit, where there is something: as [`ResolveReport::is_proven`].
    pub(crate) fn found(
        outfit: &str,
        report: &ResolveReport,
        triangles: Vec<[u32; 2]>,
    ) -> Option<Self> {
        let key = |p: &&PairReport| (p.pairs.total(), p.vertices_inside);
        let after = &report.after;
        let worst =
            after.pairs.iter().max_by_key(key).filter(|p| key(p) != (0, 0)).map(|worst| Worst {
                pairs: after.total_pairs(),
                inside: after.total_inside(),
                outer: worst.outer.clone(),
                inner: worst.inner.clone(),
            });
        let more = report
            .layers
            .iter()
            .map(|l| (l.name.clone(), l.own_pairs[1].saturating_sub(l.own_pairs[0])));
        let own: Vec<_> = more.filter(|(_, n)| *n > 0).collect();
        let triangles = if worst.is_some() { triangles } else { vec![] };
        (!report.is_proven()).then(|| Self { outfit: outfit.into(), worst, own, triangles })
    }
}

fn told(worst: Option<&Worst>, own: &[(String, usize)]) -> String {
    let between = worst.map(|w| {
        let Worst { pairs, inside, outer, inner } = w;
        format!(
            "{pairs} intersecting triangle pairs and {inside} vertices on a wrong side, most of them of `{outer}` over `{inner}`,"
        )
    });
    let own = own.iter().map(|(name, n)| format!("{n} new intersections of `{name}` with itself"));
    let parts: Vec<String> = between.into_iter().chain(own).collect();
    format!("{} are", parts.join(" and "))
}

fn list(triangles: &[[u32; 2]]) -> String {
    /// More pairs than these say nothing more to a person.
    const SHOWN: usize = 8;
    if triangles.is_empty() {
        return String::new();
    }
    let pairs: Vec<String> =
        triangles.iter().take(SHOWN).map(|[inner, outer]| format!("({inner}, {outer})")).collect();
    format!("look at the triangles (inner, outer) {}; ", pairs.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_outfit::report::{LayerReport, PairCount};

    fn layer(name: &str, own_pairs: [usize; 2]) -> LayerReport {
        let mut layer = LayerReport::default();
        (layer.name, layer.own_pairs) = (name.into(), own_pairs);
        layer
    }

    #[test]
    fn the_worst_pair_of_layers_is_named_and_none_where_all_is_clean() {
        let pair = |outer: &str, crossing, vertices_inside| {
            let mut pair = PairReport::default();
            (pair.inner, pair.outer) = ("body".into(), outer.into());
            pair.pairs = PairCount { crossing, ..Default::default() };
            (pair.vertices_inside, pair.vertices) = (vertices_inside, 10);
            pair
        };
        let found = |pairs| {
            let mut report = ResolveReport::default();
            report.after.pairs = pairs;
            Left::found("o", &report, vec![[1, 2]])
        };
        assert!(found(vec![pair("a", 0, 0)]).is_none());
        let left = found(vec![pair("a", 1, 0), pair("b", 3, 5)]).unwrap();
        let text = left.to_string();
        assert!(
            text.contains("4 intersecting")
                && text.contains("5 vertices")
                && text.contains("`b` over `body`"),
            "{text}"
        );
        assert!(left.help().unwrap().to_string().contains("(1, 2)"));
        let outer = |pairs| found(pairs).unwrap().worst.unwrap().outer;
        assert_eq!(outer(vec![pair("a", 1, 0), pair("b", 3, 0), pair("c", 2, 9)]), "b");
        assert_eq!(outer(vec![pair("a", 0, 1), pair("b", 0, 2)]), "b");
    }

    #[test]
    fn new_intersections_of_a_garment_with_itself_are_left_too_and_old_ones_are_not() {
        let found = |layers| {
            let mut report = ResolveReport::default();
            report.layers = layers;
            Left::found("o", &report, vec![[1, 2]])
        };
        assert!(found(vec![layer("a", [7, 7]), layer("b", [9, 2])]).is_none());
        let left = found(vec![layer("a", [7, 7]), layer("coat", [1, 3])]).unwrap();
        assert_eq!(
            left.to_string(),
            "outfit `o`: 2 new intersections of `coat` with itself are left"
        );
        assert!(
            !left.help().unwrap().to_string().contains("(1, 2)"),
            "these triangles are of layers that do not meet"
        );
    }
}
