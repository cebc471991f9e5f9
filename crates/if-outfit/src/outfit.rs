//! What is to be made free of intersections: a body and the garments over it.

use crate::storage::Storage;
use if_core::aabb::Aabb;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::body_surface::{NoInside, check as check_body};
use if_mesh::file::MeshFile;
use if_mesh::seams::weld;

/// A named mesh: the body, or one garment.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// What reports and errors call it.
    pub name: String,
    /// Its surface, in metres, wound counter-clockwise seen from outside.
    pub mesh: TriMesh,
    /// How its positions will be stored. Those of a garment are rounded to that form before they are
    /// verified; a body stays as it is.
    pub storage: Storage,
}

impl Layer {
    /// A layer whose positions stay in double precision ([`Storage::F64`]).
    pub fn new(name: impl Into<String>, mesh: TriMesh) -> Self {
        Self { name: name.into(), mesh, storage: Storage::F64 }
    }

    /// The mesh of a file in metres, whose positions will be written to a file of the same kind
    /// ([`MeshFile::write`](if_mesh::file::MeshFile::write)).
    pub fn of_file(name: impl Into<String>, file: &MeshFile) -> Self {
        Self { storage: Storage::of(file), ..Self::new(name, file.mesh().clone()) }
    }
}

/// A body and its garments, inner to outer.
#[derive(Clone, Debug, PartialEq)]
pub struct Outfit {
    /// The body. It stays, unless [`Pinch::Yield`](crate::Pinch::Yield) is asked for, and need not be closed ([`if_mesh::body_surface`]).
    pub body: Layer,
    /// The garments, innermost first.
    pub garments: Vec<Layer>,
}

/// Why a body and garments are no outfit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OutfitError {
    /// A layer has no triangles.
    #[error("layer `{layer}` has no triangles; leave it out, or give its mesh")]
    Empty {
        /// Its name.
        layer: String,
    },
    /// A garment has the triangles and vertices of the body.
    #[error("`{layer}` is the body itself; leave it out")]
    IsBody {
        /// Its name.
        layer: String,
    },
    /// Two layers bear one name.
    #[error("two layers are called `{layer}`; give each its own name")]
    DuplicateName {
        /// The name.
        layer: String,
    },
    /// The body has no inside: it is a plane, a folded sheet or a garment.
    #[error("`{layer}` cannot be the body: {reason}")]
    NoInside {
        /// Its name.
        layer: String,
        /// Why.
        reason: NoInside,
    },
    /// A garment does not come near the body.
    #[error(
        "garment `{layer}` lies {distance:.3} m from the body; align it first, or check the units \
         (everything is in metres)"
    )]
    FarFromBody {
        /// Its name.
        layer: String,
        /// Distance between the boxes of the two, in metres.
        distance: Real,
    },
    /// A garment is many times as large as the body.
    #[error(
        "garment `{layer}` is {size:.3e} m long, more than {LARGEST} times the body; look at vertex {vertex}, or check the units \
         (everything is in metres)"
    )]
    TooLarge {
        /// Its name.
        layer: String,
        /// The longest side of its box, in metres.
        size: Real,
        /// One of the vertices that are far out.
        vertex: u32,
    },
    /// A garment is so small beside the body that it must be in other units.
    #[error(
        "garment `{layer}` is {size:.3e} m long, less than {SMALLEST} times the body; check its units \
         (everything is in metres)"
    )]
    TooSmall {
        /// Its name.
        layer: String,
        /// The longest side of its box, in metres.
        size: Real,
    },
    /// The body's height suggests other units.
    #[error(
        "body `{layer}` is {} units high, likely {unit}; scale all layers by {scale} (everything is in metres)",
        high(*height)
    )]
    Units {
        /// Its name.
        layer: String,
        /// Largest side of its box.
        height: Real,
        /// What it likely is in.
        unit: &'static str,
        /// The factor to metres.
        scale: Real,
    },
}

/// Sizes of the body up to which a garment may be large: a train of twenty metres, and no vertex
/// gone astray.
const LARGEST: Real = 12.0;
/// Sizes of the body from which on a garment may be: a ring, and no shirt in hundredths of a metre.
const SMALLEST: Real = 0.01;

impl Outfit {
    /// Takes a body and garments, inner to outer.
    ///
    /// # Errors
    ///
    /// A layer without triangles, the body as a garment, two layers of one name, a body without an
    /// inside or not in metres (taller than 20 units or smaller than 0.1), a garment whose box is
    /// further from the body's than the body is tall, twelve times as large, or less than a hundredth of
    /// it. Vertices of no triangle count as none.
    ///
    /// A body may be open, inside out, in several parts and intersect itself: what is assumed of it
    /// then is in [`Verification::body`](crate::report::Verification::body).
    pub fn new(body: Layer, garments: Vec<Layer>) -> Result<Self, OutfitError> {
        let outfit = Self { body, garments };
        outfit.check()?;
        Ok(outfit)
    }

    /// The checks of [`Outfit::new`], for outfits that were changed since.
    ///
    /// # Errors
    ///
    /// As [`Outfit::new`].
    pub fn check(&self) -> Result<(), OutfitError> {
        let mut names = std::collections::BTreeSet::new();
        for layer in self.layers() {
            if !names.insert(&layer.name) {
                return Err(OutfitError::DuplicateName { layer: layer.name.clone() });
            }
        }
        if let Some(layer) = self.layers().find(|layer| layer.mesh.triangles().is_empty()) {
            return Err(OutfitError::Empty { layer: layer.name.clone() });
        }
        if let Some(garment) = self.garments.iter().find(|g| g.mesh == self.body.mesh) {
            return Err(OutfitError::IsBody { layer: garment.name.clone() });
        }
        let body = &self.body;
        let name = || body.name.clone();
        let sewn = weld(&body.mesh);
        let mesh = sewn.as_ref().map_or(&body.mesh, |s| &s.mesh);
        let aabb = mesh.aabb();
        let height = aabb.size().max();
        if let Some((unit, scale)) = suspicious_unit(height) {
            return Err(OutfitError::Units { layer: name(), height, unit, scale });
        }
        check_body(mesh).map_err(|reason| OutfitError::NoInside { layer: name(), reason })?;
        self.garments
            .iter()
            .try_for_each(|garment| check_garment(&aabb, &garment.name, &garment.mesh))
    }

    /// The body, then the garments, inner to outer.
    pub fn layers(&self) -> impl Iterator<Item = &Layer> {
        std::iter::once(&self.body).chain(&self.garments)
    }
}

/// Checks that a garment has a place in an outfit on a body with the box `body`.
///
/// # Errors
///
/// [`OutfitError::TooLarge`], [`OutfitError::TooSmall`] or [`OutfitError::FarFromBody`].
pub fn check_garment(body: &Aabb, name: &str, garment: &TriMesh) -> Result<(), OutfitError> {
    let (layer, height) = (|| name.to_owned(), body.size().max());
    let extent = garment.surface_aabb();
    let size = extent.size().max();
    if size > LARGEST * height {
        let middle = nalgebra::center(&body.min, &body.max);
        let far =
            |v: &&u32| (garment.vertices()[**v as usize] - middle).amax() >= 0.5 * LARGEST * height;
        let vertex = garment.triangles().as_flattened().iter().find(far).map_or(0, |v| *v);
        return Err(OutfitError::TooLarge { layer: layer(), size, vertex });
    }
    if size < SMALLEST * height {
        return Err(OutfitError::TooSmall { layer: layer(), size });
    }
    let distance = box_distance(body, &extent);
    if distance > height {
        return Err(OutfitError::FarFromBody { layer: layer(), distance });
    }
    Ok(())
}

/// A height with a digit behind the point, small ones with three that count.
fn high(height: Real) -> String {
    if height < 0.1 { format!("{height:.2e}") } else { format!("{height:.1}") }
}

/// The unit that a person of this height (longest side of the box) is likely in, where not metres.
/// A doll of ten centimetres may be.
fn suspicious_unit(height: Real) -> Option<(&'static str, Real)> {
    match height {
        0.0 => None,
        h if h < 4e-3 => Some(("kilometres", 1e3)),
        h if h < 0.1 => Some(("metres divided by 100", 1e2)),
        h if h > 500.0 => Some(("millimetres", 1e-3)),
        h if h > 90.0 => Some(("centimetres", 1e-2)),
        h if h > 20.0 => Some(("inches", 0.0254)),
        _ => None,
    }
}

/// A note if a body does not seem to stand upright along +y, as when it is z-up or lies; `None`
/// otherwise.
///
/// [`resolve`](crate::resolve::resolve) works in any orientation. Pictures, the alignment between
/// bodies and reconstruction need y to point up.
pub fn orientation_note(body: &TriMesh) -> Option<String> {
    /// Share of the longest side below which a height along y is too small for a person who stands
    /// or sits, whatever the arms do.
    const UPRIGHT: Real = 0.5;
    let size = body.surface_aabb().size();
    let longest = size.imax();
    (size.y < UPRIGHT * size[longest]).then(|| {
        format!(
            "the body is {:.2} m along {} and {:.2} m along y: it lies on its side, or was stored \
             with another axis up; y must point up in pictures and wherever garments change bodies",
            size[longest],
            ["x", "y", "z"][longest],
            size.y
        )
    })
}

pub(crate) fn box_distance(a: &Aabb, b: &Aabb) -> Real {
    (0..3)
        .map(|k| (a.min[k] - b.max[k]).max(b.min[k] - a.max[k]).max(0.0).powi(2))
        .sum::<Real>()
        .sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;

    fn tetrahedron(scale: Real, x: Real) -> TriMesh {
        let v = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let v = v.map(|p| Point::new(p[0] * scale + x, p[1] * scale, p[2] * scale)).to_vec();
        TriMesh::new(v, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap()
    }

    fn garment(mesh: TriMesh) -> Vec<Layer> {
        vec![Layer::new("shirt", mesh)]
    }

    #[test]
    fn a_body_of_loose_triangles_is_closed_and_strays_do_not_count() {
        let whole = tetrahedron(1.0, 0.0);
        let mut v: Vec<Point> = whole
            .triangles()
            .as_flattened()
            .iter()
            .map(|v| whole.vertices()[*v as usize])
            .collect();
        v.push(Point::new(1e300, 0.0, 0.0));
        let triangles: Vec<[u32; 3]> = (0..4).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let body = |triangles: &[[u32; 3]]| {
            Layer::new("body", TriMesh::new(v.clone(), triangles.to_vec()).unwrap())
        };
        let turned = [&triangles[1..], &triangles[..1]].concat();
        assert!(Outfit::new(body(&triangles), garment(body(&turned).mesh)).is_ok());
        assert!(Outfit::new(body(&triangles[1..]), garment(body(&triangles).mesh)).is_ok());
        let plane = Outfit::new(body(&triangles[..1]), garment(tetrahedron(1.0, 0.1)));
        let Err(OutfitError::NoInside { reason, .. }) = plane else { panic!("{plane:?}") };
        assert_eq!((reason.openings, reason.volume), (1, 0.0));
    }

    #[test]
    fn every_fault_has_its_own_error() {
        let body = || Layer::new("body", tetrahedron(1.0, 0.0));
        assert!(Outfit::new(body(), garment(tetrahedron(1.0, 0.1))).is_ok());
        assert!(matches!(
            Outfit::new(body(), garment(TriMesh::default())),
            Err(OutfitError::Empty { .. })
        ));
        assert!(matches!(
            Outfit::new(body(), garment(tetrahedron(1.0, 0.0))),
            Err(OutfitError::IsBody { .. })
        ));
        let twin = vec![Layer::new("body", tetrahedron(1.0, 0.1))];
        assert!(matches!(Outfit::new(body(), twin), Err(OutfitError::DuplicateName { .. })));
        let mut astray = tetrahedron(1.0, 0.1).vertices().to_vec();
        astray[3].z = 1e200;
        let astray = TriMesh::new(astray, tetrahedron(1.0, 0.1).triangles().to_vec()).unwrap();
        assert!(matches!(
            Outfit::new(body(), garment(astray)),
            Err(OutfitError::TooLarge { vertex: 3, .. })
        ));
        let OutfitError::TooSmall { size, .. } =
            Outfit::new(body(), garment(tetrahedron(0.009, 0.1))).unwrap_err()
        else {
            panic!("too small")
        };
        assert!(size < 0.01 && Outfit::new(body(), garment(tetrahedron(0.011, 0.1))).is_ok());
        assert!(matches!(
            Outfit::new(body(), garment(tetrahedron(1.0, 50.0))),
            Err(OutfitError::FarFromBody { .. })
        ));
        let mut flat = body();
        flat.mesh = TriMesh::new(flat.mesh.vertices().to_vec(), vec![[0, 1, 2]]).unwrap();
        let error = Outfit::new(flat, vec![]).unwrap_err();
        assert!(matches!(error, OutfitError::NoInside { .. }), "{error}");
    }

    #[test]
    fn open_turned_and_inverted_bodies_are_accepted() {
        let whole = tetrahedron(1.0, 0.0);
        let flip = |t: &[u32; 3]| [t[0], t[2], t[1]];
        let mut triangles = vec![
            whole.triangles()[1..].to_vec(),
            whole.triangles().iter().map(flip).collect(),
            whole.triangles().to_vec(),
        ];
        triangles[2][2].swap(0, 1);
        for triangles in triangles {
            let mesh = TriMesh::new(whole.vertices().to_vec(), triangles).unwrap();
            assert!(Outfit::new(Layer::new("body", mesh), vec![]).is_ok());
        }
    }

    #[test]
    fn a_body_that_is_not_upright_gets_a_note() {
        let body = |size: [Real; 3]| {
            let corners = tetrahedron(1.0, 0.0);
            let scaled = corners
                .vertices()
                .iter()
                .map(|p| Point::new(p.x * size[0], p.y * size[1], p.z * size[2]));
            corners.with_vertices(scaled.collect()).unwrap()
        };
        assert_eq!(orientation_note(&body([1.8, 1.7, 0.3])), None, "a T-pose");
        assert_eq!(orientation_note(&body([0.5, 1.2, 0.9])), None, "seated");
        let z_up = orientation_note(&body([1.8, 0.3, 1.7])).unwrap();
        assert!(z_up.contains("1.80 m along x and 0.30 m along y"), "{z_up}");
        assert!(orientation_note(&body([0.5, 0.3, 1.7])).unwrap().contains("along z"));
    }

    #[test]
    fn a_body_1740_units_high_is_likely_in_millimetres() {
        let error = Outfit::new(Layer::new("body", tetrahedron(1740.0, 0.0)), vec![]).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("1740.0") && text.contains("millimetres") && text.contains("0.001"),
            "{text}"
        );
    }

    #[test]
    fn a_body_of_some_millimetres_was_likely_scaled_twice() {
        for (size, unit, scale) in [
            (0.0159, "1.59e-2 units high, likely metres divided by 100", "by 100 "),
            (1.6e-3, "kilometres", "by 1000 "),
        ] {
            let body = Layer::new("body", tetrahedron(size, 0.0));
            let text = Outfit::new(body, vec![]).unwrap_err().to_string();
            assert!(text.contains(unit) && text.contains(scale), "{text}");
        }
        assert!(Outfit::new(Layer::new("doll", tetrahedron(0.12, 0.0)), vec![]).is_ok());
        let point = Outfit::new(Layer::new("body", tetrahedron(0.0, 0.0)), vec![]);
        assert!(matches!(point, Err(OutfitError::NoInside { .. })), "{point:?}");
    }
}
