//! What moves an outfit: the poses of a skeleton, or a body that is given in every frame.

use super::bound::BoundOutfit;
use super::error::AnimateError;
use super::local::PoseMaps;
use super::outfit::SkinnedOutfit;
use super::shots::{Shots, way};
use if_body::{Motion, Pose, is_rate};
use if_core::closest::ClosestPoint;
use if_core::math::{Point, Real, Vector};
use if_mesh::index::Bvh;
use if_outfit::{Outfit, Storage};
use serde_json::json;

/// Farthest from the origin that a frame may lie, in metres: there steps of single precision are 0.03 mm.
const FARTHEST: Real = 500.0;
/// Farthest that a vertex of no triangle may lie, in metres: also moved, it is a single-precision number.
const STORED: Real = 1e30;
/// No vertex is displaced by more than this from where a frame has it, in metres.
pub(super) const DISPLACED: Real = 0.1;

/// An outfit and how it is moved, frame by frame.
#[derive(Clone, Copy, Debug)]
pub struct Movement<'a>(Kind<'a>);

#[derive(Clone, Copy, Debug)]
enum Kind<'a> {
    Poses(&'a SkinnedOutfit, &'a Motion),
    Bodies(&'a BoundOutfit),
}

/// The largest distance of a garment's vertex from the body. Those of no triangle may be anywhere.
fn farthest_from_body(outfit: &Outfit) -> Real {
    let body = Bvh::new(&outfit.body.mesh);
    let distances = outfit.garments.iter().flat_map(|garment| {
        let vertices = garment.mesh.vertices().iter().zip(garment.mesh.used_vertices());
        let used = vertices.filter(|(_, is_used)| *is_used);
        used.filter_map(|(p, _)| Some(body.closest(p, Real::MAX)?.distance))
    });
    distances.fold(0.0, Real::max)
}

/// Where a walker's target is: what the way to the next frame begins from.
#[derive(Clone, Debug)]
pub(super) enum Place {
    Pose(Pose),
    /// The positions of the body.
    Body(Vec<Point>),
}

/// Positions of the rest state at a share of a way.
type Posing<'a> = dyn Fn(Real, &[Point]) -> Vec<Point> + 'a;

/// The way from a place to a frame.
pub(super) struct Way<'a> {
    /// Steps in which nothing turns by more than was asked for.
    pub(super) steps: usize,
    /// The place at a share of the way.
    pub(super) place: Box<dyn Fn(Real) -> Place + 'a>,
    /// Positions of the rest state there.
    pub(super) posed: Box<Posing<'a>>,
}

impl<'a> Movement<'a> {
    /// A skinned outfit in the poses of a motion.
    pub fn poses(outfit: &'a SkinnedOutfit, motion: &'a Motion) -> Self {
        Self(Kind::Poses(outfit, motion))
    }

    /// An outfit that follows a body that is given in every frame.
    pub fn bodies(outfit: &'a BoundOutfit) -> Self {
        Self(Kind::Bodies(outfit))
    }

    /// Body and garments in the rest pose.
    pub fn outfit(&self) -> &'a Outfit {
        match self.0 {
            Kind::Poses(outfit, _) => &outfit.outfit,
            Kind::Bodies(bound) => bound.outfit(),
        }
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        match self.0 {
            Kind::Poses(_, motion) => motion.poses.len(),
            Kind::Bodies(bound) => bound.sequence().len(),
        }
    }

    /// Frames per second.
    pub fn frames_per_second(&self) -> Real {
        match self.0 {
            Kind::Poses(_, motion) => motion.frames_per_second,
            Kind::Bodies(bound) => bound.sequence().frames_per_second,
        }
    }

    /// Where a frame has the rest pose's positions of all layers, the body first, before anything is
    /// kept apart.
    ///
    /// # Errors
    ///
    /// A file that cannot be read any more.
    ///
    /// # Panics
    ///
    /// If the frame is out of range, the points are not as many as the vertices, or its pose is of
    /// another skeleton.
    pub fn posed(&self, frame: usize, points: &[Point]) -> Result<Vec<Point>, AnimateError> {
        Ok(self.maps(frame)?.posed(points))
    }

    pub(super) fn positions(&self) -> Vec<Point> {
        self.outfit().layers().flat_map(|layer| layer.mesh.vertices()).copied().collect()
    }

    /// How frames are stored, so that differences of two frames are exact in single precision, and the frames
    /// between cuts.
    ///
    /// # Errors
    ///
    /// A frame that lies too far from the origin, or cannot be read any more.
    pub(super) fn survey(&self) -> Result<(Storage, Shots), AnimateError> {
        let rest = self.positions();
        let skin = self.outfit().body.mesh.vertices().len();
        let is_used: Vec<bool> =
            self.outfit().layers().flat_map(|layer| layer.mesh.used_vertices()).collect();
        let (mut low, mut high) =
            (Point::from([Real::INFINITY; 3]), Point::from([-Real::INFINITY; 3]));
        let (mut last, mut ways) = (Vec::new(), Vec::new());
        for frame in 0..self.frames() {
            let mut points = match self.0 {
                Kind::Poses(..) => self.posed(frame, &rest)?,
                // The maps of garments take long, and keep them as near to the body as they are.
                Kind::Bodies(bound) => bound.frame(frame)?,
            };
            for (p, _) in points.iter().zip(&is_used).filter(|(_, is_used)| **is_used) {
                (low, high) = (low.inf(p), high.sup(p));
            }
            let distance = low.coords.abs().max().max(high.coords.abs().max());
            if distance > FARTHEST {
                return Err(AnimateError::Far { frame, distance });
            }
            points.truncate(skin);
            if frame > 0 {
                let moved = points.iter().zip(&last).zip(&is_used).filter(|(_, is_used)| **is_used);
                ways.push(way(moved
                    .map(|((a, b), _): ((&Point, &Point), _)| (a - b).norm())
                    .collect()));
            }
            last = points;
        }
        let shots = Shots::new(self.frames(), &ways, 1.0 / self.frames_per_second());
        let beyond = match self.0 {
            Kind::Poses(..) => 0.0,
            Kind::Bodies(bound) => farthest_from_body(bound.outfit()),
        };
        let reach = Vector::repeat(DISPLACED + beyond);
        Ok((Storage::with_exact_differences(&(low - reach), &(high + reach)), shots))
    }

    /// Refuses poses of another skeleton, numbers that are not finite, a rate that is none, and vertices
    /// that frames cannot store.
    pub(super) fn check(&self) -> Result<(), AnimateError> {
        let rate = self.frames_per_second();
        if !is_rate(rate) {
            return Err(AnimateError::Rate(rate));
        }
        for layer in self.outfit().layers() {
            let is_far = |p: &Point| p.iter().any(|x| x.abs() > STORED);
            if let Some(vertex) = layer.mesh.vertices().iter().position(is_far) {
                let (layer, at) = (layer.name.clone(), layer.mesh.vertices()[vertex]);
                return Err(AnimateError::Vertex { layer, vertex, at });
            }
        }
        if let Kind::Poses(outfit, motion) = self.0 {
            for (frame, pose) in motion.poses.iter().enumerate() {
                let fault = |source| AnimateError::Pose { frame, source };
                Pose::from_quaternions(pose.root_translation, &pose.quaternions())
                    .map_err(fault)?;
                outfit.skeleton.transforms(pose).map_err(fault)?;
            }
        }
        Ok(())
    }

    /// The maps of all vertices in a frame, from the rest pose.
    pub(super) fn maps(&self, frame: usize) -> Result<PoseMaps, AnimateError> {
        match self.0 {
            Kind::Poses(outfit, motion) => Ok(PoseMaps::of_pose(outfit, &motion.poses[frame])),
            Kind::Bodies(bound) => Ok(bound.maps(&bound.frame(frame)?)),
        }
    }

    /// The rest pose.
    pub(super) fn rest(&self) -> Place {
        match self.0 {
            Kind::Poses(outfit, _) => Place::Pose(Pose::rest(outfit.skeleton.len())),
            Kind::Bodies(bound) => Place::Body(bound.outfit().body.mesh.vertices().to_vec()),
        }
    }

    /// The rest pose, moved as a whole to where a frame has it, and positions of the rest pose there.
    pub(super) fn rest_near(
        &self,
        frame: usize,
        points: &[Point],
    ) -> Result<(Place, Vec<Point>), AnimateError> {
        match self.0 {
            Kind::Poses(outfit, motion) => {
                let pose = &motion.poses[frame];
                let mut rest = Pose::rest(pose.rotations.len());
                rest.root_translation = pose.root_translation;
                for (k, joint) in outfit.skeleton.joints().iter().enumerate() {
                    if joint.parent.is_none() {
                        rest.rotations[k] = pose.rotations[k];
                    }
                }
                let posed = PoseMaps::of_pose(outfit, &rest).posed(points);
                Ok((Place::Pose(rest), posed))
            }
            Kind::Bodies(bound) => {
                let whole = bound.whole(&bound.frame(frame)?);
                let body = bound.outfit().body.mesh.vertices().iter().map(|p| whole * p).collect();
                Ok((Place::Body(body), points.iter().map(|p| whole * p).collect()))
            }
        }
    }

    /// The way from a place to a frame, in steps in which nothing turns by more than `turn`.
    pub(super) fn way(
        &self,
        from: &Place,
        frame: usize,
        turn: Real,
    ) -> Result<Way<'a>, AnimateError> {
        let steps = |largest: Real| (largest / turn).ceil().max(1.0) as usize;
        match (self.0, from) {
            (Kind::Poses(outfit, motion), Place::Pose(from)) => {
                let (from, to) = (from.clone(), &motion.poses[frame]);
                let pose = move |share: Real| from.toward(to, share);
                let again = pose.clone();
                Ok(Way {
                    steps: steps(pose(0.0).largest_turn(to)),
                    place: Box::new(move |share| Place::Pose(pose(share))),
                    posed: Box::new(move |share, points| {
                        PoseMaps::of_pose(outfit, &again(share)).posed(points)
                    }),
                })
            }
            (Kind::Bodies(bound), Place::Body(from)) => {
                let way = std::sync::Arc::new(bound.way(from, &bound.frame(frame)?));
                let again = way.clone();
                Ok(Way {
                    steps: steps(way.largest_turn()),
                    place: Box::new(move |share| Place::Body(bound.between(&way, share))),
                    posed: Box::new(move |share, points| {
                        bound.maps(&bound.between(&again, share)).posed(points)
                    }),
                })
            }
            // A movement makes places of its own kind alone; a foreign one is as the rest pose.
            _ => self.way(&self.rest(), frame, turn),
        }
    }

    /// Passes on all that decides the frames.
    pub(super) fn digest(&self, add: &mut dyn FnMut(&[u8])) -> Result<(), AnimateError> {
        let numbers = |add: &mut dyn FnMut(&[u8]), all: &mut dyn Iterator<Item = Real>| {
            let bytes: Vec<u8> = all.flat_map(Real::to_le_bytes).collect();
            add(&bytes);
        };
        for layer in self.outfit().layers() {
            let mesh = &layer.mesh;
            add(json!({ "layer": layer.name }).to_string().as_bytes()); // rows name it
            numbers(add, &mut std::iter::once(mesh.vertices().len() as Real));
            numbers(add, &mut mesh.vertices().iter().flat_map(|p| [p.x, p.y, p.z]));
            numbers(add, &mut mesh.triangles().iter().flatten().map(|v| Real::from(*v)));
        }
        match self.0 {
            Kind::Poses(outfit, motion) => {
                let names = outfit.skeleton.names().collect::<Vec<_>>();
                add(json!({ "joints": names }).to_string().as_bytes());
                for joint in outfit.skeleton.joints() {
                    let parent = joint.parent.map_or(-1.0, |p| p as Real);
                    let head = joint.head.coords.iter().copied();
                    numbers(add, &mut head.chain(std::iter::once(parent)));
                }
                for pose in &motion.poses {
                    numbers(add, &mut pose.root_translation.iter().copied());
                    numbers(add, &mut pose.quaternions().iter().flatten().copied());
                }
                let skin = outfit.skin();
                for (joints, weights) in skin.joints().iter().zip(skin.weights()) {
                    numbers(add, &mut joints.iter().map(|j| Real::from(*j)));
                    numbers(add, &mut weights.iter().map(|w| Real::from(*w)));
                }
            }
            Kind::Bodies(bound) => {
                add(b"bodies");
                for frame in 0..self.frames() {
                    let body = bound.frame(frame)?;
                    numbers(add, &mut body.iter().flat_map(|p| [p.x, p.y, p.z]));
                }
            }
        }
        Ok(())
    }
}
