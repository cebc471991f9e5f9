//! The writer.

use super::PlyMesh;
use super::error::WriteError;
use super::scalar::{Column, ScalarType};
use super::table::Property;
use crate::normals::{Normals, Turns};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::{MeshError, TriMesh};
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::Write;

/// How wide the coordinates of a file are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum CoordinateType {
    /// 4 bytes: what garment files nearly always have. 0.1 µm is lost at 1 m.
    #[default]
    Float,
    /// 8 bytes: nothing is lost.
    Double,
}

/// What is written beside vertices and triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Keep {
    /// Every property and element, with its type; only numbers of vertices in `int16`, which meshio
    /// cannot read, become `int32`. meshio reads the file unless it has lists beside the faces,
    /// properties of faces, or other elements.
    #[default]
    All,
    /// What other programs read too: one number for each vertex and property, 64-bit integers as
    /// `double`; no properties of faces, no lists, no other elements.
    Portable,
}

/// How to write.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct WriteParams {
    /// Width of the coordinates.
    pub coordinates: CoordinateType,
    /// What is kept beside vertices and triangles.
    pub keep: Keep,
    /// What becomes of the vertex properties nx, ny and nz, where all three are there.
    pub normals: Normals,
}

/// The positions as they will be read back from a file with such coordinates. What must hold for
/// the file, such as having no intersections, is to be proven for these.
///
/// A coordinate beyond the range of `float` becomes infinite; [`write()`] refuses it.
pub fn quantise(positions: &[Point], coordinates: CoordinateType) -> Vec<Point> {
    match coordinates {
        CoordinateType::Float => {
            positions.iter().map(|p| p.map(|x| Real::from(x as f32))).collect()
        }
        CoordinateType::Double => positions.to_vec(),
    }
}

/// Writes `ply` with its vertices at `positions` (metres), as `binary_little_endian 1.0`: vertices,
/// then faces (the polygons of the file, where it had any), then all other elements.
///
/// Vertices that have not moved keep the bits of their coordinates.
///
/// # Errors
///
/// Positions that do not fit, are not finite, or are too large for `float`; properties whose
/// lengths or names do not fit; and what `writer` returns.
pub fn write(
    ply: &PlyMesh,
    positions: &[Point],
    params: &WriteParams,
    mut writer: impl Write,
) -> Result<(), WriteError> {
    check_positions(&ply.mesh, positions, params.coordinates)?;
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
    // Positions alone go straight to the file.
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

    writer.write_all(header.as_bytes())?;
    match (vertex, params.coordinates) {
        (Some(vertex), _) => vertex.write(&mut writer)?,
        (None, CoordinateType::Float) => {
            places::<4, 12>(positions, |x| (x as f32).to_le_bytes(), &mut writer)?
        }
        (None, CoordinateType::Double) => {
            places::<8, 24>(positions, Real::to_le_bytes, &mut writer)?
        }
    }
    match polygons {
        None if face.properties.is_empty() => triangles(ply.mesh.triangles(), &mut writer)?,
        None => faces(ply.mesh.triangles().iter().map(|t| &t[..]), length, &face, &mut writer)?,
        Some(p) => faces(p.iter(), length, &face, &mut writer)?,
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

/// Positions and nothing else, of N bytes for each number and R for each position.
fn places<const N: usize, const R: usize>(
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
        follow(&mut properties, &ply.mesh, positions);
    }
    properties
}

fn borrowed(properties: &[Property]) -> Vec<Cow<'_, Property>> {
    properties.iter().map(Cow::Borrowed).collect()
}

/// The property in types that meshio reads.
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

/// Turns nx, ny and nz with the surface.
fn follow(properties: &mut [Cow<'_, Property>], mesh: &TriMesh, positions: &[Point]) {
    let place = ["nx", "ny", "nz"]
        .map(|n| properties.iter().position(|p| p.name == n && p.values.len() == positions.len()));
    let [Some(x), Some(y), Some(z)] = place else { return };
    let Some(turns) = Turns::new(mesh, positions) else { return };
    let old = [x, y, z].map(|k| properties[k].values.to_f64());
    for v in 0..positions.len() {
        let Some(n) = turns.turned(v, &Vector::new(old[0][v], old[1][v], old[2][v])) else {
            continue;
        };
        for (axis, k) in [x, y, z].into_iter().enumerate() {
            match &mut properties[k].to_mut().values {
                Column::F32(c) => c[v] = n[axis] as f32,
                Column::F64(c) => c[v] = n[axis],
                _ => {} // normals in whole numbers stay
            }
        }
    }
}

/// Bytes handed to the writer at once.
const BLOCK: usize = 1 << 16;

/// An element on its way out.
struct Rows<'a> {
    name: &'a str,
    count: usize,
    properties: Vec<Cow<'a, Property>>,
    /// Of each property that is a list, the type of its lengths.
    lengths: Vec<Option<ScalarType>>,
}

impl<'a> Rows<'a> {
    fn new(name: &'a str, count: usize, properties: Vec<Cow<'a, Property>>) -> Self {
        let length = |p: &Cow<'_, Property>| {
            let longest =
                p.lists.as_ref()?.windows(2).map(|w| w[1].saturating_sub(w[0])).max().unwrap_or(0);
            Some(if longest > u32::from(u8::MAX) { ScalarType::U32 } else { ScalarType::U8 })
        };
        let lengths = properties.iter().map(length).collect();
        Self { name, count, properties, lengths }
    }

    /// Checks the element and appends its lines to the header; `first` is a line for a first
    /// property.
    fn declare(&self, header: &mut String, first: Option<String>) -> Result<(), WriteError> {
        let mut names: BTreeSet<&str> = first.iter().map(|_| "vertex_indices").collect();
        *header += &format!("element {} {}\n", checked(self.name)?, self.count);
        *header += &first.unwrap_or_default();
        for (p, length) in self.properties.iter().zip(&self.lengths) {
            if !names.insert(checked(&p.name)?) {
                return Err(WriteError::Name { name: p.name.clone() });
            }
            let in_order = p.lists.as_ref().is_none_or(|l| {
                l.is_sorted()
                    && l.first() == Some(&0)
                    && l.last().is_some_and(|&n| n as usize == p.values.len())
            });
            if p.records() != self.count || !in_order {
                let (element, property) = (self.name.to_owned(), p.name.clone());
                return Err(WriteError::PropertyLength {
                    element,
                    property,
                    expected: self.count,
                    found: p.records(),
                });
            }
            let list = length.map_or(String::new(), |t| format!("list {t} "));
            *header += &format!("property {list}{} {}\n", p.values.scalar_type(), p.name);
        }
        Ok(())
    }

    fn write(&self, writer: &mut impl Write) -> Result<(), WriteError> {
        if self.lengths.iter().any(Option::is_some) {
            let mut out = Blocks { bytes: Vec::with_capacity(BLOCK), writer };
            for row in 0..self.count {
                self.append(row, &mut out.bytes);
                out.flush_if_full()?;
            }
            return out.flush();
        }
        let stride: usize = self.properties.iter().map(|p| p.values.scalar_type().size()).sum();
        let per_block = (BLOCK / stride.max(1)).max(1);
        let mut block = vec![0; per_block.min(self.count) * stride];
        for first in (0..self.count).step_by(per_block) {
            let bytes = &mut block[..per_block.min(self.count - first) * stride];
            let mut offset = 0;
            for p in &self.properties {
                p.values.put_strided(first, bytes, stride, offset);
                offset += p.values.scalar_type().size();
            }
            writer.write_all(bytes)?;
        }
        Ok(())
    }

    /// Appends the values of record `row`.
    fn append(&self, row: usize, bytes: &mut Vec<u8>) {
        for (p, length) in self.properties.iter().zip(&self.lengths) {
            let range = p.range(row);
            if let Some(t) = length {
                bytes.extend_from_slice(&(range.len() as u32).to_le_bytes()[..t.size()]);
            }
            p.values.append(range, bytes);
        }
    }
}

/// The name, if a header can hold it.
fn checked(name: &str) -> Result<&str, WriteError> {
    let fits = !name.is_empty() && name.bytes().all(|b| b.is_ascii_graphic());
    if fits { Ok(name) } else { Err(WriteError::Name { name: name.to_owned() }) }
}

/// Faces of any number of corners, each followed by its properties.
fn faces<'p>(
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

/// Faces of three corners, each one byte and three numbers of four.
fn triangles(triangles: &[[u32; 3]], writer: &mut impl Write) -> Result<(), WriteError> {
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

/// Collects records until there is a block of them.
struct Blocks<'a, W> {
    bytes: Vec<u8>,
    writer: &'a mut W,
}

impl<W: Write> Blocks<'_, W> {
    fn flush_if_full(&mut self) -> Result<(), WriteError> {
        if self.bytes.len() >= BLOCK { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        self.writer.write_all(&self.bytes)?;
        self.bytes.clear();
        Ok(())
    }
}
