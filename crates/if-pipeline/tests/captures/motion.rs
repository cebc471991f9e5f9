//! Clothes that move by themselves are followed in each frame of the project's own capture.

#![allow(clippy::unwrap_used)] // also in what the tests share

use if_body::TemplateBody;
use if_body::mannequin::{Garment, MannequinParams};
use if_core::closest::ClosestPoint;
use if_core::math::Real;
use if_core::monitor::Silent;
use if_mesh::index::Bvh;
use if_mesh::ply::{self, Column};
use if_pipeline::capture::synth::{BODY, SynthParams, TRUTH, synth};
use if_pipeline::capture::{Capture, SKIN};
use if_pipeline::reconstruct::{MotionParams, SurfaceParams, fit_motion, fit_surface, posed};

/// Mean distance of the clothes as they are from the surface in each frame, without motion and with
/// it, in millimetres.
fn errors(nonrigid: Real) -> [Real; 2] {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("capture");
    let scene = SynthParams {
        garments: vec![Garment::Trousers, Garment::Tshirt],
        frames: 12,
        size: 128,
        nonrigid,
        mannequin: MannequinParams { resolution: 0.7, overlap: 0.0 },
        ..SynthParams::default()
    };
    synth(&scene, &path, &mut Silent).unwrap();
    let capture = Capture::open(&path).unwrap();
    let template = TemplateBody::read(&path.join(BODY)).unwrap();
    let (read, params) = (SurfaceParams::default(), MotionParams::default());
    let surface = fit_surface(&capture, &template, &read, None, &mut Silent).unwrap();
    let motion =
        fit_motion(&capture, &template.skeleton, &surface, &read, &params, &mut Silent).unwrap();
    let mut sums = [0.0; 2];
    let mut count = 0;
    for frame in (0..12).step_by(3) {
        let truth =
            ply::read_path(&path.join(TRUTH).join(format!("frame_{frame:04}.ply"))).unwrap();
        let Column::U8(labels) = &truth.vertex_properties[0].values else {
            panic!("labels are bytes")
        };
        for (sum, d) in sums.iter_mut().zip([&[][..], &motion.offsets[frame][..]]) {
            let points =
                posed(&surface.mesh, &surface.skin, &template.skeleton, capture.pose(frame), d)
                    .unwrap();
            let mesh = surface.mesh.with_vertices(points).unwrap();
            let tree = Bvh::new(&mesh);
            for (p, _) in truth
                .mesh
                .vertices()
                .iter()
                .zip(labels)
                .filter(|(_, label)| **label > SKIN)
                .step_by(5)
            {
                *sum += 1e3 * (tree.closest(p, Real::INFINITY).unwrap().point - p).norm();
                count += 1;
            }
        }
    }
    sums.map(|s| 2.0 * s / Real::from(count))
}

#[test]
fn clothes_that_move_are_followed_and_clothes_that_do_not_are_left() {
    let [without, with] = errors(0.02);
    assert!(with < 0.9 * without, "{without} {with}");
    let [without, with] = errors(1e-9);
    // A pixel is 14 mm wide.
    assert!(with < 1.1 * without, "{without} {with}");
}
