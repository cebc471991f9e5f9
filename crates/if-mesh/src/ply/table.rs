//! The records of an element, property by property.

use super::error::{At, ReadError};
use super::header::ElementLayout;
use super::scalar::Scalar;
use crate::attributes::{Property, ScalarType};
use crate::polygons::FaceList;
use if_core::math::Point;
use if_core::mesh::{FinitePoints, MeshError, Triangles};

/// An element as it is read.
pub(super) struct Table<'a> {
    pub(super) layout: &'a ElementLayout,
    /// One per property of the layout; the vertex indices of faces stay empty.
    pub(super) slots: Vec<Property>,
    /// The vertex indices, in the element `face`.
    pub(super) faces: Option<Faces>,
    /// Positions, in the element `vertex`, if its coordinates all have four bytes, or all eight;
    /// their properties then stay empty.
    pub(super) points: Option<Points>,
    /// Records read so far.
    pub(super) done: u64,
}

/// The vertex indices of the faces.
pub(super) struct Faces {
    /// Index of their property.
    pub(super) property: usize,
    /// Number of vertices.
    pub(super) vertices: u64,
    pub(super) list: FaceList,
    scratch: Vec<u32>,
}

/// Positions as they are read from records of one size.
pub(super) struct Points {
    /// Indices of the properties x, y and z.
    pub(super) axes: [usize; 3],
    list: FinitePoints,
    /// The first position that is not finite; none is taken after it. It is reported once the whole
    /// file was read, after faults of its syntax.
    fault: Option<MeshError>,
}

impl Points {
    /// Appends the positions of records of `stride` bytes, with coordinates at `offsets` of type
    /// `scalar`, which has four or eight bytes.
    pub(super) fn extend(
        &mut self,
        records: &[u8],
        stride: usize,
        offsets: [usize; 3],
        scalar: ScalarType,
        big_endian: bool,
    ) {
        let alone = stride == 3 * scalar.size() && offsets == [0, 1, 2].map(|k| k * scalar.size());
        match scalar {
            ScalarType::F32 if alone && !big_endian => {
                self.alone::<4, 12>(records, |b| f32::from_le_bytes(b).into())
            }
            ScalarType::F32 => self.among::<f32>(records, stride, offsets, big_endian),
            _ if alone && !big_endian => self.alone::<8, 24>(records, f64::from_le_bytes),
            _ => self.among::<f64>(records, stride, offsets, big_endian),
        }
    }

    /// Records of three numbers of N bytes only, R bytes in all.
    fn alone<const N: usize, const R: usize>(
        &mut self,
        records: &[u8],
        number: impl Fn([u8; N]) -> f64,
    ) {
        self.take(records.as_chunks::<R>().0.iter().map(|r| {
            let numbers = r.as_chunks::<N>().0;
            Point::new(number(numbers[0]), number(numbers[1]), number(numbers[2]))
        }));
    }

    /// Records with other properties, too.
    fn among<T: Scalar + Into<f64>>(
        &mut self,
        records: &[u8],
        stride: usize,
        [x, y, z]: [usize; 3],
        big_endian: bool,
    ) {
        let get = |bytes: &[u8]| T::get(bytes, big_endian).into();
        self.take(
            records
                .chunks_exact(stride)
                .map(|r| Point::new(get(&r[x..]), get(&r[y..]), get(&r[z..]))),
        );
    }

    fn take(&mut self, points: impl Iterator<Item = Point>) {
        if self.fault.is_none() {
            self.fault = self.list.extend(points).err();
        }
    }
}

/// Maximum number of values to reserve memory for if the size of the file is unknown.
const UNSEEN: u64 = 1 << 16;

impl<'a> Table<'a> {
    /// `faces`: index of the property with the vertex indices, and the number of vertices. `axes`:
    /// indices of the coordinates that are joined to positions.
    pub(super) fn new(
        layout: &'a ElementLayout,
        faces: Option<(usize, u64)>,
        axes: Option<[usize; 3]>,
        left: Option<u64>,
    ) -> Self {
        // If the size of the file is known, the count was checked against it.
        let room = if left.is_some() {
            layout.count
        } else {
            layout.count.min(UNSEEN / layout.properties.len().max(1) as u64)
        };
        let slots = layout.properties.iter().enumerate().map(|(k, p)| {
            let lists = p.length.map(|_| {
                let mut starts = Vec::with_capacity(room as usize + 1);
                starts.push(0);
                starts
            });
            let is_face = faces.is_some_and(|(property, _)| property == k);
            let is_axis = axes.is_some_and(|axes| axes.contains(&k));
            let room = if p.length.is_some() || is_axis { 0 } else { room as usize };
            Property {
                name: p.name.clone(),
                values: p.scalar.column(room),
                lists: lists.filter(|_| !is_face),
            }
        });
        Self {
            layout,
            slots: slots.collect(),
            faces: faces.map(|(property, vertices)| Faces {
                property,
                vertices,
                // A triangle takes at least 4 bytes (its length and three indices), 8 as text.
                list: FaceList {
                    triangles: Triangles::with_capacity(
                        room.min(left.unwrap_or(u64::MAX) / 4) as usize
                    ),
                    ..FaceList::default()
                },
                scratch: Vec::new(),
            }),
            points: axes.map(|axes| Points {
                axes,
                list: FinitePoints::with_capacity(room as usize),
                fault: None,
            }),
            done: 0,
        }
    }

    /// Ends the list of this record in property `k`, whose values were appended.
    pub(super) fn end_list(&mut self, k: usize) -> Result<(), ReadError> {
        let slot = &mut self.slots[k];
        let end = u32::try_from(slot.values.len())
            .map_err(|_| ReadError::TooLarge { element: self.layout.name.clone() })?;
        slot.lists.as_mut().expect("only lists are ended").push(end);
        Ok(())
    }

    pub(super) fn truncated(&self, at: At) -> ReadError {
        ReadError::Truncated {
            at,
            element: self.layout.name.clone(),
            record: self.done,
            count: self.layout.count,
        }
    }

    pub(super) fn negative_length(&self, at: At, k: usize, length: i64) -> ReadError {
        let property = self.layout.properties[k].name.clone();
        ReadError::ListLength {
            at,
            element: self.layout.name.clone(),
            record: self.done,
            property,
            length,
        }
    }

    /// The properties without the vertex indices, the faces, and the positions.
    pub(super) fn finish(
        self,
    ) -> (Vec<Property>, Option<FaceList>, Option<Result<FinitePoints, MeshError>>) {
        let mut slots = self.slots;
        let list = self.faces.map(|f| {
            slots.remove(f.property);
            f.list
        });
        (slots, list, self.points.map(|p| p.fault.map_or(Ok(p.list), Err)))
    }
}

impl Faces {
    /// Appends a face.
    pub(super) fn push(
        &mut self,
        indices: impl Iterator<Item = i64>,
        at: At,
    ) -> Result<(), ReadError> {
        let face = self.list.len() as u64;
        self.scratch.clear();
        for (corner, index) in indices.enumerate() {
            if index < 0 || index as u64 >= self.vertices {
                return Err(ReadError::Index {
                    at,
                    face,
                    corner: corner as u64,
                    index,
                    vertices: self.vertices,
                });
            }
            self.scratch.push(index as u32);
        }
        if self.scratch.len() < 3 {
            return Err(ReadError::FaceTooShort { at, face, corners: self.scratch.len() as u64 });
        }
        if !self.list.push(&self.scratch) {
            return Err(ReadError::TooLarge { element: "face".into() });
        }
        Ok(())
    }
}
