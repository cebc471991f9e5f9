//! What a person should know of a report, in sentences.

use super::{
    BodyReport, LayerReport, MovedApart, PairReport, PrimitiveDistance, Primitives, ResolveReport,
    SeamReport, Verification,
};
use crate::motion::OWN;
use crate::moving_apart::ENOUGH;
use if_core::math::Real;
use if_mesh::measure::Strain;

/// Share of a garment's vertices inside another one beyond which their order is doubted.
const MOSTLY: Real = 0.6;
/// Depth, in metres, from which a garment mostly inside the body is doubted: tight ones are so by
/// millimetres.
const DEEP: Real = 0.02;
/// Strain of the hundredth part of a garment's edges from which it is doubted.
const DRAWN: Real = 0.5;
/// Mean motion of a garment, in metres, from which it is doubted if nothing of it lay as deep: those
/// that have to give way move by less than their deepest vertex in the mean.
const SLID: Real = 0.01;

/// Distance of two primitives of a garment from which on it is too near for simulators with a barrier, in
/// metres: those take contacts of some 0.01 to 1 mm.
const THIN: Real = 1e-6;
/// Share of what a garment opened to itself below which its primitives are noted: two of five garments come to
/// 0.998 of it.
const NEARLY: Real = 0.9;

/// Whether a garment is strained so much that it may be made for another body: one edge in a hundred by
/// more than half.
fn is_drawn(strain: &Strain) -> bool {
    strain.p99 > DRAWN
}

impl Verification {
    /// What was assumed of the body, in sentences; `name` is what it is called.
    pub fn body_notes(&self, name: &str) -> Vec<String> {
        let notes = self.body.as_ref().map_or(Vec::new(), BodyReport::notes);
        notes.iter().map(|note| format!("`{name}`: {note}")).collect()
    }

    /// What a person should know, in sentences: [`Verification::body_notes`], garments that lie
    /// mostly and deep inside the body, or mostly inside one that is given below them, so that their
    /// place or order may be wrong, and those with primitives less than 1 µm apart. `body` is what the body
    /// is called.
    pub fn notes(&self, body: &str) -> Vec<String> {
        [self.body_notes(body), self.place_notes(body), self.thin_notes(THIN)].concat()
    }

    /// Garments of which two primitives that share no vertex are nearer than `least` metres.
    fn thin_notes(&self, least: Real) -> Vec<String> {
        let mut names: Vec<&str> = self.pairs.iter().map(|pair| pair.outer.as_str()).collect();
        names.dedup();
        let note = |(name, found): (&str, &Option<PrimitiveDistance>)| {
            let PrimitiveDistance { distance, primitives, are_neighbours, .. } =
                found.filter(|found| found.distance < least)?;
            let two = match primitives {
                Primitives::VertexTriangle(v, t) => format!("vertex {v} and triangle {t:?}"),
                Primitives::Edges(e, f) => format!("edges {e:?} and {f:?}"),
            };
            let what = if are_neighbours { ", a sliver" } else { "" };
            Some(format!(
                "`{name}`: {two} are {:.1e} mm apart{what}: too near for simulators with a barrier",
                1e3 * distance
            ))
        };
        names.into_iter().zip(&self.own_primitive_distances).filter_map(note).collect()
    }

    fn place_notes(&self, body: &str) -> Vec<String> {
        let note = |pair: &PairReport| {
            let PairReport { inner, outer, .. } = pair;
            let share = pair.vertices_inside as Real / pair.vertices.max(1) as Real;
            let percent = format!("{:.0} %", 1e2 * share);
            if share <= MOSTLY || (inner == body && pair.deepest < DEEP) {
                None
            } else if inner == body {
                Some(format!(
                    "`{outer}`: {percent} of it lies inside the body, {:.0} mm deep; is it for this body, and in place?",
                    1e3 * pair.deepest
                ))
            } else {
                Some(format!(
                    "`{outer}`: {percent} of it lies inside `{inner}`, which is given below it; is the order right (`check --order auto`)?"
                ))
            }
        };
        self.pairs.iter().filter_map(note).collect()
    }
}

impl SeamReport {
    fn note(&self) -> String {
        let Self { name, edges, given, now } = self;
        if *now == 0.0 {
            return format!(
                "`{name}`: the sides of seams were up to {:.2} µm apart at {edges} boundary edges, and were joined",
                1e6 * given
            );
        }
        format!(
            "`{name}`: {edges} boundary edges lay within {:.2} mm of others, and are {:.1} mm apart now; if that is a seam, merge its vertices by distance first",
            1e3 * given,
            1e3 * now
        )
    }
}

impl ResolveReport {
    /// A note if layers stay nearer than they were moved apart to.
    fn nearer(&self) -> Option<String> {
        /// More pairs than these do not help a person.
        const NAMED: usize = 4;
        let MovedApart { goal, reached, .. } = self.moved_apart?;
        let mm = |length: Real| format!("{:.4} mm", 1e3 * length);
        let least = |pair: &PairReport| pair.least_distance.map_or(goal, |least| least.distance);
        let mut nearer: Vec<&PairReport> =
            self.after.pairs.iter().filter(|pair| least(pair) < ENOUGH * goal).collect();
        nearer.sort_by(|a, b| least(a).total_cmp(&least(b)));
        let name = |pair: &&PairReport| {
            format!("`{}` over `{}` ({})", pair.outer, pair.inner, mm(least(pair)))
        };
        let named: Vec<String> = nearer.iter().take(NAMED).map(name).collect();
        let more = match nearer.len() - named.len() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        (!named.is_empty()).then(|| {
            format!(
                "layers were moved apart to {} of {}; nearer are {}{more}",
                mm(reached),
                mm(goal),
                named.join(", ")
            )
        })
    }

    /// A note if the garment moved farther than what it lay in asks for.
    fn slid(&self, layer: &LayerReport) -> Option<String> {
        let own = self.before.pairs.iter().filter(|pair| pair.outer == layer.name);
        let deepest = own.map(|pair| pair.deepest).fold(0.0, Real::max);
        let mean = layer.moved.mean;
        (mean > SLID && mean > deepest).then(|| {
            format!(
                "`{}`: moved by {:.0} mm in the mean, and nothing of it was deeper than {:.0} mm in a layer; did it slide?",
                layer.name,
                1e3 * mean,
                1e3 * deepest
            )
        })
    }

    /// What a person should know, in sentences: [`Verification::notes`] of the input, garments that
    /// are drawn so much that they may be for another body, those that moved farther than they lay
    /// deep, layers that stay nearer than [`MovedApart::goal`], and primitives of garments that do, or are less
    /// than 1 µm apart. `body` is what the body is called.
    pub fn notes(&self, body: &str) -> Vec<String> {
        let mut notes = self.before.notes(body);
        notes.extend(self.seams.iter().map(SeamReport::note));
        let drawn = self.layers.iter().filter(|layer| is_drawn(&layer.strain));
        notes.extend(drawn.map(|layer| {
            format!(
                "`{}`: one edge in a hundred is strained by {:.0} % or more; is it for this body?",
                layer.name,
                1e2 * layer.strain.p99
            )
        }));
        notes.extend(self.layers.iter().filter_map(|layer| self.slid(layer)));
        notes.extend(self.nearer());
        let opened = self.moved_apart.map_or(0.0, |apart| NEARLY * apart.goal.min(OWN));
        notes.extend(self.after.thin_notes(THIN.max(opened)));
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::super::LeastDistance;
    use super::*;
    use if_mesh::measure::Displacement;

    #[test]
    fn a_garment_mostly_inside_one_below_it_is_noted() {
        let pair = |inner: &str, vertices_inside| PairReport {
            inner: inner.into(),
            outer: "shirt".into(),
            vertices_inside,
            vertices: 100,
            ..PairReport::default()
        };
        let pairs = vec![pair("skin", 90), pair("vest", 60), pair("coat", 61)];
        let notes = Verification { pairs, ..Verification::default() }.notes("skin");
        let [note] = &notes[..] else { panic!("{notes:?}") };
        assert!(note.contains("`shirt`: 61 % of it lies inside `coat`"), "{note}");
    }

    #[test]
    fn garments_that_are_deep_inside_the_body_or_drawn_are_noted() {
        let pair = |vertices_inside, deepest| PairReport {
            inner: "skin".into(),
            outer: "tights".into(),
            vertices_inside,
            vertices: 100,
            deepest,
            ..PairReport::default()
        };
        let notes = |pair, p99| {
            let strain = Strain { p99, ..Strain::default() };
            let layer = LayerReport { name: "tights".into(), strain, ..LayerReport::default() };
            let before = Verification { pairs: vec![pair], ..Verification::default() };
            ResolveReport { before, layers: vec![layer], ..ResolveReport::default() }.notes("skin")
        };
        assert!(notes(pair(90, 0.005), 0.3).is_empty());
        assert!(notes(pair(50, 0.05), 0.3).is_empty());
        let found = notes(pair(90, 0.05), 0.77);
        let [inside, drawn] = &found[..] else { panic!("{found:?}") };
        assert!(inside.starts_with("`tights`: 90 % of it lies inside the body, 50 mm deep"));
        assert!(drawn.starts_with("`tights`: one edge in a hundred is strained by 77 % or more"));
    }

    #[test]
    fn layers_that_stay_nearer_than_the_goal_are_noted_with_what_was_reached() {
        let least = |distance| Some(LeastDistance { distance, error: 0.0, triangles: [0, 1] });
        let pair = |inner: &str, outer: &str, distance| PairReport {
            inner: inner.into(),
            outer: outer.into(),
            least_distance: least(distance),
            ..PairReport::default()
        };
        let pairs = vec![
            pair("skin", "vest", 0.2997e-3),
            pair("skin", "coat", 0.28e-3),
            pair("vest", "coat", 0.26e-3),
        ];
        let after = Verification { pairs, ..Verification::default() };
        let moved_apart = Some(MovedApart { goal: 0.3e-3, reached: 0.26e-3, moved: 1e-3 });
        let report = ResolveReport { after, moved_apart, ..ResolveReport::default() };
        assert_eq!(
            report.notes("skin"),
            ["layers were moved apart to 0.2600 mm of 0.3000 mm; nearer are `coat` over `vest` \
              (0.2600 mm), `coat` over `skin` (0.2800 mm)"]
        );
    }

    #[test]
    fn slivers_are_noted_below_a_micrometre_or_what_a_garment_opens_to() {
        let pair = |outer: &str| PairReport { outer: outer.into(), ..PairReport::default() };
        let thin = |distance, are_neighbours| {
            let primitives = Primitives::VertexTriangle(3919, [3918, 4007, 3980]);
            Some(PrimitiveDistance { distance, error: 0.0, primitives, are_neighbours })
        };
        let found = Verification {
            pairs: vec![pair("vest"), pair("coat"), pair("coat")],
            own_primitive_distances: vec![thin(2e-5, true), thin(4e-8, true)],
            ..Verification::default()
        };
        let notes = found.notes("skin");
        let [note] = &notes[..] else { panic!("{notes:?}") };
        assert_eq!(
            note,
            "`coat`: vertex 3919 and triangle [3918, 4007, 3980] are 4.0e-5 mm apart, a sliver: too \
             near for simulators with a barrier"
        );
        let moved_apart = Some(MovedApart { goal: 1e-3, ..MovedApart::default() });
        let mut report = ResolveReport { after: found, moved_apart, ..ResolveReport::default() };
        assert_eq!(report.notes("skin").len(), 2);
        report.after.own_primitive_distances[0] = thin(0.998e-4, true);
        assert_eq!(report.notes("skin").len(), 1, "it opened to all but rounding");
    }

    #[test]
    fn garments_that_moved_farther_than_they_lay_deep_are_noted() {
        let pair = |inner: &str, outer: &str, deepest| PairReport {
            inner: inner.into(),
            outer: outer.into(),
            deepest,
            ..PairReport::default()
        };
        let notes = |deepest, mean| {
            let moved = Displacement { mean, ..Displacement::default() };
            let layer = LayerReport { name: "sock".into(), moved, ..LayerReport::default() };
            let pairs = vec![
                pair("skin", "sock", deepest),
                pair("tights", "sock", 0.001),
                pair("skin", "shoe", 0.1),
            ];
            let before = Verification { pairs, ..Verification::default() };
            ResolveReport { before, layers: vec![layer], ..ResolveReport::default() }.notes("skin")
        };
        assert!(notes(0.025, 0.024).is_empty(), "it had to come out");
        assert!(notes(0.002, 0.009).is_empty());
        let found = notes(0.004, 0.027);
        let [note] = &found[..] else { panic!("{found:?}") };
        assert!(
            note.starts_with(
                "`sock`: moved by 27 mm in the mean, and nothing of it was deeper than 4 mm"
            ),
            "{note}"
        );
    }
}
