//! The ten kinds of numbers of a PLY file, and columns of them.

use std::fmt;

/// A kind of number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // the names are the types
pub enum ScalarType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// One property of all records of an element. A property of lists holds the values of all lists,
/// one list after the other.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)] // the names are the types
pub enum Column {
    I8(Vec<i8>),
    U8(Vec<u8>),
    I16(Vec<i16>),
    U16(Vec<u16>),
    I32(Vec<i32>),
    U32(Vec<u32>),
    I64(Vec<i64>),
    U64(Vec<u64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// A number as bytes and as text.
pub(super) trait Scalar: Copy + Default {
    const TYPE: ScalarType;
    /// Reads the first bytes of `bytes`.
    fn get(bytes: &[u8], big_endian: bool) -> Self;
    fn parse(text: &str) -> Option<Self>;
    /// Writes itself into the first bytes of `bytes`, little-endian.
    fn put(self, bytes: &mut [u8]);
    fn to_f64(self) -> f64;
    /// Saturates; a float is cut to its whole part, and NaN gives zero.
    fn to_i64(self) -> i64;
}

/// Runs `$body` with `$v` bound to the vector of whichever type `$column` has.
macro_rules! with_column {
    ($column:expr, $v:ident => $body:expr) => {
        match $column {
            Column::I8($v) => $body,
            Column::U8($v) => $body,
            Column::I16($v) => $body,
            Column::U16($v) => $body,
            Column::I32($v) => $body,
            Column::U32($v) => $body,
            Column::I64($v) => $body,
            Column::U64($v) => $body,
            Column::F32($v) => $body,
            Column::F64($v) => $body,
        }
    };
}

pub(crate) use with_column;

macro_rules! scalar {
    ($($t:ident $variant:ident $text:literal $parse:expr;)*) => {
        $(impl Scalar for $t {
            const TYPE: ScalarType = ScalarType::$variant;
            #[inline]
            fn get(bytes: &[u8], big_endian: bool) -> Self {
                let b = *bytes.first_chunk().expect("callers hand over as many bytes as the type has");
                if big_endian { Self::from_be_bytes(b) } else { Self::from_le_bytes(b) }
            }
            fn parse(text: &str) -> Option<Self> {
                let parse: fn(&str) -> Option<Self> = $parse;
                parse(text)
            }
            #[inline]
            fn put(self, bytes: &mut [u8]) {
                bytes[..size_of::<Self>()].copy_from_slice(&self.to_le_bytes());
            }
            #[inline]
            fn to_f64(self) -> f64 {
                self as f64
            }
            #[inline]
            fn to_i64(self) -> i64 {
                // Only u64 and floats can saturate.
                if Self::TYPE == ScalarType::U64 { (self as u64).min(i64::MAX as u64) as i64 } else { self as i64 }
            }
        })*

        impl ScalarType {
            /// The name that the writer uses; meshio knows those of int8, uint8, uint16, int32,
            /// uint32, float and double.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }

            /// Bytes of one number.
            pub fn size(self) -> usize {
                match self { $(Self::$variant => size_of::<$t>(),)* }
            }

            pub(super) fn column(self, capacity: usize) -> Column {
                match self { $(Self::$variant => Column::$variant(Vec::with_capacity(capacity)),)* }
            }

            /// The number at the start of `bytes`, saturated.
            #[inline]
            pub(super) fn get_i64(self, bytes: &[u8], big_endian: bool) -> i64 {
                match self { $(Self::$variant => $t::get(bytes, big_endian).to_i64(),)* }
            }
        }
    };
}

scalar! {
    i8  I8  "int8"   whole;
    u8  U8  "uint8"  whole;
    i16 I16 "int16"  whole;
    u16 U16 "uint16" whole;
    i32 I32 "int32"  whole;
    u32 U32 "uint32" whole;
    i64 I64 "int64"  |t| t.parse().ok();
    u64 U64 "uint64" |t| t.parse().ok();
    f32 F32 "float"  |t| t.parse().ok();
    f64 F64 "double" |t| t.parse().ok();
}

/// A whole number; also in a form such as `255.0`, which some programs write for colours.
fn whole<T: TryFrom<i64>>(text: &str) -> Option<T> {
    let value = text.parse::<i64>().ok().or_else(|| {
        let v = text.parse::<f64>().ok()?;
        (v.fract() == 0.0 && v.abs() < 1e15).then_some(v as i64)
    });
    value.and_then(|v| T::try_from(v).ok())
}

impl ScalarType {
    /// Whether the numbers are whole.
    pub fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

impl fmt::Display for ScalarType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Column {
    /// Number of values.
    pub fn len(&self) -> usize {
        with_column!(self, v => v.len())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What kind of numbers stand here.
    pub fn scalar_type(&self) -> ScalarType {
        fn of<T: Scalar>(_: &[T]) -> ScalarType {
            T::TYPE
        }
        with_column!(self, v => of(v))
    }

    /// All values as `f64`, in order. Whole numbers beyond 2⁵³ are rounded.
    pub fn to_f64(&self) -> Vec<f64> {
        with_column!(self, v => v.iter().map(|x| x.to_f64()).collect())
    }

    /// Appends the numbers that stand at byte `offset` of each record of `stride` bytes.
    pub(super) fn extend_strided(
        &mut self,
        records: &[u8],
        stride: usize,
        offset: usize,
        big_endian: bool,
    ) {
        fn run<T: Scalar>(
            out: &mut Vec<T>,
            records: &[u8],
            stride: usize,
            offset: usize,
            big_endian: bool,
        ) {
            out.extend(records.chunks_exact(stride).map(|r| T::get(&r[offset..], big_endian)));
        }
        with_column!(self, v => run(v, records, stride, offset, big_endian));
    }

    /// Appends numbers that stand one after the other.
    pub(super) fn extend_packed(&mut self, bytes: &[u8], big_endian: bool) {
        self.extend_strided(bytes, self.scalar_type().size(), 0, big_endian);
    }

    /// Appends one number from text; `false` where it is none of this type.
    pub(super) fn push_text(&mut self, text: &str) -> bool {
        fn run<T: Scalar>(out: &mut Vec<T>, text: &str) -> bool {
            T::parse(text).map(|x| out.push(x)).is_some()
        }
        with_column!(self, v => run(v, text))
    }

    /// Writes values `first..` to byte `offset` of each record of `stride` bytes, little-endian.
    pub(super) fn put_strided(
        &self,
        first: usize,
        records: &mut [u8],
        stride: usize,
        offset: usize,
    ) {
        fn run<T: Scalar>(values: &[T], records: &mut [u8], stride: usize, offset: usize) {
            records.chunks_exact_mut(stride).zip(values).for_each(|(r, x)| x.put(&mut r[offset..]));
        }
        with_column!(self, v => run(&v[first..], records, stride, offset));
    }

    /// Appends values `range` to `bytes`, little-endian.
    pub(super) fn append(&self, range: std::ops::Range<usize>, bytes: &mut Vec<u8>) {
        let start = bytes.len();
        bytes.resize(start + range.len() * self.scalar_type().size(), 0);
        self.put_strided(range.start, &mut bytes[start..], self.scalar_type().size(), 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_survive_bytes_in_both_orders() {
        let bytes = [1, 2, 3, 4, 5, 6, 7, 0x40];
        assert_eq!(i16::get(&bytes, true), 0x0102);
        assert_eq!(u32::get(&bytes, false), 0x0403_0201);
        let mut out = [0; 8];
        f64::get(&bytes, false).put(&mut out);
        assert_eq!(out, bytes);
        assert_eq!(ScalarType::U64.get_i64(&[0xff; 8], false), i64::MAX);
        assert_eq!(ScalarType::I8.get_i64(&[0xff; 1], false), -1);
    }

    #[test]
    fn text_gives_numbers_of_the_type_or_nothing() {
        let mut bytes = ScalarType::U8.column(0);
        assert!(bytes.push_text("255") && bytes.push_text("7.0"));
        for bad in ["256", "-1", "7.5", "", "seven", "1e40", "nan"] {
            assert!(!bytes.push_text(bad), "{bad}");
        }
        assert_eq!(bytes, Column::U8(vec![255, 7]));
        let mut floats = ScalarType::F32.column(0);
        assert!(floats.push_text("0.1") && floats.push_text("-inf") && floats.push_text("NaN"));
        assert_eq!(floats.to_f64()[0], f64::from(0.1f32));
    }

    #[test]
    fn columns_are_read_and_written_with_a_stride() {
        let records = [9, 1, 0, 9, 2, 0];
        let mut column = ScalarType::U16.column(0);
        column.extend_strided(&records, 3, 1, false);
        assert_eq!(column, Column::U16(vec![1, 2]));
        let mut out = [9; 6];
        column.put_strided(0, &mut out, 3, 1);
        assert_eq!(out, records);
        let mut packed = Vec::new();
        column.append(1..2, &mut packed);
        assert_eq!(packed, [2, 0]);
    }
}
