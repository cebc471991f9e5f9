//! Pictures of an outfit before and after.

use if_core::mesh::TriMesh;
use if_render::{Image, Intersections, PALETTE, RenderLayer, View, side_by_side};
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
/// Returns the bytes of a PNG file.
pub(crate) fn draw(outfit: &Intersections) -> io::Result<Vec<u8>> {
    let mut png = Vec::new();
    outfit.preview(&VIEWS, SIZE).write_png(&mut png).map_err(io::Error::other)?;
    Ok(png)
}

/// Draws one garment from the same sides.
pub(crate) fn draw_one(mesh: &TriMesh, path: &Path) -> io::Result<()> {
    let layers = [RenderLayer { mesh, color: PALETTE[2], highlight: &[] }];
    write(&side_by_side(&layers, &VIEWS, SIZE[0], SIZE[1]), path)
}

/// Writes a picture as PNG.
pub(crate) fn write(image: &Image, path: &Path) -> io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    image.write_png(&mut file).map_err(io::Error::other)?;
    file.flush()
}
