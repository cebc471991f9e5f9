//! Skinning weights: up to four joints for each vertex.

use crate::left_out::LeftOut;
use crate::skeleton::Skeleton;
use if_core::parameter::ParameterError;
use if_mesh::file::{Content, MeshFile};
use if_mesh::gltf::Influences;
use if_mesh::ply::{Column, PlyMesh, Property};
use if_sparse::CholeskyError;
use std::collections::HashMap;

/// Up to four joints and their weights for each vertex. Weights are non-negative and sum to 1.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct SkinWeights {
    joints: Vec<[u16; 4]>,
    weights: Vec<[f32; 4]>,
    left_out: Option<LeftOut>,
}

/// Skinning weights are invalid, or do not match a mesh or skeleton.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum SkinError {
    /// A layer without weights has none to take them from.
    #[error(
        "there are no skinning weights; give those of the body, as vertex properties j0 to j3 and w0 to w3 of a PLY file or the skin of a glTF file"
    )]
    NoWeights,
    /// A property of the PLY file is missing.
    #[error(
        "the mesh has no vertex property `{name}`; skinning needs integers j0 to j3 and floats w0 to w3"
    )]
    Missing { name: String },
    /// A property of the PLY file has the wrong type.
    #[error(
        "vertex property `{name}` has the type {found}; j0 to j3 must be integers, w0 to w3 floats; lists are not allowed"
    )]
    Type { name: String, found: String },
    /// Not one record for each vertex.
    #[error("{vertices} vertices have {records} records of skinning weights; give one for each")]
    Count { vertices: usize, records: usize },
    /// There is nothing to interpolate.
    #[error(
        "skinning weights need vertices, triangles and joints; there are {vertices} vertices and \
         {joints} joints"
    )]
    Empty { vertices: usize, joints: usize },
    /// A joint is missing from the skeleton.
    #[error(
        "vertex {vertex} has a weight for joint {joint}, but there are {count} joints (0 is the first)"
    )]
    Joint { vertex: usize, joint: i64, count: usize },
    /// A joint of a glTF file is missing from the skeleton.
    #[error(
        "vertex {vertex} has a weight for the joint `{name}`, which the skeleton does not have"
    )]
    UnknownJoint { vertex: usize, name: String },
    /// A weight is negative, NaN or infinite.
    #[error(
        "weight {slot} of vertex {vertex} is {weight}; weights must be finite and not negative"
    )]
    Weight { vertex: usize, slot: usize, weight: f32 },
    /// The weights of a vertex do not sum to 1.
    #[error("the weights of vertex {vertex} sum to {sum}; they must sum to 1")]
    Sum { vertex: usize, sum: f32 },
    /// Weights cannot be extended along a garment.
    #[error("cannot extend the weights along the garment: {0}")]
    Extension(#[from] CholeskyError),
    /// The parameters of a grid are out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

/// Tolerance of the sum of a vertex's weights before they are normalised. Four weights rounded to
/// two decimals can differ from 1 by 0.02; ten times more would hide a lost joint.
const SUM: f32 = 0.03;

impl SkinWeights {
    /// Most joints that vertices can follow.
    pub const MAX_JOINTS: usize = u16::MAX as usize + 1;

    /// Validates and normalises the joints and weights of each vertex, for a skeleton of `count`
    /// joints.
    ///
    /// # Errors
    ///
    /// The first invalid vertex. Joints of weight zero must exist, too.
    pub fn new(
        joints: Vec<[u16; 4]>,
        mut weights: Vec<[f32; 4]>,
        count: usize,
    ) -> Result<Self, SkinError> {
        if joints.len() != weights.len() {
            return Err(SkinError::Count { vertices: joints.len(), records: weights.len() });
        }
        for (vertex, (j, w)) in joints.iter().zip(&mut weights).enumerate() {
            for slot in 0..4 {
                if usize::from(j[slot]) >= count {
                    return Err(SkinError::Joint { vertex, joint: j[slot].into(), count });
                }
                if !(w[slot].is_finite() && w[slot] >= 0.0) {
                    return Err(SkinError::Weight { vertex, slot, weight: w[slot] });
                }
            }
            let sum: f32 = w.iter().sum();
            if (sum - 1.0).abs() > SUM {
                return Err(SkinError::Sum { vertex, sum });
            }
            *w = w.map(|x| x / sum);
        }
        Ok(Self { joints, weights, left_out: None })
    }

    /// Reads the properties j0 to j3 and w0 to w3 of a PLY file, for a skeleton of `count` joints.
    ///
    /// # Errors
    ///
    /// A property is missing or of the wrong type, and as [`SkinWeights::new`].
    pub fn from_ply(ply: &PlyMesh, count: usize) -> Result<Self, SkinError> {
        let property = |name: String| {
            let found =
                ply.vertex_property(&name).ok_or(SkinError::Missing { name: name.clone() })?;
            let integer = found.values.scalar_type().is_integer();
            if found.lists.is_some() || integer != name.starts_with('j') {
                let list = if found.lists.is_some() { "list of " } else { "" };
                return Err(SkinError::Type {
                    name,
                    found: format!("{list}{}", found.values.scalar_type()),
                });
            }
            Ok(found.values.to_f64())
        };
        let n = ply.mesh.vertices().len();
        let (mut joints, mut weights) = (vec![[0u16; 4]; n], vec![[0f32; 4]; n]);
        for slot in 0..4 {
            for (vertex, j) in property(format!("j{slot}"))?.into_iter().enumerate() {
                if !(0.0..count as f64).contains(&j) || j > f64::from(u16::MAX) {
                    return Err(SkinError::Joint { vertex, joint: j as i64, count });
                }
                joints[vertex][slot] = j as u16;
            }
            for (vertex, w) in property(format!("w{slot}"))?.into_iter().enumerate() {
                weights[vertex][slot] = w as f32;
            }
        }
        Self::new(joints, weights, count)
    }

    /// The weights of a glTF file's skin, for a skeleton with joints of these names. Of more than four
    /// joints a vertex keeps those with the largest weights, and the rest is [left out](Self::left_out).
    ///
    /// # Errors
    ///
    /// A joint that the file or the skeleton does not have, and as [`SkinWeights::new`].
    pub fn from_gltf<'a>(
        influences: &Influences,
        names: impl Iterator<Item = &'a str>,
    ) -> Result<Self, SkinError> {
        let names: Vec<&str> = names.collect();
        let find = |joint: &String| names.iter().position(|name| name == joint);
        let of_joint: Vec<Option<usize>> = influences.joints.iter().map(find).collect();
        let n = influences.of_vertex.len();
        let (mut joints, mut weights) = (vec![[0u16; 4]; n], vec![[0f32; 4]; n]);
        let mut left_out = None;
        for (vertex, of) in influences.of_vertex.iter().enumerate() {
            let largest = LeftOut::cut(&mut left_out, of);
            let sum: f64 = largest.iter().map(|(_, weight)| weight).sum();
            for (slot, (joint, weight)) in largest.into_iter().enumerate() {
                let name = || influences.joints[joint].clone();
                let count = of_joint.len();
                let beyond = SkinError::Joint { vertex, joint: joint as i64, count };
                let found = of_joint.get(joint).ok_or(beyond)?;
                let found =
                    found.ok_or_else(|| SkinError::UnknownJoint { vertex, name: name() })?;
                joints[vertex][slot] = found as u16;
                weights[vertex][slot] = (weight / sum) as f32;
            }
        }
        Ok(Self { left_out, ..Self::new(joints, weights, names.len())? })
    }

    /// The weights of a mesh file: vertex properties j0 to j3 and w0 to w3 of PLY files, and skins of glTF
    /// files whose joints have the names of the skeleton's, or the joint from which a node without a skin
    /// hangs. `None` if it has none.
    ///
    /// # Errors
    ///
    /// As [`SkinWeights::from_ply`] and [`SkinWeights::from_gltf`].
    pub fn from_file(file: &MeshFile, skeleton: &Skeleton) -> Result<Option<Self>, SkinError> {
        let found = match file.content() {
            Content::Ply(ply) => ["j0", "w0"]
                .iter()
                .any(|name| ply.vertex_property(name).is_some())
                .then(|| Self::from_ply(ply, skeleton.len())),
            Content::Gltf(gltf) => {
                let is_joint = |joint: &str| skeleton.names().any(|name| name == joint);
                gltf.influences(is_joint)
                    .map(|influences| Self::from_gltf(&influences, skeleton.names()))
            }
            _ => None,
        };
        found.transpose()
    }

    /// The same weights for another skeleton, by the names of joints; `None` if it lacks one that moves
    /// a vertex. Joints of weight zero that it lacks become the first.
    pub fn for_skeleton(self, from: &Skeleton, to: &Skeleton) -> Option<Self> {
        if from.names().eq(to.names()) {
            return Some(self);
        }
        let of_name: HashMap<&str, u16> = to.names().zip(0..).collect();
        let of_joint: Vec<Option<u16>> =
            from.names().map(|name| of_name.get(name).copied()).collect();
        let mut joints = self.joints;
        for (own, weights) in joints.iter_mut().zip(&self.weights) {
            for (joint, weight) in own.iter_mut().zip(weights) {
                let found = of_joint.get(usize::from(*joint)).copied().flatten();
                *joint = if *weight > 0.0 { found? } else { found.unwrap_or(0) };
            }
        }
        Some(Self { joints, weights: self.weights, left_out: self.left_out })
    }

    /// The properties j0 to j3 and w0 to w3 for a PLY file; `uchar` joints where there are fewer
    /// than 256.
    pub fn to_properties(&self) -> Vec<Property> {
        let small = self.joints.iter().flatten().all(|j| *j < 256);
        let joint = |k: usize| {
            let values = self.joints.iter().map(|j| j[k]);
            if small {
                Column::U8(values.map(|j| j as u8).collect())
            } else {
                Column::U16(values.collect())
            }
        };
        let mut out: Vec<Property> =
            (0..4).map(|k| Property::new(format!("j{k}"), joint(k))).collect();
        out.extend((0..4).map(|k| {
            Property::new(format!("w{k}"), Column::F32(self.weights.iter().map(|w| w[k]).collect()))
        }));
        out
    }

    /// Checks that there is one record for each of `vertices`, and that all joints are among the
    /// first `count`.
    ///
    /// # Errors
    ///
    /// [`SkinError::Count`] or [`SkinError::Joint`].
    pub fn check(&self, vertices: usize, count: usize) -> Result<(), SkinError> {
        self.check_len(vertices)?;
        for (vertex, joints) in self.joints.iter().enumerate() {
            if let Some(joint) = joints.iter().find(|j| usize::from(**j) >= count) {
                return Err(SkinError::Joint { vertex, joint: (*joint).into(), count });
            }
        }
        Ok(())
    }

    /// Checks that there is one record for each of `vertices`.
    ///
    /// # Errors
    ///
    /// [`SkinError::Count`].
    pub fn check_len(&self, vertices: usize) -> Result<(), SkinError> {
        let records = self.len();
        if records == vertices { Ok(()) } else { Err(SkinError::Count { vertices, records }) }
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// Whether there are no vertices.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// What was left out of vertices that follow more than four joints in their glTF file; `None` if none does.
    pub fn left_out(&self) -> Option<LeftOut> {
        self.left_out
    }

    /// The joints of each vertex.
    pub fn joints(&self) -> &[[u16; 4]] {
        &self.joints
    }

    /// The weights of each vertex: finite, non-negative, summing to 1.
    pub fn weights(&self) -> &[[f32; 4]] {
        &self.weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::Joint;
    use if_core::math::Point;
    use if_core::mesh::TriMesh;

    fn two() -> SkinWeights {
        SkinWeights::new(
            vec![[0, 1, 0, 0], [2, 0, 0, 0]],
            vec![[0.25, 0.75, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]],
            3,
        )
        .unwrap()
    }

    fn ply() -> PlyMesh {
        let mesh = TriMesh::new(vec![Point::origin(), Point::new(1.0, 0.0, 0.0)], vec![]).unwrap();
        PlyMesh { mesh, vertex_properties: two().to_properties(), ..PlyMesh::default() }
    }

    #[test]
    fn properties_give_the_same_weights_again() {
        assert_eq!(SkinWeights::from_ply(&ply(), 3).unwrap(), two());
        let joint = SkinWeights::from_ply(&ply(), 2);
        assert_eq!(joint, Err(SkinError::Joint { vertex: 1, joint: 2, count: 2 }));
        let mut lacking = ply();
        lacking.vertex_properties.retain(|p| p.name != "w2");
        assert_eq!(
            SkinWeights::from_ply(&lacking, 3),
            Err(SkinError::Missing { name: "w2".into() })
        );
        let mut swapped = ply();
        swapped.vertex_properties[0].values = Column::F32(vec![0.0; 2]);
        assert!(matches!(SkinWeights::from_ply(&swapped, 3), Err(SkinError::Type { .. })));
    }

    #[test]
    fn weights_go_to_another_skeleton_by_the_names_of_joints() {
        let skeleton = |names: &[&str]| {
            let joint = |(k, name): (usize, &&str)| Joint {
                name: name.to_string(),
                parent: k.checked_sub(1).map(|_| 0),
                head: Point::origin(),
                tail: Point::new(0.0, 0.1, 0.0),
            };
            Skeleton::new(names.iter().enumerate().map(joint).collect()).unwrap()
        };
        let own = skeleton(&["hips", "left", "right", "tail"]);
        let weights = [[0.25, 0.75, 0.0, 0.0], [0.5, 0.0, 0.5, 0.0]].to_vec();
        let skin = SkinWeights::new(vec![[0, 1, 3, 0], [2, 3, 1, 0]], weights.clone(), 4).unwrap();
        let other = skeleton(&["hips", "right", "left"]);
        let moved = skin.clone().for_skeleton(&own, &other).unwrap();
        assert_eq!(moved, SkinWeights::new(vec![[0, 2, 0, 0], [1, 0, 2, 0]], weights, 3).unwrap());
        assert_eq!(skin.clone().for_skeleton(&own, &own), Some(skin.clone()));
        assert_eq!(skin.for_skeleton(&own, &skeleton(&["hips", "left"])), None);
    }

    #[test]
    fn joints_of_a_gltf_skin_belong_to_the_skeleton_by_name() {
        let names = ["hip", "knee", "foot", "toe", "hand", "head"];
        let of = |joints: &[&str], of_vertex: Vec<Vec<(usize, f64)>>| {
            let joints = joints.iter().map(ToString::to_string).collect();
            SkinWeights::from_gltf(&Influences { joints, of_vertex }, names.into_iter())
        };
        let weights = of(&["knee", "hip"], vec![vec![(1, 0.25), (0, 0.75)], vec![(0, 2.0)]]);
        let expected = SkinWeights::new(
            vec![[1, 0, 0, 0]; 2],
            vec![[0.75, 0.25, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]],
            6,
        );
        assert_eq!(weights, expected);
        // Of five joints the one with the smallest weight goes.
        let five = vec![(0, 0.3), (1, 0.1), (2, 0.05), (3, 0.2), (4, 0.35)];
        let weights = of(&names[..5], vec![five]).unwrap();
        assert_eq!(weights.joints()[0], [4, 0, 3, 1]);
        assert!((weights.weights()[0][0] - 0.35 / 0.95).abs() < 1e-6);
        let left_out = weights.left_out().unwrap();
        assert!(left_out.vertices == 1 && (left_out.largest - 0.05).abs() < 1e-9, "{left_out:?}");
        // Equal joints, as in copies of an armature or in two sets, are one.
        let twice = vec![(0, 0.15), (1, 0.2), (2, 0.2), (3, 0.2), (4, 0.1), (0, 0.15)];
        let weights = of(&names[..5], vec![twice]).unwrap();
        assert_eq!(weights.joints()[0], [0, 1, 2, 3]);
        assert!((weights.weights()[0][0] - 0.3 / 0.9).abs() < 1e-6);
        let tail = of(&["hip", "tail"], vec![vec![(0, 1.0)], vec![(1, 1.0)]]);
        assert_eq!(tail, Err(SkinError::UnknownJoint { vertex: 1, name: "tail".into() }));
        assert!(matches!(of(&["hip"], vec![vec![]]), Err(SkinError::Sum { vertex: 0, .. })));
        let beyond = of(&["hip"], vec![vec![(5, 1.0)]]);
        assert_eq!(beyond, Err(SkinError::Joint { vertex: 0, joint: 5, count: 1 }));
    }

    #[test]
    fn invalid_weights_are_errors() {
        let new = |w: [f32; 4]| SkinWeights::new(vec![[0; 4]], vec![w], 1);
        assert_eq!(new([0.5, 0.49, 0.0, 0.0]).unwrap().weights()[0].iter().sum::<f32>(), 1.0);
        for w in [[0.0; 4], [0.5, 0.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0]] {
            assert!(matches!(new(w), Err(SkinError::Sum { vertex: 0, .. })), "{w:?}");
        }
        for w in [[-0.5, 1.5, 0.0, 0.0], [f32::NAN, 1.0, 0.0, 0.0]] {
            assert!(matches!(new(w), Err(SkinError::Weight { vertex: 0, slot: 0, .. })), "{w:?}");
        }
        assert_eq!(
            SkinWeights::new(vec![[0; 4]], vec![], 1),
            Err(SkinError::Count { vertices: 1, records: 0 })
        );
    }
}
