//! Numbers of PLY files as bytes and as text.

use crate::attributes::{Column, ScalarType, with_column};
use crate::float_of_c::float_of_c;

/// A number as bytes and as text.
pub(super) trait Scalar: Copy + Default {
    const TYPE: ScalarType;
    /// Reads the first bytes of `bytes`.
    fn get(bytes: &[u8], big_endian: bool) -> Self;
    fn parse(text: &str) -> Option<Self>;
    /// Writes itself into the first bytes of `bytes`, little-endian.
    fn put(self, bytes: &mut [u8]);
    /// Saturates; floats are truncated, and NaN gives zero.
    fn to_i64(self) -> i64;
}

macro_rules! scalar {
    ($($t:ident $variant:ident $parse:expr;)*) => {
        $(impl Scalar for $t {
            const TYPE: ScalarType = ScalarType::$variant;
            #[inline]
            fn get(bytes: &[u8], big_endian: bool) -> Self {
                let b = *bytes.first_chunk().expect("callers pass at least as many bytes as the type has");
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
            fn to_i64(self) -> i64 {
                // Only u64 and floats can saturate.
                if Self::TYPE == ScalarType::U64 { (self as u64).min(i64::MAX as u64) as i64 } else { self as i64 }
            }
        })*

        impl ScalarType {
            /// The number at the start of `bytes`, saturated.
            #[inline]
            pub(super) fn get_i64(self, bytes: &[u8], big_endian: bool) -> i64 {
                match self { $(Self::$variant => $t::get(bytes, big_endian).to_i64(),)* }
            }
        }
    };
}

scalar! {
    i8  I8 whole;
    u8  U8 whole;
    i16 I16 whole;
    u16 U16 whole;
    i32 I32 whole;
    u32 U32 whole;
    i64 I64 |t| t.parse().ok();
    u64 U64 |t| t.parse().ok();
    f32 F32 float_of_c;
    f64 F64 float_of_c;
}

/// Parses an integer, also in a form such as `255.0`, which some programs write for colours.
fn whole<T: TryFrom<i64>>(text: &str) -> Option<T> {
    let value = text.parse::<i64>().ok().or_else(|| {
        let v = text.parse::<f64>().ok()?;
        (v.fract() == 0.0 && v.abs() < 1e15).then_some(v as i64)
    });
    value.and_then(|v| T::try_from(v).ok())
}

impl Column {
    /// Appends the numbers at byte `offset` of each record of `stride` bytes.
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

    /// Appends packed numbers.
    pub(super) fn extend_packed(&mut self, bytes: &[u8], big_endian: bool) {
        self.extend_strided(bytes, self.scalar_type().size(), 0, big_endian);
    }

    /// Appends one number from text; `false` if the text is not a valid number of this type.
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
    fn numbers_survive_both_byte_orders() {
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
    fn text_that_is_not_a_number_of_the_type_is_rejected() {
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
