//! What is drawn, in which colours, and from where.

use if_core::math::{Real, Vector};
use if_core::mesh::TriMesh;

/// Colours that remain distinct, also from the red of intersections, with any colour vision: skin,
/// then layers from inner to outer.
pub const PALETTE: [[u8; 3]; 8] = [
    [224, 188, 160],
    [240, 222, 140],
    [46, 150, 136],
    [88, 132, 196],
    [112, 104, 128],
    [204, 204, 200],
    [150, 190, 226],
    [120, 140, 70],
];

/// A mesh in a picture.
#[derive(Clone, Copy, Debug)]
pub struct RenderLayer<'a> {
    /// Its surface. The back of its triangles is drawn darker.
    pub mesh: &'a TriMesh,
    /// Its colour, in sRGB.
    pub color: [u8; 3],
    /// Triangles drawn in red, such as intersecting ones.
    pub highlight: &'a [u32],
}

/// A direction of view, in parallel projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Angle of the eye about the y axis, in degrees: 0 looks at the front (from +z), 90 at the
    /// left side (from +x), 180 at the back.
    pub azimuth: Real,
    /// Angle of the eye above the horizon, in degrees, from −90 to 90.
    pub elevation: Real,
    /// A half-space that is cut away.
    pub cut: Option<Cut>,
}

/// A half-space that is cut away: points with `n · p > offset`, `n` the unit normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// Points into the half-space. Its length does not matter.
    pub normal: Vector,
    /// Distance of the plane from the origin along the normal, in metres; `None` for the plane through the
    /// middle of what is drawn.
    pub offset: Option<Real>,
}

impl View {
    /// From the front.
    pub const FRONT: View = View { azimuth: 0.0, elevation: 4.0, cut: None };
    /// From the front and the person's left.
    pub const THREE_QUARTER: View = View { azimuth: 38.0, elevation: 8.0, cut: None };
    /// From behind.
    pub const BACK: View = View { azimuth: 180.0, elevation: 4.0, cut: None };
    /// From the person's left side, without the left half: layers from inside.
    pub const HALF: View = View {
        azimuth: 90.0,
        elevation: 0.0,
        cut: Some(Cut { normal: Vector::new(1.0, 0.0, 0.0), offset: None }),
    };
}
