//! Oriented points, such as a scan's vertices and normals, and the distance estimated from them.

mod winding;

use crate::error::TargetError;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Points of a leaf of the tree.
const LEAF: usize = 8;
/// Neighbours that an estimate rests on. With 8 the side is wrong twice as often beside noisy
/// folds; 32 cost twice the time and blur no less.
const NEIGHBOURS: usize = 16;

/// σ of the weights by normals, a length of nᵢ − n: at 30° a neighbour counts a third, at 60° a
/// fiftieth.
const FOLD: Real = 0.5;
/// A mean normal shorter than this has no direction.
const CANCELLED: Real = 0.15;
/// Rounds in which the weights follow the mean normal. A third changes no error by a hundredth.
const REWEIGHTED: usize = 2;

/// Points with outward unit normals, and a tree over them.
#[derive(Clone, Debug)]
pub struct OrientedPoints {
    points: Vec<Point>,
    normals: Vec<Vector>,
    nodes: Vec<Node>,
    aabb: Aabb,
    spacing: Real,
    areas: Vec<Real>,
    dipoles: Vec<winding::Dipole>,
}

/// A range of the points, split along an axis; leaves have no children.
#[derive(Clone, Copy, Debug)]
struct Node {
    from: u32,
    to: u32,
    axis: u8,
    split: Real,
    /// The second child; the first is the next node. 0 for a leaf.
    second: u32,
}

/// The estimate of the surface from the points near a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Distance to the surface, negative inside, in metres.
    pub distance: Real,
    /// Its direction, of unit length, or zero.
    pub normal: Vector,
    /// How well the normals agree, from 0 to 1.
    pub trust: Real,
    /// Distance to the nearest point, in metres.
    pub nearest: Real,
}

impl OrientedPoints {
    /// Builds the tree over points (metres) with outward normals of any length. Points at one position, as
    /// files without shared vertices have them, count as one, with the mean of their unit normals.
    ///
    /// # Errors
    ///
    /// Too few points, another number of normals, a value that is not finite, a normal that is zero,
    /// all points in one place, or normals that point inwards.
    pub fn new(points: Vec<Point>, normals: Vec<Vector>) -> Result<Self, TargetError> {
        if points.len() != normals.len() {
            return Err(TargetError::NormalCount { points: points.len(), normals: normals.len() });
        }
        if points.len() < NEIGHBOURS {
            return Err(TargetError::TooFewPoints { got: points.len(), needed: NEIGHBOURS });
        }
        let mut unit = Vec::with_capacity(normals.len());
        for (index, (point, normal)) in points.iter().zip(&normals).enumerate() {
            let n = unit_or_zero(normal);
            if n == Vector::zeros() || !point.iter().all(|x| x.is_finite()) {
                return Err(TargetError::NotOriented { index, point: *point, normal: *normal });
            }
            unit.push(n);
        }
        let aabb = Aabb::from_points(&points);
        let size = aabb.diagonal();
        if !(size > 0.0 && size.is_finite()) {
            return Err(TargetError::NoExtent { aabb });
        }
        let (points, unit) = merged(points, unit);
        if points.len() < NEIGHBOURS {
            return Err(TargetError::TooFewPoints { got: points.len(), needed: NEIGHBOURS });
        }
        // By the divergence theorem this is three times the volume for points spread evenly over a
        // closed surface.
        let middle = aabb.center();
        let along = points.iter().zip(&unit).map(|(p, n)| n.dot(&(p - middle))).sum::<Real>()
            / (points.len() as Real * size);
        if along < 0.0 {
            return Err(TargetError::InwardNormals { along });
        }
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let mut nodes = Vec::new();
        let length = order.len();
        build(&points, &mut order, (0, length), &mut nodes);
        let mut cloud = Self {
            points: order.iter().map(|i| points[*i as usize]).collect(),
            normals: order.iter().map(|i| unit[*i as usize]).collect(),
            nodes,
            aabb,
            spacing: 0.0,
            areas: Vec::new(),
            dipoles: Vec::new(),
        };
        cloud.spacing = cloud.median_spacing();
        cloud.areas = winding::areas(&cloud);
        cloud.dipoles = winding::dipoles(&cloud.nodes, &cloud.points, &cloud.normals, &cloud.areas);
        Ok(cloud)
    }

    /// The points, in the order of the tree.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Their unit normals.
    pub fn normals(&self) -> &[Vector] {
        &self.normals
    }

    /// The box around the points.
    pub fn aabb(&self) -> Aabb {
        self.aabb
    }

    /// Median distance of a point to its fourth neighbour, in metres: about an edge of the mesh
    /// they come from.
    pub fn spacing(&self) -> Real {
        self.spacing
    }

    fn median_spacing(&self) -> Real {
        let stride = self.points.len().div_ceil(1000);
        let mut found = [(0.0, 0); NEIGHBOURS];
        let mut all: Vec<Real> = self
            .points
            .iter()
            .step_by(stride)
            .map(|p| {
                self.neighbours(p, &mut found);
                found[4].0.sqrt()
            })
            .collect();
        all.sort_unstable_by(Real::total_cmp);
        all[all.len() / 2].max(Real::MIN_POSITIVE)
    }

    /// The nearest points, as squared distance and index, nearest first.
    fn neighbours(&self, p: &Point, out: &mut [(Real, u32); NEIGHBOURS]) {
        out.fill((Real::INFINITY, u32::MAX));
        self.descend(0, p, out);
    }

    fn descend(&self, at: u32, p: &Point, out: &mut [(Real, u32); NEIGHBOURS]) {
        let node = self.nodes[at as usize];
        if node.second == 0 {
            for i in node.from..node.to {
                let d = (self.points[i as usize] - p).norm_squared();
                if d < out[NEIGHBOURS - 1].0 {
                    let place = out.partition_point(|o| o.0 <= d);
                    out.copy_within(place..NEIGHBOURS - 1, place + 1);
                    out[place] = (d, i);
                }
            }
            return;
        }
        let off = p[node.axis as usize] - node.split;
        let (near, far) = if off < 0.0 { (at + 1, node.second) } else { (node.second, at + 1) };
        self.descend(near, p, out);
        if off * off < out[NEIGHBOURS - 1].0 {
            self.descend(far, p, out);
        }
    }

    /// The signed distance at `p` by the points near it:
    ///
    /// ```text
    /// f = Σ wᵢ ½(nᵢ + n)·(p − pᵢ) / Σ wᵢ,   wᵢ = exp(−(|p − pᵢ|² − d²) / h² − |nᵢ − n|² / σ²),   d = min |p − pᵢ|
    /// ```
    ///
    /// with n the direction of Σ wᵢ nᵢ, found from weights without it, and twice more. A plane
    /// through pᵢ across nᵢ leaves a bent surface by h² / 2r on one side, a plane across n on the
    /// other; the zero set of their mean is exact on spheres. Neighbours across a fold have other
    /// normals, and count less.
    ///
    /// Where d < h the distance is f, in which noise averages out; beyond 2h it is d with the side
    /// of the winding number, as the nearest normals are arbitrary beside a hole; in between a
    /// blend. `h` is the `smoothing`, in metres. The trust is the agreement of the normals, |Σ wᵢ
    /// nᵢ| / Σ wᵢ with weights by distance alone, near the surface and the distance of the winding
    /// number from one half, doubled, beyond.
    ///
    /// # Source
    ///
    /// Kolluri 2005, *Provably good moving least squares*; the mean of the two normals is that of
    /// Rusinkiewicz 2019, *A symmetric objective function for ICP*; weights by normals are those of
    /// Öztireli et al. 2009. [`OrientedPoints::winding_number`]: the side.
    ///
    /// At a point that is not finite, or too far away for a distance, the distance is NaN and the
    /// trust 0.
    pub fn estimate(&self, p: &Point, smoothing: Real) -> Estimate {
        let mut found = [(0.0, 0); NEIGHBOURS];
        self.neighbours(p, &mut found);
        let nearest = found[0].0.sqrt();
        if !nearest.is_finite() {
            return Estimate { distance: Real::NAN, normal: Vector::zeros(), trust: 0.0, nearest };
        }
        // Far away the neighbours differ by little compared to d: the width grows with it.
        let h2 = (smoothing * smoothing + 0.01 * found[0].0).max(Real::MIN_POSITIVE);
        // The nearest alone has weight 1.
        let by_distance = found.map(|(d2, _)| (-(d2 - found[0].0) / h2).exp());
        let normals = found.map(|(_, i)| self.normals[i as usize]);
        let mean = |weights: &[Real; NEIGHBOURS]| {
            let sum = weights.iter().zip(&normals).map(|(w, n)| n * *w).sum::<Vector>();
            sum / weights.iter().sum::<Real>()
        };
        // Normals that cancel have no mean: the direction of their sum is arbitrary.
        let direction = |mean: Vector| {
            if mean.norm() < CANCELLED { Vector::zeros() } else { unit_or_zero(&mean) }
        };
        let agreement = mean(&by_distance).norm();
        let mut normal = direction(mean(&by_distance));
        let mut weights = by_distance;
        for _ in 0..REWEIGHTED {
            if normal == Vector::zeros() {
                break;
            }
            for ((w, by_distance), n) in weights.iter_mut().zip(&by_distance).zip(&normals) {
                *w = by_distance * (-(n - normal).norm_squared() / (FOLD * FOLD)).exp();
            }
            normal = direction(mean(&weights));
        }
        let planes = found.iter().zip(&normals).map(|((_, i), n)| {
            // Without a mean each keeps its own.
            let across = if normal == Vector::zeros() { *n } else { (n + normal) * 0.5 };
            across.dot(&(p - self.points[*i as usize]))
        });
        let f =
            planes.zip(&weights).map(|(d, w)| d * w).sum::<Real>() / weights.iter().sum::<Real>();
        let far = ((nearest - smoothing) / smoothing.max(Real::MIN_POSITIVE)).clamp(0.0, 1.0);
        let (mut distance, mut trust) = (f, agreement);
        if far > 0.0 {
            let inside = self.winding_number(p) - 0.5;
            distance = f * (1.0 - far) - nearest.copysign(inside) * far;
            trust = agreement * (1.0 - far) + (2.0 * inside.abs()).min(1.0) * far;
        }
        Estimate { distance, normal, trust, nearest }
    }
}

/// Points with unit normals, each position once, where it comes first. A position whose normals cancel is
/// left out.
fn merged(points: Vec<Point>, unit: Vec<Vector>) -> (Vec<Point>, Vec<Vector>) {
    // The bits of a coordinate; both zeros are equal.
    let key = |p: &Point| [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits());
    let mut first = HashMap::with_capacity(points.len());
    let mut found: Vec<(Point, Vector, bool)> = Vec::with_capacity(points.len());
    for (p, n) in points.into_iter().zip(unit) {
        match first.entry(key(&p)) {
            Entry::Vacant(place) => {
                place.insert(found.len());
                found.push((p, n, false));
            }
            Entry::Occupied(place) => {
                let (_, sum, repeated) = &mut found[*place.get()];
                (*sum, *repeated) = (*sum + n, true);
            }
        }
    }
    let mean =
        |(p, n, repeated): (Point, Vector, bool)| (p, if repeated { unit_or_zero(&n) } else { n });
    found.into_iter().map(mean).filter(|(_, n)| *n != Vector::zeros()).unzip()
}

fn build(points: &[Point], order: &mut [u32], (from, to): (usize, usize), nodes: &mut Vec<Node>) {
    let at = nodes.len();
    nodes.push(Node { from: from as u32, to: to as u32, axis: 0, split: 0.0, second: 0 });
    if to - from <= LEAF {
        return;
    }
    let size = Aabb::from_points(order.iter().map(|i| &points[*i as usize])).size();
    let axis = size.imax();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |a, b| {
        points[*a as usize][axis].total_cmp(&points[*b as usize][axis]).then(a.cmp(b))
    });
    nodes[at].axis = axis as u8;
    nodes[at].split = points[order[middle] as usize][axis];
    let (first, second) = order.split_at_mut(middle);
    build(points, first, (from, from + middle), nodes);
    nodes[at].second = nodes.len() as u32;
    build(points, second, (from + middle, to), nodes);
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes;

    fn ball() -> (Vec<Point>, Vec<Vector>) {
        let mesh = meshes::icosphere(0.5, 4);
        (mesh.vertices().to_vec(), mesh.vertices().iter().map(|p| p.coords).collect())
    }

    #[test]
    fn neighbours_are_those_of_a_full_search() {
        let (points, normals) = ball();
        let cloud = OrientedPoints::new(points, normals).unwrap();
        for k in 0..50 {
            let p = Point::new(
                (k as Real * 0.37).sin(),
                (k as Real * 0.73).cos() * 0.7,
                (k as Real * 1.1).sin() * 0.6,
            );
            let mut found = [(0.0, 0); NEIGHBOURS];
            cloud.neighbours(&p, &mut found);
            let mut all: Vec<Real> =
                cloud.points().iter().map(|q| (q - p).norm_squared()).collect();
            all.sort_unstable_by(Real::total_cmp);
            for (f, a) in found.iter().zip(&all) {
                assert_eq!(f.0, *a);
            }
        }
    }

    #[test]
    fn repeated_points_count_as_one() {
        let mesh = meshes::icosphere(0.5, 3);
        let normal = |v: &u32| mesh.vertices()[*v as usize].coords;
        let corners: Vec<u32> = mesh.triangles().as_flattened().to_vec();
        let points = corners.iter().map(|v| mesh.vertices()[*v as usize]).collect();
        let soup = OrientedPoints::new(points, corners.iter().map(normal).collect()).unwrap();
        let n = mesh.vertices().len();
        let all: Vec<u32> = (0..n as u32).collect();
        let shared =
            OrientedPoints::new(mesh.vertices().to_vec(), all.iter().map(normal).collect())
                .unwrap();
        assert_eq!((soup.points().len(), soup.spacing()), (n, shared.spacing()));
        // A position whose normals cancel has no side.
        let mut points = mesh.vertices().to_vec();
        points.push(points[7]);
        let mut normals: Vec<Vector> = all.iter().map(normal).collect();
        normals.push(-normals[7]);
        assert_eq!(OrientedPoints::new(points, normals).unwrap().points().len(), n - 1);
    }

    #[test]
    fn the_estimate_is_the_distance_of_a_ball_and_averages_noise() {
        let (points, normals) = ball();
        let clean = OrientedPoints::new(points.clone(), normals.clone()).unwrap();
        let h = 1.5 * clean.spacing();
        let radius = |p: &Point| p.coords.norm() - 0.5;
        for k in 0..200 {
            let p = Point::new(
                (k as Real * 0.37).sin(),
                (k as Real * 0.73).cos() * 0.7,
                (k as Real * 1.1).sin() * 0.6,
            );
            let e = clean.estimate(&p, h);
            approx::assert_abs_diff_eq!(e.distance, radius(&p), epsilon = 0.01);
            assert!(e.trust > 0.5);
        }
        let noisy: Vec<Point> = points
            .iter()
            .enumerate()
            .map(|(i, p)| p + p.coords * (0.02 * (i as Real * 12.9898).sin()))
            .collect();
        let noisy = OrientedPoints::new(noisy, normals).unwrap();
        let mean =
            |f: &dyn Fn(&Point) -> Real| points.iter().map(f).sum::<Real>() / points.len() as Real;
        let raw = mean(&|p| {
            noisy.points().iter().map(|q| (q - p).norm()).fold(Real::INFINITY, Real::min)
        });
        let estimated = mean(&|p| noisy.estimate(p, h).distance.abs());
        assert!(estimated < 0.6 * raw, "{estimated} {raw}");
    }

    #[test]
    fn invalid_points_are_named() {
        let (points, normals) = ball();
        let with =
            |p: Vec<Point>, n: Vec<Vector>| OrientedPoints::new(p, n).map(|_| ()).unwrap_err();
        assert_eq!(with(vec![], vec![]), TargetError::TooFewPoints { got: 0, needed: NEIGHBOURS });
        assert!(matches!(
            with(points.clone(), vec![]),
            TargetError::NormalCount { normals: 0, .. }
        ));
        let mut bad = points.clone();
        bad[3].x = Real::NAN;
        assert!(matches!(with(bad, normals.clone()), TargetError::NotOriented { index: 3, .. }));
        let mut bad = normals.clone();
        bad[5] = Vector::zeros();
        assert!(matches!(with(points.clone(), bad), TargetError::NotOriented { index: 5, .. }));
        let inwards: Vec<Vector> = normals.iter().map(|n| -n).collect();
        assert!(
            matches!(with(points.clone(), inwards), TargetError::InwardNormals { along } if along < 0.0)
        );
        assert!(matches!(
            with(vec![points[0]; 40], normals[..40].to_vec()),
            TargetError::NoExtent { .. }
        ));
        // Coincident points among others are allowed.
        let mut doubled = points.clone();
        doubled[..40].fill(points[0]);
        assert!(OrientedPoints::new(doubled, normals).is_ok());
    }
}
