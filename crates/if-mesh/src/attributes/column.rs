//! Columns of numbers of any of ten types.

use std::fmt;

/// A type of number.
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

/// One property of all records. A property of lists holds the values of all lists, one list after
/// the other.
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

/// Runs `$body` with `$v` bound to the vector of `$column`, whatever its type.
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

macro_rules! scalar_types {
    ($($t:ident $variant:ident $text:literal;)*) => {
        impl ScalarType {
            /// The name of the type in PLY files; meshio knows those of int8, uint8, uint16, int32,
            /// uint32, float and double.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }

            /// Bytes per number.
            pub fn size(self) -> usize {
                match self { $(Self::$variant => size_of::<$t>(),)* }
            }

            /// An empty column of this type.
            pub(crate) fn column(self, capacity: usize) -> Column {
                match self { $(Self::$variant => Column::$variant(Vec::with_capacity(capacity)),)* }
            }
        }

        impl Column {
            /// The type of the values.
            pub fn scalar_type(&self) -> ScalarType {
                match self { $(Self::$variant(_) => ScalarType::$variant,)* }
            }

            /// The values at `indices`.
            pub(super) fn picked(&self, indices: &[usize]) -> Self {
                match self {
                    $(Self::$variant(v) => Self::$variant(indices.iter().map(|k| v[*k]).collect()),)*
                }
            }
        }
    };
}

scalar_types! {
    i8  I8  "int8";
    u8  U8  "uint8";
    i16 I16 "int16";
    u16 U16 "uint16";
    i32 I32 "int32";
    u32 U32 "uint32";
    i64 I64 "int64";
    u64 U64 "uint64";
    f32 F32 "float";
    f64 F64 "double";
}

impl ScalarType {
    /// Whether the type is an integer.
    pub fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// Whether the type has negative numbers.
    pub(crate) fn is_signed(self) -> bool {
        !matches!(self, Self::U8 | Self::U16 | Self::U32 | Self::U64)
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

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All values as `f64`, in order. Integers beyond 2⁵³ are rounded.
    #[allow(clippy::unnecessary_cast)] // the macro serves all types
    pub fn to_f64(&self) -> Vec<f64> {
        with_column!(self, v => v.iter().map(|x| *x as f64).collect())
    }

    /// Value `k` as `f64`.
    #[allow(clippy::unnecessary_cast)] // as above
    pub(crate) fn get(&self, k: usize) -> f64 {
        with_column!(self, v => v[k] as f64)
    }

    /// Sets value `k`: rounded for integer types, which also saturate.
    pub(crate) fn set(&mut self, k: usize, value: f64) {
        match self {
            Self::F32(v) => v[k] = value as f32,
            Self::F64(v) => v[k] = value,
            Self::I8(v) => v[k] = value.round() as i8,
            Self::U8(v) => v[k] = value.round() as u8,
            Self::I16(v) => v[k] = value.round() as i16,
            Self::U16(v) => v[k] = value.round() as u16,
            Self::I32(v) => v[k] = value.round() as i32,
            Self::U32(v) => v[k] = value.round() as u32,
            Self::I64(v) => v[k] = value.round() as i64,
            Self::U64(v) => v[k] = value.round() as u64,
        }
    }

    /// Sets value `k` to value `from` of another column of the same type, with all bits.
    pub(super) fn set_from(&mut self, k: usize, other: &Self, from: usize) {
        match (other, self) {
            (Self::I64(a), Self::I64(b)) => b[k] = a[from],
            (Self::U64(a), Self::U64(b)) => b[k] = a[from],
            // `f64` holds all values of the other types.
            (a, b) => b.set(k, a.get(from)),
        }
    }
}
