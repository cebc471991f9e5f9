//! Which joints each vertex hangs on.

use if_mesh::ply::{Column, PlyMesh, Property};

/// Up to four joints and their weights for each vertex. Weights are not negative and sum to 1.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct SkinWeights {
    joints: Vec<[u16; 4]>,
    weights: Vec<[f32; 4]>,
}

/// Why numbers make no skinning weights.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum SkinWeightsError {
    /// The file has no such property.
    #[error(
        "the mesh has no vertex property `{name}`; skinning needs integers j0 to j3 and floats w0 to w3"
    )]
    Missing { name: String },
    /// The file has it with another type.
    #[error(
        "vertex property `{name}` has the type {found}; j0 to j3 must be integers, w0 to w3 floats, and none lists"
    )]
    Type { name: String, found: String },
    /// Lists of different lengths.
    #[error("{joints} vertices have joints, but {weights} have weights")]
    Count { joints: usize, weights: usize },
    /// A joint that the skeleton does not have.
    #[error(
        "vertex {vertex} hangs on joint {joint}, but the skeleton has only {count} (0 is the first)"
    )]
    Joint { vertex: usize, joint: i64, count: usize },
    /// A weight is negative, NaN or infinite.
    #[error(
        "weight {slot} of vertex {vertex} is {weight}; weights must be finite and not negative"
    )]
    Weight { vertex: usize, slot: usize, weight: f32 },
    /// All weights of a vertex are zero, or they are far from 1 in sum.
    #[error("the weights of vertex {vertex} sum to {sum}; they must sum to 1")]
    Sum { vertex: usize, sum: f32 },
}

/// How far the sum of a vertex's weights may lie from 1 before they are normalised. Four weights of
/// two decimals can miss 0.02; ten times more would hide a lost joint.
const SUM: f32 = 0.03;

impl SkinWeights {
    /// Checks, normalises and takes the joints and weights of each vertex, for a skeleton of
    /// `count` joints.
    ///
    /// # Errors
    ///
    /// The first vertex that does not fit. A joint of weight zero must exist all the same.
    pub fn new(
        joints: Vec<[u16; 4]>,
        mut weights: Vec<[f32; 4]>,
        count: usize,
    ) -> Result<Self, SkinWeightsError> {
        if joints.len() != weights.len() {
            return Err(SkinWeightsError::Count { joints: joints.len(), weights: weights.len() });
        }
        for (vertex, (j, w)) in joints.iter().zip(&mut weights).enumerate() {
            for slot in 0..4 {
                if usize::from(j[slot]) >= count {
                    return Err(SkinWeightsError::Joint { vertex, joint: j[slot].into(), count });
                }
                if !(w[slot].is_finite() && w[slot] >= 0.0) {
                    return Err(SkinWeightsError::Weight { vertex, slot, weight: w[slot] });
                }
            }
            let sum: f32 = w.iter().sum();
            if (sum - 1.0).abs() > SUM {
                return Err(SkinWeightsError::Sum { vertex, sum });
            }
            *w = w.map(|x| x / sum);
        }
        Ok(Self { joints, weights })
    }

    /// The properties j0 to j3 and w0 to w3 of a PLY file, for a skeleton of `count` joints.
    ///
    /// # Errors
    ///
    /// A property that is missing or of another type, and as [`SkinWeights::new`].
    pub fn from_ply(ply: &PlyMesh, count: usize) -> Result<Self, SkinWeightsError> {
        let property = |name: String| {
            let found = ply
                .vertex_property(&name)
                .ok_or(SkinWeightsError::Missing { name: name.clone() })?;
            let integer = found.values.scalar_type().is_integer();
            if found.lists.is_some() || integer != name.starts_with('j') {
                let list = if found.lists.is_some() { "list of " } else { "" };
                return Err(SkinWeightsError::Type {
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
                    return Err(SkinWeightsError::Joint { vertex, joint: j as i64, count });
                }
                joints[vertex][slot] = j as u16;
            }
            for (vertex, w) in property(format!("w{slot}"))?.into_iter().enumerate() {
                weights[vertex][slot] = w as f32;
            }
        }
        Self::new(joints, weights, count)
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

    /// The first vertex that names a joint beyond the first `count`, and that joint: `None` where
    /// the weights fit a skeleton of `count` joints.
    pub fn beyond(&self, count: usize) -> Option<(usize, u16)> {
        self.joints.iter().enumerate().find_map(|(vertex, on)| {
            on.iter().find(|j| usize::from(**j) >= count).map(|j| (vertex, *j))
        })
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// The joints of each vertex.
    pub fn joints(&self) -> &[[u16; 4]] {
        &self.joints
    }

    /// The weights of each vertex: finite, not negative, of sum 1.
    pub fn weights(&self) -> &[[f32; 4]] {
        &self.weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
        assert_eq!(joint, Err(SkinWeightsError::Joint { vertex: 1, joint: 2, count: 2 }));
        let mut lacking = ply();
        lacking.vertex_properties.retain(|p| p.name != "w2");
        assert_eq!(
            SkinWeights::from_ply(&lacking, 3),
            Err(SkinWeightsError::Missing { name: "w2".into() })
        );
        let mut swapped = ply();
        swapped.vertex_properties[0].values = Column::F32(vec![0.0; 2]);
        assert!(matches!(SkinWeights::from_ply(&swapped, 3), Err(SkinWeightsError::Type { .. })));
    }

    #[test]
    fn weights_that_are_none_are_named() {
        let new = |w: [f32; 4]| SkinWeights::new(vec![[0; 4]], vec![w], 1);
        assert_eq!(new([0.5, 0.49, 0.0, 0.0]).unwrap().weights()[0].iter().sum::<f32>(), 1.0);
        for w in [[0.0; 4], [0.5, 0.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0]] {
            assert!(matches!(new(w), Err(SkinWeightsError::Sum { vertex: 0, .. })), "{w:?}");
        }
        for w in [[-0.5, 1.5, 0.0, 0.0], [f32::NAN, 1.0, 0.0, 0.0]] {
            assert!(
                matches!(new(w), Err(SkinWeightsError::Weight { vertex: 0, slot: 0, .. })),
                "{w:?}"
            );
        }
        assert_eq!(
            SkinWeights::new(vec![[0; 4]], vec![], 1),
            Err(SkinWeightsError::Count { joints: 1, weights: 0 })
        );
    }
}
