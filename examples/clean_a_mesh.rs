//! A damaged garment made whole: loose parts dropped, holes filled, openings kept (Appendix B).
//!
//! ```text
//! cargo run --release --example clean_a_mesh
//! ```

#![allow(clippy::print_stdout)] // a program for the terminal

use if_garments::core::shapes::meshes::tube;
use if_garments::mesh::attributes::VertexAttributes;
use if_garments::mesh::cleanup::{CleanupParams, Openings, cleanup};
use if_garments::mesh::validate::is_valid;
use if_garments::{Silent, TriMesh};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A sleeve without some triangles in its middle, and with a loose triangle beside it.
    let sleeve = tube(0.1, 0.4, 40, 20, false);
    let mut triangles = sleeve.triangles().to_vec();
    triangles.drain(600..604);
    let mut vertices = sleeve.vertices().to_vec();
    let first = vertices.len() as u32;
    vertices.extend(sleeve.corners(0).map(|p| p + 0.5 * p.coords));
    triangles.push([first, first + 1, first + 2]);
    let damaged = TriMesh::new(vertices, triangles)?;

    // Two openings are known here. The default decides by the shape of each loop.
    let params = CleanupParams { openings: Openings::Count(2), ..Default::default() };
    let attributes = VertexAttributes::none(damaged.vertices().len());
    let clean = cleanup(&damaged, &attributes, None, &params, &mut Silent)?;
    let holes = &clean.report.holes;
    println!("{} filled, {} openings kept", holes.filled.len(), holes.openings.len());
    assert_eq!((holes.filled.len(), holes.openings.len()), (1, 2));
    assert!(is_valid(&clean.mesh));
    Ok(())
}
