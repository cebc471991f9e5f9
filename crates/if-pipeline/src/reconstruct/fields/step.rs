//! One step of training: the loss of a batch, and its derivatives.
//!
//! ```text
//! pixels       x ← Newton on φ(x) = 0 and LBS(x + d) on the ray;  1 − n · N
//! silhouettes  x ← φ(x) = 0;  distance of LBS(x + d) from the mask's border
//! near the surface  |∇φ| = 1, and little change of curvature
//! on the surface, in all frames  small and rigid d, with a mean of zero
//! ```

use super::nets::{Nets, field_of};
use super::params::{FieldsParams, FieldsWeights};
use super::place::{Adjoint, Offset, Place};
use super::report::Rays;
use super::scene::{Pixel, Rim, Scene};
use super::skin::Skin;
use super::terms::Terms;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_neural::network::Network;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Newton's method found a point if φ and the distance from the ray are at most this, in metres: a
/// twentieth of a pixel of the sample captures. Ten times more lets unfinished points in, ten times
/// less is what f32 resolves.
const FOUND: Real = 3e-4;
/// Longest Newton step, in metres.
const LONGEST: Real = 0.02;
/// Least cosine between the surface's normal and the line of sight. The derivative of the point
/// along the ray, and the area that a pixel sees, are divided by it.
const GRAZING: Real = 0.15;
/// Least cosine between an observed normal and the surface's for both to be of one point.
const SAME_PLACE: Real = 0.2;
/// Step of the differences of ∇φ and J, in metres: far below a cell of the grid, far above what f32
/// resolves.
const DIFFERENCE: Real = 1e-3;
/// Distance from the surface beyond which φ stays as it was, in metres: more than training moves
/// the surface.
const NOT_SEEN: Real = 0.05;
/// Distance of the two points whose change of normal is compared, in metres.
const APART: Real = 0.01;

/// Sums of what a step saw.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// The loss.
    pub(super) loss: Real,
    pub(super) rays: Rays,
    /// Sum of angles, in radians.
    pub(super) angle: Real,
    /// Sum of squared distances of silhouettes, in m², and their count.
    pub(super) silhouette: (Real, usize),
    /// Sum of | |∇φ| − 1 |, and the count of points.
    pub(super) eikonal: (Real, usize),
    /// Sums of |d|² and |mean of d|², in m², and their counts.
    pub(super) motion: (Real, usize),
    pub(super) mean_motion: (Real, usize),
}

/// What a step reads.
pub(super) struct Step<'a> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) nets: &'a Nets,
    /// φ before the first step.
    pub(super) start: &'a Network,
    pub(super) params: &'a FieldsParams,
    /// Points on the surface.
    pub(super) vertices: &'a [Point],
}

/// Random numbers of a step: a stream for each, so that nothing about batches has to be stored.
pub(super) fn random_of(seed: u64, step: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed ^ (step + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15))
}

impl Step<'_> {
    /// The derivatives of the loss of a random batch. Points found on rays replace those of
    /// `pixels`.
    pub(super) fn terms(
        &self,
        pixels: &mut [Pixel],
        rims: &[Rim],
        random: &mut Pcg64Mcg,
    ) -> (Terms, Sums) {
        let (mut terms, mut sums) = (Terms::default(), Sums::default());
        let mut choose = |count: usize, of: usize| -> Vec<usize> {
            if of == 0 {
                Vec::new()
            } else {
                (0..count).map(|_| random.random_range(0..of)).collect()
            }
        };
        let chosen = choose(self.params.rays, pixels.len());
        let rim: Vec<Rim> =
            choose(self.params.silhouettes, rims.len()).into_iter().map(|k| rims[k]).collect();
        self.normals(pixels, &chosen, &mut terms, &mut sums);
        self.silhouettes(&rim, &mut terms, &mut sums);
        self.near(random, &mut terms, &mut sums);
        self.far(random, &mut terms, &mut sums);
        self.material(random, &mut terms, &mut sums);
        (terms, sums)
    }

    /// The places of canonical points in frames of the scene.
    fn places(&self, x: &[Point], frames: &[u32], skins: &[Skin]) -> Vec<Option<Place>> {
        self.places_at(x, frames, skins, &self.offsets(x, frames))
    }

    /// d of canonical points in frames of the scene.
    fn offsets(&self, x: &[Point], frames: &[u32]) -> Vec<Offset> {
        let numbers: Vec<u32> = frames.iter().map(|k| self.number(*k)).collect();
        self.nets.offsets(x, &numbers)
    }

    /// The places of canonical points with given d.
    fn places_at(
        &self,
        x: &[Point],
        frames: &[u32],
        skins: &[Skin],
        offsets: &[Offset],
    ) -> Vec<Option<Place>> {
        let field = self.nets.field(x);
        let place = |k: usize| {
            let joints = &self.scene.joints[frames[k] as usize];
            Place::new(&x[k], field[k], &offsets[k], &skins[k], joints)
        };
        (0..x.len()).into_par_iter().with_min_len(64).map(place).collect()
    }

    /// The index in the capture of a frame of the scene.
    fn number(&self, frame: u32) -> u32 {
        self.scene.frames[frame as usize].frame as u32
    }

    fn normals(&self, pixels: &mut [Pixel], chosen: &[usize], terms: &mut Terms, sums: &mut Sums) {
        let batch: Vec<Pixel> = chosen.iter().map(|k| pixels[*k]).collect();
        let frames: Vec<u32> = batch.iter().map(|p| p.frame).collect();
        let mut x: Vec<Point> = batch.iter().map(|p| p.at).collect();
        let rays: Vec<(Point, Vector)> =
            batch.iter().map(|p| self.scene.ray(p.pixel as usize)).collect();
        let skins: Vec<Skin> = x.par_iter().with_min_len(64).map(|x| self.scene.skin(x)).collect();
        for _ in 0..self.params.newton {
            let places = self.places(&x, &frames, &skins);
            for ((x, place), (from, along)) in x.iter_mut().zip(&places).zip(&rays) {
                let step = place.as_ref().map(|p| p.step_to_line(from, along));
                if let Some(step) = step.filter(|s| s.norm().is_finite()) {
                    *x += step * (LONGEST / step.norm()).min(1.0);
                }
            }
        }
        let offsets = self.offsets(&x, &frames);
        let places = self.places_at(&x, &frames, &skins, &offsets);

        // Judge the rays; those that are good have an adjoint of their normal.
        let weight = self.params.weights.normals / self.params.rays as Real;
        let mut good = Vec::new();
        for (k, place) in places.iter().enumerate() {
            let (from, along) = &rays[k];
            let found = place
                .as_ref()
                .filter(|p| p.field.distance.abs() <= FOUND && p.off_line(from, along) <= FOUND);
            let Some(place) = found else {
                sums.rays.lost += 1;
                continue;
            };
            pixels[chosen[k]].at = x[k];
            let n = place.unit_normal();
            if -n.dot(along) < GRAZING {
                sums.rays.grazing += 1;
                continue;
            }
            let seen = self.scene.frames[frames[k] as usize].normals[batch[k].pixel as usize];
            let seen = Vector::new(seen[0].into(), seen[1].into(), seen[2].into());
            let (agreement, facing) = (n.dot(&seen), -seen.dot(along));
            if agreement < SAME_PLACE || facing <= 0.0 {
                sums.rays.contradicting += 1;
                continue;
            }
            sums.rays.used += 1;
            sums.angle += agreement.min(1.0).acos();
            let joints = &self.scene.joints[frames[k] as usize];
            let weight = weight / facing.max(GRAZING);
            sums.loss += weight * (1.0 - agreement);
            let by_normal = seen * -weight;
            good.push((k, place, place.of_normal(&by_normal, &x[k], &skins[k], joints)));
        }

        // Their points follow φ and d along the ray. Beside them d is continued by its slope, which is
        // constant between the kinks of its ReLUs.
        let beside = |(k, _, turned): &(usize, &Place, Adjoint)| {
            // Without a gradient there is nothing to differentiate: any direction gives 0.
            let step = unit_or_zero(&turned.gradient) * DIFFERENCE;
            let Offset { offset, jacobian } = offsets[*k];
            (x[*k] + step, Offset { offset: offset + jacobian * step, jacobian })
        };
        let (points, beside): (Vec<Point>, Vec<Offset>) = good.iter().map(beside).unzip();
        let frames: Vec<u32> = good.iter().map(|g| frames[g.0]).collect();
        let near: Vec<Skin> = good.iter().map(|g| skins[g.0].clone()).collect();
        let besides = self.places_at(&points, &frames, &near, &beside);
        for ((k, place, turned), beside) in good.into_iter().zip(&besides) {
            let Some(beside) = beside else { continue };
            let by_point = place.by_point(&turned, beside, DIFFERENCE);
            if let Some(moved) = place.of_point(&by_point, &rays[k].1) {
                terms.add(&x[k], self.number(batch[k].frame), &(turned + moved));
            }
        }
    }

    fn silhouettes(&self, rims: &[Rim], terms: &mut Terms, sums: &mut Sums) {
        let frames: Vec<u32> = rims.iter().map(|r| r.frame).collect();
        let mut x: Vec<Point> = rims.iter().map(|r| r.at).collect();
        let skins: Vec<Skin> = x.par_iter().with_min_len(64).map(|x| self.scene.skin(x)).collect();
        let places = self.places(&x, &frames, &skins);
        for (x, place) in x.iter_mut().zip(places) {
            let step = place.map(|p| p.step_to_surface()).filter(|s| s.norm() <= LONGEST);
            *x += step.unwrap_or_default();
        }
        let FieldsWeights { silhouettes, reach, .. } = self.params.weights;
        let weight = silhouettes / self.params.silhouettes as Real;
        for (k, place) in self.places(&x, &frames, &skins).into_iter().enumerate() {
            let Some(place) = place else { continue };
            let (frame, normal) = (frames[k] as usize, place.unit_normal());
            let seen = self.scene.beside_mask(frame, &place.posed, &normal, rims[k].own);
            let Some((e, slope)) = seen else { continue };
            // Geman and McClure 1985.
            let below = e * e + reach * reach;
            let by_way = 2.0 * e * (reach / below).powi(2) * slope;
            sums.loss += weight * rims[k].weight * e * e / below;
            let adjoint = place.of_way(weight * rims[k].weight * by_way);
            terms.add(&x[k], self.number(frames[k]), &adjoint);
            sums.silhouette = (sums.silhouette.0 + e * e, sums.silhouette.1 + 1);
        }
    }

    /// Pairs of points near the surface.
    fn near(&self, random: &mut Pcg64Mcg, terms: &mut Terms, sums: &mut Sums) {
        let pairs = self.params.points.div_ceil(2);
        let mut points = Vec::with_capacity(2 * pairs);
        for _ in 0..pairs {
            let on = self.vertices[random.random_range(0..self.vertices.len())];
            let a = on + gaussian(random) * APART;
            points.extend([a, a + unit_or_zero(&gaussian(random)) * APART]);
        }
        let now = self.nets.field(&points);
        let start = field_of(self.start, &self.nets.frame, &points);
        let FieldsWeights { eikonal, bending, .. } = self.params.weights;
        let share = 1.0 / points.len() as Real;
        let change = |k: usize| now[k].gradient - start[k].gradient;
        for (k, x) in points.iter().enumerate() {
            let g = now[k].gradient;
            let length = g.norm();
            let mut by_gradient = (change(k) - change(k ^ 1)) * (4.0 * bending * share);
            // Where ∇φ vanishes the term has no gradient.
            if length > 0.0 {
                by_gradient += g * (2.0 * eikonal * share * (length - 1.0) / length);
            }
            sums.loss += share * eikonal * (length - 1.0).powi(2);
            sums.loss += share * bending * (change(k) - change(k ^ 1)).norm_squared();
            sums.eikonal = (sums.eikonal.0 + (length - 1.0).abs(), sums.eikonal.1 + 1);
            terms.add_field(x, 0.0, by_gradient);
        }
    }

    /// Points far from the surface, where nothing is seen.
    fn far(&self, random: &mut Pcg64Mcg, terms: &mut Terms, sums: &mut Sums) {
        let cube = self.nets.frame.aabb();
        let points: Vec<Point> = (0..self.params.far)
            .map(|_| {
                let share = Vector::from_fn(|_, _| random.random::<Real>());
                cube.min + cube.size().component_mul(&share)
            })
            .collect();
        let now = self.nets.field(&points);
        let start = field_of(self.start, &self.nets.frame, &points);
        let weight = self.params.weights.stay / points.len() as Real;
        for ((x, now), start) in points.iter().zip(&now).zip(&start) {
            if start.distance.abs() > NOT_SEEN {
                let change = now.distance - start.distance;
                sums.loss += weight * change * change;
                terms.add_field(x, 2.0 * weight * change, Vector::zeros());
            }
        }
    }

    /// Points on the surface, in all frames.
    fn material(&self, random: &mut Pcg64Mcg, terms: &mut Terms, sums: &mut Sums) {
        let frames = self.nets.deformation.config().frames;
        let count = self.params.material.div_ceil(frames);
        let mut points = Vec::with_capacity(count * frames);
        for _ in 0..count {
            let on = self.vertices[random.random_range(0..self.vertices.len())];
            points.extend(std::iter::repeat_n(on, frames));
        }
        let on: Vec<Point> = points.iter().step_by(frames).copied().collect();
        let normals: Vec<Vector> =
            self.nets.field(&on).iter().map(|s| unit_or_zero(&s.gradient)).collect();
        let numbers: Vec<u32> = (0..count).flat_map(|_| 0..frames as u32).collect();
        let offsets = self.nets.offsets(&points, &numbers);
        let FieldsWeights { small, along, rigid, mean, smooth, .. } = self.params.weights;
        let share = 1.0 / points.len() as Real;
        for ((all, first), n) in
            offsets.chunks_exact(frames).zip((0..).step_by(frames)).zip(&normals)
        {
            let middle = all.iter().map(|o| o.offset).sum::<Vector>() / frames as Real;
            sums.mean_motion = (sums.mean_motion.0 + middle.norm_squared(), sums.mean_motion.1 + 1);
            for (k, o) in (first..).zip(all) {
                // The change to the next frame, and from the one before.
                let next = all.get(k - first + 1).map_or(Vector::zeros(), |n| n.offset - o.offset);
                let before = match k - first {
                    0 => Vector::zeros(),
                    i => o.offset - all[i - 1].offset,
                };
                let slid = o.offset - n * n.dot(&o.offset);
                let pull =
                    o.offset * small + slid * along + middle * mean + (before - next) * smooth;
                let by_offset = pull * (2.0 * share);
                let strain = o.jacobian + o.jacobian.transpose();
                let by_jacobian = strain * (4.0 * rigid * share);
                sums.loss += share
                    * (small * o.offset.norm_squared()
                        + along * slid.norm_squared()
                        + mean * middle.norm_squared()
                        + smooth * next.norm_squared()
                        + rigid * strain.norm_squared());
                terms.add_offset(&points[k], numbers[k], by_offset, by_jacobian);
                sums.motion = (sums.motion.0 + o.offset.norm_squared(), sums.motion.1 + 1);
            }
        }
    }
}

/// Three independent numbers of mean 0 and deviation 1 [Box and Muller 1958].
fn gaussian(random: &mut Pcg64Mcg) -> Vector {
    Vector::from_fn(|_, _| {
        // 1 − u is in (0, 1], so that the logarithm is finite.
        let radius = (-2.0 * (1.0 - random.random::<Real>()).ln()).sqrt();
        radius * (std::f64::consts::TAU * random.random::<Real>()).cos()
    })
}
