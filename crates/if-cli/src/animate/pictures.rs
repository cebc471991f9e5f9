//! Pictures of an animation: skinned alone, with triangles that intersect another layer in red, and
//! as it is written.

use super::AnimateFault;
use crate::output_error::OutputError;
use crate::staging::Staging;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_outfit::outfit::Outfit;
use if_pipeline::animate::{Animation, Movement};
use if_render::{Image, View, preview, write_animation};
use miette::Report;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// The animated picture: before on the left, after on the right.
pub(super) const MOTION: &str = "motion.png";
/// Some frames side by side: before above, after below.
pub(super) const STRIP: &str = "strip.png";
/// Most frames of the animated picture.
const MOST: usize = 48;
/// Most frames of the strip.
const SIDE_BY_SIDE: usize = 6;
/// Pixels of one view.
const SIZE: [u32; 2] = [240, 400];

/// Draws both pictures, and returns their names.
pub(super) fn draw(
    movement: Movement<'_>,
    animation: &Animation,
    (staging, out): (&Staging, &Path),
) -> Result<Vec<String>, Report> {
    let frames = animation.frames.len();
    let step = frames.div_ceil(MOST).max(1);
    let outfit = movement.outfit();
    let rest: Vec<Point> = outfit.layers().flat_map(|l| l.mesh.vertices()).copied().collect();
    let mut shown: Vec<[Image; 2]> = Vec::new();
    for frame in (0..frames).step_by(step) {
        let fault = |source| AnimateFault::Animate { source };
        let after = animation.frames.positions(frame).map_err(fault)?;
        let before = movement.posed(frame, &rest).map_err(fault)?;
        shown.push([before, after].map(|x| view(outfit, &x)));
    }
    let write = |name: &str, fill: &dyn Fn(&mut dyn Write) -> Result<(), if_render::PngError>| {
        let fault = |source| OutputError::File { path: out.join(name), source };
        let mut file = BufWriter::new(File::create(staging.path(name)).map_err(fault)?);
        fill(&mut file).map_err(|e| fault(io::Error::other(e)))?;
        file.flush().map_err(fault)
    };
    let animated: Vec<Image> = shown.iter().map(|pair| beside(pair)).collect();
    let rate = movement.frames_per_second() / step as f64;
    write(MOTION, &|file| write_animation(&animated, rate, file))?;
    let each = shown.len().div_ceil(SIDE_BY_SIDE).max(1);
    let some: Vec<&[Image; 2]> = shown.iter().step_by(each).collect();
    let rows = [0, 1].map(|k| beside(&some.iter().map(|pair| pair[k].clone()).collect::<Vec<_>>()));
    write(STRIP, &|file| below(&rows).write_png(file))?;
    Ok(vec![MOTION.into(), STRIP.into()])
}

/// One view of the outfit with these positions.
fn view(outfit: &Outfit, positions: &[Point]) -> Image {
    let meshes = meshes(outfit, positions);
    preview(&meshes.iter().collect::<Vec<_>>(), &[View::THREE_QUARTER], SIZE)
}

/// The layers of the outfit with these positions, the body first.
pub(super) fn meshes(outfit: &Outfit, positions: &[Point]) -> Vec<TriMesh> {
    let mut rest = positions;
    let mut meshes: Vec<TriMesh> = Vec::new();
    for layer in outfit.layers() {
        let (own, others) = rest.split_at(layer.mesh.vertices().len());
        rest = others;
        let mesh = layer.mesh.with_vertices(own.to_vec());
        meshes.push(mesh.expect("positions of frames are finite"));
    }
    meshes
}

/// Pictures of one size from left to right.
fn beside(images: &[Image]) -> Image {
    let (width, height) = images.first().map_or((0, 0), |i| (i.width, i.height));
    let row = 3 * width as usize;
    let rows = (0..height as usize).flat_map(|y| {
        images.iter().flat_map(move |i| i.rgb[y * row..(y + 1) * row].iter().copied())
    });
    Image { width: width * images.len() as u32, height, rgb: rows.collect() }
}

/// Pictures of one width from above.
fn below(images: &[Image]) -> Image {
    let width = images.first().map_or(0, |i| i.width);
    let height = images.iter().map(|i| i.height).sum();
    Image { width, height, rgb: images.iter().flat_map(|i| i.rgb.iter().copied()).collect() }
}
