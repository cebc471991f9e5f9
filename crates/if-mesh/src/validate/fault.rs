//! Faults of meshes, with messages for users.

use if_core::math::Real;
use serde::Serialize;
use std::fmt;

/// Maximum number of indices that a fault lists.
pub(super) const LISTED: usize = 5;

/// A defect of a mesh, or a warning about it.
///
/// The lists hold the first few indices only, the counts are of all.
#[derive(Clone, Debug, PartialEq, Serialize, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum Fault {
    /// The mesh has no triangles.
    #[error("there are no triangles ({vertices} vertices)")]
    NoTriangles { vertices: usize },
    /// Triangles have no area, and so no normal.
    #[error(
        "{count} triangles have no area ({}); merge their vertices or drop them",
        list(triangles)
    )]
    ZeroArea { count: usize, triangles: Vec<u32> },
    /// Triangles have the same three corners as others before them.
    #[error("{count} triangles repeat others ({}); drop them", list(triangles))]
    Repeated { count: usize, triangles: Vec<u32> },
    /// Edges have three or more triangles.
    #[error(
        "{count} edges belong to more than two triangles ({}); split the surface there",
        pairs(edges)
    )]
    NonManifold { count: usize, edges: Vec<[u32; 2]> },
    /// Neighbouring triangles have opposite orientations.
    #[error(
        "at {count} edges ({}) two triangles have opposite orientations; make the normals consistent",
        pairs(edges)
    )]
    Winding { count: usize, edges: Vec<[u32; 2]> },
    /// The normals of the closed surface point inwards.
    #[error("the closed surface is inside out (volume {volume:.3e}); flip its triangles")]
    InsideOut { volume: Real },
    /// The normals of a component of the closed surface point inwards, and it is not a cavity.
    #[error(
        "a part of the closed surface is inside out, {triangles} triangles from triangle {triangle} on (volume {volume:.3e}); \
         flip these"
    )]
    PartInsideOut { triangle: usize, triangles: usize, volume: Real },
    /// Vertices have equal positions: an open seam, or vertices that an exporter has split.
    #[error(
        "{count} vertices lie exactly on others ({}); those of a garment move as one",
        list(vertices)
    )]
    Duplicates { count: usize, vertices: Vec<u32> },
    /// Several fans of triangles meet in one vertex.
    #[error(
        "in {count} vertices ({}) parts of the surface meet that share no edge; give each part a vertex of its own",
        list(vertices)
    )]
    BowTies { count: usize, vertices: Vec<u32> },
    /// Vertices belong to no triangle.
    #[error("{count} vertices belong to no triangle ({}), and do not move", list(vertices))]
    Unused { count: usize, vertices: Vec<u32> },
    /// The size is impossible for a person in metres.
    #[error("{} units high: {unit}", thousands(*height))]
    Units { height: Real, unit: Unit },
}

/// The unit that a height suggests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Unit {
    /// 100 to 250 high.
    Centimetres,
    /// 800 to 2,500 high.
    Millimetres,
    /// Much too large or too small for metres.
    Unknown,
}

impl Unit {
    /// The factor to metres, if known.
    pub fn scale(self) -> Option<Real> {
        match self {
            Self::Centimetres => Some(0.01),
            Self::Millimetres => Some(0.001),
            Self::Unknown => None,
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Centimetres => "likely centimetres; scale by 0.01",
            Self::Millimetres => "likely millimetres; scale by 0.001",
            Self::Unknown => "not metres; scale it to metres",
        })
    }
}

impl Fault {
    /// Whether the solver cannot work with it: normals, sides and neighbours must be defined. All
    /// other faults are warnings.
    pub fn is_defect(&self) -> bool {
        !matches!(
            self,
            Self::BowTies { .. }
                | Self::Duplicates { .. }
                | Self::Unused { .. }
                | Self::Units { .. }
        )
    }
}

fn list(indices: &[u32]) -> String {
    let words: Vec<String> = indices.iter().map(u32::to_string).collect();
    format!("{}{}", words.join(", "), if indices.len() == LISTED { ", …" } else { "" })
}

fn pairs(edges: &[[u32; 2]]) -> String {
    let words: Vec<String> = edges.iter().map(|[a, b]| format!("{a}–{b}")).collect();
    format!("{}{}", words.join(", "), if edges.len() == LISTED { ", …" } else { "" })
}

/// `1,740` for 1740.2, and three digits of small numbers.
pub(super) fn thousands(x: Real) -> String {
    if x < 100.0 {
        return format!("{x:.3}");
    }
    let digits = format!("{x:.0}");
    let groups: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().map(|g| std::str::from_utf8(g).unwrap_or("")).collect();
    groups.join(",")
}
