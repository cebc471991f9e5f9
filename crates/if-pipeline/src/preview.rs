//! Pictures of an outfit, triangles that meet another layer in red.

use crate::outfit::Outfit;
use crate::render::{Image, PALETTE, RenderLayer, View, side_by_side};
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;

/// Draws an outfit, its layers in different colours and triangles that meet another layer in red; `size` are the width and
/// height of one view, in pixels.
pub fn preview(outfit: &Outfit, views: &[View], size: [u32; 2]) -> Image {
    let red = intersecting(outfit);
    let layers: Vec<RenderLayer> = outfit
        .layers()
        .zip(&red)
        .enumerate()
        .map(|(k, (layer, red))| RenderLayer { mesh: &layer.mesh, color: color(k), highlight: red })
        .collect();
    side_by_side(&layers, views, size[0], size[1])
}

/// Skin first; more garments than colours begin again after the skin.
fn color(layer: usize) -> [u8; 3] {
    let [skin, cloths @ ..] = PALETTE;
    if layer == 0 { skin } else { cloths[(layer - 1) % cloths.len()] }
}

/// Of each layer the triangles that meet another layer, ascending.
fn intersecting(outfit: &Outfit) -> Vec<Vec<u32>> {
    let trees: Vec<Bvh> = outfit.layers().map(|l| Bvh::new(&l.mesh)).collect();
    let mut found = vec![Vec::new(); trees.len()];
    for outer in 1..trees.len() {
        for inner in 0..outer {
            for pair in pairs(&trees[inner], &trees[outer]) {
                found[inner].push(pair.a);
                found[outer].push(pair.b);
            }
        }
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
    use crate::mannequin::{Garment, MannequinParams, body, garment};
    use crate::outfit::Layer;

    #[test]
    fn triangles_that_meet_are_red_and_others_are_not() {
        let of = |overlap| {
            let params = MannequinParams { resolution: 0.7, overlap };
            let shirt = Layer::new("tshirt", garment(Garment::Tshirt, &params));
            Outfit::new(Layer::new("body", body(&params)), vec![shirt]).unwrap()
        };
        let red = |outfit: &Outfit| {
            let image = preview(outfit, &[View::FRONT], [100, 160]);
            assert_eq!((image.width, image.height), (100, 160));
            image.rgb.chunks_exact(3).filter(|p| i32::from(p[0]) > 2 * i32::from(p[1])).count()
        };
        assert_eq!(red(&of(0.0)), 0);
        assert!(red(&of(1.0)) > 50);
    }
}
