//! What is to be made free of intersections: a closed body and the garments over it.

use crate::storage::Storage;
use if_core::aabb::Aabb;
use if_core::edges::Edges;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::file::MeshFile;
use if_mesh::inverted::{InvertedPart, inverted_part};
use if_mesh::seams::weld;

/// A named mesh: the body, or one garment.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// What reports and errors call it.
    pub name: String,
    /// Its surface, in metres, wound counter-clockwise seen from outside.
    pub mesh: TriMesh,
    /// How its positions will be stored. They are rounded to that form before they are verified.
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

/// A closed body and its garments, inner to outer.
#[derive(Clone, Debug, PartialEq)]
pub struct Outfit {
    /// The body: closed, wound outwards. It never moves.
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
    /// Two layers bear one name.
    #[error("two layers are called `{layer}`; give each its own name")]
    DuplicateName {
        /// The name.
        layer: String,
    },
    /// The body is not closed.
    #[error(
        "body `{layer}` has {open_edges} boundary edges (the first between vertices {first:?}); it must be closed: \
         fill its holes first"
    )]
    OpenBody {
        /// Its name.
        layer: String,
        /// How many edges have one triangle only.
        open_edges: usize,
        /// The ends of the first of them.
        first: [u32; 2],
    },
    /// Triangles of the body wind against their neighbours.
    #[error(
        "triangles {} and {} of body `{layer}` run along a common edge in the same direction, and so do others at {others} edges; wind \
         all triangles counter-clockwise seen from outside, as a clean-up does", triangles[0], triangles[1]
    )]
    Winding {
        /// Its name.
        layer: String,
        /// Two of the triangles at the first such edge.
        triangles: [u32; 2],
        /// How many edges more.
        others: usize,
    },
    /// The body winds inwards.
    #[error(
        "body `{layer}` is inside out (signed volume {volume:.3e} m³); reverse the winding of its triangles"
    )]
    InsideOut {
        /// Its name.
        layer: String,
        /// Its signed volume, in cubic metres.
        volume: Real,
    },
    /// A part of the body winds inwards, and is no cavity of another.
    #[error(
        "a part of body `{layer}` is inside out: {} triangles from triangle {} on (signed volume {:.3e} m³); reverse their winding, \
         or drop them", part.triangles, part.triangle, part.volume
    )]
    PartInsideOut {
        /// Its name.
        layer: String,
        /// Which part.
        part: InvertedPart,
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
    /// The body's height suggests other units.
    #[error(
        "body `{layer}` is {height:.1} units high, likely {unit}; scale all layers by {scale} (everything is in metres)"
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

impl Outfit {
    /// Takes a body and garments, inner to outer.
    ///
    /// # Errors
    ///
    /// A layer without triangles, two of one name, a body that is open, inside out (as a whole, in
    /// a part or in single triangles) or not in metres (taller than 20 units), a garment whose box
    /// is further from the body's than the body is tall, or twelve times as large. Seams of the
    /// body count as closed ([`if_mesh::seams`]), and vertices of no triangle as none.
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
            if layer.mesh.triangles().is_empty() {
                return Err(OutfitError::Empty { layer: layer.name.clone() });
            }
            if !names.insert(&layer.name) {
                return Err(OutfitError::DuplicateName { layer: layer.name.clone() });
            }
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
        let edges = Edges::new(mesh);
        let mut open = edges
            .valence
            .iter()
            .enumerate()
            .filter(|(_, v)| **v == 1)
            .map(|(e, _)| edges.vertices[e]);
        if let Some(first) = open.next() {
            // As the vertices are numbered in the file: the first that stands in each place.
            let named = |v: u32| {
                sewn.as_ref()
                    .and_then(|s| s.vertex_map.iter().position(|w| *w == v))
                    .map_or(v, |v| v as u32)
            };
            return Err(OutfitError::OpenBody {
                layer: name(),
                open_edges: 1 + open.count(),
                first: first.map(named),
            });
        }
        let mut turned = turned_edges(mesh, &edges);
        if let Some(e) = turned.next() {
            return Err(OutfitError::Winding {
                layer: name(),
                triangles: edges.triangles[e],
                others: turned.count(),
            });
        }
        let volume = mesh.signed_volume();
        if volume <= 0.0 {
            return Err(OutfitError::InsideOut { layer: name(), volume });
        }
        if let Some(part) = inverted_part(mesh) {
            return Err(OutfitError::PartInsideOut { layer: name(), part });
        }
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
/// [`OutfitError::TooLarge`] or [`OutfitError::FarFromBody`].
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
    let distance = box_distance(body, &extent);
    if distance > height {
        return Err(OutfitError::FarFromBody { layer: layer(), distance });
    }
    Ok(())
}

/// Edges that triangles do not run through as often in one direction as in the other: there no side
/// is the inside.
fn turned_edges(mesh: &TriMesh, edges: &Edges) -> impl Iterator<Item = usize> {
    let mut balance = vec![0i32; edges.len()];
    for (corners, of_triangle) in mesh.triangles().iter().zip(&edges.of_triangle) {
        for k in 0..3 {
            balance[of_triangle[k] as usize] +=
                if corners[k] < corners[(k + 1) % 3] { 1 } else { -1 };
        }
    }
    balance.into_iter().enumerate().filter(|(_, b)| *b != 0).map(|(e, _)| e)
}

/// The unit that a person of this height (longest side of the box) is likely in, where not metres.
fn suspicious_unit(height: Real) -> Option<(&'static str, Real)> {
    match height {
        h if h > 500.0 => Some(("millimetres", 1e-3)),
        h if h > 40.0 => Some(("centimetres", 1e-2)),
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

fn box_distance(a: &Aabb, b: &Aabb) -> Real {
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
        assert!(Outfit::new(body(&triangles), garment(body(&triangles).mesh)).is_ok());
        let open = Outfit::new(body(&triangles[1..]), garment(tetrahedron(1.0, 0.1)));
        assert!(
            matches!(open, Err(OutfitError::OpenBody { open_edges: 3, first, .. }) if first.iter().all(|v| *v >= 3))
        );
    }

    #[test]
    fn every_fault_has_its_own_error() {
        let body = || Layer::new("body", tetrahedron(1.0, 0.0));
        assert!(Outfit::new(body(), garment(tetrahedron(1.0, 0.1))).is_ok());
        assert!(matches!(
            Outfit::new(body(), garment(TriMesh::default())),
            Err(OutfitError::Empty { .. })
        ));
        let twin = vec![Layer::new("body", tetrahedron(1.0, 0.0))];
        assert!(matches!(Outfit::new(body(), twin), Err(OutfitError::DuplicateName { .. })));
        let mut two = tetrahedron(1.0, 0.0).vertices().to_vec();
        two.extend_from_within(..);
        two[4..].iter_mut().for_each(|p| p.x = 2.0 + 0.5 * p.x);
        let mut triangles = tetrahedron(1.0, 0.0).triangles().to_vec();
        triangles.extend(triangles.clone().iter().map(|[a, b, c]| [a + 4, c + 4, b + 4]));
        let two = Layer::new("body", TriMesh::new(two, triangles).unwrap());
        let error = Outfit::new(two, garment(tetrahedron(1.0, 0.1)));
        assert!(
            matches!(error, Err(OutfitError::PartInsideOut { part, .. }) if part.triangle == 4)
        );
        let mut astray = tetrahedron(1.0, 0.1).vertices().to_vec();
        astray[3].z = 1e200;
        let astray = TriMesh::new(astray, tetrahedron(1.0, 0.1).triangles().to_vec()).unwrap();
        assert!(matches!(
            Outfit::new(body(), garment(astray)),
            Err(OutfitError::TooLarge { vertex: 3, .. })
        ));
        assert!(matches!(
            Outfit::new(body(), garment(tetrahedron(1.0, 50.0))),
            Err(OutfitError::FarFromBody { .. })
        ));
        let mut open = body();
        open.mesh =
            TriMesh::new(open.mesh.vertices().to_vec(), open.mesh.triangles()[..3].to_vec())
                .unwrap();
        assert!(matches!(
            Outfit::new(open, vec![]),
            Err(OutfitError::OpenBody { open_edges: 3, .. })
        ));
        let mut turned = body();
        let t = [[0, 2, 1], [0, 1, 3], [0, 2, 3], [1, 2, 3]];
        turned.mesh = TriMesh::new(turned.mesh.vertices().to_vec(), t.to_vec()).unwrap();
        let error = Outfit::new(turned, vec![]).unwrap_err();
        assert!(
            matches!(error, OutfitError::Winding { triangles: [0, 2], others: 2, .. }),
            "{error}"
        );
        let mut inverted = body();
        let t = inverted.mesh.triangles().iter().map(|t| [t[0], t[2], t[1]]).collect();
        inverted.mesh = TriMesh::new(inverted.mesh.vertices().to_vec(), t).unwrap();
        assert!(matches!(Outfit::new(inverted, vec![]), Err(OutfitError::InsideOut { .. })));
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
}
