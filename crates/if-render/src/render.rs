//! Pictures of layered outfits by software rasterisation: layers in their colours, intersections in
//! red, and cuts that show the layers from inside.

mod image;
mod light;
mod occlusion;
mod raster;
mod scene;
mod section;

pub use image::{Image, PngError};

use if_core::math::{Real, Vector};
use if_core::mesh::TriMesh;
use raster::Samples;
use rayon::prelude::*;
use scene::{Frame, Scene};

/// Samples along each side of a pixel.
const SUPER: usize = 2;

/// Colours that people with any colour vision tell apart, and tell from the red of intersections:
/// skin, then layers inner to outer.
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

/// Where the eye is: far away, so that lines that are parallel stay so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Angle of the eye about the y axis, in degrees: 0 looks at the front (from +z), 90 at the
    /// left side (from +x), 180 at the back.
    pub azimuth: Real,
    /// Angle of the eye above the horizon, in degrees, from −90 to 90.
    pub elevation: Real,
    /// What is left out.
    pub cut: Option<Cut>,
}

/// A half-space that is left out: points with `n · p > offset`, `n` of unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// Points into what is left out. Its length does not matter.
    pub normal: Vector,
    /// Distance of the plane from the origin along the normal, in metres.
    pub offset: Real,
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
        cut: Some(Cut { normal: Vector::new(1.0, 0.0, 0.0), offset: 0.0 }),
    };
}

/// Draws the scene as large as it fits.
///
/// A triangle that is highlighted shows through whatever lies less than 3 cm before it, in a paler
/// red. Where a cut opens a closed mesh, its inside is one flat colour, and where it meets any
/// mesh, a line.
pub fn render(scene: &[RenderLayer], view: &View, width: u32, height: u32) -> Image {
    side_by_side(scene, &[*view], width, height)
}

/// Draws several views of the scene, each `width` times `height` pixels, in one scale and one row.
pub fn side_by_side(scene: &[RenderLayer], views: &[View], width: u32, height: u32) -> Image {
    let (w, h) = (width as usize, height as usize);
    let frame = Frame::new(scene, views, w * SUPER, h * SUPER);
    let pictures: Vec<Vec<[u8; 3]>> =
        views.iter().map(|view| draw(scene, view, &frame, w, h)).collect();
    let mut image = Image::new(width * views.len() as u32, height);
    let stride = 3 * w * views.len();
    if stride > 0 {
        image.rgb.par_chunks_exact_mut(stride).enumerate().for_each(|(y, row)| {
            for (v, picture) in pictures.iter().enumerate() {
                let part = &mut row[3 * w * v..3 * w * (v + 1)];
                part.chunks_exact_mut(3)
                    .zip(&picture[y * w..])
                    .for_each(|(o, p)| o.copy_from_slice(p));
            }
        });
    }
    image
}

fn draw(
    layers: &[RenderLayer],
    view: &View,
    frame: &Frame,
    width: usize,
    height: usize,
) -> Vec<[u8; 3]> {
    let scene = Scene::new(layers, view, frame);
    let samples = Samples::new(&scene, width * SUPER, height * SUPER);
    let occlusion = occlusion::occlusion(&scene, &samples, width, height);
    let mut out = vec![[0; 3]; width * height];
    out.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            let mut sum = [0.0; 3];
            for s in 0..SUPER * SUPER {
                let at = (y * SUPER + s / SUPER) * width * SUPER + x * SUPER + s % SUPER;
                let color = light::sample(&scene, &samples, at, occlusion[y * width + x]);
                (0..3).for_each(|k| sum[k] += color[k] / (SUPER * SUPER) as f32);
            }
            *pixel = sum.map(light::encode);
        }
    });
    out
}
