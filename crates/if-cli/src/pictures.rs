//! Pictures of an outfit before and after.

use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;
use if_pipeline::outfit::Outfit;
use if_pipeline::render::{PALETTE, RenderLayer, View, side_by_side};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// The outfit as it came.
pub(crate) const BEFORE: &str = "before.png";
/// The outfit as it is written.
pub(crate) const AFTER: &str = "after.png";

/// From where it is drawn, from left to right.
const VIEWS: [View; 4] = [View::FRONT, View::THREE_QUARTER, View::BACK, View::HALF];
/// Pixels of one view: a person with arms spread and some air.
const SIZE: [u32; 2] = [400, 640];

/// Draws an outfit, its layers in different colours and triangles that meet another layer in red.
pub(crate) fn draw(outfit: &Outfit, path: &Path) -> io::Result<()> {
    let red = intersecting(outfit);
    let layers: Vec<RenderLayer> = outfit
        .layers()
        .zip(&red)
        .enumerate()
        .map(|(k, (layer, red))| RenderLayer { mesh: &layer.mesh, color: color(k), highlight: red })
        .collect();
    let image = side_by_side(&layers, &VIEWS, SIZE[0], SIZE[1]);
    let mut file = BufWriter::new(File::create(path)?);
    image.write_png(&mut file).map_err(io::Error::other)?;
    file.flush()
}

/// Draws one garment from the same sides.
pub(crate) fn draw_one(mesh: &TriMesh, path: &Path) -> io::Result<()> {
    let layers = [RenderLayer { mesh, color: PALETTE[2], highlight: &[] }];
    let image = side_by_side(&layers, &VIEWS, SIZE[0], SIZE[1]);
    let mut file = BufWriter::new(File::create(path)?);
    image.write_png(&mut file).map_err(io::Error::other)?;
    file.flush()
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
