//! The orientation and the focal length of a camera that are off by a constant error.

use super::terms::silhouette_slope;
use crate::reconstruct::figure::{Figure, RimPoint};
use crate::reconstruct::observe::Observation;
use crate::reconstruct::projection::pixels_per_metre;
use if_body::TemplateBody;
use if_core::edges::Edges;
use if_core::math::{Real, Vector};
use if_mesh::camera::Camera;
use nalgebra::{Matrix5, UnitQuaternion, Vector5};
use rayon::prelude::*;

/// Residuals in metres at which weights fall to 0.7, a step each: the first sees errors of some
/// degrees, the last the thickness of clothes.
const OUTLIERS: [Real; 6] = [0.2, 0.1, 0.05, 0.03, 0.02, 0.02];
/// Largest distance of a silhouette from the mask's border, in metres.
const REACH: Real = 0.3;
/// Standard deviation of the mean distance of clothes from the body, in metres.
const CLOTHES: Real = 0.03;
/// Standard deviation of the focal length, as a share of it.
const FOCAL: Real = 0.02;
/// A share by which the focal length is off below which it stays: where it is exact, clothes of
/// other thickness at head and feet are taken for 0.4 to 0.8 %, in one of 16,000 pixels for 1.5 %.
const LEAST_FOCAL: Real = 0.015;
/// Standard deviation of a silhouette's vertex, in metres: neighbours err together.
const SILHOUETTE: Real = 0.2;

/// The camera turned about its centre, and its focal lengths multiplied by s, so that the posed
/// template lies evenly within the masks.
///
/// ```text
/// least over ω, s, c of  Σ w ρ(r(ω, s) + c) / σ²  +  |ω|² / σ_ω²  +  ln² s / σ_s²  +  c² / σ_c²
/// ```
///
/// with r the signed distance of the template's silhouette from the masks' borders, over all frames,
/// and c the thickness of clothes. A turn that moves the person by less than `negligible` metres is
/// left to the poses, and a focal length that is hardly off stays: `None` if both do.
pub(super) fn corrected(
    camera: &Camera,
    template: &TemplateBody,
    frames: &[Observation],
    degrees: Real,
    negligible: Real,
) -> Option<Camera> {
    let edges = Edges::new(&template.mesh);
    let (mut turn, mut clothes) = (UnitQuaternion::identity(), 0.0);
    let mut zoom = 1.0;
    let mut moved = 0.0;
    for outlier in OUTLIERS {
        let now = camera.turned(&turn).zoomed(zoom).ok()?;
        let terms = frames.par_iter().map(|frame| {
            let skin = &template.skin;
            let figure = Figure::new(&template.mesh, &edges, skin, &now, &frame.transforms);
            let (mut h, mut g, mut far) = (Matrix5::zeros(), Vector5::zeros(), (0.0, 0.0));
            for point in figure.rim(&frame.outside, REACH) {
                let p = &figure.points[point.vertex];
                let scale = pixels_per_metre(&now);
                // The template lies within the clothes, and is no fitted surface: its silhouette
                // counts where it is, whatever its outline.
                let metres = point.metres + point.own * p.z / scale;
                let point = RimPoint { metres, ..point };
                let along = silhouette_slope(&now, &frame.outside, &point, p, scale);
                let along = now.rotation() * along.transpose();
                let by_turn = p.coords.cross(&along);
                let by_zoom = along.x * p.x + along.y * p.y;
                let residual = point.metres + clothes;
                let weight = point.weight / (1.0 + (residual / outlier).powi(2)).sqrt();
                let row = Vector5::new(by_turn.x, by_turn.y, by_turn.z, 1.0, by_zoom);
                h += row * row.transpose() * (weight / SILHOUETTE.powi(2));
                g += row * (weight * residual / SILHOUETTE.powi(2));
                let by_now = turn.scaled_axis().cross(&p.coords).norm();
                far = (far.0 + point.weight * by_now, far.1 + point.weight);
            }
            (h, g, far)
        });
        let terms: Vec<_> = terms.collect();
        let sigma = degrees.to_radians();
        let prior = Vector5::new(sigma, sigma, sigma, CLOTHES, FOCAL).map(|s| s.powi(-2));
        let mut h = Matrix5::from_diagonal(&prior);
        let axis = turn.scaled_axis();
        let mut g =
            Vector5::new(axis.x, axis.y, axis.z, clothes, Real::ln(zoom)).component_mul(&prior);
        let mut far = (0.0, 0.0);
        for (h_frame, g_frame, far_frame) in terms {
            h += h_frame;
            g += g_frame;
            far = (far.0 + far_frame.0, far.1 + far_frame.1);
        }
        moved = if far.1 > 0.0 { far.0 / far.1 } else { 0.0 };
        let step = -h.cholesky()?.solve(&g);
        turn = UnitQuaternion::from_scaled_axis(Vector::new(step.x, step.y, step.z)) * turn;
        clothes += step[3];
        zoom *= step[4].exp();
    }
    let [is_turned, is_zoomed] = [moved > negligible, (zoom - 1.0).abs() > LEAST_FOCAL];
    let found = if is_turned { camera.turned(&turn) } else { camera.clone() };
    let found = if is_zoomed { found.zoomed(zoom).ok()? } else { found };
    (is_turned || is_zoomed).then_some(found)
}
