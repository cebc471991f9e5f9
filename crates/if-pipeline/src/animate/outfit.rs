//! Outfits with skinning weights.

use if_body::skinning::{blends, pose_points, transferred_weights};
use if_body::{LeftOut, Pose, PoseError, Skeleton, SkinError, SkinWeights};
use if_core::math::{Point, Real, Vector};
use if_mesh::file::MeshFile;
use if_mesh::measure::percentile;
use if_outfit::Outfit;

/// An outfit, its skeleton, and skinning weights of all layers.
#[derive(Clone, Debug)]
pub struct SkinnedOutfit {
    /// Body and garments in the rest pose, in metres, clean.
    pub outfit: Outfit,
    /// The joints.
    pub skeleton: Skeleton,
    /// The weights of all vertices, the body's first, then the garments', inner to outer.
    skin: SkinWeights,
    /// Names of garments whose weights were taken from the body.
    pub without_weights: Vec<String>,
    /// Layers of whose weights some are left out, and how many.
    pub left_out: Vec<(String, LeftOut)>,
}

/// The skinning weights of a layer are missing or invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("layer `{layer}`: {source}")]
pub struct SkinFault {
    /// Its name.
    pub layer: String,
    /// What is wrong.
    pub source: SkinError,
}

/// Median distance of joints from the skin that they bend, as a share of the body's size, beyond which they
/// are another body's. On three bodies of 1.6 to 1.7 m it is 0.014 to 0.016 with their own skeletons, and at
/// least 0.07 with one another's.
const MISPLACED: Real = 0.04;
/// Sum of the products of two joints' weights above which they bend skin.
const BENT: Real = 0.5;

impl SkinnedOutfit {
    /// An outfit with the weights of each layer, the body's first; garments with `None` get theirs
    /// from the body ([`transferred_weights`]).
    ///
    /// # Errors
    ///
    /// The body has no weights, weights are not as many as vertices, or a joint is missing.
    ///
    /// # Panics
    ///
    /// If there is not one entry for each layer.
    pub fn new(
        outfit: Outfit,
        skeleton: Skeleton,
        skins: Vec<Option<SkinWeights>>,
    ) -> Result<Self, SkinFault> {
        let layers: Vec<_> = outfit.layers().collect();
        assert_eq!(layers.len(), skins.len(), "one entry for each layer");
        let (mut joints, mut weights) = (Vec::new(), Vec::new());
        let (mut without_weights, mut left_out) = (Vec::new(), Vec::new());
        let count = skeleton.len();
        let mut body: Option<SkinWeights> = None;
        for (layer, skin) in layers.iter().zip(skins) {
            let fault = |source| SkinFault { layer: layer.name.clone(), source };
            let points = layer.mesh.vertices();
            let skin = match (skin, &body) {
                (Some(skin), _) => skin,
                (None, None) => return Err(fault(SkinError::NoWeights)),
                (None, Some(body)) => {
                    without_weights.push(layer.name.clone());
                    transferred_weights(&layers[0].mesh, body, &layer.mesh, count).map_err(fault)?
                }
            };
            skin.check(points.len(), count).map_err(fault)?;
            left_out.extend(skin.left_out().map(|of| (layer.name.clone(), of)));
            joints.extend_from_slice(skin.joints());
            weights.extend_from_slice(skin.weights());
            body.get_or_insert(skin);
        }
        let fault = |source| SkinFault { layer: layers[0].name.clone(), source };
        let skin = SkinWeights::new(joints, weights, count).map_err(fault)?;
        Ok(Self { outfit, skeleton, skin, without_weights, left_out })
    }

    /// The same with weights from the files of the layers, the body's first, where they have some
    /// ([`SkinWeights::from_file`]).
    ///
    /// # Errors
    ///
    /// As [`SkinnedOutfit::new`], and properties that are invalid.
    ///
    /// # Panics
    ///
    /// If there is not one file for each layer.
    pub fn from_files<'a>(
        outfit: Outfit,
        skeleton: Skeleton,
        files: impl Iterator<Item = &'a MeshFile>,
    ) -> Result<Self, SkinFault> {
        let read = |(layer, file): (&if_outfit::Layer, &MeshFile)| {
            SkinWeights::from_file(file, &skeleton)
                .map_err(|source| SkinFault { layer: layer.name.clone(), source })
        };
        let skins = outfit.layers().zip(files).map(read).collect::<Result<Vec<_>, _>>()?;
        Self::new(outfit, skeleton, skins)
    }

    /// How far the skeleton lies from the body, in metres, if it may be that of another one: the median
    /// distance of a joint from the middle of the skin that it bends, where that is more than a share of the
    /// body's size. `None` if it fits, or no joint bends any skin.
    pub fn misplaced_skeleton(&self) -> Option<Real> {
        let body = self.outfit.body.mesh.vertices();
        let joints = self.skeleton.joints();
        let mut middles = vec![(Vector::zeros(), 0.0); joints.len()];
        for ((own, weights), p) in self.skin.joints().iter().zip(self.skin.weights()).zip(body) {
            let of = |joint: usize| {
                let all = own.iter().zip(weights);
                all.filter(|(j, _)| usize::from(**j) == joint).map(|(_, w)| Real::from(*w)).sum()
            };
            for (joint, weight) in own.iter().map(|j| usize::from(*j)).zip(weights) {
                let bent: Real = Real::from(*weight) * joints[joint].parent.map_or(0.0, of);
                middles[joint].0 += p.coords * bent;
                middles[joint].1 += bent;
            }
        }
        let bends = joints.iter().zip(middles).filter(|(_, (_, bent))| *bent > BENT);
        let mut distances: Vec<Real> =
            bends.map(|(joint, (sum, bent))| (joint.head.coords - sum / bent).norm()).collect();
        distances.sort_unstable_by(Real::total_cmp);
        let median = percentile(&distances, 50.0);
        (median > MISPLACED * self.outfit.body.mesh.aabb().size().max()).then_some(median)
    }

    /// The weights of all vertices, the body's first.
    pub fn skin(&self) -> &SkinWeights {
        &self.skin
    }

    /// The positions of all layers, the body first.
    pub fn positions(&self) -> Vec<Point> {
        self.outfit.layers().flat_map(|layer| layer.mesh.vertices()).copied().collect()
    }

    /// `points` in a pose, one for each vertex of all layers, by linear blend skinning.
    ///
    /// # Errors
    ///
    /// A pose of another number of joints.
    ///
    /// # Panics
    ///
    /// If the points are not as many as the vertices.
    pub fn posed(&self, points: &[Point], pose: &Pose) -> Result<Vec<Point>, PoseError> {
        let transforms = self.skeleton.transforms(pose)?;
        Ok(pose_points(points, &blends(&self.skin, &transforms)))
    }
}
