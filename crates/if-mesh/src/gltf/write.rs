//! The glTF writer.

use super::accessor::Elements;
use super::edit::{Beside, Edit, GltfFiles};
use super::error::WriteError;
use super::gltf_mesh::{GltfMesh, Part};
use super::placing::Placing;
use super::read::read_with;
use crate::normals::{Normals, Turns};
use if_core::math::{Point, Real, Vector};
use serde_json::json;
use std::io;
use std::path::Path;

/// The file with the vertices at `positions`, in the units of the scene.
///
/// # Errors
///
/// Positions of another number, not finite or too large; vertices that two nodes show; a file whose
/// positions share bytes with other data.
pub fn write(
    gltf: &GltfMesh,
    positions: &[Point],
    normals: Normals,
) -> Result<GltfFiles, WriteError> {
    write_layers(&[(gltf, positions)], normals, Beside::Files)
}

/// Several layers of one file, each with its vertices at its positions, and its buffers of other files
/// beside it or embedded.
///
/// # Errors
///
/// As [`write()`]; no layer, or layers of several files.
pub fn write_layers(
    layers: &[(&GltfMesh, &[Point])],
    normals: Normals,
    beside: Beside,
) -> Result<GltfFiles, WriteError> {
    edited(layers, normals, beside, false)
}

/// As [`write_layers`] with embedded buffers and without the animations of the file, which would pose meshes
/// that are posed already. Skins stay: in the pose of the nodes they show the positions.
///
/// # Errors
///
/// As [`write_layers`].
pub fn write_frame(
    layers: &[(&GltfMesh, &[Point])],
    normals: Normals,
) -> Result<GltfFiles, WriteError> {
    edited(layers, normals, Beside::Embedded, true)
}

fn edited(
    layers: &[(&GltfMesh, &[Point])],
    normals: Normals,
    beside: Beside,
    is_frame: bool,
) -> Result<GltfFiles, WriteError> {
    let Some(&(gltf, _)) = layers.first() else { return Err(WriteError::SeveralFiles) };
    if layers.iter().any(|(other, _)| !other.is_in_file_of(gltf)) {
        return Err(WriteError::SeveralFiles);
    }
    let mut edit = Edit::new(&gltf.source);
    if is_frame {
        edit.drop_animations()?;
    }
    for (gltf, positions) in layers {
        gltf.mesh.check_positions(positions)?;
        let before = gltf.mesh.vertices();
        if before == *positions {
            continue;
        }
        gltf.check_movable()?;
        let turns = match normals {
            Normals::Follow => Turns::new(&gltf.mesh, positions),
            Normals::Keep => None,
        };
        for part in &gltf.parts {
            place(gltf, part, positions, &mut edit)?;
            let Some(turns) = &turns else { continue };
            if let Some(normals) = &part.normals {
                let maps: Maps = (Placing::normal_forward, Placing::normal_back);
                turn::<3>(gltf, part, (normals, turns), maps, &mut edit)?;
            }
            if let Some(tangents) = &part.tangents {
                let maps: Maps = (Placing::tangent_forward, Placing::tangent_back);
                turn::<4>(gltf, part, (tangents, turns), maps, &mut edit)?;
            }
        }
    }
    let files = edit.finish(beside)?;
    if files.bytes != gltf.source.bytes {
        // What is read back must be what was meant, also of files whose data overlap.
        for (gltf, positions) in layers {
            if !is_as_meant(gltf, positions, &files) {
                return Err(WriteError::Overlap);
            }
        }
    }
    Ok(files)
}

/// Whether a reader gets the layer with its vertices at `positions`.
fn is_as_meant(gltf: &GltfMesh, positions: &[Point], files: &GltfFiles) -> bool {
    let beside = |path: &Path| {
        let found = files.beside.iter().find(|(other, _)| other == path);
        found.map(|(_, bytes)| bytes.clone()).ok_or_else(|| io::ErrorKind::NotFound.into())
    };
    let again = read_with(files.bytes.clone(), gltf.node.as_deref(), &beside);
    again.is_ok_and(|again| {
        again.mesh.vertices() == gltf.positions_as_written(positions)
            && again.mesh.triangles() == gltf.mesh.triangles()
    })
}

/// Writes the positions of vertices that moved.
fn place(
    gltf: &GltfMesh,
    part: &Part,
    positions: &[Point],
    edit: &mut Edit<'_>,
) -> Result<(), WriteError> {
    let before = gltf.mesh.vertices();
    let vertices = part.first..part.first + part.positions.count;
    if before[vertices.clone()] == positions[vertices] {
        return Ok(());
    }
    let of = part.positions;
    let mut rows: Vec<[Real; 3]> = Vec::with_capacity(of.count);
    for k in 0..of.count {
        let vertex = part.first + k;
        let stored = if positions[vertex] == before[vertex] {
            of.values(&gltf.source, k).map(|x| x as f32)
        } else {
            part.placings.of(k).back(&positions[vertex])
        };
        if !stored.iter().all(|x| x.is_finite()) {
            return Err(WriteError::Range { vertex });
        }
        rows.push(stored.map(Real::from));
    }
    if of.is_float_in_place() {
        // Only those that moved: others may share their bytes.
        for (k, row) in rows.iter().enumerate() {
            if positions[part.first + k] != before[part.first + k] {
                of.put(edit.bytes(of.buffer), k, *row);
            }
        }
        // The bounds of what is stored, whatever that has become.
        for (k, row) in rows.iter_mut().enumerate() {
            *row = of.values_in(edit.bytes(of.buffer), k);
        }
    } else {
        edit.replace(of.accessor, of.home, &rows)?;
    }
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for axis in 0..3 {
        for row in &rows {
            bounds[0][axis] = bounds[0][axis].min(row[axis]);
            bounds[1][axis] = bounds[1][axis].max(row[axis]);
        }
    }
    let about = edit.accessor(of.accessor)?;
    (about["min"], about["max"]) = (json!(bounds[0]), json!(bounds[1]));
    Ok(())
}

/// From a direction of the file to one of the scene, and back.
type Maps = (fn(&Placing, &Vector) -> Vector, fn(&Placing, &Vector) -> Vector);

/// Turns normals, or tangents, which have a fourth number, with the surface.
fn turn<const N: usize>(
    gltf: &GltfMesh,
    part: &Part,
    (directions, turns): (&Elements, &Turns),
    (forward, back): Maps,
    edit: &mut Edit<'_>,
) -> Result<(), WriteError> {
    let turned = |k: usize, stored: &Vector| {
        let placing = part.placings.of(k);
        let n = forward(placing, stored).try_normalize(0.0)?;
        let turned = turns.turned(part.first + k, &n)?;
        back(placing, &turned).try_normalize(0.0)
    };
    let stored = |k: usize| directions.values::<N>(&gltf.source, k);
    let direction = |row: [Real; N]| Vector::new(row[0], row[1], row[2]);
    let changes: Vec<(usize, Vector)> = (0..directions.count)
        .filter_map(|k| Some((k, turned(k, &direction(stored(k)))?)))
        .collect();
    if changes.is_empty() {
        return Ok(());
    }
    if directions.is_direction_in_place() {
        for (k, n) in changes {
            directions.put(edit.bytes(directions.buffer), k, n.into());
        }
    } else {
        let mut rows: Vec<[Real; N]> = (0..directions.count).map(stored).collect();
        for (k, n) in changes {
            rows[k][..3].copy_from_slice(n.as_slice());
        }
        edit.replace(directions.accessor, directions.home, &rows)?;
    }
    // Bounds of directions are optional, and would not be theirs any more.
    if let Some(about) = edit.accessor(directions.accessor)?.as_object_mut() {
        about.shift_remove("min");
        about.shift_remove("max");
    }
    Ok(())
}
