//! Thumbnails of garments: front and back.

use if_core::mesh::TriMesh;
use if_render::{Image, PALETTE, RenderLayer, View, side_by_side};

/// Pixels of one view.
const SIZE: [u32; 2] = [160, 200];

pub(super) fn draw(mesh: &TriMesh) -> Image {
    let layer = RenderLayer { mesh, color: PALETTE[3], highlight: &[] };
    side_by_side(&[layer], &[View::THREE_QUARTER, View::BACK], SIZE[0], SIZE[1])
}
