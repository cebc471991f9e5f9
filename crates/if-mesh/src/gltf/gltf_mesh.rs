//! A glTF file in memory.

use super::accessor::Elements;
use super::error::WriteError;
use super::placing::Placing;
use super::scene::SkinJoint;
use super::skin::Skinned;
use super::source::Source;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use std::path::{Path, PathBuf};

/// The surface of a glTF file, and the whole file.
#[derive(Clone, Debug)]
pub struct GltfMesh {
    pub(super) source: Source,
    /// The node that was chosen.
    pub(super) node: Option<String>,
    pub(super) mesh: TriMesh,
    pub(super) parts: Vec<Part>,
    pub(super) collapsed: Vec<u32>,
    /// Two nodes that show the same vertices.
    pub(super) shared: Option<[usize; 2]>,
    pub(super) images: Vec<Result<PathBuf, String>>,
    pub(super) joints: Vec<SkinJoint>,
}

/// Vertices that share their accessors.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Its first vertex in the mesh.
    pub(super) first: usize,
    pub(super) positions: Elements,
    /// As many as positions.
    pub(super) normals: Option<Elements>,
    /// Directions along the surface, with the side of the third one.
    pub(super) tangents: Option<Elements>,
    /// As many as positions.
    pub(super) texture: Option<Elements>,
    pub(super) placings: Placings,
    pub(super) skinned: Option<Skinned>,
    /// Without a skin the nearest of the mesh's joints above its node, or at it.
    pub(super) hangs_from: Option<usize>,
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

/// The joints of a skin and their weights for each vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct Influences {
    /// Names of the joints' nodes; `joint 7` if node 7 has none.
    pub joints: Vec<String>,
    /// For each vertex indices of joints, and their weights, of which none is zero.
    pub of_vertex: Vec<Vec<(usize, Real)>>,
}

impl GltfMesh {
    /// The surface as the default scene shows it, in its units (metres by the specification).
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// The file as it was read, byte for byte, without the files beside it.
    pub fn bytes(&self) -> &[u8] {
        &self.source.bytes
    }

    /// The buffers in files beside it: each file's path from the folder of this file, and its bytes.
    pub fn beside(&self) -> impl Iterator<Item = (&Path, &[u8])> {
        self.source.beside()
    }

    /// The images in files beside it, by their paths from the folder of this file. An error is the
    /// URI of one that is elsewhere.
    pub fn images(&self) -> impl Iterator<Item = Result<&Path, &str>> {
        self.images.iter().map(|image| image.as_deref().map_err(String::as_str))
    }

    /// Whether it is one binary file (`.glb`); otherwise it is JSON (`.gltf`).
    pub fn is_binary(&self) -> bool {
        self.source.is_binary()
    }

    /// Indices of the file's triangles that use a vertex twice. The mesh does not have them.
    pub fn collapsed(&self) -> &[u32] {
        &self.collapsed
    }

    /// The skin's joints and weights; `None` if there are vertices without. What has no skin follows the
    /// nearest joint above its node that `is_joint` by its name, as a watch follows the forearm.
    pub fn influences(&self, is_joint: impl Fn(&str) -> bool) -> Option<Influences> {
        let mut joints: Vec<String> = Vec::new();
        let mut of_vertex = Vec::with_capacity(self.mesh.vertices().len());
        for part in &self.parts {
            let mut place = |name: &String| {
                let found = joints.iter().position(|joint| joint == name);
                found.unwrap_or_else(|| {
                    joints.push(name.clone());
                    joints.len() - 1
                })
            };
            let Some(skinned) = &part.skinned else {
                let above = |joint: &usize| self.joints[*joint].parent;
                let joint = std::iter::successors(part.hangs_from, above)
                    .map(|joint| &self.joints[joint].name)
                    .find(|name| is_joint(name))?;
                let joint = place(joint);
                of_vertex.extend(std::iter::repeat_n(vec![(joint, 1.0)], part.positions.count));
                continue;
            };
            let places: Vec<usize> = skinned.joints.iter().map(&mut place).collect();
            let of =
                |k: usize| skinned.of(k).map(|(joint, weight)| (places[joint], weight)).collect();
            of_vertex.extend((0..part.positions.count).map(of));
        }
        Some(Influences { joints, of_vertex })
    }

    /// The joints of all skins of the file; those that have the names of joints of this surface's skins are these.
    pub fn joints(&self) -> &[SkinJoint] {
        &self.joints
    }

    /// The texture coordinates (`TEXCOORD_0`) of each vertex; `None` if there are vertices without.
    pub fn texture_coordinates(&self) -> Option<Vec<[f32; 2]>> {
        let mut all = Vec::with_capacity(self.mesh.vertices().len());
        for part in &self.parts {
            let texture = part.texture.as_ref()?;
            let of = |k: usize| texture.values::<2>(&self.source, k).map(|x| x as f32);
            all.extend((0..texture.count).map(of));
        }
        Some(all)
    }

    /// Whether both are layers of one file.
    pub fn is_in_file_of(&self, other: &Self) -> bool {
        self.source.is_same(&other.source)
    }

    /// Whether both are layers of one file that have vertices in common.
    pub fn shares_vertices_with(&self, other: &Self) -> bool {
        let has = |part: &Part| {
            other.parts.iter().any(|p| p.positions.accessor == part.positions.accessor)
        };
        self.is_in_file_of(other) && self.parts.iter().any(has)
    }

    /// Checks that vertices can move: no two nodes show the same ones.
    ///
    /// # Errors
    ///
    /// [`WriteError::Shared`].
    pub fn check_movable(&self) -> Result<(), WriteError> {
        match self.shared {
            Some([first, second]) => Err(WriteError::Shared { first, second }),
            None => Ok(()),
        }
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
