//! Reading and writing a PLY file of a million triangles, in memory, against the bound: a copy of
//! its bytes into new memory.
//!
//! ```text
//! RAYON_NUM_THREADS=1 cargo run --release -p if-benches --example ply_speed [TURNS \
//!     [copy|read|write|mesh]]
//! ```
//!
//! With a word only that is done, so that on a busy machine the time of the processor can be taken:
//! that of many turns less that of one.

#![allow(clippy::print_stdout)] // that is what it is for

use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::tube;
use if_mesh::ply::{self, PlyMesh, WriteParams};
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

const WORDS: [&str; 4] = ["copy", "read", "write", "mesh"];

fn main() -> Result<(), Box<dyn Error>> {
    let only = std::env::args().nth(2);
    if only.as_ref().is_some_and(|o| !WORDS.contains(&o.as_str())) {
        return Err(format!("one of {WORDS:?}").into());
    }
    let turns: usize = std::env::args().nth(1).map_or(Ok(15), |n| n.parse())?;
    let mesh = tube(0.2, 1.7, 1000, 500, true);
    // What single precision holds: the file gives the same mesh again.
    let points =
        mesh.vertices().iter().map(|p| p.map(|x| f64::from(x as f32))).collect::<Vec<Point>>();
    let file = PlyMesh::new(TriMesh::new(points, mesh.triangles().to_vec())?);
    let write = |capacity| -> Result<Vec<u8>, ply::WriteError> {
        let mut bytes = Vec::with_capacity(capacity);
        ply::write(&file, file.mesh.vertices(), &WriteParams::default(), &mut bytes)?;
        Ok(bytes)
    };
    let bytes = write(0)?;
    if ply::read_bytes(&bytes)?.mesh != file.mesh {
        return Err("the file gives another mesh".into());
    }
    // In turn, so that all meet the same neighbours on this machine.
    let mut times = [const { Vec::new() }; 4];
    for _ in 0..turns {
        let mut take = |k: usize, work: &mut dyn FnMut()| {
            if only.as_ref().is_some_and(|o| o != WORDS[k]) {
                return;
            }
            let start = Instant::now();
            work();
            times[k].push(start.elapsed().as_secs_f64() * 1e3);
        };
        take(0, &mut || drop(black_box(black_box(&bytes).to_vec())));
        take(1, &mut || drop(black_box(ply::read_bytes(black_box(&bytes)))));
        take(2, &mut || drop(black_box(write(bytes.len()))));
        take(3, &mut || {
            drop(black_box((file.mesh.vertices().to_vec(), file.mesh.triangles().to_vec())))
        });
    }
    times.iter_mut().for_each(|t| t.sort_by(f64::total_cmp));
    println!(
        "{} triangles, {} vertices, {} bytes; least and median of {turns} turns, ms",
        mesh.triangles().len(),
        mesh.vertices().len(),
        bytes.len()
    );
    for (name, t) in ["copy of the file's bytes", "read", "write", "copy of the mesh"]
        .iter()
        .zip(&times)
        .filter(|(_, t)| !t.is_empty())
    {
        let of = times[0].get(turns / 2).map_or(String::new(), |copy| {
            format!(", {:.2} {:.2} of the copy", t[0] / times[0][0], t[turns / 2] / copy)
        });
        println!("{name}: {:.1} {:.1}{of}", t[0], t[turns / 2]);
    }
    Ok(())
}
