//! The PLY writer.

use super::error::WriteError;
use super::params::{CoordinateType, Keep, WriteParams};
use super::ply_mesh::PlyMesh;
use super::rows::{BLOCK, Blocks, Rows};
use crate::attributes::{Column, Property, ScalarType};
use crate::normals::{Normals, Turns};
use if_core::math::{Point, Real};
use if_core::mesh::{MeshError, TriMesh};
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::Path;

/// The positions as a file with such coordinates returns them. Properties of the file, such as
/// having no intersections, must be proven for these.
///
/// A coordinate beyond the range of `float` becomes infinite; [`write()`] rejects it.
pub fn quantise(positions: &[Point], coordinates: CoordinateType) -> Vec<Point> {
    match coordinates {
        CoordinateType::Float => {
            positions.iter().map(|p| p.map(|x| Real::from(x as f32))).collect()
        }
        CoordinateType::Double => positions.to_vec(),
    }
}

/// Writes `ply` with its vertices at `positions` (metres), as `binary_little_endian 1.0`: vertices,
/// then faces (the polygons of the file, if it had any), then all other elements.
///
/// Vertices that have not moved keep the bits of their coordinates.
///
/// # Errors
///
/// Positions of another number, not finite, or too large for `float`; properties whose lengths or
/// names are invalid; and errors of `writer`.
pub fn write(
    ply: &PlyMesh,
    positions: &[Point],
    params: &WriteParams,
    mut writer: impl Write,
) -> Result<(), WriteError> {
    check_positions(&ply.mesh, positions, params.coordinates)?;
    // The polygons must be fans of the mesh's triangles.
    let polygons = ply.polygons.as_ref();
    if let Some(p) = polygons {
        let (polygon_triangles, triangles) =
            (p.iter().map(|f| f.len() - 2).sum(), ply.mesh.triangles().len());
        let fewer = polygon_triangles > triangles && !ply.collapsed.is_empty();
        let unlike = (polygon_triangles != triangles && !fewer)
            || p.iter().flatten().any(|&v| v as usize >= positions.len());
        if unlike || !p.fans().eq(ply.mesh.triangles().iter().copied()) {
            return Err(WriteError::Polygons { polygon_triangles, triangles });
        }
    }
    let widest = polygons.map_or(3, |p| p.iter().map(<[u32]>::len).max().unwrap_or(3));
    let length = if widest > usize::from(u8::MAX) { ScalarType::U32 } else { ScalarType::U8 };
    let index = if positions.len() > i32::MAX as usize { ScalarType::U32 } else { ScalarType::I32 };
    let all = params.keep == Keep::All;
    // Positions without further properties are written directly.
    let alone = ply.vertex_properties.iter().all(|p| !is_kept(p, params.keep));
    let vertex = (!alone)
        .then(|| Rows::new("vertex", positions.len(), vertex_properties(ply, positions, params)));
    let face_count = polygons.map_or(ply.mesh.triangles().len(), |p| p.len());
    let face = Rows::new(
        "face",
        face_count,
        if all { borrowed(&ply.face_properties) } else { Vec::new() },
    );
    let others = ply
        .other_elements
        .iter()
        .filter(|_| all)
        .map(|e| Rows::new(&e.name, e.count, borrowed(&e.properties)));
    let others: Vec<Rows<'_>> = others.collect();

    // Header.
    let mut header = String::from("ply\nformat binary_little_endian 1.0\n");
    for (word, texts) in [("comment", &ply.comments), ("obj_info", &ply.obj_info)] {
        for line in texts.iter().flat_map(|t| t.split(['\n', '\r'])) {
            header += &format!("{word} {line}\n");
        }
    }
    match &vertex {
        Some(vertex) => vertex.declare(&mut header, None)?,
        None => {
            let number = if params.coordinates == CoordinateType::Float {
                ScalarType::F32
            } else {
                ScalarType::F64
            };
            header += &format!(
                "element vertex {}\nproperty {number} x\nproperty {number} y\nproperty {number} z\n",
                positions.len()
            );
        }
    }
    face.declare(&mut header, Some(format!("property list {length} {index} vertex_indices\n")))?;
    let mut names = BTreeSet::from(["vertex", "face"]);
    for element in &others {
        if !names.insert(element.name) {
            return Err(WriteError::Name { name: element.name.to_owned() });
        }
        element.declare(&mut header, None)?;
    }
    header += "end_header\n";

    // Records.
    writer.write_all(header.as_bytes())?;
    match (vertex, params.coordinates) {
        (Some(vertex), _) => vertex.write(&mut writer)?,
        (None, CoordinateType::Float) => {
            write_positions::<4, 12>(positions, |x| (x as f32).to_le_bytes(), &mut writer)?
        }
        (None, CoordinateType::Double) => {
            write_positions::<8, 24>(positions, Real::to_le_bytes, &mut writer)?
        }
    }
    match polygons {
        None if face.properties.is_empty() => write_triangles(ply.mesh.triangles(), &mut writer)?,
        None => {
            write_faces(ply.mesh.triangles().iter().map(|t| &t[..]), length, &face, &mut writer)?
        }
        Some(p) => write_faces(p.iter(), length, &face, &mut writer)?,
    }
    for element in &others {
        element.write(&mut writer)?;
    }
    writer.flush()?;
    Ok(())
}

fn is_kept(vertex_property: &Property, keep: Keep) -> bool {
    keep == Keep::All || vertex_property.lists.is_none()
}

/// Writes positions without further properties: N bytes per number, R per position.
fn write_positions<const N: usize, const R: usize>(
    positions: &[Point],
    bytes_of: impl Fn(Real) -> [u8; N],
    writer: &mut impl Write,
) -> Result<(), WriteError> {
    let mut block = vec![0; (BLOCK / R).min(positions.len()) * R];
    for chunk in positions.chunks(BLOCK / R) {
        let bytes = &mut block[..chunk.len() * R];
        for (record, p) in bytes.as_chunks_mut::<R>().0.iter_mut().zip(chunk) {
            for (number, x) in record.as_chunks_mut::<N>().0.iter_mut().zip([p.x, p.y, p.z]) {
                *number = bytes_of(x);
            }
        }
        writer.write_all(bytes)?;
    }
    Ok(())
}

fn check_positions(
    mesh: &TriMesh,
    positions: &[Point],
    coordinates: CoordinateType,
) -> Result<(), WriteError> {
    let expected = mesh.vertices().len();
    if positions.len() != expected {
        return Err(MeshError::VertexCount { expected, got: positions.len() }.into());
    }
    let largest =
        if coordinates == CoordinateType::Float { Real::from(f32::MAX) } else { Real::MAX };
    let is_good =
        |p: &Point| (p.x.abs() <= largest) & (p.y.abs() <= largest) & (p.z.abs() <= largest);
    if positions.iter().fold(true, |good, p| good & is_good(p)) {
        return Ok(());
    }
    for (vertex, p) in positions.iter().enumerate() {
        for axis in 0..3 {
            let value = p[axis];
            if !value.is_finite() {
                return Err(MeshError::NonFinite { vertex, axis, value }.into());
            }
            if coordinates == CoordinateType::Float && !(value as f32).is_finite() {
                return Err(WriteError::TooLarge { vertex, value });
            }
        }
    }
    Ok(())
}

/// The properties of the vertices, coordinates first.
fn vertex_properties<'a>(
    ply: &'a PlyMesh,
    positions: &[Point],
    params: &WriteParams,
) -> Vec<Cow<'a, Property>> {
    let coordinate = |axis: usize| match params.coordinates {
        CoordinateType::Float => Column::F32(positions.iter().map(|p| p[axis] as f32).collect()),
        CoordinateType::Double => Column::F64(positions.iter().map(|p| p[axis]).collect()),
    };
    let mut properties: Vec<_> = (0..3)
        .map(|axis| Cow::Owned(Property::new(["x", "y", "z"][axis], coordinate(axis))))
        .collect();
    let kept = ply.vertex_properties.iter().filter(|p| is_kept(p, params.keep));
    properties.extend(kept.map(|p| readable(p, params.keep)));
    if params.normals == Normals::Follow {
        rotate_normals(&mut properties, &ply.mesh, positions);
    }
    properties
}

fn borrowed(properties: &[Property]) -> Vec<Cow<'_, Property>> {
    properties.iter().map(Cow::Borrowed).collect()
}

/// The property in a type that meshio reads.
fn readable(p: &Property, keep: Keep) -> Cow<'_, Property> {
    let values = match &p.values {
        _ if p.lists.is_some() => return Cow::Borrowed(p),
        Column::I16(v) => Column::I32(v.iter().map(|&x| x.into()).collect()),
        Column::I64(v) if keep == Keep::Portable => {
            Column::F64(v.iter().map(|&x| x as f64).collect())
        }
        Column::U64(v) if keep == Keep::Portable => {
            Column::F64(v.iter().map(|&x| x as f64).collect())
        }
        _ => return Cow::Borrowed(p),
    };
    Cow::Owned(Property::new(p.name.clone(), values))
}

/// Rotates nx, ny and nz with the surface.
fn rotate_normals(properties: &mut [Cow<'_, Property>], mesh: &TriMesh, positions: &[Point]) {
    let place = ["nx", "ny", "nz"]
        .map(|n| properties.iter().position(|p| p.name == n && p.values.len() == positions.len()));
    let [Some(x), Some(y), Some(z)] = place else { return };
    let Some(turns) = Turns::new(mesh, positions) else { return };
    let axes = properties.get_disjoint_mut([x, y, z]).expect("properties of different names");
    turns.turn(axes.map(|p| &mut p.to_mut().values));
}

/// Writes faces of any number of corners, each followed by its properties.
fn write_faces<'p>(
    all: impl Iterator<Item = &'p [u32]>,
    length: ScalarType,
    properties: &Rows<'_>,
    writer: &mut impl Write,
) -> Result<(), WriteError> {
    let mut out = Blocks { bytes: Vec::with_capacity(BLOCK), writer };
    for (row, corners) in all.enumerate() {
        out.bytes.extend_from_slice(&(corners.len() as u32).to_le_bytes()[..length.size()]);
        corners.iter().for_each(|c| out.bytes.extend_from_slice(&c.to_le_bytes()));
        properties.append(row, &mut out.bytes);
        out.flush_if_full()?;
    }
    out.flush()
}

/// Writes triangles without further properties: one byte and three numbers of four bytes each.
fn write_triangles(triangles: &[[u32; 3]], writer: &mut impl Write) -> Result<(), WriteError> {
    const RECORD: usize = 13;
    let mut block = vec![3; (BLOCK / RECORD).min(triangles.len()) * RECORD];
    for chunk in triangles.chunks(BLOCK / RECORD) {
        let bytes = &mut block[..chunk.len() * RECORD];
        for (r, t) in bytes.as_chunks_mut::<RECORD>().0.iter_mut().zip(chunk) {
            for k in 0..3 {
                r[1 + 4 * k..5 + 4 * k].copy_from_slice(&t[k].to_le_bytes());
            }
        }
        writer.write_all(bytes)?;
    }
    Ok(())
}

/// Writes the file at `path`, completely or not at all ([`crate::atomic`]).
///
/// # Errors
///
/// As [`write()`], and errors of the file system.
pub fn write_path(
    ply: &PlyMesh,
    positions: &[Point],
    params: &WriteParams,
    path: &Path,
) -> Result<(), WriteError> {
    crate::atomic::write_file(path, |file| write(ply, positions, params, file))
}
