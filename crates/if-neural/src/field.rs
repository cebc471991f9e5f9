//! A network as a signed distance field in metres.

use crate::frame::Frame;
use crate::frozen::FrozenMlp;
use crate::grid::GridField;
use crate::network::Network;
use crate::trainable::{Sample32, TrainableField};
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::parameter::ParameterError;

/// φ and ∇φ in network units: all that evaluation needs.
pub trait Samples32: Sync {
    /// φ and ∇φ at `points`; for each point the same bits whatever the others are.
    ///
    /// # Panics
    ///
    /// If `out` is not as long as `points`.
    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]);

    /// φ alone, the same bits.
    ///
    /// # Panics
    ///
    /// If `out` is not as long as `points`.
    fn values32(&self, points: &[[f32; 3]], out: &mut [f32]) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        let mut samples = vec![Sample32::default(); points.len()];
        self.samples32(points, &mut samples);
        out.iter_mut().zip(&samples).for_each(|(o, s)| *o = s.value);
    }
}

impl Samples32 for GridField {
    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        TrainableField::samples32(self, points, out);
    }
}

impl Samples32 for FrozenMlp {
    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        self.samples(points, out);
    }
    fn values32(&self, points: &[[f32; 3]], out: &mut [f32]) {
        self.values(points, out);
    }
}

impl Samples32 for Network {
    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        TrainableField::samples32(self, points, out);
    }
    fn values32(&self, points: &[[f32; 3]], out: &mut [f32]) {
        match self {
            Network::Grid(grid) => grid.values32(points, out),
            Network::Sdf(sdf) => sdf.frozen().values(points, out),
        }
    }
}

impl<N: Samples32> Samples32 for &N {
    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        (**self).samples32(points, out);
    }
    fn values32(&self, points: &[[f32; 3]], out: &mut [f32]) {
        (**self).values32(points, out);
    }
}

/// Cells along a side of the cube, in which the gradients and the box of the inside are measured.
const CELLS: usize = 64;
/// The steepest gradient seen times this is the Lipschitz bound, unless the caller gives one.
const SAFETY: Real = 1.25;
/// Points of one call.
const BATCH: usize = 1 << 14;

/// A network cannot be used as a field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FieldError {
    /// The frame has numbers that are not finite, or a scale that is not above zero.
    #[error(transparent)]
    Frame(#[from] ParameterError),
    /// The network is NaN or infinite at a point.
    #[error("the network is {} with gradient {:?} at {point:?} (network units): its parameters are not finite, or too large", sample.value, sample.gradient)]
    NotANumber {
        /// Where, in network units.
        point: [f32; 3],
        /// The sample there.
        sample: Sample32,
    },
    /// The inside reaches the border of the cube.
    #[error(
        "the network is {value} m at {point}, on the border of its cube: the inside must lie within"
    )]
    Leaves {
        /// Where, in metres.
        point: Point,
        /// The value, in metres.
        value: Real,
    },
}

/// A network φ over the cube [−1, 1]³, as a field in metres.
///
/// ```text
/// φ(x) = φ_net(u) / scale + |x − q|,   u = (q − center) · scale,   q the point of the cube nearest to x
/// ```
///
/// In the cube this is the network; beyond it, where networks are wild, its value at the border and
/// the distance to the border. Both are continuous, the gradient of the second jumps at the border.
///
/// `lipschitz()` is measured: the steepest gradient at the nodes of a grid of 64 cells, and beside
/// the surface, times 1.25. It is an estimate, not a proof.
///
/// Points and gradients are rounded to f32, and values to about 1e-7 of the cube.
#[derive(Clone, Debug)]
pub struct NeuralField<N> {
    network: N,
    frame: Frame,
    bounds: Aabb,
    lipschitz: Real,
}

impl<N: Samples32> NeuralField<N> {
    /// Measures the network's steepness and the box of its inside; evaluates some 300,000
    /// points.
    ///
    /// # Errors
    ///
    /// The frame is invalid, or the network is not finite, or negative at the border of the cube.
    pub fn new(network: N, frame: Frame) -> Result<Self, FieldError> {
        frame.validate()?;
        let mut field = Self { network, frame, bounds: frame.aabb(), lipschitz: 1.0 };
        field.measure()?;
        Ok(field)
    }

    /// The network.
    pub fn network(&self) -> &N {
        &self.network
    }

    /// Where the cube lies.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    fn measure(&mut self) -> Result<(), FieldError> {
        let edge = 2.0 / CELLS as f32;
        let n = CELLS + 1;
        let node = |i: usize| [i % n, i / n % n, i / n / n];
        // First, all nodes of the grid: every sample is finite, and positive on the border.
        let mut points = Vec::with_capacity(BATCH);
        let mut samples = vec![Sample32::default(); BATCH];
        let mut steepest = 0.0f64;
        let mut values = Vec::with_capacity(n * n * n);
        for first in (0..n * n * n).step_by(BATCH) {
            points.clear();
            points.extend(
                (first..(first + BATCH).min(n * n * n))
                    .map(|i| node(i).map(|x| x as f32 * edge - 1.0)),
            );
            let samples = &mut samples[..points.len()];
            self.network.samples32(&points, samples);
            for (point, s) in points.iter().zip(&*samples) {
                steepest = steepest.max(length(s));
                if !s.value.is_finite() || !length(s).is_finite() {
                    return Err(FieldError::NotANumber { point: *point, sample: *s });
                }
                values.push(s.value);
                if s.value <= 0.0 && point.iter().any(|x| x.abs() >= 1.0) {
                    let value = Real::from(s.value) / self.frame.scale;
                    return Err(FieldError::Leaves { point: self.frame.to_metres(point), value });
                }
            }
        }
        // Then three more points in each cell near the surface: a cell around a node can hold it
        // only if the value is at most half a diagonal times the steepest slope.
        let farthest = (SAFETY * steepest.max(1.0)) as f32 * edge * 0.5 * 3.0f32.sqrt();
        let near: Vec<usize> = (0..values.len()).filter(|i| values[*i] <= farthest).collect();
        let mut bounds = Aabb::EMPTY;
        let offsets = [[0.5, 0.5, 0.5], [0.25, -0.25, 0.5], [-0.5, 0.25, 0.25]];
        for some in near.chunks(BATCH / offsets.len()) {
            points.clear();
            for i in some {
                let p = node(*i).map(|x| x as f32 * edge - 1.0);
                // A value is trusted within half a cell of its node, in every direction.
                for half in [-0.5, 0.5] {
                    bounds = bounds.grown_to(
                        &self.frame.to_metres(&p.map(|x| (x + half * edge).clamp(-1.0, 1.0))),
                    );
                }
                points.extend(
                    offsets.map(|o| [0, 1, 2].map(|k| (p[k] + o[k] * edge).clamp(-1.0, 1.0))),
                );
            }
            let samples = &mut samples[..points.len()];
            self.network.samples32(&points, samples);
            for (point, s) in points.iter().zip(&*samples) {
                if !s.value.is_finite() || !length(s).is_finite() {
                    return Err(FieldError::NotANumber { point: *point, sample: *s });
                }
                steepest = steepest.max(length(s));
            }
        }
        self.bounds = bounds;
        self.lipschitz = SAFETY * steepest.max(1.0);
        Ok(())
    }

    /// The sample in metres, from that of the network at the nearest point of the cube.
    #[inline]
    fn in_metres(&self, p: &Point, s: &Sample32) -> FieldSample {
        let cube = self.frame.aabb();
        let mut distance = Real::from(s.value) / self.frame.scale;
        let mut gradient = Vector::from(s.gradient.map(Real::from));
        if !cube.contains(p) {
            // Along the axes on which p is outside, the nearest point of the cube stays the same.
            let off = p - p.inf(&cube.max).sup(&cube.min);
            for k in 0..3 {
                if off[k] != 0.0 {
                    gradient[k] = 0.0;
                }
            }
            let length = off.norm();
            distance += length;
            gradient += off / length; // above zero outside the cube
        }
        FieldSample { distance, gradient }
    }

    #[inline]
    fn unit(&self, p: &Point) -> [f32; 3] {
        self.frame.to_unit(p).map(|x| x.clamp(-1.0, 1.0))
    }
}

fn length(s: &Sample32) -> f64 {
    s.gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt()
}

impl<N: Samples32> SignedDistance for NeuralField<N> {
    fn distance(&self, p: &Point) -> Real {
        let mut out = [0.0];
        self.network.values32(&[self.unit(p)], &mut out);
        self.in_metres(p, &Sample32 { value: out[0], gradient: [0.0; 3] }).distance
    }

    fn sample(&self, p: &Point) -> FieldSample {
        let mut out = [Sample32::default()];
        self.network.samples32(&[self.unit(p)], &mut out);
        self.in_metres(p, &out[0])
    }

    fn distances(&self, points: &[Point], out: &mut [Real]) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        for (points, out) in points.chunks(BATCH).zip(out.chunks_mut(BATCH)) {
            let units: Vec<[f32; 3]> = points.iter().map(|p| self.unit(p)).collect();
            let mut values = vec![0.0; units.len()];
            self.network.values32(&units, &mut values);
            for ((p, value), o) in points.iter().zip(values).zip(out) {
                *o = self.in_metres(p, &Sample32 { value, gradient: [0.0; 3] }).distance;
            }
        }
    }

    fn samples(&self, points: &[Point], out: &mut [FieldSample]) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        for (points, out) in points.chunks(BATCH).zip(out.chunks_mut(BATCH)) {
            let units: Vec<[f32; 3]> = points.iter().map(|p| self.unit(p)).collect();
            let mut samples = vec![Sample32::default(); units.len()];
            self.network.samples32(&units, &mut samples);
            for ((p, s), o) in points.iter().zip(&samples).zip(out) {
                *o = self.in_metres(p, s);
            }
        }
    }

    fn bounds(&self) -> Option<Aabb> {
        Some(self.bounds)
    }

    fn lipschitz(&self) -> Real {
        // Beyond the cube the border's tangential slope and the distance add up.
        self.lipschitz.hypot(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::GridConfig;
    use if_core::conformance::{FieldTolerances, check_signed_distance};
    use if_core::random::SplitMix64;

    fn ball() -> NeuralField<GridField> {
        let grid =
            GridField::new(GridConfig { finest: 32, levels: 3, ..GridConfig::default() }).unwrap();
        NeuralField::new(grid, Frame { center: Point::new(0.0, 1.0, 0.0), scale: 2.0 }).unwrap()
    }

    #[test]
    fn a_network_conforms_inside_and_outside_its_cube() {
        let field = ball();
        let mut random = SplitMix64::new(9);
        let mut next = move || random.unit() * 1.4 - 0.7;
        let points: Vec<Point> =
            (0..700).map(|_| Point::new(next(), 1.0 + next(), next())).collect();
        // f32 values are rounded to 1e-7: differences over 2 mm are good to 1e-4.
        let tolerances =
            FieldTolerances { step: 2e-3, gradient: 2e-2, kink: 0.1, kinks: 0.3, rounding: 1e-6 };
        check_signed_distance(&field, &points, &tolerances).unwrap();
        for p in &points {
            let truth = (p - Point::new(0.0, 1.0, 0.0)).norm() - 0.25;
            if field.frame().aabb().contains(p) {
                approx::assert_abs_diff_eq!(field.distance(p), truth, epsilon = 0.02);
            }
        }
        let bounds = field.bounds().unwrap();
        assert!(
            bounds.contains(&Point::new(0.25, 1.0, 0.0)) && bounds.size().x < 0.7,
            "{bounds:?}"
        );
    }

    #[test]
    fn invalid_networks_and_frames_are_rejected() {
        let broken = |change: &dyn Fn(&mut [f32])| {
            let mut grid = ball().network().clone();
            change(grid.parameters_mut());
            NeuralField::new(grid, Frame::UNIT).map(|_| ()).unwrap_err()
        };
        assert!(matches!(broken(&|p| p.fill(f32::NAN)), FieldError::NotANumber { .. }));
        let inside_out = broken(&|p| p.iter_mut().for_each(|c| *c = -*c));
        assert!(matches!(inside_out, FieldError::Leaves { value, .. } if value < 0.0));
        let bad = Frame { scale: 0.0, ..Frame::UNIT };
        assert!(matches!(
            NeuralField::new(ball().network().clone(), bad),
            Err(FieldError::Frame(_))
        ));
    }
}
