//! The GLB writer.

use super::container::with_json;
use super::error::WriteError;
use super::glb_mesh::{GlbMesh, Part};
use super::read::read_layer;
use crate::normals::{Normals, Turns};
use if_core::math::{Point, Vector};
use serde_json::{Value, json};
use std::io::Write;

/// Writes the file with the vertices at `positions`, in the units of the scene.
///
/// # Errors
///
/// Positions of another number, not finite or too large; a file whose positions share bytes with
/// other data; and errors of `writer`.
pub fn write(
    glb: &GlbMesh,
    positions: &[Point],
    normals: Normals,
    writer: impl Write,
) -> Result<(), WriteError> {
    write_layers(&[(glb, positions)], normals, writer)
}

/// Writes several layers of one file, each with its vertices at its positions.
///
/// # Errors
///
/// As [`write`]; no layer, or layers of several files.
pub fn write_layers(
    layers: &[(&GlbMesh, &[Point])],
    normals: Normals,
    mut writer: impl Write,
) -> Result<(), WriteError> {
    let Some(&(glb, _)) = layers.first() else { return Err(WriteError::SeveralFiles) };
    if layers.iter().any(|(other, _)| other.bytes != glb.bytes) {
        return Err(WriteError::SeveralFiles);
    }
    let mut bytes = glb.bytes.clone();
    let mut bounds = Vec::new();
    for (glb, positions) in layers {
        glb.mesh.check_positions(positions)?;
        let turns = match normals {
            Normals::Follow => Turns::new(&glb.mesh, positions),
            Normals::Keep => None,
        };
        for part in &glb.parts {
            if place(part, [glb.mesh.vertices(), positions], &mut bytes)? {
                bounds.push((part.positions.accessor, box_of(part, &bytes)));
            }
            if let Some(turns) = &turns {
                turn(part, turns, &mut bytes);
            }
        }
    }
    if !bounds.is_empty() {
        let mut document: Value = serde_json::from_slice(&bytes[glb.chunks.json.clone()])
            .map_err(|_| WriteError::Overlap)?;
        for (accessor, [min, max]) in bounds {
            let about = &mut document["accessors"][accessor];
            (about["min"], about["max"]) = (json!(min), json!(max));
        }
        bytes = with_json(&bytes, &glb.chunks, document.to_string().as_bytes());
        // What is read back must be what was meant, also of files whose data overlap.
        for (glb, positions) in layers {
            let expected = glb.positions_as_written(positions);
            let again = read_layer(bytes.clone(), glb.node.as_deref());
            let is_as_meant = again.is_ok_and(|again| {
                again.mesh.vertices() == expected && again.mesh.triangles() == glb.mesh.triangles()
            });
            if !is_as_meant {
                return Err(WriteError::Overlap);
            }
        }
    }
    writer.write_all(&bytes)?;
    writer.flush()?;
    Ok(())
}

/// Writes the positions of vertices that moved. Returns whether one has.
fn place(
    part: &Part,
    [before, positions]: [&[Point]; 2],
    bytes: &mut [u8],
) -> Result<bool, WriteError> {
    let mut has_moved = false;
    for k in 0..part.positions.count {
        let vertex = part.first + k;
        if positions[vertex] == before[vertex] {
            continue;
        }
        let stored = part.placings.of(k).back(&positions[vertex]);
        if !stored.iter().all(|x| x.is_finite()) {
            return Err(WriteError::Range { vertex });
        }
        put(bytes, part.positions.at(k), stored);
        has_moved = true;
    }
    Ok(has_moved)
}

/// Turns the normals with the surface.
fn turn(part: &Part, turns: &Turns, bytes: &mut [u8]) {
    let Some(normals) = &part.normals else { return };
    for k in 0..normals.count {
        let placing = part.placings.of(k);
        let stored = Vector::from(normals.values::<3>(bytes, k));
        let Some(n) = placing.normal_forward(&stored).try_normalize(0.0) else { continue };
        let turned = turns.turned(part.first + k, &n).map(|n| placing.normal_back(&n));
        if let Some(n) = turned.and_then(|n| n.try_normalize(0.0)) {
            put(bytes, normals.at(k), n.map(|x| x as f32).into());
        }
    }
}

fn put(bytes: &mut [u8], at: usize, numbers: [f32; 3]) {
    for (k, x) in numbers.into_iter().enumerate() {
        bytes[at + 4 * k..at + 4 * k + 4].copy_from_slice(&x.to_le_bytes());
    }
}

/// The bounds of what is stored, which the format asks for.
fn box_of(part: &Part, bytes: &[u8]) -> [[f64; 3]; 2] {
    let mut found = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for element in 0..part.positions.count {
        let p: [f64; 3] = part.positions.values(bytes, element);
        for axis in 0..3 {
            found[0][axis] = found[0][axis].min(p[axis]);
            found[1][axis] = found[1][axis].max(p[axis]);
        }
    }
    found
}
