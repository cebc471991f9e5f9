//! The PLY reader.

use super::ascii;
use super::binary;
use super::error::{At, ReadError};
use super::header::{self, ElementLayout, Header};
use super::params::CoordinateType;
use super::ply_mesh::{Element, PlyMesh};
use super::source::Source;
use super::table::Table;
use crate::attributes::{Column, ScalarType};
use crate::polygons::FaceList;
use if_core::math::Point;
use if_core::mesh::{FinitePoints, TriMesh};
use ply_rs_bw::ply::Encoding;
use std::fs::File;
use std::io::{Empty, Read};
use std::path::Path;

/// Reads a PLY file from any source, to its end.
///
/// # Errors
///
/// [`ReadError`], with the line of a text file or the byte of a binary one.
///
/// # Examples
///
/// ```
/// let file = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
///     element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
/// let ply = if_mesh::ply::read(&file[..])?;
/// assert_eq!(ply.mesh.triangles(), [[0, 1, 2]]);
/// # Ok::<(), if_mesh::ply::ReadError>(())
/// ```
pub fn read(reader: impl Read) -> Result<PlyMesh, ReadError> {
    read_from(Source::new(reader), None, |plan, source| {
        plan.sequential(&plan.header.elements, source)
    })
}

/// Reads the PLY file at `path`. Counts that the file cannot hold are found before anything is read.
///
/// # Errors
///
/// As [`read`]; the message does not name the path, unlike that of `MeshFile::read`.
pub fn read_path(path: &Path) -> Result<PlyMesh, ReadError> {
    let file = File::open(path)?;
    let about = file.metadata()?;
    let size = about.is_file().then_some(about.len()); // a pipe has no size
    read_from(Source::new(file), size, |plan, source| {
        plan.sequential(&plan.header.elements, source)
    })
}

/// Reads from bytes in memory. Counts that the bytes cannot hold are found before anything is read.
pub fn read_bytes(bytes: &[u8]) -> Result<PlyMesh, ReadError> {
    read_from(Source::of(bytes), Some(bytes.len() as u64), |plan, source| plan.parallel(source))
}

/// Maximum white space after the last record.
const MAX_TRAILING_SPACE: usize = 1 << 16;

/// Number of bytes from which on vertices and faces are read in parallel.
const MANY: u64 = 1 << 20;

/// What reading one element requires of the others.
struct Plan<'h> {
    header: &'h Header,
    /// Bytes after the header, if known.
    left: Option<u64>,
    axes: [usize; 3],
    /// Number of vertices.
    vertices: u64,
    /// Index of the property of the faces that holds the vertex indices.
    indices: Option<usize>,
}

impl<'h> Plan<'h> {
    /// Reads all records of an element.
    fn read<R: Read>(
        &self,
        layout: &'h ElementLayout,
        source: &mut Source<'_, R>,
    ) -> Result<Table<'h>, ReadError> {
        let ascii = self.header.encoding == Encoding::Ascii;
        let corners = self.indices.filter(|_| layout.name == "face").map(|k| (k, self.vertices));
        let joined = Some(self.axes)
            .filter(|axes| !ascii && layout.name == "vertex" && are_joined(layout, *axes));
        let mut table = Table::new(layout, corners, joined, self.left);
        match self.header.encoding {
            Encoding::Ascii => ascii::read(source, &mut table)?,
            Encoding::BinaryLittleEndian => binary::read(source, &mut table, false)?,
            Encoding::BinaryBigEndian => binary::read(source, &mut table, true)?,
        }
        Ok(table)
    }

    /// Reads `elements` one after the other.
    fn sequential<R: Read>(
        &self,
        elements: &'h [ElementLayout],
        source: &mut Source<'_, R>,
    ) -> Result<Vec<Table<'h>>, ReadError> {
        elements.iter().map(|layout| self.read(layout, source)).collect()
    }

    /// Reads all elements from memory. If the header determines the size of the first one, it is read
    /// in parallel to the others. The result is the same either way: a fault of the first element
    /// comes before all others.
    fn parallel(&self, source: &mut Source<'_, Empty>) -> Result<Vec<Table<'h>>, ReadError> {
        let elements = &self.header.elements[..];
        let many =
            self.header.encoding != Encoding::Ascii && self.left.is_some_and(|left| left >= MANY);
        let Some((first, others)) = elements.split_first().filter(|_| many) else {
            return self.sequential(elements, source);
        };
        let bytes = first.fixed_bytes().and_then(|n| usize::try_from(n).ok());
        let Some(mut start) = bytes.and_then(|n| source.split_off(n)) else {
            return self.sequential(elements, source);
        };
        let (first, others) =
            rayon::join(|| self.read(first, &mut start), || self.sequential(others, source));
        let mut tables = vec![first?];
        tables.append(&mut others?);
        Ok(tables)
    }
}

/// `elements` reads the records of all elements.
fn read_from<R: Read>(
    mut source: Source<'_, R>,
    size: Option<u64>,
    elements: impl for<'h> FnOnce(&Plan<'h>, &mut Source<'_, R>) -> Result<Vec<Table<'h>>, ReadError>,
) -> Result<PlyMesh, ReadError> {
    let header = header::read(&mut source)?;
    let ascii = header.encoding == Encoding::Ascii;
    let left = size.map(|s| s.saturating_sub(source.offset()));
    check_claims(&header.elements, ascii, left)?;
    let vertices =
        header.elements.iter().find(|e| e.name == "vertex").ok_or(ReadError::NoVertices)?;
    let axes = axes(vertices)?;
    let indices = indices(&header.elements)?;
    let plan = Plan { header: &header, left, axes, vertices: vertices.count, indices };

    let mut ply = PlyMesh::default();
    let (mut points, mut faces) = (Ok(FinitePoints::default()), FaceList::default());
    for table in elements(&plan, &mut source)? {
        let layout = table.layout;
        let (mut properties, list, joined) = table.finish();
        match layout.name.as_str() {
            "vertex" => {
                (points, ply.coordinates) = match joined {
                    Some(points) if vertices.properties[axes[0]].scalar == ScalarType::F32 => {
                        (points, CoordinateType::Float)
                    }
                    Some(points) => (points, CoordinateType::Double),
                    None => {
                        let (points, coordinates) = positions(axes.map(|k| &properties[k].values));
                        (FinitePoints::new(points), coordinates)
                    }
                };
                let mut k = 0..;
                properties.retain(|_| k.next().is_some_and(|k| !axes.contains(&k)));
                ply.vertex_properties = properties;
            }
            "face" => {
                faces = list.unwrap_or_default();
                ply.face_properties = properties;
            }
            _ => ply.other_elements.push(Element {
                name: layout.name.clone(),
                count: layout.count as usize,
                properties,
            }),
        }
    }
    check_end(&mut source, ascii)?;
    ply.mesh = TriMesh::from_parts(points?, faces.triangles)?;
    (ply.polygons, ply.collapsed) = (faces.polygons, faces.collapsed);
    (ply.comments, ply.obj_info) = (header.comments, header.obj_info);
    Ok(ply)
}

/// Rejects counts that the remaining bytes cannot hold.
fn check_claims(
    elements: &[ElementLayout],
    ascii: bool,
    left: Option<u64>,
) -> Result<(), ReadError> {
    let Some(left) = left else { return Ok(()) };
    let mut sum = 0u128;
    for e in elements {
        let needed = e.least_bytes(ascii);
        sum += needed;
        if sum > u128::from(left) {
            let left = u128::from(left).saturating_sub(sum - needed) as u64;
            return Err(ReadError::Claim { count: e.count, element: e.name.clone(), needed, left });
        }
    }
    Ok(())
}

/// Indices of the properties x, y and z.
fn axes(vertices: &ElementLayout) -> Result<[usize; 3], ReadError> {
    let mut found = [0; 3];
    for (k, axis) in ['x', 'y', 'z'].into_iter().enumerate() {
        let named = |p: &header::PropertyLayout| {
            p.length.is_none() && p.name.len() == 1 && p.name.starts_with(axis)
        };
        found[k] =
            vertices.properties.iter().position(named).ok_or(ReadError::NoCoordinate { axis })?;
    }
    Ok(found)
}

/// Whether coordinates are joined to positions as they are read: all have the same float type, and
/// all records the same size.
fn are_joined(vertices: &ElementLayout, axes: [usize; 3]) -> bool {
    let [x, y, z] = axes.map(|k| vertices.properties[k].scalar);
    let same = x == y && y == z && !x.is_integer();
    same && vertices.properties.iter().all(|p| p.length.is_none())
}

/// Index of the property of the element `face` that holds the vertex indices.
fn indices(elements: &[ElementLayout]) -> Result<Option<usize>, ReadError> {
    let Some(face) = elements.iter().find(|e| e.name == "face") else {
        let strips = elements.iter().any(|e| e.name == "tristrips" && e.count > 0);
        return if strips { Err(ReadError::TriangleStrips) } else { Ok(None) };
    };
    let list =
        |name: &str| face.properties.iter().position(|p| p.name == name && p.length.is_some());
    match list("vertex_indices").or_else(|| list("vertex_index")) {
        Some(k) if !face.properties[k].scalar.is_integer() => {
            let p = &face.properties[k];
            Err(ReadError::IndexType { property: p.name.clone(), found: p.scalar })
        }
        None if face.count > 0 => Err(ReadError::NoIndices { count: face.count }),
        found => Ok(found),
    }
}

/// Positions from three columns, and the type of the coordinates.
fn positions(columns: [&Column; 3]) -> (Vec<Point>, CoordinateType) {
    fn join<T: Copy + Into<f64>>(x: &[T], y: &[T], z: &[T]) -> Vec<Point> {
        x.iter()
            .zip(y)
            .zip(z)
            .map(|((&x, &y), &z)| Point::new(x.into(), y.into(), z.into()))
            .collect()
    }
    match columns {
        [Column::F32(x), Column::F32(y), Column::F32(z)] => (join(x, y, z), CoordinateType::Float),
        [Column::F64(x), Column::F64(y), Column::F64(z)] => (join(x, y, z), CoordinateType::Double),
        mixed => {
            let [x, y, z] = mixed.map(Column::to_f64);
            (join(&x, &y, &z), CoordinateType::Double)
        }
    }
}

/// Rejects anything but white space after the last record.
fn check_end<R: Read>(source: &mut Source<'_, R>, ascii: bool) -> Result<(), ReadError> {
    let (offset, line) = (source.offset(), source.line_number() + 1);
    let rest = source.peek(MAX_TRAILING_SPACE)?;
    if rest.len() >= MAX_TRAILING_SPACE || !rest.trim_ascii().is_empty() {
        return Err(ReadError::Trailing {
            at: if ascii { At::Line(line) } else { At::Byte(offset) },
        });
    }
    Ok(())
}
