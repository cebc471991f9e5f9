//! What was assumed of a body, and why one has no inside.

use if_core::math::Real;
use serde::{Deserialize, Serialize};

/// A loop of boundary edges of a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct Hole {
    /// Number of edges.
    pub edges: usize,
    /// Longest side of its box, in metres.
    pub size: Real,
    /// Mean of its vertices, in metres.
    pub center: [Real; 3],
    /// Whether the patch over it counts as skin. Otherwise it only bounds the inside, and nothing is
    /// pushed out of it.
    pub filled: bool,
}

/// What was assumed of a body that is not one closed surface. The default is that of a closed one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Default)]
#[serde(default)]
#[non_exhaustive]
pub struct BodyReport {
    /// Loops of boundary edges of parts with an inside.
    pub holes: Vec<Hole>,
    /// Vertices that were taken for another one at the same place.
    pub merged_vertices: usize,
    /// Triangles that repeat another one, or have two corners at one place.
    pub repeated_triangles: usize,
    /// Triangles that wind against their neighbours, and count as turned.
    pub turned_triangles: usize,
    /// Parts that are inside out, and count as turned.
    pub turned_parts: usize,
    /// Open parts without an inside beside an opening: pieces of skin that push what lies closely
    /// behind them.
    pub islands: usize,
    /// Other open parts without an inside, such as lashes or cards of hair. Garments must not
    /// intersect them, and may lie on either side.
    pub sheets: usize,
    /// Parts that lie inside others, such as eyes and teeth. Garments must not intersect them.
    pub inner_parts: usize,
    /// Triangles of other parts that lie inside the body, where it intersects itself.
    pub hidden_triangles: usize,
    /// Pairs of its triangles that intersect.
    pub own_pairs: usize,
}

impl BodyReport {
    /// Holes that stay open: nothing is pushed out of them.
    pub fn openings(&self) -> impl Iterator<Item = &Hole> {
        self.holes.iter().filter(|hole| !hole.filled)
    }

    /// Sentences for a person, one for each assumption.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let (mut filled, mut largest): (usize, Real) = (0, 0.0);
        for hole in self.holes.iter().filter(|hole| hole.filled) {
            filled += 1;
            largest = largest.max(hole.size);
        }
        if filled > 0 {
            let largest = 1e3 * largest;
            notes.push(format!("{filled} holes of up to {largest:.0} mm count as closed"));
        }
        let open: Vec<String> = self
            .openings()
            .take(LISTED)
            .map(|hole| {
                let [x, y, z] = hole.center;
                format!("{:.0} mm at ({x:.2}, {y:.2}, {z:.2})", 1e3 * hole.size)
            })
            .collect();
        if !open.is_empty() {
            let more = self.openings().count() - open.len();
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            notes.push(format!(
                "nothing is pushed out of openings of {}{more}, where the body is not there",
                open.join(", ")
            ));
        }
        let mut count = |n: usize, what: &str| {
            if n > 0 {
                notes.push(format!("{n} {what}"));
            }
        };
        count(self.merged_vertices, "vertices at the place of another one count as one with it");
        count(
            self.repeated_triangles,
            "triangles that repeat another one or are lines are ignored",
        );
        count(
            self.turned_triangles,
            "triangles that wind against their neighbours count as turned",
        );
        count(self.turned_parts, "parts that are inside out count as turned");
        count(self.inner_parts, "parts inside others do not push garments");
        count(self.islands, "pieces of skin beside openings have no inside, but a front");
        count(self.sheets, "open parts without an inside do not push garments");
        count(self.own_pairs, "pairs of its triangles intersect; what they enclose is inside");
        notes
    }
}

/// Openings that a note lists.
const LISTED: usize = 6;

/// A mesh has no inside, so that it is not a body.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "it has no inside: {}; a body must be closed, or open only where a small share of it is missing",
    if *openings == 0 {
        format!("its surface of {area:.3e} m² encloses {volume:.3e} m³")
    } else {
        format!("its {openings} openings are {:.0} % as large as its surface of {area:.3e} m²", 100.0 * share)
    }
)]
#[non_exhaustive]
pub struct NoInside {
    /// Its area, in square metres.
    pub area: Real,
    /// The volume that its largest part encloses if it is closed, in cubic metres.
    pub volume: Real,
    /// Openings of its largest part that are too large to count as closed.
    pub openings: usize,
    /// The area of the openings of its largest part as a share of that part's.
    pub share: Real,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_have_numbers_and_places() {
        assert!(BodyReport::default().notes().is_empty());
        let hole = |size, filled| Hole { edges: 5, size, center: [0.0, 1.4, 0.0], filled };
        let mut report = BodyReport { holes: vec![hole(0.012, true); 3], ..Default::default() };
        report.holes.extend(vec![hole(0.118, false); 8]);
        report.inner_parts = 2;
        let notes = report.notes();
        assert_eq!(notes[0], "3 holes of up to 12 mm count as closed");
        assert!(notes[1].contains("118 mm at (0.00, 1.40, 0.00)"), "{}", notes[1]);
        assert!(notes[1].contains("and 2 more"), "{}", notes[1]);
        assert_eq!(notes[2], "2 parts inside others do not push garments");
    }
}
