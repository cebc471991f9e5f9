//! A number in a file, or the word `infinite`, as JSON has no such number:
//! `#[serde(with = "if_core::number_or_infinite")]`.

use crate::math::Real;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Written {
    Number(Real),
    Word(Word),
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Word {
    Infinite,
}

/// Writes the number, or the word.
///
/// # Errors
///
/// Those of the writer.
pub fn serialize<S: Serializer>(number: &Real, to: S) -> Result<S::Ok, S::Error> {
    let written = if *number == Real::INFINITY {
        Written::Word(Word::Infinite)
    } else {
        Written::Number(*number)
    };
    written.serialize(to)
}

/// Reads the number, or the word.
///
/// # Errors
///
/// Those of the reader: neither is there.
pub fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Real, D::Error> {
    Ok(match Written::deserialize(from)? {
        Written::Number(number) => number,
        Written::Word(Word::Infinite) => Real::INFINITY,
    })
}
