//! A GLB file in memory.

use super::accessor::Elements;
use super::container::Chunks;
use super::placing::Placing;
use if_core::math::Point;
use if_core::mesh::TriMesh;

/// The surface of a GLB file, and the whole file.
#[derive(Clone, Debug)]
pub struct GlbMesh {
    pub(super) bytes: Vec<u8>,
    /// The node that was chosen.
    pub(super) node: Option<String>,
    pub(super) chunks: Chunks,
    pub(super) mesh: TriMesh,
    pub(super) parts: Vec<Part>,
    pub(super) collapsed: Vec<u32>,
}

/// Vertices that share their accessors.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Its first vertex in the mesh.
    pub(super) first: usize,
    pub(super) positions: Elements,
    /// Those that can be written.
    pub(super) normals: Option<Elements>,
    pub(super) placings: Placings,
}

/// The placing of each vertex of a part.
#[derive(Clone, Debug)]
pub(super) enum Placings {
    All(Placing),
    Each(Vec<Placing>),
}

impl Placings {
    pub(super) fn of(&self, vertex: usize) -> &Placing {
        match self {
            Self::All(placing) => placing,
            Self::Each(placings) => &placings[vertex],
        }
    }

    fn is_identity(&self) -> bool {
        match self {
            Self::All(placing) => placing.is_identity(),
            Self::Each(placings) => placings.iter().all(Placing::is_identity),
        }
    }
}

impl GlbMesh {
    /// The surface as the default scene shows it, in its units (metres by the specification).
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// The file as it was read, byte for byte.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Indices of the file's triangles that use a vertex twice. The mesh does not have them.
    pub fn collapsed(&self) -> &[u32] {
        &self.collapsed
    }

    /// Whether both are layers of one file that have vertices in common.
    pub fn shares_vertices_with(&self, other: &Self) -> bool {
        let has =
            |part: &Part| other.parts.iter().any(|p| p.positions.at(0) == part.positions.at(0));
        self.bytes == other.bytes && self.parts.iter().any(has)
    }

    /// Whether the scene's positions are the single-precision numbers of the file: no node, joint or
    /// morph target moves them.
    pub fn is_single_precision(&self) -> bool {
        self.parts.iter().all(|part| part.placings.is_identity())
    }

    /// The positions as they will be read back: rounded to `f32` in the coordinates of their nodes.
    /// Without moves, these are the positions of [`mesh`](Self::mesh).
    ///
    /// # Panics
    ///
    /// If there are not as many positions as vertices.
    pub fn positions_as_written(&self, positions: &[Point]) -> Vec<Point> {
        let before = self.mesh.vertices();
        assert_eq!(positions.len(), before.len(), "one position for each vertex");
        let mut written = before.to_vec();
        for (v, placing) in self.placings() {
            if positions[v] != before[v] {
                written[v] = placing.forward(placing.back(&positions[v]));
            }
        }
        written
    }

    /// The vertices of the mesh and their placings, in order.
    fn placings(&self) -> impl Iterator<Item = (usize, &Placing)> {
        self.parts.iter().flat_map(|part| {
            (0..part.positions.count).map(move |k| (part.first + k, part.placings.of(k)))
        })
    }
}
