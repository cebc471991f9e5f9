//! A clean outfit through a motion, every frame proven: `animate` and its frames.
//!
//! ```text
//! cargo run --release --example animate_in_memory
//! ```

#![allow(clippy::print_stdout)] // a program for the terminal

use if_garments::body::Motion;
use if_garments::body::mannequin::{self, Garment, MannequinParams, rig};
use if_garments::pipeline::animate::{AnimateParams, SkinnedOutfit, animate};
use if_garments::{Layer, Outfit, ResolveParams, Silent, resolve};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The mannequin in trousers, which have to be clean before they move.
    let scene = MannequinParams { resolution: 0.7, ..Default::default() };
    let body = Layer::new("body", mannequin::body(&scene));
    let trousers = Layer::new("trousers", mannequin::garment(Garment::Trousers, &scene));
    let outfit =
        resolve(&Outfit::new(body, vec![trousers])?, &ResolveParams::default(), &mut Silent)?
            .outfit;

    // Skinning weights of the body; the trousers take theirs from it.
    let weights = rig::skin_weights(outfit.body.mesh.vertices());
    let skinned = SkinnedOutfit::new(outfit, rig::skeleton(), vec![Some(weights), None])?;

    // The first four frames of a step. The folder keeps frames, so that a run that was stopped goes on.
    let poses = (0..4).map(|frame| rig::walking_pose(frame, 24)).collect();
    let motion = Motion::new(24.0, poses)?;
    let folder = tempfile::tempdir()?;
    let done = animate(&skinned, &motion, &AnimateParams::default(), folder.path(), &mut Silent)?;
    for row in &done.report.frames {
        println!(
            "frame {}: {} pairs after skinning, {} left",
            row.frame, row.pairs_before, row.pairs
        );
    }
    assert_eq!(done.report.clean, 4);

    // Positions of each layer, the body first, in the order of its vertices.
    let layers = done.frames.layers(3)?;
    assert_eq!(layers[1].len(), skinned.outfit.garments[0].mesh.vertices().len());
    Ok(())
}
