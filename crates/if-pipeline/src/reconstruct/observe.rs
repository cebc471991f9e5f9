//! Observations: the images of a frame, prepared for fitting.

use super::distance_image::DistanceImage;
use super::error::ReconstructError;
use super::params::SurfaceParams;
use super::progress;
use super::skipped::Skipped;
use crate::capture::{BACKGROUND, Capture};
use if_body::Skeleton;
use if_core::math::Vector;
use if_core::monitor::Monitor;
use if_mesh::camera::Camera;
use nalgebra::{Isometry3, Matrix3};
use rayon::prelude::*;

/// Least share of the picture that a person covers; less is noise: 65 pixels of 256². Ten times
/// more would lose a person far away.
const LEAST_PERSON: f64 = 1e-3;

/// Pixels on both sides of a border between labels whose normals are not used.
const BORDER: usize = 2;

/// Frames per thread between two progress reports.
const TOGETHER: usize = 2;

/// A usable frame.
pub(super) struct Observation {
    /// Its index in the capture.
    pub(super) frame: usize,
    /// The skinning transforms of the pose.
    pub(super) transforms: Vec<Isometry3<f64>>,
    /// Signed distance from the border of the mask, in pixels, positive outside.
    pub(super) outside: DistanceImage,
    /// Unit normals in world space; zero where missing, too close to the border of the mask to be
    /// reliable, or beside a border of labels: a hem steps down to what is below it, which normals do not
    /// show. Used, they would draw the one in and the other out.
    pub(super) normals: Vec<[f32; 3]>,
}

impl Observation {
    /// Turns the normals by `turn`, for another camera.
    pub(super) fn turn_normals(&mut self, turn: &Matrix3<f64>) {
        for n in self.normals.iter_mut().filter(|n| **n != [0.0; 3]) {
            *n = (turn * Vector::from(n.map(f64::from))).map(|x| x as f32).into();
        }
    }
}

/// Reads a frame of a capture; the inner error is the reason to skip it.
pub(super) fn observe(
    capture: &Capture,
    skeleton: &Skeleton,
    frame: usize,
    params: &SurfaceParams,
) -> Result<Result<Observation, Skipped>, ReconstructError> {
    let transforms = skeleton
        .transforms(capture.pose(frame))
        .map_err(|source| ReconstructError::Pose { frame, source })?;
    let mask = capture.mask(frame)?;
    let pixels = mask.iter().filter(|m| **m).count();
    if (pixels as f64) < LEAST_PERSON * mask.len() as f64 {
        return Ok(Err(Skipped::NoPerson { frame, pixels }));
    }
    if pixels == mask.len() {
        return Ok(Err(Skipped::NoBorder { frame }));
    }
    let camera = capture.camera();
    let mut normals = capture.normals(frame)?;
    let labels = capture.label_image(frame)?;
    for (i, n) in normals.iter_mut().enumerate() {
        if is_beside_another_label(&labels, camera.width(), i) {
            *n = [0.0; 3];
        }
    }
    Ok(Ok(prepared(camera, frame, transforms, &mask, normals, params)))
}

/// Whether a pixel of the person lies within [`BORDER`] pixels of one with another label.
fn is_beside_another_label(labels: &[u8], width: usize, i: usize) -> bool {
    let (x, y, own) = (i % width, i / width, labels[i]);
    let rows = y.saturating_sub(BORDER)..(y + BORDER + 1).min(labels.len() / width);
    let columns = x.saturating_sub(BORDER)..(x + BORDER + 1).min(width);
    let differs = |label: &u8| *label != own && *label != BACKGROUND;
    own != BACKGROUND
        && rows.into_iter().any(|v| labels[v * width..][columns.clone()].iter().any(differs))
}

/// Reads the frames that the surface did not skip, in order.
pub(super) fn observe_used(
    capture: &Capture,
    skeleton: &Skeleton,
    skipped: &[Skipped],
    params: &SurfaceParams,
    monitor: &mut dyn Monitor,
) -> Result<Vec<Observation>, ReconstructError> {
    let numbers: Vec<usize> = Skipped::others(skipped, capture).collect();
    let mut frames = Vec::with_capacity(numbers.len());
    for group in numbers.chunks(TOGETHER * rayon::current_num_threads()) {
        progress::report(monitor, "read", (group[0], capture.len()), None)?;
        let seen: Vec<_> =
            group.par_iter().map(|k| observe(capture, skeleton, *k, params)).collect();
        for frame in seen {
            // Frames that the surface could not use are skipped here, too.
            frames.extend(frame?);
        }
    }
    Ok(frames)
}

/// Prepares the images of a frame. `normals` are in the camera's frame.
pub(super) fn prepared(
    camera: &Camera,
    frame: usize,
    transforms: Vec<Isometry3<f64>>,
    mask: &[bool],
    mut normals: Vec<[f32; 3]>,
    params: &SurfaceParams,
) -> Observation {
    let (width, height) = (camera.width(), camera.height());
    let exact = DistanceImage::new(mask, width, height, 0.0);
    let outside = DistanceImage::new(mask, width, height, params.border_blur);
    let to_world = camera.rotation().transpose();
    for (i, n) in normals.iter_mut().enumerate() {
        let trusted = f64::from(exact.pixel(i)) < -params.normal_margin;
        if !trusted || *n == [0.0; 3] {
            *n = [0.0; 3];
            continue;
        }
        let world = to_world * Vector::new(n[0].into(), n[1].into(), n[2].into());
        *n = [world.x as f32, world.y as f32, world.z as f32];
    }
    Observation { frame, transforms, outside, normals }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_beside_a_border_of_labels_are_found_and_those_beside_the_background_are_not() {
        // Background, then five columns of one label and five of another, in three rows.
        let row = [0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2];
        let labels: Vec<u8> = row.repeat(3);
        let found: Vec<usize> =
            (0..12).filter(|i| is_beside_another_label(&labels, 12, 12 + i)).collect();
        assert_eq!(found, [5, 6, 7, 8]);
        // A speck of another label in the corner.
        let mut labels = vec![1; 36];
        labels[0] = 3;
        let found = (0..36).filter(|i| is_beside_another_label(&labels, 12, *i)).count();
        assert_eq!(found, 9);
    }
}
