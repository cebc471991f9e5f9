//! Draws scenes: samples, occlusion, light, and the mean of the samples of each pixel.

use crate::image::Image;
use crate::raster::{SUPER, Samples};
use crate::scene::{Frame, Scene};
use crate::view::{RenderLayer, View};
use crate::{color, light, occlusion};
use if_core::math::Vector;
use rayon::prelude::*;

/// Largest number of pixels of a picture: 8192 × 8192.
const MOST_PIXELS: u128 = 1 << 26;

/// Draws one view of the scene, scaled to fill the picture.
///
/// A highlighted triangle shows through surfaces less than 3 cm in front of it, in a paler red.
/// Where a cut opens a closed mesh, its inside is one flat colour; where the cut meets any mesh, a
/// line is drawn.
///
/// # Panics
///
/// If the picture would have more than 2²⁶ pixels.
pub fn render(scene: &[RenderLayer], view: &View, width: u32, height: u32) -> Image {
    side_by_side(scene, &[*view], width, height)
}

/// Draws several views of the scene side by side, each `width` × `height` pixels, at one scale.
///
/// # Panics
///
/// If the picture would have more than 2²⁶ pixels, all views together.
pub fn side_by_side(scene: &[RenderLayer], views: &[View], width: u32, height: u32) -> Image {
    let pixels = u128::from(width) * u128::from(height) * views.len() as u128;
    assert!(
        pixels <= MOST_PIXELS,
        "{} views of {width} × {height} pixels are too large: a picture has at most 2²⁶ pixels",
        views.len()
    );
    let (w, h) = (width as usize, height as usize);
    let frame = Frame::new(scene, views, w * SUPER, h * SUPER);
    let normals: Vec<Vec<Vector>> = scene.iter().map(|layer| layer.mesh.vertex_normals()).collect();
    let pictures: Vec<Vec<[u8; 3]>> =
        views.iter().map(|view| draw((scene, &normals), view, &frame, w, h)).collect();
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

/// The pixels of one view: each is the mean of its samples.
fn draw(
    (layers, normals): (&[RenderLayer], &[Vec<Vector>]),
    view: &View,
    frame: &Frame,
    width: usize,
    height: usize,
) -> Vec<[u8; 3]> {
    let scene = Scene::new((layers, normals), view, frame);
    let samples = Samples::new(&scene, width * SUPER, height * SUPER);
    let occlusion = occlusion::occlusion(&scene, &samples, width, height);
    let mut out = vec![[0; 3]; width * height];
    out.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        let middle = |pixel: usize| (pixel * SUPER) as f32 + 0.5 * SUPER as f32;
        let plain = scene.backdrop.plain(middle(y)).map(color::encode);
        for (x, pixel) in row.iter_mut().enumerate() {
            if samples.is_empty_pixel([x, y]) && scene.backdrop.is_plain([middle(x), middle(y)]) {
                *pixel = plain;
                continue;
            }
            let color = light::pixel(&scene, &samples, [x, y], occlusion[y * width + x]);
            *pixel = color.map(color::encode);
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "a picture has at most 2²⁶ pixels")]
    fn a_picture_that_no_memory_holds_is_refused() {
        render(&[], &View::FRONT, u32::MAX, u32::MAX);
    }
}
