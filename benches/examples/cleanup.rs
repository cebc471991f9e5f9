//! Cleans a mesh file and says what was done, as JSON: what `benches/cleanup.py` runs.
//!
//! ```text
//! cargo run --release -p if-benches --example cleanup -- IN.ply OUT.ply [key=value …]
//!
//! openings=4         as many openings        body=FILE.ply      openings by complement
//! longer=0.3         openings by length      field=FILE.ply     φ of this closed mesh
//! components=1       at most so many parts   least=0.01         least share of a part
//! fill=false         surface=10         smooth=false       subdivide=2   repeat=5
//! roughness=0.2      passes=40          trim=false         rings=3       rounds=4      steps=1
//! ```

use if_core::edges::Edges;
use if_core::field::SignedDistance;
use if_core::mesh::TriMesh;
use if_core::monitor::Progress;
use if_mesh::attributes::{Source, VertexAttributes};
use if_mesh::cleanup::{CleanupParams, Complement, Openings, cleanup};
use if_mesh::ply::{self, WriteParams};
use if_mesh::sdf::MeshSdf;
use std::collections::BTreeMap;
use std::error::Error;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, options @ ..] = &args[..] else {
        return Err("give IN.ply OUT.ply [key=value …]".into());
    };
    if let Some(word) = options.iter().find(|o| !o.contains('=')) {
        return Err(format!("`{word}` is no key=value; one file is read and one written").into());
    }
    let options: BTreeMap<&str, &str> = options.iter().filter_map(|o| o.split_once('=')).collect();
    let number = |key: &str| options.get(key).map(|v| v.parse::<f64>()).transpose();

    let mut file = ply::read_path(Path::new(input))?;
    let mut mesh = file.mesh.clone();
    let mut attributes =
        VertexAttributes::new(mesh.vertices().len(), std::mem::take(&mut file.vertex_properties))?;
    for _ in 0..number("subdivide")?.unwrap_or(0.0) as usize {
        let (finer, sources) = subdivided(&mesh)?;
        attributes = attributes.derive(&sources);
        mesh = finer;
    }
    let mut params = CleanupParams { single_precision: true, ..CleanupParams::default() };
    if let Some(count) = number("openings")? {
        params.openings = Openings::Count(count as usize);
    }
    if let Some(length) = number("longer")? {
        params.openings = Openings::Longer(length);
    }
    if let Some(body) = options.get("body") {
        params.openings =
            Openings::Complement(Box::new(Complement::new(ply::read_path(Path::new(body))?.mesh)));
    }
    if let Some(components) = &mut params.components {
        components.most = number("components")?.map(|n| n as usize);
        components.least_share = number("least")?.unwrap_or(components.least_share);
    }
    if options.get("fill") == Some(&"false") {
        params.fill = None;
    }
    if let Some(smooth) = &mut params.smooth {
        smooth.surface_passes = number("surface")?.unwrap_or(0.0) as usize;
        smooth.roughness = number("roughness")?.unwrap_or(smooth.roughness);
        smooth.passes = number("passes")?.map_or(smooth.passes, |n| n as usize);
        smooth.rounds = number("rounds")?.map_or(smooth.rounds, |n| n as usize);
        smooth.rings = number("rings")?.map_or(smooth.rings, |n| n as usize);
        smooth.trim = options.get("trim") != Some(&"false");
        smooth.boundary = options.get("smooth") != Some(&"false");
    }
    let field = match options.get("field") {
        Some(path) => Some(MeshSdf::closed(&ply::read_path(Path::new(path))?.mesh)?),
        None => None,
    };
    let field = field.as_ref().map(|f| f as &dyn SignedDistance);

    let mut times = Vec::new();
    let mut clean = None;
    for _ in 0..number("repeat")?.unwrap_or(1.0) as usize {
        let start = Instant::now();
        let (mut steps, mut last) = (vec![start], None);
        let mut monitor = |progress: &Progress<'_>| {
            if last.replace(progress.stage) != Some(progress.stage) {
                steps.push(Instant::now());
            }
            ControlFlow::Continue(())
        };
        clean = Some(cleanup(&mesh, &attributes, field, &params, &mut monitor)?);
        steps.push(Instant::now());
        if options.contains_key("steps") {
            let ms: Vec<String> = steps
                .windows(2)
                .map(|w| format!("{:.1}", (w[1] - w[0]).as_secs_f64() * 1e3))
                .collect();
            writeln!(
                std::io::stderr(),
                "copy, manifold, then components, holes, …, boundary, in ms: {}",
                ms.join(" ")
            )?;
        }
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    let clean = clean.ok_or("repeat must be at least 1")?;
    times.sort_by(f64::total_cmp);
    file.polygons = None;
    file.face_properties.clear();
    file.mesh = clean.mesh;
    file.vertex_properties = clean.attributes.into_properties();
    let positions = file.mesh.vertices().to_vec();
    ply::write_path(&file, &positions, &WriteParams::default(), Path::new(output))?;
    let report = serde_json::json!({ "milliseconds": { "least": times[0], "median": times[times.len() / 2] }, "report": clean.report });
    writeln!(std::io::stdout(), "{report}")?;
    Ok(())
}

/// Each triangle in four.
fn subdivided(mesh: &TriMesh) -> Result<(TriMesh, Vec<Source>), Box<dyn Error>> {
    let edges = Edges::new(mesh);
    let n = mesh.vertices().len() as u32;
    let mut points = mesh.vertices().to_vec();
    let mut sources: Vec<Source> = (0..n).map(Source::Vertex).collect();
    for &[a, b] in &edges.vertices {
        points.push(nalgebra::center(&points[a as usize], &points[b as usize]));
        sources.push(Source::Blend(vec![(a, 0.5), (b, 0.5)]));
    }
    let mut triangles = Vec::with_capacity(4 * mesh.triangles().len());
    for (t, e) in mesh.triangles().iter().zip(&edges.of_triangle) {
        let m = e.map(|e| n + e);
        triangles.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m]);
    }
    Ok((TriMesh::new(points, triangles)?, sources))
}
