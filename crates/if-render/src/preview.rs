//! Pictures of outfits, with intersecting triangles in red.

use crate::color::decode;
use crate::image::Image;
use crate::intersections::Intersections;
use crate::render::side_by_side;
use crate::view::{PALETTE, RenderLayer, View};
use if_core::mesh::TriMesh;

/// Draws the layers of an outfit, body first, in different colours, and triangles that intersect
/// another layer in red. `size` is the width and height of one view, in pixels.
///
/// # Panics
///
/// If the picture would have more than 2²⁶ pixels.
pub fn preview(layers: &[&TriMesh], views: &[View], size: [u32; 2]) -> Image {
    Intersections::between(layers).preview(views, size)
}

impl Intersections<'_> {
    /// As [`preview`], with what has been found.
    ///
    /// # Panics
    ///
    /// As [`preview`].
    pub fn preview(&self, views: &[View], size: [u32; 2]) -> Image {
        let red = self.triangles();
        let layers = self.layers().iter().zip(&red).enumerate();
        let layers: Vec<RenderLayer> = layers
            .map(|(k, (layer, red))| RenderLayer { mesh: layer, color: color(k), highlight: red })
            .collect();
        side_by_side(&layers, views, size[0], size[1])
    }
}

/// The colour of a layer; garments reuse the palette without its first colour, the skin's.
pub(crate) fn color(layer: usize) -> [u8; 3] {
    let [skin, cloths @ ..] = PALETTE;
    if layer == 0 { skin } else { cloths[(layer - 1) % cloths.len()] }
}

/// The colour of a layer of an outfit in pictures and pages, 0 for the body, in linear light.
pub fn layer_color(layer: usize) -> [f32; 3] {
    decode(color(layer))
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;
    use if_core::shapes::meshes::{icosphere, tube};

    #[test]
    fn intersecting_triangles_are_red_and_others_are_not() {
        let red = |radius| {
            let tube = tube(radius, 0.3, 60, 8, false);
            let lowered =
                tube.vertices().iter().map(|p| Point::new(p.x, p.y - 0.15, p.z)).collect();
            let belt = tube.with_vertices(lowered).unwrap();
            let image = preview(&[&icosphere(0.2, 3), &belt], &[View::FRONT], [100, 160]);
            assert_eq!((image.width, image.height), (100, 160));
            image.rgb.chunks_exact(3).filter(|p| i32::from(p[0]) > 2 * i32::from(p[1])).count()
        };
        assert_eq!(red(0.21), 0);
        assert!(red(0.19) > 50);
    }

    #[test]
    fn a_vertex_of_no_triangle_changes_no_picture() {
        let ball = icosphere(0.2, 3);
        let far = [ball.vertices(), &[Point::new(1e3, -50.0, 0.0)]].concat();
        let more = if_core::mesh::TriMesh::new(far, ball.triangles().to_vec()).unwrap();
        let picture = |mesh| preview(&[mesh], &[View::FRONT], [100, 160]).rgb;
        assert!(picture(&ball) == picture(&more));
    }
}
