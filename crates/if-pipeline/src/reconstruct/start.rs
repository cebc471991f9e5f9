//! The start of the fit of a surface: the template, or its union with the inside of loose clothes.

use super::canonical::{FloodedField, Shares, carried_to, four_largest, largest_piece};
use super::error::ReconstructError;
use super::lattice::Lattice;
use super::loose::{Filling, Space, View, fill, loose_labels};
use super::observe::Observation;
use super::params::SurfaceParams;
use super::report::{Filled, StartReport};
use crate::capture::Capture;
use if_body::SkinWeights;
use if_body::TemplateBody;
use if_body::skinning::{WeightGrid, WeightGridParams};
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::Monitor;
use if_mesh::extract::{ExtractParams, Resolution, extract};
use rayon::prelude::*;

/// Overlap of the filled region with the template, in voxels: more than the smoothing removes.
const INTO: usize = 3;
/// Passes of the (1 2 1)/4 filter over the filled region: a Gaussian whose deviation is the voxel
/// size times √(passes / 2).
const SMOOTH: usize = 4;
/// Distance from the template, in metres, over which skinning weights blend from the template's to
/// those of the grid.
const OVER: Real = 0.03;

/// A surface with weights.
pub(super) struct Start {
    pub(super) mesh: TriMesh,
    pub(super) skin: SkinWeights,
    pub(super) report: StartReport,
}

impl Start {
    /// The template alone.
    pub(super) fn template(template: &TemplateBody) -> Self {
        let (mesh, skin) = (template.mesh.clone(), template.skin.clone());
        Self { mesh, skin, report: StartReport::default() }
    }
}

/// Detects loose clothes by pixels of the person far from the posed template, and fills them. Label
/// images are read only if there are such pixels.
///
/// # Errors
///
/// Label images cannot be read, or the template is not closed although its inside is needed.
pub(super) fn start(
    capture: &Capture,
    template: &TemplateBody,
    params: &SurfaceParams,
    frames: &[Observation],
    monitor: &mut dyn Monitor,
) -> Result<Start, ReconstructError> {
    let (mesh, skin, camera) = (&template.mesh, &template.skin, capture.camera());
    let mut views: Vec<View> =
        frames.par_iter().map(|f| View::new(mesh, skin, camera, f, params.loose)).collect();
    let mut space = None;
    let (mut beside, mut found) =
        fill_loose(capture, template, params, frames, &mut views, &mut space)?;
    if found.is_none() {
        // A skirt about legs that stand close may span less. Where more is loose, that would take the space
        // between arms and body for its inside.
        views.iter_mut().for_each(|view| view.between = true);
        let again = fill_loose(capture, template, params, frames, &mut views, &mut space)?;
        if again.1.is_some() {
            (beside, found) = again;
        }
    }
    let (Some(filling), Some((grid, solid))) = (found, space) else {
        let (mesh, skin) = (mesh.clone(), skin.clone());
        return Ok(Start { mesh, skin, report: StartReport { beside, filled: None } });
    };

    // The surface of the union, with weights.
    let union = Union::new(solid, &filling);
    let cells = ExtractParams {
        resolution: Resolution::Cell(filling.lattice.cell),
        newton: 0,
        check: 0,
        ..ExtractParams::default()
    };
    let mesh = largest_piece(&extract(&union, &cells, monitor)?.mesh);
    let skin = weights(template, &grid, &mesh);
    let voxels = filling.space.iter().filter(|s| **s == Space::Filled).count();
    let name = |j: &usize| template.skeleton.joints()[*j].name.clone();
    let filled = Filled {
        garments: (0..filling.loose.len())
            .filter(|k| filling.loose[*k])
            .map(|k| capture.labels()[k].clone())
            .collect(),
        joints: filling.joints.iter().map(name).collect(),
        litres: voxels as Real * filling.lattice.cell.powi(3) * 1e3,
        certain_litres: filling.certain as Real * filling.lattice.cell.powi(3) * 1e3,
        vertices: mesh.vertices().len(),
    };
    Ok(Start { mesh, skin, report: StartReport { beside, filled: Some(filled) } })
}

/// Weights in space, and the inside of the template: made once.
type TemplateSpace = Option<(WeightGrid, FloodedField)>;

/// The share of the person's pixels that are far from the posed template, and, if that is enough, the
/// space inside loose garments.
fn fill_loose(
    capture: &Capture,
    template: &TemplateBody,
    params: &SurfaceParams,
    frames: &[Observation],
    views: &mut [View],
    space: &mut TemplateSpace,
) -> Result<(Real, Option<Filling>), ReconstructError> {
    let (person, beside) =
        views.iter().map(View::counts).fold((0, 0), |(a, b), (c, d)| (a + c, b + d));
    let beside = if person == 0 { 0.0 } else { beside as Real / person as Real };
    if beside < params.least_loose {
        return Ok((beside, None));
    }
    if views.iter().all(|view| view.labels.is_empty()) {
        let labels: Vec<_> = frames.par_iter().map(|f| capture.label_image(f.frame)).collect();
        for (view, labels) in views.iter_mut().zip(labels) {
            view.labels = labels?;
        }
    }
    let loose = loose_labels(views, capture.labels());
    if !loose.contains(&true) {
        return Ok((beside, None));
    }
    let (grid, solid) = match space {
        Some(space) => space,
        None => {
            let (mesh, skin) = (&template.mesh, &template.skin);
            let params = WeightGridParams::default();
            let grid = WeightGrid::new(mesh.vertices(), skin, template.skeleton.len(), &params)?;
            let solid = FloodedField::new(mesh).map_err(ReconstructError::TemplateInside)?;
            space.insert((grid, solid))
        }
    };
    let skeleton = &template.skeleton;
    let filling = fill(params.loose_cell, grid, solid, capture.camera(), views, &loose, skeleton);
    Ok((beside, filling))
}

/// Skinning weights of the start: the template's on it, those of the grid away from it.
fn weights(template: &TemplateBody, grid: &WeightGrid, mesh: &TriMesh) -> SkinWeights {
    let near = carried_to(&template.mesh, &template.skin, mesh.vertices());
    let of = |(p, (distance, carried)): (&Point, &(Real, Shares))| {
        let far = (distance / OVER).min(1.0);
        let mut sums = vec![0.0; grid.joints()];
        grid.weights_at(p, &mut sums);
        sums.iter_mut().for_each(|w| *w *= far);
        carried.iter().for_each(|(j, w)| sums[usize::from(*j)] += (1.0 - far) * w);
        four_largest(
            sums.into_iter()
                .enumerate()
                .filter(|(_, w)| *w > 0.0)
                .map(|(j, w)| (j as u16, w))
                .collect(),
        )
    };
    let (on, weights) = mesh.vertices().par_iter().zip(&near).with_min_len(256).map(of).unzip();
    SkinWeights::new(on, weights, grid.joints())
        .expect("the four largest parts of weights are positive, and were divided by their sum")
}

/// The union of the template and the filled voxels, which are smoothed.
struct Union {
    template: FloodedField,
    lattice: Lattice,
    /// Approximate signed distance from the filled region, in metres.
    values: Vec<f32>,
    /// Bounding box of the filled region.
    near: Aabb,
}

impl Union {
    fn new(template: FloodedField, filling: &Filling) -> Self {
        let Filling { lattice, space, .. } = filling;
        // The filled voxels, and the adjacent voxels of the body: no gap remains between them.
        let mut solid: Vec<bool> = space.iter().map(|s| *s == Space::Filled).collect();
        for _ in 0..INTO {
            let next = |i: usize| {
                solid[i]
                    || (space[i] == Space::Body && lattice.size.neighbours(i).any(|k| solid[k]))
            };
            solid = (0..solid.len()).into_par_iter().with_min_len(4096).map(next).collect();
        }
        let mut share: Vec<f32> = solid.iter().map(|s| if *s { 1.0 } else { 0.0 }).collect();
        for _ in 0..SMOOTH {
            share = smoothed(lattice, share);
        }
        // The slope of a smoothed step at its middle is that of the Gaussian's peak.
        let spread =
            (0.5 * SMOOTH as Real).sqrt() * (2.0 * std::f64::consts::PI).sqrt() * lattice.cell;
        let values = share.into_iter().map(|s| ((0.5 - Real::from(s)) * spread) as f32).collect();
        let filled: Vec<Point> =
            (0..solid.len()).filter(|i| solid[*i]).map(|i| lattice.center(i)).collect();
        let near = Aabb::from_points(&filled).inflated((SMOOTH + 2) as Real * lattice.cell);
        Self { template, lattice: lattice.clone(), values, near }
    }

    /// Trilinear interpolation between the centres of the voxels.
    fn filled(&self, p: &Point) -> Real {
        let Lattice { min, cell, size } = &self.lattice;
        let (low, part) = size.cell_at([0, 1, 2].map(|k| (p[k] - min[k]) / cell - 0.5));
        let mut sum = 0.0;
        for c in 0..8 {
            let bit = [c & 1, c >> 1 & 1, c >> 2];
            let w: Real =
                (0..3).map(|k| if bit[k] == 1 { part[k] } else { 1.0 - part[k] }).product();
            if w > 0.0 {
                let at = size.index([0, 1, 2].map(|k| low[k] + bit[k]));
                sum += w * Real::from(self.values[at]);
            }
        }
        // Outside the box nothing is filled.
        sum + self.near.distance_squared(p).sqrt()
    }
}

/// One pass of the (1 2 1)/4 filter along each axis, with zeros outside the lattice.
fn smoothed(lattice: &Lattice, mut values: Vec<f32>) -> Vec<f32> {
    for (step, n) in lattice.size.strides().into_iter().zip(lattice.size.0) {
        let of = |i: usize| {
            let k = i / step % n;
            let low = if k > 0 { values[i - step] } else { 0.0 };
            let high = if k + 1 < n { values[i + step] } else { 0.0 };
            0.25 * (low + high) + 0.5 * values[i]
        };
        values = (0..values.len()).into_par_iter().with_min_len(4096).map(of).collect();
    }
    values
}

/// Step of the finite differences of the gradient, as a share of a voxel.
const STEP: Real = 0.1;

impl SignedDistance for Union {
    fn distance(&self, p: &Point) -> Real {
        self.template.distance(p).min(self.filled(p))
    }

    fn sample(&self, p: &Point) -> FieldSample {
        let (body, filled) = (self.template.sample(p), self.filled(p));
        if body.distance <= filled {
            return body;
        }
        let h = STEP * self.lattice.cell;
        let slope = |k: usize| {
            let mut step = Vector::zeros();
            step[k] = h;
            (self.filled(&(p + step)) - self.filled(&(p - step))) / (2.0 * h)
        };
        FieldSample { distance: filled, gradient: Vector::new(slope(0), slope(1), slope(2)) }
    }

    fn bounds(&self) -> Option<Aabb> {
        self.template.bounds().map(|b| b.merged(&self.near))
    }

    fn lipschitz(&self) -> Real {
        // Between voxels that differ by d along each axis the trilinear slope is at most √3 d.
        3.0f64.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_body::{Joint, Skeleton};
    use if_core::monitor::Silent;
    use if_core::random::SplitMix64;
    use if_core::shapes::meshes::icosphere;

    /// Two balls of 10 cm side by side, 8 cm apart, and what lies between them.
    fn two_balls() -> (TriMesh, Filling) {
        let ball = icosphere(0.1, 3);
        let n = ball.vertices().len() as u32;
        let mut vertices: Vec<Point> =
            ball.vertices().iter().map(|p| p - Vector::new(0.14, 0.0, 0.0)).collect();
        vertices.extend(ball.vertices().iter().map(|p| p + Vector::new(0.14, 0.0, 0.0)));
        let mut triangles = ball.triangles().to_vec();
        triangles.extend(ball.triangles().iter().map(|t| t.map(|v| v + n)));
        let mesh = TriMesh::new(vertices, triangles).unwrap();
        let lattice = Lattice::new(&mesh.aabb().inflated(0.05), 0.01);
        let space = (0..lattice.len())
            .map(|i| {
                let p = lattice.center(i);
                let body = (p.coords - Vector::new(0.14f64.copysign(p.x), 0.0, 0.0)).norm() < 0.1;
                match body {
                    true => Space::Body,
                    false if p.x.abs() < 0.14 && p.y.hypot(p.z) < 0.07 => Space::Filled,
                    false => Space::Open,
                }
            })
            .collect();
        (mesh, Filling { lattice, space, certain: 0, joints: Vec::new(), loose: Vec::new() })
    }

    #[test]
    fn the_union_is_one_piece_and_elsewhere_the_template() {
        let (mesh, filling) = two_balls();
        let union = Union::new(FloodedField::new(&mesh).unwrap(), &filling);
        assert!(union.distance(&Point::origin()) < -0.01);
        // The bridge is 7 cm thick, and its smoothing takes less than a voxel off.
        let side = union.distance(&Point::new(0.0, 0.07, 0.0));
        assert!(side.abs() < 0.01, "{side}");
        for p in
            [Point::new(0.25, 0.0, 0.0), Point::new(-0.245, 0.0, 0.0), Point::new(0.9, 0.0, 0.0)]
        {
            assert_eq!(union.distance(&p), union.template.distance(&p), "{p}");
        }
        // Nowhere is it steeper than it says, and it does not jump, also where what is filled ends.
        let mut random = SplitMix64::new(9);
        let mut unit = || random.unit();
        for _ in 0..2000 {
            let p = Point::new(unit() - 0.5, unit() - 0.5, unit() - 0.5);
            let q = p + Vector::new(unit() - 0.5, unit() - 0.5, unit() - 0.5) * 1e-3;
            let slope = (union.distance(&p) - union.distance(&q)).abs() / (p - q).norm();
            assert!(slope <= union.lipschitz(), "{p}: {slope}");
        }
        let cells = ExtractParams {
            resolution: Resolution::Cell(0.01),
            newton: 0,
            ..ExtractParams::default()
        };
        let found = extract(&union, &cells, &mut Silent).unwrap().mesh;
        assert_eq!(largest_piece(&found), found);
        assert!(found.signed_volume() > mesh.signed_volume() * 1.1);
    }

    #[test]
    fn weights_go_over_from_the_template_to_the_space_about_it() {
        let (mesh, _) = two_balls();
        let half = mesh.vertices().len() / 2;
        let of = |v: usize| if v < half { [1.0, 0.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0, 0.0] };
        let skin =
            SkinWeights::new(vec![[0, 1, 0, 0]; 2 * half], (0..2 * half).map(of).collect(), 2)
                .unwrap();
        let joint = |name: &str, parent| Joint {
            name: name.into(),
            parent,
            head: Point::origin(),
            tail: Point::origin(),
        };
        let skeleton = Skeleton::new(vec![joint("left", None), joint("right", Some(0))]).unwrap();
        let template = TemplateBody { mesh, skin, skeleton };
        let grid = WeightGrid::new(
            template.mesh.vertices(),
            &template.skin,
            2,
            &WeightGridParams::default(),
        )
        .unwrap();
        let points = TriMesh::new(
            vec![Point::new(-0.2, 0.08, 0.0), Point::origin(), Point::new(-0.05, 0.05, 0.0)],
            vec![[0, 1, 2]],
        )
        .unwrap();
        let found = weights(&template, &grid, &points);
        let left = |v: usize| {
            (0..4)
                .filter(|k| found.joints()[v][*k] == 0)
                .map(|k| found.weights()[v][k])
                .sum::<f32>()
        };
        assert!(left(0) > 0.999, "{}", left(0));
        assert!((left(1) - 0.5).abs() < 0.05, "{}", left(1)); // 4 cm from both
        assert!(left(2) > 0.6 && left(2) < 1.0, "{}", left(2));
    }
}
