//! Records of binary files: in blocks if all have the same size, else one by one.

use super::error::{At, ReadError};
use super::scalar::Scalar;
use super::source::Source;
use super::table::Table;
use crate::attributes::ScalarType;
use if_core::mesh::Triangles;
use std::io::Read;

/// Reads all records of an element.
pub(super) fn read<R: Read>(
    source: &mut Source<'_, R>,
    table: &mut Table<'_>,
    big_endian: bool,
) -> Result<(), ReadError> {
    if table.layout.properties.iter().all(|p| p.length.is_none()) {
        return scalars(source, table, big_endian);
    }
    let triangle = TriangleRecord::of(table);
    while table.done < table.layout.count {
        if let Some(t) = &triangle
            && t.run(source, table, big_endian)?
        {
            continue;
        }
        record(source, table, big_endian)?;
    }
    Ok(())
}

/// Records without lists.
fn scalars<R: Read>(
    source: &mut Source<'_, R>,
    table: &mut Table<'_>,
    big_endian: bool,
) -> Result<(), ReadError> {
    let stride: usize = table.layout.properties.iter().map(|p| p.scalar.size()).sum();
    let mut offsets = vec![0; table.slots.len()];
    while table.done < table.layout.count {
        let left = table.layout.count - table.done;
        let there = source.peek(stride)?;
        let records = (there.len() / stride).min(usize::try_from(left).unwrap_or(usize::MAX));
        if records == 0 {
            let end = there.len() as u64;
            return Err(table.truncated(At::Byte(source.offset() + end)));
        }
        let block = &there[..records * stride];
        let mut offset = 0;
        for (k, slot) in table.slots.iter_mut().enumerate() {
            offsets[k] = offset;
            if table.points.as_ref().is_none_or(|p| !p.axes.contains(&k)) {
                slot.values.extend_strided(block, stride, offset, big_endian);
            }
            offset += slot.values.scalar_type().size();
        }
        if let Some(points) = &mut table.points {
            let at = points.axes.map(|k| offsets[k]);
            points.extend(
                block,
                stride,
                at,
                table.layout.properties[points.axes[0]].scalar,
                big_endian,
            );
        }
        source.consume(records * stride);
        table.done += records as u64;
    }
    Ok(())
}

/// One record of any layout.
fn record<R: Read>(
    source: &mut Source<'_, R>,
    table: &mut Table<'_>,
    big_endian: bool,
) -> Result<(), ReadError> {
    for k in 0..table.slots.len() {
        let (length, scalar) =
            (table.layout.properties[k].length, table.layout.properties[k].scalar);
        let mut values = 1;
        if let Some(t) = length {
            let at = At::Byte(source.offset());
            let n = t.get_i64(exactly(source, t.size(), table)?, big_endian);
            values = usize::try_from(n).map_err(|_| table.negative_length(at, k, n))?;
            source.consume(t.size());
        }
        let at = At::Byte(source.offset());
        let size = values.saturating_mul(scalar.size());
        let bytes = exactly(source, size, table)?;
        match &mut table.faces {
            Some(faces) if faces.property == k => {
                faces.push(
                    bytes.chunks_exact(scalar.size()).map(|b| scalar.get_i64(b, big_endian)),
                    at,
                )?;
            }
            _ => {
                table.slots[k].values.extend_packed(bytes, big_endian);
                if length.is_some() {
                    table.end_list(k)?;
                }
            }
        }
        source.consume(size);
    }
    table.done += 1;
    Ok(())
}

fn exactly<'s, R: Read>(
    source: &'s mut Source<'_, R>,
    n: usize,
    table: &Table<'_>,
) -> Result<&'s [u8], ReadError> {
    let offset = source.offset();
    let there = source.peek(n)?;
    if there.len() < n {
        return Err(table.truncated(At::Byte(offset + there.len() as u64)));
    }
    Ok(&there[..n])
}

/// Bytes of a triangle without further properties, with a length of one byte.
const PLAIN: usize = 13;

/// Number of such triangles that are decoded before they are checked: they fit the first-level cache.
const AT_ONCE: usize = 512;

/// Appends records of triangles without further properties. Returns `false`, and appends nothing, if
/// one of them is not a triangle of vertices below `limit`.
fn plain(records: &[[u8; PLAIN]], limit: u32, triangles: &mut Triangles) -> bool {
    let before = triangles.len();
    let mut lengths = 0;
    let good = triangles.extend_below(
        limit,
        records.iter().map(|r| {
            let [n, a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3] = *r;
            lengths |= n ^ 3;
            [
                u32::from_le_bytes([a0, a1, a2, a3]),
                u32::from_le_bytes([b0, b1, b2, b3]),
                u32::from_le_bytes([c0, c1, c2, c3]),
            ]
        }),
    );
    if lengths != 0 {
        triangles.truncate(before);
    }
    lengths == 0 && good.is_ok()
}

/// Layout of a face of three corners, with any numbers before and after the list: nearly all faces.
struct TriangleRecord {
    stride: usize,
    list: usize,
    length: ScalarType,
    signed: bool,
    /// Offset of each number besides the list, with its property.
    scalars: Vec<(usize, usize)>,
}

impl TriangleRecord {
    /// `None` if the layout has other lists, or indices of other than 32 bits.
    fn of(table: &Table<'_>) -> Option<Self> {
        let list = table.faces.as_ref()?.property;
        let mut found =
            Self { stride: 0, list: 0, length: ScalarType::U8, signed: false, scalars: Vec::new() };
        for (k, p) in table.layout.properties.iter().enumerate() {
            match p.length {
                Some(length)
                    if k == list && matches!(p.scalar, ScalarType::I32 | ScalarType::U32) =>
                {
                    (found.list, found.length, found.signed) =
                        (found.stride, length, p.scalar == ScalarType::I32);
                    found.stride += length.size() + 12;
                }
                Some(_) => return None,
                None => {
                    found.scalars.push((found.stride, k));
                    found.stride += p.scalar.size();
                }
            }
        }
        Some(found)
    }

    /// Reads the buffered triangles, up to the first other or invalid face. Returns `false` if there
    /// is none, which leaves the next face to [`record`].
    fn run<R: Read>(
        &self,
        source: &mut Source<'_, R>,
        table: &mut Table<'_>,
        big_endian: bool,
    ) -> Result<bool, ReadError> {
        let left = usize::try_from(table.layout.count - table.done).unwrap_or(usize::MAX);
        let Some(faces) = &mut table.faces else { return Ok(false) };
        if faces.list.polygons.is_some() {
            return Ok(false);
        }
        // As u32 a negative index is at least 2³¹, which is above this limit.
        let limit = faces.vertices.min(if self.signed { 1 << 31 } else { 1 << 32 });
        let limit = u32::try_from(limit).unwrap_or(u32::MAX);
        let there = source.peek(self.stride)?;
        let block = &there[..(there.len() / self.stride).min(left) * self.stride];
        let indices = self.list + self.length.size();
        let before = faces.list.triangles.len();
        let mut done = 0;
        if self.stride == PLAIN && self.length == ScalarType::U8 && !big_endian {
            for records in block.as_chunks::<PLAIN>().0.chunks(AT_ONCE) {
                if !plain(records, limit, &mut faces.list.triangles) {
                    break;
                }
                done += records.len() * PLAIN;
            }
        }
        // If a block has another or invalid face, the triangles before it are read one by one.
        for r in block[done..].chunks_exact(self.stride) {
            let length = self.length.get_i64(&r[self.list..], big_endian);
            let c = &r[indices..indices + 12];
            let t = [
                u32::get(c, big_endian),
                u32::get(&c[4..], big_endian),
                u32::get(&c[8..], big_endian),
            ];
            if length != 3
                || t.iter().any(|&index| index >= limit)
                || faces.list.triangles.push(t).is_err()
            {
                break;
            }
        }
        let run = faces.list.triangles.len() - before;
        for &(offset, k) in &self.scalars {
            table.slots[k].values.extend_strided(
                &block[..run * self.stride],
                self.stride,
                offset,
                big_endian,
            );
        }
        source.consume(run * self.stride);
        table.done += run as u64;
        Ok(run > 0)
    }
}
