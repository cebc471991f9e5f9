//! How well a surface explains the images: residuals of frames and joints, and what to doubt.

use super::figure::Figure;
use super::observe::Observation;
use super::projection::pixels_per_metre;
use if_body::{Skeleton, SkinWeights};
use if_core::edges::Edges;
use if_core::math::{Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::camera::Camera;
use if_mesh::raster::NOTHING;
use nalgebra::Point2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

// Limits: frames of four captures with exact poses and clothes that move by 10 mm are off by at most
// 7 mm, 18° and 0.4 % of their pixels, and by 22° with normals that are 12° off; with poses 3° and
// 9 mm off half the frames are off by more than 15 mm and 23°, and the worst by 29 mm, 31° and 10 %
// (docs/evidence/reconstruction.md).

/// Largest residual of a frame's silhouettes, in millimetres and in pixels; the larger counts.
const FRAME_SILHOUETTE: (Real, Real) = (10.0, 1.5);
/// Largest residual of a frame's normals, in degrees.
const FRAME_NORMAL: Real = 25.0;
/// Largest share of a frame's pixels that lie outside the mask by more than its silhouettes may, and
/// of those of a joint in a frame.
const FRAME_OUTSIDE: Real = 0.1;
const JOINT_OUTSIDE: Real = 0.4;
/// The other limits of a joint in a frame, as multiples.
const JOINT_SILHOUETTE: Real = 3.0;
const JOINT_NORMAL: Real = 2.4;
/// Least weight of silhouette vertices of a joint in a frame, and least share of the frame's pixels:
/// less is noise.
const LEAST: (Real, Real) = (5.0, 0.02);

/// Largest distance from the mask's border at which a silhouette is attributed to it, in metres.
const REACH: Real = 0.15;
/// Largest distance inside the mask that counts, in metres. What lies deeper is a gap between limbs
/// that the mask closes.
const INSIDE: Real = 0.02;
/// Least cosine between line of sight and surface for normals to be compared.
const FACING: Real = 0.3;

/// What separates a surface from images.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Residual {
    /// Root mean square distance of silhouettes from the masks' borders, in millimetres.
    pub silhouette_mm: Real,
    /// Root mean square angle between normals, in degrees.
    pub normal_degrees: Real,
    /// Share of the surface's pixels that lie outside the mask by more than the limit of silhouettes.
    pub outside: Real,
}

/// Residual of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FrameQuality {
    /// Its index in the capture; in a [`super::ReconstructReport`] its number there.
    pub frame: usize,
    /// Its residual.
    pub residual: Residual,
}

/// Residual of a joint in all frames.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct JointQuality {
    /// The joint.
    pub name: String,
    /// The residual of the surface that follows it more than other joints.
    pub residual: Residual,
}

/// A frame, or a joint in a frame, with a residual beyond the limits: its pose or its images are
/// wrong.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Doubt {
    /// Its index in the capture; in a [`super::ReconstructReport`] its number there.
    pub frame: usize,
    /// The joint; `None` for the frame as a whole.
    pub joint: Option<String>,
    /// The residual.
    pub residual: Residual,
}

/// How well a surface explains the images.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct QualityReport {
    /// Of all frames.
    pub all: Residual,
    /// Largest residual of a frame that is not doubted.
    pub limit: Residual,
    /// Of each frame.
    pub frames: Vec<FrameQuality>,
    /// Of each joint.
    pub joints: Vec<JointQuality>,
    /// Residuals beyond the limits.
    pub doubts: Vec<Doubt>,
}

/// Weighted sums of squared metres and radians.
#[derive(Clone, Copy, Default)]
struct Sums {
    silhouettes: (Real, Real),
    normals: (Real, Real),
    /// Pixels outside the mask, and all.
    outside: (Real, Real),
}

impl Sums {
    fn silhouette(&mut self, metres: Real, weight: Real) {
        self.silhouettes.0 += weight * metres * metres;
        self.silhouettes.1 += weight;
    }

    fn normal(&mut self, angle: Real) {
        self.normals.0 += angle * angle;
        self.normals.1 += 1.0;
    }

    fn of<'a>(parts: impl IntoIterator<Item = &'a Self>) -> Self {
        parts.into_iter().fold(Self::default(), |a, b| Self {
            silhouettes: (a.silhouettes.0 + b.silhouettes.0, a.silhouettes.1 + b.silhouettes.1),
            normals: (a.normals.0 + b.normals.0, a.normals.1 + b.normals.1),
            outside: (a.outside.0 + b.outside.0, a.outside.1 + b.outside.1),
        })
    }

    /// Zero without any evidence.
    fn residual(&self) -> Residual {
        let mean = |(sum, weight): (Real, Real)| if weight > 0.0 { sum / weight } else { 0.0 };
        Residual {
            silhouette_mm: 1e3 * mean(self.silhouettes).sqrt(),
            normal_degrees: mean(self.normals).sqrt().to_degrees(),
            outside: mean(self.outside),
        }
    }
}

/// Compares a surface with the images of frames.
pub(super) fn measure(
    mesh: &TriMesh,
    edges: &Edges,
    skin: &SkinWeights,
    skeleton: &Skeleton,
    camera: &Camera,
    frames: &[Observation],
) -> QualityReport {
    let joints = strongest(skin);
    let (mm, pixels) = FRAME_SILHOUETTE;
    let scale = pixels_per_metre(camera);
    let cells: Vec<(Vec<Sums>, Real)> = frames
        .par_iter()
        .map(|frame| {
            let figure = Figure::new(mesh, edges, skin, camera, &frame.transforms);
            let depth = figure.points.iter().map(|p| p.z).sum::<Real>();
            let depth = depth / figure.points.len().max(1) as Real;
            let limit_mm = mm.max(pixels * 1e3 * depth / scale);
            let mut sums = vec![Sums::default(); skeleton.len()];
            for rim in figure.rim(&frame.outside, REACH) {
                sums[joints[rim.vertex]].silhouette(rim.metres.max(-INSIDE), rim.weight);
            }
            let margin = 1e-3 * limit_mm * scale / depth;
            add_pixels(&mut sums, &figure, frame, margin, &joints);
            (sums, limit_mm)
        })
        .collect();

    let limit_mm = cells.iter().map(|c| c.1).sum::<Real>() / cells.len().max(1) as Real;
    let limit =
        Residual { silhouette_mm: limit_mm, normal_degrees: FRAME_NORMAL, outside: FRAME_OUTSIDE };
    let of_joint = Residual {
        silhouette_mm: JOINT_SILHOUETTE * limit.silhouette_mm,
        normal_degrees: JOINT_NORMAL * limit.normal_degrees,
        outside: JOINT_OUTSIDE,
    };
    let beyond = |r: &Residual, limit: &Residual| {
        r.silhouette_mm > limit.silhouette_mm
            || r.normal_degrees > limit.normal_degrees
            || r.outside > limit.outside
    };
    let mut report = QualityReport {
        all: Sums::of(cells.iter().flat_map(|c| &c.0)).residual(),
        limit,
        ..Default::default()
    };
    for (j, name) in skeleton.names().enumerate() {
        let residual = Sums::of(cells.iter().map(|c| &c.0[j])).residual();
        report.joints.push(JointQuality { name: name.into(), residual });
    }
    for (frame, (sums, _)) in frames.iter().map(|f| f.frame).zip(&cells) {
        let whole = Sums::of(sums);
        let residual = whole.residual();
        report.frames.push(FrameQuality { frame, residual });
        if beyond(&residual, &limit) {
            report.doubts.push(Doubt { frame, joint: None, residual });
        }
        for (sums, name) in sums.iter().zip(skeleton.names()) {
            let mut enough = *sums;
            if enough.silhouettes.1 < LEAST.0 {
                enough.silhouettes = (0.0, 0.0);
            }
            if enough.outside.1 < LEAST.1 * whole.outside.1 {
                (enough.normals, enough.outside) = Default::default();
            }
            let residual = enough.residual();
            if beyond(&residual, &of_joint) {
                report.doubts.push(Doubt { frame, joint: Some(name.into()), residual });
            }
        }
    }
    report
}

/// Adds the surface's pixels: whether they lie more than `margin` pixels outside the mask, and the
/// angles between observed normals and the surface's.
fn add_pixels(
    sums: &mut [Sums],
    figure: &Figure,
    frame: &Observation,
    margin: Real,
    joints: &[usize],
) {
    let width = figure.camera.width();
    for (i, (&t, n)) in figure.seen.triangle.iter().zip(&frame.normals).enumerate() {
        if t == NOTHING {
            continue;
        }
        let corner = figure.mesh.triangles()[t as usize][0] as usize;
        let sums = &mut sums[joints[corner]];
        sums.outside.0 += if Real::from(frame.outside.pixel(i)) > margin { 1.0 } else { 0.0 };
        sums.outside.1 += 1.0;
        if *n == [0.0; 3] {
            continue;
        }
        let observed = Vector::new(n[0].into(), n[1].into(), n[2].into());
        let observed = figure.camera.rotation() * observed;
        let normal = figure.face_normal(t);
        let center = Point2::new((i % width) as Real + 0.5, (i / width) as Real + 0.5);
        if -normal.dot(&unit_or_zero(&figure.camera.pixel_direction(&center))) > FACING {
            sums.normal(normal.dot(&observed).clamp(-1.0, 1.0).acos());
        }
    }
}

/// The joint of the largest weight of each vertex.
fn strongest(skin: &SkinWeights) -> Vec<usize> {
    let joint = |(joints, weights): (&[u16; 4], &[f32; 4])| {
        let k = (1..4).fold(0, |most, k| if weights[k] > weights[most] { k } else { most });
        usize::from(joints[k])
    };
    skin.joints().iter().zip(skin.weights()).map(joint).collect()
}
