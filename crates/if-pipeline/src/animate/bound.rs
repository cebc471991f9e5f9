//! Outfits that follow a body that is given in every frame: garments bound to its surface.

use super::error::AnimateError;
use super::local::PoseMaps;
use super::outfit::SkinFault;
use if_body::skinning::{Affine, Binding};
use if_body::{BodySequence, BodySurface};
use if_core::math::{Point, Real, Vector};
use if_core::nalgebra::{Isometry3, Matrix3, UnitQuaternion};
use if_outfit::Outfit;

/// An outfit whose body is given in every frame. Garments follow its surface: near cloth the nearest
/// place, the rest of a garment what is near.
#[derive(Debug)]
pub struct BoundOutfit {
    outfit: Outfit,
    sequence: BodySequence,
    surface: BodySurface,
    bindings: Vec<Binding>,
}

/// The way from one state of the body to another.
#[derive(Debug)]
pub(super) struct BodyWay {
    ends: [(Vec<Point>, Vec<UnitQuaternion<Real>>); 2],
}

impl BodyWay {
    /// The largest angle by which a vertex turns.
    pub(super) fn largest_turn(&self) -> Real {
        let [(_, from), (_, to)] = &self.ends;
        from.iter().zip(to).map(|(a, b)| a.angle_to(b)).fold(0.0, Real::max)
    }
}

impl BoundOutfit {
    /// A clean outfit and the frames of its body.
    ///
    /// # Errors
    ///
    /// A body without triangles, or a garment that cannot be bound to it.
    pub fn new(outfit: Outfit, sequence: BodySequence) -> Result<Self, SkinFault> {
        let body = &outfit.body;
        let fault = |layer: &str, source| SkinFault { layer: layer.to_owned(), source };
        let surface = BodySurface::new(body.mesh.clone()).map_err(|e| fault(&body.name, e))?;
        let bind = |garment: &if_outfit::Layer| {
            Binding::new(&body.mesh, &garment.mesh).map_err(|e| fault(&garment.name, e))
        };
        let bindings = outfit.garments.iter().map(bind).collect::<Result<_, _>>()?;
        Ok(Self { outfit, sequence, surface, bindings })
    }

    /// Body and garments at rest.
    pub fn outfit(&self) -> &Outfit {
        &self.outfit
    }

    /// The frames of the body.
    pub fn sequence(&self) -> &BodySequence {
        &self.sequence
    }

    /// The positions of the body in a frame.
    pub(super) fn frame(&self, frame: usize) -> Result<Vec<Point>, AnimateError> {
        Ok(self.sequence.positions(frame)?)
    }

    /// The motion of the whole from rest to where the body is.
    pub(super) fn whole(&self, body: &[Point]) -> Isometry3<Real> {
        self.surface.whole(body)
    }

    /// The maps of all vertices where the body is: of the body rigid ones, of garments those of the
    /// body carried along.
    pub(super) fn maps(&self, body: &[Point]) -> PoseMaps {
        let mut maps = self.surface.maps(body, &self.surface.turns(body));
        for binding in &self.bindings {
            let number = |map: &Affine, k: usize| {
                if k < 9 { map.linear[k] } else { map.offset[k - 9] }
            };
            let columns: Vec<Vec<Real>> =
                (0..12).map(|k| binding.carried(|v| number(&maps[v], k))).collect();
            let of = |v: usize| Affine {
                linear: Matrix3::from_fn(|row, column| columns[3 * column + row][v]),
                offset: Vector::from_fn(|row, _| columns[9 + row][v]),
            };
            let carried: Vec<Affine> = (0..columns[0].len()).map(of).collect();
            maps.extend(carried);
        }
        PoseMaps::new(maps)
    }

    /// The way of the body between two states.
    pub(super) fn way(&self, from: &[Point], to: &[Point]) -> BodyWay {
        BodyWay { ends: [from, to].map(|x| (x.to_vec(), self.surface.turns(x))) }
    }

    /// The body at a share of a way.
    pub(super) fn between(&self, way: &BodyWay, share: Real) -> Vec<Point> {
        self.surface.between(way.ends.each_ref().map(|(x, turns)| (&x[..], &turns[..])), share)
    }
}
