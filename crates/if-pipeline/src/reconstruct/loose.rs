//! The inside of loose clothes, such as the space between the legs in a skirt.

use super::canonical::FloodedField;
use super::distance_image::DistanceImage;
use super::lattice::Lattice;
use super::observe::Observation;
use super::projection::{in_camera, pixels_per_metre};
use crate::asset::{GarmentClass, LayerHint};
use crate::capture::FIRST_GARMENT;
use if_body::skinning::{Affine, WeightGrid, blends, pose_points};
use if_body::{Skeleton, SkinWeights};
use if_core::SignedDistance;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::camera::Camera;
use if_mesh::raster::{IdBuffer, NOTHING, RasterParams, Rasteriser};
use rayon::prelude::*;

/// The share of the distance from the template beyond which a pixel is far from it that holds between
/// two parts of it, such as legs: there skirts span gaps that are hardly twice as wide.
const BETWEEN: Real = 0.8;
/// How far these parts are from the pixel at most, along its row, in metres.
const APART: Real = 0.15;
/// Largest share of frames whose masks may contradict a filled voxel: noise, and clothes that do not
/// follow the skeleton.
const ALLOWED: Real = 1.0 / 12.0;
/// Least share of frames, and at least two, that must see a voxel beside the template for it to be
/// certain.
const CERTAIN: Real = 1.0 / 12.0;
/// Least share of the garment pixels beside the template for a garment to be loose. Parsers confuse
/// a few per cent.
const LOOSE: Real = 0.2;
/// Largest share of the frames seeing a voxel that may see something other than loose clothes. The
/// poorest parser of `docs/reference/capture.md` is wrong at one pixel in ten.
const ELSEWHERE: Real = 0.25;
/// Least share of the certain voxels that a joint must move most for loose clothes to hang around
/// it.
const HANGS: Real = 0.02;
/// Largest distance from a joint to what hangs at it, as a share of the skeleton's size, for it to be of a hand, a
/// foot or the head. Hands have 0.08, feet 0.10, forearms at least 0.20, whatever the skeleton.
const HAND: Real = 0.15;
/// How far the fill goes on beyond the joints around which clothes hang, in metres.
const TAPER: Real = 0.25;
/// How thick it is at most there, in metres; it thins out by the square of the distance to its end.
const THICK: Real = 0.1;
/// Least certain volume, in cubic metres: a tenth of a litre. Less is noise.
const LEAST_CERTAIN: Real = 1e-4;
/// The same where pixels between two parts count. Legs of trousers that nearly touch have up to 0.17
/// litres, the narrowest pencil skirts 0.21.
const LEAST_CERTAIN_BETWEEN: Real = 2e-4;

/// Share of a person's pixels that lie no farther beside the template than its clothes reach. The others
/// are noise of masks.
const NEARLY_ALL: Real = 0.999;
/// Largest distance from the template that clothes reach, in metres.
const WIDEST: Real = 1.2;

/// Where a pixel lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// Near the posed template, or beside the person.
    Near,
    /// Less far from the template, between two parts of it.
    Between,
    /// Far from it.
    Far,
}

/// A frame with the posed template.
pub(super) struct View<'a> {
    /// The transform of each joint into the camera's frame.
    maps: Vec<Affine>,
    outside: &'a DistanceImage,
    /// Depth of the posed template, infinite beside it.
    depth: Vec<f32>,
    /// Where each pixel of the person lies beside the posed template.
    place: Vec<Place>,
    /// How far beside it nearly all pixels of the person lie at most, in metres.
    widest: Real,
    /// Whether pixels between two parts of it count as far from it.
    pub(super) between: bool,
    /// Label image; empty until it is read.
    pub(super) labels: Vec<u8>,
}

impl<'a> View<'a> {
    /// Poses the template; `loose` is the distance beyond which a pixel is far from it, in metres.
    pub(super) fn new(
        mesh: &TriMesh,
        skin: &SkinWeights,
        camera: &Camera,
        frame: &'a Observation,
        loose: Real,
    ) -> Self {
        let world = pose_points(mesh.vertices(), &blends(skin, &frame.transforms));
        let mut buffer = IdBuffer::default();
        Rasteriser::default().rasterise(
            mesh,
            &world,
            camera,
            &RasterParams::default(),
            &mut buffer,
        );
        let figure: Vec<bool> = buffer.triangle.iter().map(|t| *t != NOTHING).collect();
        let seen: Vec<Real> =
            buffer.depth.iter().filter(|z| z.is_finite()).map(|z| Real::from(*z)).collect();
        let depth = seen.iter().sum::<Real>() / seen.len().max(1) as Real;
        let away = DistanceImage::new(&figure, camera.width(), camera.height(), 0.0);
        let per_metre = if depth > 0.0 { pixels_per_metre(camera) / depth } else { Real::INFINITY };
        let (pixels, apart) = (loose * per_metre, (APART * per_metre) as usize);
        let is_between = |i: usize| {
            let (row, at) = (i / camera.width() * camera.width(), i % camera.width());
            let row = &figure[row..row + camera.width()];
            let right = row[at..].iter().take(apart).any(|f| *f);
            right && row[..at].iter().rev().take(apart).any(|f| *f)
        };
        let place = |i: usize| match Real::from(away.pixel(i)) {
            _ if frame.outside.pixel(i) >= 0.0 => Place::Near,
            away if away > pixels => Place::Far,
            away if away > BETWEEN * pixels && is_between(i) => Place::Between,
            _ => Place::Near,
        };
        let place = (0..figure.len()).map(place).collect();
        let person = (0..figure.len()).filter(|i| frame.outside.pixel(*i) < 0.0);
        let mut beside: Vec<f32> = person.map(|i| away.pixel(i)).collect();
        let rank = (NEARLY_ALL * beside.len() as Real) as usize;
        let widest = match beside.len() {
            0 => 0.0,
            n => Real::from(*beside.select_nth_unstable_by(rank.min(n - 1), f32::total_cmp).1),
        };
        let widest = widest / per_metre;
        let maps = frame.transforms.iter().map(in_camera(camera)).collect();
        let (outside, depth) = (&frame.outside, buffer.depth);
        Self { maps, outside, depth, place, widest, between: false, labels: Vec::new() }
    }

    /// Whether a pixel of the person is far from the posed template.
    fn is_beside(&self, i: usize) -> bool {
        self.place[i] == Place::Far || self.between && self.place[i] == Place::Between
    }

    /// Number of pixels of the person, and of those far from the template.
    pub(super) fn counts(&self) -> (usize, usize) {
        let pixels = 0..self.place.len();
        let person = pixels.clone().filter(|i| self.outside.pixel(*i) < 0.0).count();
        (person, pixels.filter(|i| self.is_beside(*i)).count())
    }
}

/// The labels of loose garments: those of a large share of the pixels far from the template. Trousers are none
/// by their name: masks that are a pixel too large close the gap between their legs.
pub(super) fn loose_labels(views: &[View], labels: &[String]) -> Vec<bool> {
    let mut counts = vec![0usize; labels.len()];
    for view in views {
        for (i, label) in view.labels.iter().enumerate() {
            counts[usize::from(*label)] += usize::from(view.is_beside(i));
        }
    }
    let first = usize::from(FIRST_GARMENT).min(labels.len());
    let all: usize = counts[first..].iter().sum();
    let may_hang = |name: &str| LayerHint::of_name(name).class != GarmentClass::Legs;
    let enough = |(k, n): (usize, &usize)| {
        k >= first && *n > 0 && *n as Real >= LOOSE * all as Real && may_hang(&labels[k])
    };
    counts.iter().enumerate().map(enough).collect()
}

/// The state of a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Space {
    /// Not known to be filled.
    Open,
    /// Inside the template.
    Body,
    /// Outside the template, and possibly inside clothes: the joint that moves it most, and whether
    /// frames see it beside the template.
    Maybe { joint: u16, certain: bool },
    /// Outside the template, inside all masks, where frames see clothes that hang over loose ones.
    Covered,
    /// Inside clothes.
    Filled,
}

/// The filled voxels.
pub(super) struct Filling {
    pub(super) lattice: Lattice,
    pub(super) space: Vec<Space>,
    /// Number of voxels that frames see beside the template.
    pub(super) certain: usize,
    /// Joints around which the clothes hang.
    pub(super) joints: Vec<usize>,
    /// Whether each label of the capture is that of loose clothes.
    pub(super) loose: Vec<bool>,
}

/// Finds the space inside loose clothes.
///
/// ```text
/// a voxel may be filled   if it lies outside the template, inside (nearly) all masks, and (nearly) all frames whose view of it
///                         the template does not block see a loose garment there
/// it is certain           if in some frames it lies far beside the posed template
/// J                       the joints that move the certain voxels most, but for hands, feet and head, and their parents
/// filled                  what can be reached from certain voxels through such as may be filled, and are moved most by J;
///                         beyond them, ever thinner, up to 25 cm; and what that shuts in
/// ```
///
/// With arms down, masks do not show the space between arms and torso; nothing is certain there, and
/// the arms are not in J. A hand beside a coat would take a part of it for its own: nothing hangs around hands. `None` if nothing is certain. `loose` are the labels of loose garments.
pub(super) fn fill(
    cell: Real,
    grid: &WeightGrid,
    template: &FloodedField,
    camera: &Camera,
    views: &[View],
    loose: &[bool],
    skeleton: &Skeleton,
) -> Option<Filling> {
    let judge = Judge { grid, camera, views, loose };
    let states = |lattice: &Lattice| -> Vec<Space> {
        let state = |i: usize| {
            let p = lattice.center(i);
            match judge.maybe(&p) {
                None => Space::Open,
                Some(_) if template.contains(&p) => Space::Body,
                Some(v) if v.labels.are_over() => Space::Covered,
                Some(v) if v.labels.refute() => Space::Open,
                Some(v) => Space::Maybe { joint: v.joint, certain: v.certain },
            }
        };
        (0..lattice.len()).into_par_iter().with_min_len(1024).map(state).collect()
    };
    let least = if views.iter().any(|v| v.between) { LEAST_CERTAIN_BETWEEN } else { LEAST_CERTAIN };
    // Twice as large voxels are an eighth of the work, and tell where next to nothing is certain.
    let bounds = bounds(grid, template, views);
    let coarse = Lattice::new(&bounds, 2.0 * cell);
    let coarse_space = states(&coarse);
    let some =
        coarse_space.iter().filter(|s| matches!(s, Space::Maybe { certain: true, .. })).count();
    if (some as Real) * coarse.cell.powi(3) < 0.5 * least {
        return None;
    }
    let lattice = Lattice::new(&bounds, cell);
    let mut space = states(&lattice);

    // J: the joints that move certain voxels most, and their parents.
    let is_end = ends(skeleton);
    let mut moved = vec![0usize; grid.joints()];
    for s in &space {
        if let Space::Maybe { joint, certain: true } = s
            && !is_end[usize::from(*joint)]
        {
            moved[usize::from(*joint)] += 1;
        }
    }
    let certain: usize = moved.iter().sum();
    if (certain as Real) * lattice.cell.powi(3) < least {
        return None;
    }
    let mut about: Vec<bool> =
        moved.iter().map(|n| *n as Real >= HANGS * certain as Real).collect();
    let joints: Vec<usize> = (0..about.len()).filter(|j| about[*j]).collect();
    joints.iter().filter_map(|j| skeleton.joints()[*j].parent).for_each(|p| about[p] = true);

    // Flood fill from the certain voxels.
    let passes = |s: Space| matches!(s, Space::Maybe { joint, .. } if about[usize::from(joint)]);
    let is_certain = |s: Space| passes(s) && matches!(s, Space::Maybe { certain: true, .. });
    let mut next: Vec<usize> = (0..space.len()).filter(|i| is_certain(space[*i])).collect();
    next.iter().for_each(|i| space[*i] = Space::Filled);
    while let Some(i) = next.pop() {
        for k in lattice.size.neighbours(i) {
            if passes(space[k]) {
                space[k] = Space::Filled;
                next.push(k);
            }
        }
    }
    taper(&lattice, &mut space);
    shut_in(&lattice, &mut space);
    Some(Filling { lattice, space, certain, joints, loose: loose.to_vec() })
}

/// Whether each joint is of a hand, a foot or the head: all that hangs at it is near.
fn ends(skeleton: &Skeleton) -> Vec<bool> {
    let joints = skeleton.joints();
    let size = Aabb::from_points(joints.iter().flat_map(|j| [&j.head, &j.tail])).size().max();
    let mut is_end = vec![true; joints.len()];
    for (k, last) in joints.iter().enumerate() {
        for above in std::iter::successors(Some(k), |j| joints[*j].parent) {
            let from = joints[above].head;
            let reach = (last.tail - from).norm().max((last.head - from).norm());
            is_end[above] &= reach <= HAND * size;
        }
    }
    is_end
}

/// Where clothes may be: the box of the grid, and for clothes that frames show farther from the template
/// than that is from its box, a larger one.
fn bounds(grid: &WeightGrid, template: &FloodedField, views: &[View]) -> Aabb {
    let all = grid.bounds();
    let body = template.bounds().unwrap_or(all);
    let (low, high) = (body.min - all.min, all.max - body.max);
    let margin = low.iter().chain(high.iter()).copied().fold(Real::INFINITY, Real::min);
    let widest = views.iter().map(|view| view.widest).fold(0.0, Real::max).min(WIDEST);
    all.inflated((widest - margin).max(0.0))
}

/// Goes on beyond J, ever thinner: `up` steps from the fill, of at most n, voxels are filled that lie
/// at most (1 − up / n)² of [`THICK`] from the template, both along the lattice. A fill that ended at
/// once would leave a ledge of centimetres, which folds when the surface is drawn out to the clothes
/// above it.
fn taper(lattice: &Lattice, space: &mut [Space]) {
    let height = (TAPER / lattice.cell).ceil() as usize;
    let open = |i: usize| matches!(space[i], Space::Maybe { .. } | Space::Covered);
    let steps = |from: Space| -> Vec<usize> {
        let mut steps = vec![usize::MAX; space.len()];
        let mut next: Vec<usize> = (0..space.len()).filter(|i| space[*i] == from).collect();
        next.iter().for_each(|i| steps[*i] = 0);
        for step in 1..=height {
            let near: Vec<usize> = next.iter().flat_map(|i| lattice.size.neighbours(*i)).collect();
            next.clear();
            for i in near {
                if open(i) && steps[i] == usize::MAX {
                    steps[i] = step;
                    next.push(i);
                }
            }
        }
        steps
    };
    let up = steps(Space::Filled);
    let off = steps(Space::Body);
    let thin = |i: &usize| {
        let left = 1.0 - up[*i].min(height) as Real / height as Real;
        open(*i) && off[*i] as Real * lattice.cell <= THICK * left * left
    };
    let filled: Vec<usize> = (0..space.len()).filter(thin).collect();
    filled.into_iter().for_each(|i| space[i] = Space::Filled);
}

/// Fills voxels that are not connected to the border of the lattice.
fn shut_in(lattice: &Lattice, space: &mut [Space]) {
    let solid = |s: Space| matches!(s, Space::Filled | Space::Body);
    let mut reached = vec![false; space.len()];
    let mut next: Vec<usize> = (0..space.len())
        .filter(|i| lattice.size.neighbours(*i).count() < 6 && !solid(space[*i]))
        .collect();
    next.iter().for_each(|i| reached[*i] = true);
    while let Some(i) = next.pop() {
        for k in lattice.size.neighbours(i) {
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
    labels: Seen,
}

/// Numbers of frames that see a label where the template does not hide the voxel.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// Of loose clothes.
    loose: usize,
    /// Of all else.
    other: usize,
    /// Of skin, or of clothes that loose ones are worn over: seen through an opening, as of a jacket.
    beneath: usize,
}

impl Seen {
    fn count(&mut self, label: u8, loose: &[bool]) {
        let label = usize::from(label);
        if loose[label] {
            self.loose += 1;
        } else {
            self.other += 1;
            self.beneath += usize::from(loose[label..].contains(&true));
        }
    }

    fn are_many(self, frames: usize) -> bool {
        frames as Real > ELSEWHERE * (self.loose + self.other) as Real
    }

    /// Whether something else than loose clothes is there.
    fn refute(self) -> bool {
        self.loose == 0 || self.are_many(self.other)
    }

    /// Whether that is clothes that hang over loose ones.
    fn are_over(self) -> bool {
        self.refute() && self.other > 0 && !self.are_many(self.beneath)
    }
}

impl Judge<'_> {
    /// The verdict of all frames on a point of canonical space; `None` if it lies outside the masks,
    /// or in too few pictures.
    fn maybe(&self, p: &Point) -> Option<Verdict> {
        let (width, height) = (self.camera.width(), self.camera.height());
        let mut weights = vec![0.0; self.grid.joints()];
        self.grid.weights_at(p, &mut weights);
        let carried: Vec<(usize, Real)> =
            weights.iter().copied().enumerate().filter(|(_, w)| *w > 0.0).collect();
        let most = carried.iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?.0;
        let frames = self.views.len() as Real;
        let (mut seen, mut out, mut beside) = (0usize, 0usize, 0usize);
        let mut labels = Seen::default();
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
            beside += usize::from(view.is_beside(i));
            // Pixels that the template hides, or that have no label, do not count.
            let label = view.labels[i];
            if Real::from(view.depth[i]) >= q.z && label > 0 {
                labels.count(label, self.loose);
            }
        }
        if (seen as Real) < 0.5 * frames {
            return None;
        }
        Some(Verdict {
            joint: most as u16,
            certain: beside as Real >= (CERTAIN * frames).max(2.0),
            labels,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_body::Joint;
    use if_body::mannequin::rig;
    use if_core::shapes::meshes;

    #[test]
    fn enclosed_voxels_are_filled_and_open_ones_are_not() {
        let l = Lattice { min: Point::origin(), cell: 0.5, size: if_mesh::grid::GridSize([5; 3]) };
        let mut space = vec![Space::Open; l.len()];
        let at = |x: usize, y: usize, z: usize| (z * 5 + y) * 5 + x;
        for (x, y, z) in [(1, 2, 2), (3, 2, 2), (2, 1, 2), (2, 3, 2), (2, 2, 1)] {
            space[at(x, y, z)] = Space::Filled;
        }
        let open = space.clone();
        shut_in(&l, &mut space);
        assert_eq!(space, open); // open on one side
        space[at(2, 2, 3)] = Space::Body;
        shut_in(&l, &mut space);
        assert_eq!(space[at(2, 2, 2)], Space::Filled);
        assert_eq!(space.iter().filter(|s| **s == Space::Filled).count(), 6);
    }

    #[test]
    fn hands_feet_and_head_are_ends_with_their_fingers_and_without() {
        let plain = rig::skeleton();
        let names = |skeleton: &Skeleton| -> Vec<String> {
            let is_end = ends(skeleton);
            let named = skeleton.names().zip(is_end).filter(|(_, is_end)| *is_end);
            named.map(|(name, _)| name.to_owned()).collect()
        };
        assert_eq!(names(&plain), ["head", "left_foot", "right_foot"]);
        // A hand of 15 cm, with a finger of two bones and a thumb.
        let mut joints = plain.joints().to_vec();
        let wrist = joints[4].tail;
        let at = |along: Real| wrist + Vector::x() * along;
        for (name, parent, from, to) in [
            ("hand", 4, 0.0, 0.06),
            ("finger", joints.len(), 0.06, 0.1),
            ("tip", joints.len() + 1, 0.1, 0.15),
            ("thumb", joints.len(), 0.03, 0.08),
        ] {
            let (head, tail) = (at(from), at(to));
            joints.push(Joint { name: name.into(), parent: Some(parent), head, tail });
        }
        let fingered = Skeleton::new(joints).unwrap();
        let all = ["head", "left_foot", "right_foot", "hand", "finger", "tip", "thumb"];
        assert_eq!(names(&fingered), all);
    }

    #[test]
    fn between_two_legs_less_is_far_than_beside_them() {
        // Two legs of 12 cm with 9 cm between them, and a skirt that reaches 4.5 cm beyond them.
        let leg = |x: Real| {
            let tube = meshes::tube(0.06, 0.8, 24, 8, true);
            tube.with_vertices(tube.vertices().iter().map(|p| p + Vector::x() * x).collect())
        };
        let [a, b] = [leg(-0.105).unwrap(), leg(0.105).unwrap()];
        let n = a.vertices().len();
        let more = b.triangles().iter().map(|t| t.map(|v| v + n as u32));
        let legs = TriMesh::new(
            [a.vertices(), b.vertices()].concat(),
            a.triangles().iter().copied().chain(more).collect(),
        )
        .unwrap();
        let skin =
            SkinWeights::new(vec![[0; 4]; 2 * n], vec![[1.0, 0.0, 0.0, 0.0]; 2 * n], 1).unwrap();
        let (size, eye, up) = ((256, 256), Point::new(0.0, 0.4, 3.0), Vector::y());
        let camera = Camera::looking_at(size, &eye, &Point::new(0.0, 0.4, 0.0), &up, 0.35).unwrap();
        let pixel = |x: Real, y: Real| {
            let pixel = camera.project(&Point::new(x, y, 0.0)).unwrap();
            [pixel.x as usize, pixel.y as usize]
        };
        let at = |x: Real| pixel(x, 0.4)[1] * 256 + pixel(x, 0.4)[0];
        let ([left, top], [right, bottom]) = (pixel(-0.21, 0.8), pixel(0.21, 0.0));
        let is_skirt =
            |i: usize| (left..right).contains(&(i % 256)) && (top..bottom).contains(&(i / 256));
        let mask: Vec<bool> = (0..256 * 256).map(is_skirt).collect();
        let frame = Observation {
            frame: 0,
            transforms: vec![if_core::nalgebra::Isometry3::identity()],
            outside: DistanceImage::new(&mask, 256, 256, 0.0),
            normals: Vec::new(),
        };
        let mut view = View::new(&legs, &skin, &camera, &frame, 0.05);
        assert_eq!(view.counts().1, 0);
        view.between = true;
        assert!(view.is_beside(at(0.0)));
        assert!(!view.is_beside(at(0.206)) && !view.is_beside(at(-0.206)));
        assert!(!view.is_beside(at(0.105)), "a leg");
        // Nothing is that far.
        let view = View { between: true, ..View::new(&legs, &skin, &camera, &frame, 0.06) };
        assert_eq!(view.counts().1, 0);
    }

    #[test]
    fn what_hangs_over_loose_clothes_is_told_from_what_they_are_worn_over() {
        let judged = |labels: &[u8], loose: &[bool]| {
            let mut seen = Seen::default();
            labels.iter().for_each(|l| seen.count(*l, loose));
            (seen.refute(), seen.are_over())
        };
        // Background, skin, T-shirt, skirt (loose), jacket.
        let seen = |labels: &[u8]| judged(labels, &[false, false, false, true, false]);
        assert_eq!(seen(&[3, 3, 3, 4]), (false, false));
        assert_eq!(seen(&[3, 4, 4, 4]), (true, true));
        assert_eq!(seen(&[4, 4]), (true, true));
        assert_eq!(seen(&[3, 1, 1, 4]), (true, false));
        assert_eq!(seen(&[3, 2, 2, 2]), (true, false));
        assert_eq!(seen(&[]), (true, false));
        // A T-shirt over loose trousers, seen through a loose jacket that is open.
        assert_eq!(judged(&[3, 3, 4], &[false, false, true, false, true]), (true, false));
    }

    #[test]
    fn the_fill_tapers_off_along_the_body() {
        // Columns of 40 voxels of 1 cm: one of the body, and ten beside it, which are filled up to
        // height 5. All above may be.
        let size = if_mesh::grid::GridSize([11, 40, 2]);
        let l = Lattice { min: Point::origin(), cell: 0.01, size };
        let at = |x: usize, y: usize| size.index([x, y, 0]);
        let maybe = Space::Maybe { joint: 0, certain: false };
        let mut space = vec![Space::Open; l.len()];
        for y in 0..40 {
            space[at(0, y)] = Space::Body;
            (1..11).for_each(|x| {
                space[at(x, y)] = match y {
                    0..5 => Space::Filled,
                    5..15 => maybe,
                    _ => Space::Covered,
                }
            });
        }
        space[at(2, 12)] = Space::Open;
        taper(&l, &mut space);
        let thick = |y: usize| (1..11).filter(|x| space[at(*x, y)] == Space::Filled).count();
        // What hangs over loose clothes is no obstacle. (1 − 1/25)² of 10 cm, (1 − 12/25)² of it, and nothing beyond 25 cm.
        assert_eq!([thick(4), thick(5), thick(16), thick(25), thick(30)], [10, 9, 2, 0, 0]);
        assert!((5..39).all(|y| thick(y + 1) <= thick(y) || y == 12));
        assert_eq!(space[at(2, 12)], Space::Open);
    }

    #[test]
    fn garments_with_many_pixels_beside_the_template_are_loose() {
        let outside = DistanceImage::new(&[true; 8], 8, 1, 0.0);
        let view = |labels: Vec<u8>| View {
            maps: Vec::new(),
            outside: &outside,
            depth: vec![Real::INFINITY as f32; 8],
            place: [[Place::Far; 6].as_slice(), &[Place::Between, Place::Near]].concat(),
            widest: 0.0,
            between: false,
            labels,
        };
        // Skin is not a garment, label 3 has one pixel of five, label 4 is in front of the template.
        let views = [view(vec![1, 2, 2, 2, 2, 3, 4, 4]), view(vec![1, 2, 2, 2, 2, 0, 4, 4])];
        let names = ["background", "skin", "skirt", "coat", "tshirt"].map(String::from);
        assert_eq!(loose_labels(&views, &names), [false, false, true, false, false]);
        assert_eq!(loose_labels(&views[..1], &names), [false, false, true, true, false]);
        assert_eq!(loose_labels(&[view(vec![1; 8])], &names[..2]), [false, false]);
        // Trousers have two legs.
        let names = ["background", "skin", "trousers", "coat", "tshirt"].map(String::from);
        assert_eq!(loose_labels(&views[..1], &names), [false, false, false, true, false]);
    }
}
