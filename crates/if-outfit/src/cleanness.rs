//! How clean an outfit is, in one word.

use serde::{Deserialize, Serialize};
use std::fmt;

/// How clean an outfit is; a later one is cleaner.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
pub enum Cleanness {
    /// Triangles of two layers intersect, a vertex is on the wrong side of a layer below, or a
    /// garment has an intersection with itself that the input did not have.
    #[default]
    #[serde(rename = "not clean")]
    NotClean,
    /// Layers do not meet, but a garment or the body intersects itself.
    #[serde(rename = "clean between layers")]
    BetweenLayers,
    /// No two triangles of the scene, body and garments, meet except at common vertices: what
    /// simulators require of their start. Vertices at exactly the same position count as one, a
    /// triangle that repeats another (as in two-sided exports) does not count, nor one without area;
    /// [`notes`](crate::notes::notes) names them: a tool that goes by the numbers of vertices alone may
    /// call them intersections.
    #[serde(rename = "clean everywhere")]
    Everywhere,
}

impl fmt::Display for Cleanness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotClean => "not clean",
            Self::BetweenLayers => "clean between layers",
            Self::Everywhere => "clean everywhere",
        })
    }
}
