//! Pictures of outfits, with intersecting triangles in red.

use crate::color::decode;
use crate::image::Image;
use crate::render::side_by_side;
use crate::view::{PALETTE, RenderLayer, View};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs_between;

/// Draws the layers of an outfit, body first, in different colours, and triangles that intersect
/// another layer in red. `size` is the width and height of one view, in pixels.
pub fn preview(layers: &[&TriMesh], views: &[View], size: [u32; 2]) -> Image {
    let red = intersecting(layers);
    let layers: Vec<RenderLayer> = layers
        .iter()
        .zip(&red)
        .enumerate()
        .map(|(k, (layer, red))| RenderLayer { mesh: layer, color: color(k), highlight: red })
        .collect();
    side_by_side(&layers, views, size[0], size[1])
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

/// The triangles of each layer that intersect another layer, in ascending order.
fn intersecting(layers: &[&TriMesh]) -> Vec<Vec<u32>> {
    let trees: Vec<Bvh> = layers.iter().map(|mesh| Bvh::new(mesh)).collect();
    let mut found = vec![Vec::new(); trees.len()];
    for ([a, b], pairs) in pairs_between(&trees) {
        found[a].extend(pairs.iter().map(|pair| pair.a));
        found[b].extend(pairs.iter().map(|pair| pair.b));
    }
    for triangles in &mut found {
        triangles.sort_unstable();
        triangles.dedup();
    }
    found
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
}
