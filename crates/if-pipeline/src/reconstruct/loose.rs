//! What clothes fill that the template body has apart: the inside of a skirt, between the legs.

use super::canonical::FloodedField;
use super::distance_image::DistanceImage;
use super::hull::in_camera;
use super::observe::Observation;
use crate::capture::FIRST_GARMENT;
use if_body::SkinWeights;
use if_body::skinning::{Affine, WeightGrid, blends, pose_points};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::camera::Camera;
use if_mesh::raster::{IdBuffer, NOTHING, RasterParams, Rasteriser};
use rayon::prelude::*;

/// Part of the frames whose masks may contradict a voxel that is filled: noise, and clothes that do
/// not follow the skeleton.
const ALLOWED: Real = 1.0 / 12.0;
/// Part of the frames, and at least two, that must see a voxel beside the template for it to be
/// certain.
const CERTAIN: Real = 1.0 / 12.0;
/// Part of the garments' pixels beside the template from which on a garment is a loose one. Parsers
/// mistake a few in a hundred.
const LOOSE: Real = 0.2;
/// Part of the frames that see a voxel which may see something else than loose clothes there. The
/// poorest parser of `docs/capture.md` is wrong at one pixel in ten.
const ELSEWHERE: Real = 0.25;
/// Part of the certain voxels from which on the joint that most moves them is one that loose
/// clothes hang about.
const HANGS: Real = 0.02;
/// Voxels at most: 64 MB. Beyond it they are made larger.
const MOST_VOXELS: Real = 8e6;
/// Less that is certain than this is noise, in cubic metres: a tenth of a litre.
const LEAST_CERTAIN: Real = 1e-4;

/// A frame, as it is looked at from the inside of clothes.
pub(super) struct View<'a> {
    /// Each joint's transform, straight into the camera's frame.
    maps: Vec<Affine>,
    outside: &'a DistanceImage,
    /// The depth of the posed template, infinite beside it.
    depth: Vec<f32>,
    /// Pixels of the person that lie far beside the posed template.
    pub(super) beside: Vec<bool>,
    /// Empty until they are read.
    pub(super) labels: Vec<u8>,
}

impl<'a> View<'a> {
    /// Poses the template; `loose` is the distance from which on a pixel lies far beside it, in
    /// metres.
    pub(super) fn new(
        mesh: &TriMesh,
        skin: &SkinWeights,
        camera: &Camera,
        frame: &'a Observation,
        loose: Real,
    ) -> Self {
        let world = pose_points(mesh.vertices(), &blends(skin, &frame.transforms));
        let mut buffer = IdBuffer::default();
        Rasteriser::default().look(mesh, &world, camera, &RasterParams::default(), &mut buffer);
        let figure: Vec<bool> = buffer.triangle.iter().map(|t| *t != NOTHING).collect();
        let seen: Vec<Real> =
            buffer.depth.iter().filter(|z| z.is_finite()).map(|z| Real::from(*z)).collect();
        let depth = seen.iter().sum::<Real>() / seen.len().max(1) as Real;
        let away = DistanceImage::new(&figure, camera.width(), camera.height(), 0.0);
        let pixels =
            if depth > 0.0 { loose * pixels_per_metre(camera) / depth } else { Real::INFINITY };
        let beside = (0..figure.len())
            .map(|i| frame.outside.pixel(i) < 0.0 && Real::from(away.pixel(i)) > pixels)
            .collect();
        let maps = frame.transforms.iter().map(in_camera(camera)).collect();
        Self { maps, outside: &frame.outside, depth: buffer.depth, beside, labels: Vec::new() }
    }

    /// Pixels of the person, and of these such far beside the template.
    pub(super) fn counts(&self) -> (usize, usize) {
        let person = (0..self.beside.len()).filter(|i| self.outside.pixel(*i) < 0.0).count();
        (person, self.beside.iter().filter(|b| **b).count())
    }
}

/// Pixels of a length of one metre at a depth of one metre.
fn pixels_per_metre(camera: &Camera) -> Real {
    let k = camera.intrinsics();
    0.5 * (k[(0, 0)] + k[(1, 1)])
}

/// Which labels are of loose garments: those of a good part of the pixels far beside the template.
pub(super) fn loose_labels(views: &[View], labels: usize) -> Vec<bool> {
    let mut counts = vec![0usize; labels];
    for view in views {
        for (label, beside) in view.labels.iter().zip(&view.beside) {
            counts[usize::from(*label)] += usize::from(*beside);
        }
    }
    let first = usize::from(FIRST_GARMENT).min(labels);
    let all: usize = counts[first..].iter().sum();
    let enough =
        |(k, n): (usize, &usize)| k >= first && *n > 0 && *n as Real >= LOOSE * all as Real;
    counts.iter().enumerate().map(enough).collect()
}

/// Cubes of equal size over a box.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    pub(super) min: Point,
    pub(super) cell: Real,
    pub(super) counts: [usize; 3],
}

impl Lattice {
    /// Two on each side at least.
    pub(super) fn new(region: &Aabb, cell: Real) -> Self {
        let size = region.size();
        let counts = |cell: Real| [0, 1, 2].map(|k| (size[k] / cell).ceil().max(2.0));
        let mut cell = cell;
        while counts(cell).iter().product::<Real>() > MOST_VOXELS {
            cell *= 1.25;
        }
        Self { min: region.min, cell, counts: counts(cell).map(|n| n as usize) }
    }

    pub(super) fn len(&self) -> usize {
        self.counts.iter().product()
    }

    /// The middle of cube `i`; x runs fastest.
    pub(super) fn center(&self, i: usize) -> Point {
        let [nx, ny, _] = self.counts;
        self.min
            + (Vector::new((i % nx) as Real, (i / nx % ny) as Real, (i / (nx * ny)) as Real)
                .add_scalar(0.5))
                * self.cell
    }

    /// The cubes that share a face with cube `i`.
    pub(super) fn beside(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        let [nx, ny, nz] = self.counts;
        let at = [i % nx, i / nx % ny, i / (nx * ny)];
        let steps = [1, nx, nx * ny];
        (0..3).flat_map(move |k| {
            let low = (at[k] > 0).then(|| i - steps[k]);
            let high = (at[k] + 1 < [nx, ny, nz][k]).then(|| i + steps[k]);
            low.into_iter().chain(high)
        })
    }
}

/// A voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Space {
    /// Not known to be filled.
    Open,
    /// Inside the template.
    Body,
    /// Outside of it, but nothing speaks against clothes: the joint that moves it most, and whether
    /// it was seen beside the template.
    Maybe { joint: u16, certain: bool },
    /// Inside clothes.
    Filled,
}

/// What is filled, and why.
pub(super) struct Filling {
    pub(super) lattice: Lattice,
    pub(super) space: Vec<Space>,
    /// Voxels that frames see beside the template.
    pub(super) certain: usize,
    /// Joints about which the clothes hang.
    pub(super) joints: Vec<usize>,
}

/// Finds the space inside loose clothes.
///
/// ```text
/// a voxel may be filled   if it lies outside the template, inside (nearly) all masks, and (nearly) all frames whose view of it
///                         the template does not block see a loose garment there
/// it is certain           if in some frames it lies far beside the posed template
/// J                       the joints that move the certain voxels most, and their parents
/// filled                  what can be reached from certain voxels through such as may be filled, and are moved most by J;
///                         and what that shuts in
/// ```
///
/// With arms down masks do not tell what lies between arms and torso; nothing is certain there, and
/// the arms are not of J. `None` where nothing is certain. `parents` are those of the skeleton's
/// joints, `loose` the labels of loose garments.
pub(super) fn fill(
    lattice: Lattice,
    grid: &WeightGrid,
    template: &FloodedField,
    camera: &Camera,
    views: &[View],
    loose: &[bool],
    parents: &[Option<usize>],
) -> Option<Filling> {
    let judge = Judge { grid, camera, views, loose };
    let state = |i: usize| {
        let p = lattice.center(i);
        match judge.maybe(&p) {
            None => Space::Open,
            Some(_) if template.contains(&p) => Space::Body,
            Some(Verdict { refuted: true, .. }) => Space::Open,
            Some(v) => Space::Maybe { joint: v.joint, certain: v.certain },
        }
    };
    let mut space: Vec<Space> =
        (0..lattice.len()).into_par_iter().with_min_len(1024).map(state).collect();

    let mut moved = vec![0usize; grid.joints()];
    for s in &space {
        if let Space::Maybe { joint, certain: true } = s {
            moved[usize::from(*joint)] += 1;
        }
    }
    let certain: usize = moved.iter().sum();
    if (certain as Real) * lattice.cell.powi(3) < LEAST_CERTAIN {
        return None;
    }
    let mut about: Vec<bool> =
        moved.iter().map(|n| *n as Real >= HANGS * certain as Real).collect();
    let joints: Vec<usize> = (0..about.len()).filter(|j| about[*j]).collect();
    joints.iter().filter_map(|j| parents[*j]).for_each(|p| about[p] = true);

    let passes = |s: Space| matches!(s, Space::Maybe { joint, .. } if about[usize::from(joint)]);
    let is_certain = |s: Space| passes(s) && matches!(s, Space::Maybe { certain: true, .. });
    let mut next: Vec<usize> = (0..space.len()).filter(|i| is_certain(space[*i])).collect();
    next.iter().for_each(|i| space[*i] = Space::Filled);
    while let Some(i) = next.pop() {
        for k in lattice.beside(i) {
            if passes(space[k]) {
                space[k] = Space::Filled;
                next.push(k);
            }
        }
    }
    shut_in(&lattice, &mut space);
    Some(Filling { lattice, space, certain, joints })
}

/// Fills what the border of the lattice does not reach.
fn shut_in(lattice: &Lattice, space: &mut [Space]) {
    let solid = |s: Space| matches!(s, Space::Filled | Space::Body);
    let mut reached = vec![false; space.len()];
    let mut next: Vec<usize> =
        (0..space.len()).filter(|i| lattice.beside(*i).count() < 6 && !solid(space[*i])).collect();
    next.iter().for_each(|i| reached[*i] = true);
    while let Some(i) = next.pop() {
        for k in lattice.beside(i) {
            if !reached[k] && !solid(space[k]) {
                reached[k] = true;
                next.push(k);
            }
        }
    }
    for (s, reached) in space.iter_mut().zip(reached) {
        if !reached && !solid(*s) {
            *s = Space::Filled;
        }
    }
}

struct Judge<'a> {
    grid: &'a WeightGrid,
    camera: &'a Camera,
    views: &'a [View<'a>],
    loose: &'a [bool],
}

struct Verdict {
    joint: u16,
    certain: bool,
    /// Frames see something else than loose clothes there.
    refuted: bool,
}

impl Judge<'_> {
    /// What the frames say about a point of canonical space; `None` where it lies outside the
    /// masks, or is hardly in any picture.
    fn maybe(&self, p: &Point) -> Option<Verdict> {
        let (width, height) = (self.camera.width(), self.camera.height());
        let mut weights = vec![0.0; self.grid.joints()];
        self.grid.weights_at(p, &mut weights);
        let carried: Vec<(usize, Real)> =
            weights.iter().copied().enumerate().filter(|(_, w)| *w > 0.0).collect();
        let most = carried.iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?.0;
        let frames = self.views.len() as Real;
        let (mut seen, mut out, mut beside, mut agree, mut against) =
            (0usize, 0usize, 0usize, 0usize, 0usize);
        for view in self.views {
            let mut q = Vector::zeros();
            for (j, w) in &carried {
                q += (view.maps[*j].linear * p.coords + view.maps[*j].offset) * *w;
            }
            if q.z <= 0.0 {
                continue;
            }
            let pixel = self.camera.to_pixel(&Point::from(q));
            if !(pixel.x >= 0.0
                && pixel.y >= 0.0
                && pixel.x < width as Real
                && pixel.y < height as Real)
            {
                continue;
            }
            let i = pixel.y as usize * width + pixel.x as usize;
            seen += 1;
            if view.outside.pixel(i) > 0.0 {
                out += 1;
                if out as Real > (ALLOWED * frames).max(1.0) {
                    return None;
                }
                continue;
            }
            beside += usize::from(view.beside[i]);
            // What the template hides, or the parser lost, says nothing.
            let label = view.labels[i];
            if Real::from(view.depth[i]) >= q.z && label > 0 {
                if self.loose[usize::from(label)] { agree += 1 } else { against += 1 }
            }
        }
        if (seen as Real) < 0.5 * frames {
            return None;
        }
        let refuted = agree == 0 || against as Real > ELSEWHERE * (agree + against) as Real;
        Some(Verdict {
            joint: most as u16,
            certain: beside as Real >= (CERTAIN * frames).max(2.0),
            refuted,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(counts: [usize; 3]) -> Lattice {
        Lattice { min: Point::origin(), cell: 0.5, counts }
    }

    #[test]
    fn cubes_know_their_places_and_neighbours() {
        let l = lattice([3, 4, 2]);
        for i in 0..l.len() {
            let p = l.center(i);
            for k in l.beside(i) {
                assert!(((l.center(k) - p).norm() - 0.5).abs() < 1e-12);
            }
            let border = (0..3).map(|k| {
                usize::from(p[k] < 0.5) + usize::from(p[k] > 0.5 * (l.counts[k] - 1) as Real)
            });
            assert_eq!(l.beside(i).count() + border.sum::<usize>(), 6, "{i}");
        }
        let fine =
            Lattice::new(&Aabb::from_points(&[Point::origin(), Point::new(1.0, 2.0, 1.0)]), 1e-4);
        assert!(
            fine.len() as Real <= MOST_VOXELS && fine.len() as Real > 0.3 * MOST_VOXELS,
            "{}",
            fine.len()
        );
        assert_eq!(Lattice::new(&Aabb::from_points(&[Point::origin()]), 0.1).counts, [2; 3]);
    }

    #[test]
    fn what_is_shut_in_is_filled_and_what_is_open_stays() {
        let l = lattice([5, 5, 5]);
        let mut space = vec![Space::Open; l.len()];
        let at = |x: usize, y: usize, z: usize| (z * 5 + y) * 5 + x;
        for (x, y, z) in [(1, 2, 2), (3, 2, 2), (2, 1, 2), (2, 3, 2), (2, 2, 1)] {
            space[at(x, y, z)] = Space::Filled;
        }
        let open = space.clone();
        shut_in(&l, &mut space);
        assert_eq!(space, open); // one side is missing
        space[at(2, 2, 3)] = Space::Body;
        shut_in(&l, &mut space);
        assert_eq!(space[at(2, 2, 2)], Space::Filled);
        assert_eq!(space.iter().filter(|s| **s == Space::Filled).count(), 6);
    }

    #[test]
    fn loose_are_the_garments_of_many_pixels_beside_the_template() {
        let outside = DistanceImage::new(&[true; 8], 8, 1, 0.0);
        let view = |labels: Vec<u8>| View {
            maps: Vec::new(),
            outside: &outside,
            depth: vec![Real::INFINITY as f32; 8],
            beside: vec![true, true, true, true, true, true, false, false],
            labels,
        };
        // Skin is none, 3 has one of five, 4 lies before the template.
        let views = [view(vec![1, 2, 2, 2, 2, 3, 4, 4]), view(vec![1, 2, 2, 2, 2, 0, 4, 4])];
        assert_eq!(loose_labels(&views, 5), [false, false, true, false, false]);
        assert_eq!(loose_labels(&views[..1], 5), [false, false, true, true, false]);
        assert_eq!(loose_labels(&[view(vec![1; 8])], 2), [false, false]);
    }
}
