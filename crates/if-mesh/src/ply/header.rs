//! The header of a PLY file: `ply-rs-bw` parses its grammar; names and sizes are checked here.

use super::error::ReadError;
use super::rows::is_name;
use super::source::Source;
use crate::attributes::ScalarType;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{DefaultElement, Encoding, PropertyType, ScalarType as Theirs};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;

/// Maximum size of a header, in bytes: some ten thousand lines. Without a limit another kind of file,
/// or an endless device, would be read into memory in search of `end_header`.
const MAX_HEADER: u64 = 1 << 20;

pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<ElementLayout>,
    pub(super) comments: Vec<String>,
    pub(super) obj_info: Vec<String>,
}

pub(super) struct ElementLayout {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<PropertyLayout>,
}

pub(super) struct PropertyLayout {
    pub(super) name: String,
    /// The type of the length, if the property is a list.
    pub(super) length: Option<ScalarType>,
    pub(super) scalar: ScalarType,
}

impl ElementLayout {
    /// Minimum size of all records, in bytes.
    pub(super) fn least_bytes(&self, ascii: bool) -> u128 {
        let record: usize = if ascii {
            self.properties.len() // a digit each; spaces are not counted, so that the faulty line is found and named
        } else {
            self.properties.iter().map(|p| p.length.unwrap_or(p.scalar).size()).sum()
        };
        u128::from(self.count) * record as u128
    }

    /// Size of all records of a binary file in bytes, if it does not depend on the data.
    pub(super) fn fixed_bytes(&self) -> Option<u128> {
        self.properties.iter().all(|p| p.length.is_none()).then(|| self.least_bytes(false))
    }
}

/// Reads up to and including the line `end_header`.
pub(super) fn read<R: Read>(source: &mut Source<'_, R>) -> Result<Header, ReadError> {
    let Some(first) = source.line(MAX_HEADER as usize)? else { return Err(ReadError::Empty) };
    if first.trim_ascii_end() != b"ply" {
        let found = first[..first.len().min(40)].to_vec();
        return Err(ReadError::NotPly { found: String::from_utf8_lossy(&found).into_owned() });
    }
    let mut names = Names::default();
    let mut text = String::from("ply\n");
    let mut lines = vec![(0, String::new()), (1, String::new())]; // of the file, for each line of `text` from 1 on
    loop {
        let line = match source.line(MAX_HEADER as usize)? {
            Some(line) => decode(line.trim_ascii()),
            None => {
                return Err(ReadError::HeaderEnd {
                    bytes: source.offset(),
                    lines: source.line_number(),
                });
            }
        };
        if source.offset() > MAX_HEADER {
            return Err(ReadError::HeaderEnd { bytes: MAX_HEADER, lines: source.line_number() });
        }
        if !line.is_empty() {
            text.push_str(&names.checked(&line, source.line_number())?);
            text.push('\n');
        }
        let is_last = line == "end_header";
        if !line.is_empty() {
            lines.push((source.line_number(), line));
        }
        if is_last {
            break;
        }
    }
    let parsed = Parser::<DefaultElement>::new()
        .read_header(&mut Reader::new(text.as_bytes()))
        .map_err(|e| match e.line() {
            Some(k) if k < lines.len() => {
                let (line, text) = lines.swap_remove(k);
                ReadError::HeaderLine { line, text }
            }
            _ => ReadError::Format,
        })?;
    if (parsed.version.major, parsed.version.minor) != (1, 0) {
        return Err(ReadError::Format);
    }
    let mut elements = Vec::with_capacity(parsed.elements.len());
    for (e, (_, element)) in parsed.elements.into_iter().enumerate() {
        let (name, of_properties) = std::mem::take(&mut names.given[e]);
        if element.properties.is_empty() && element.count > 0 {
            return Err(ReadError::NoProperties { element: name, count: element.count as u64 });
        }
        let mut properties = Vec::with_capacity(element.properties.len());
        let defined = element.properties.into_iter().zip(of_properties).enumerate();
        for (p, ((_, def), property)) in defined {
            let of = |slot, t: &Theirs| {
                names.wide.get(&(e, p, slot)).copied().unwrap_or_else(|| ours(t))
            };
            let (length, scalar) = match &def.data_type {
                PropertyType::Scalar(t) => (None, of(1, t)),
                PropertyType::List(n, t) => (Some(of(2, n)), of(3, t)),
            };
            if let Some(found) = length.filter(|n| !n.is_integer()) {
                return Err(ReadError::ListLengthType { element: name, property, found });
            }
            properties.push(PropertyLayout { name: property, length, scalar });
        }
        elements.push(ElementLayout { name, count: element.count as u64, properties });
    }
    Ok(Header {
        encoding: parsed.encoding,
        elements,
        comments: parsed.comments,
        obj_info: parsed.obj_infos,
    })
}

/// Names, and checks that `ply-rs-bw` does not make: it drops the first of two elements of the same name,
/// does not support 64-bit integers, and refuses names of other characters than letters, digits, `_` and
/// `-`, as in CloudCompare's `scalar_Illuminance_(PCV)`.
#[derive(Default)]
struct Names {
    /// Each element with its properties.
    given: Vec<(String, Vec<String>)>,
    elements: BTreeSet<String>,
    properties: BTreeSet<String>,
    /// (element, property, word of the line) of each 64-bit integer type.
    wide: BTreeMap<(usize, usize, usize), ScalarType>,
}

impl Names {
    /// The line for `ply-rs-bw`, with other names, and `double` in place of 64-bit integers.
    fn checked(&mut self, line: &str, number: u64) -> Result<String, ReadError> {
        let mut words: Vec<&str> = line.split_ascii_whitespace().collect();
        let last = words.len() - 1; // callers skip empty lines
        let named = match words[0] {
            "element" => words.get(1),
            "property" => words.last(),
            _ => None,
        };
        if named.is_some_and(|name| !is_name(name)) {
            return Err(ReadError::HeaderLine { line: number, text: line.to_owned() });
        }
        match words[0] {
            "element" if words.len() == 3 => {
                let name = words[1].to_owned();
                if !self.elements.insert(name.clone()) {
                    return Err(ReadError::DuplicateElement { line: number, name });
                }
                self.properties.clear();
                self.given.push((name, Vec::new()));
                let stand_in = format!("e{}", self.given.len());
                words[1] = &stand_in;
                Ok(words.join(" "))
            }
            "property" if words.len() == if words.get(1) == Some(&"list") { 5 } else { 3 } => {
                let element = self.given.len().wrapping_sub(1);
                let Some((current, properties)) = self.given.last_mut() else {
                    return Ok(line.to_owned()); // of no element, which is refused
                };
                let name = words[last].to_owned();
                if !self.properties.insert(name.clone()) {
                    let element = current.clone();
                    return Err(ReadError::DuplicateProperty { line: number, element, name });
                }
                for slot in 1..last {
                    let t = match words[slot] {
                        "int64" => ScalarType::I64,
                        "uint64" => ScalarType::U64,
                        _ => continue,
                    };
                    self.wide.insert((element, properties.len(), slot), t);
                    words[slot] = "double";
                }
                let stand_in = format!("p{}", properties.len());
                properties.push(name);
                words[last] = &stand_in;
                Ok(words.join(" "))
            }
            _ => Ok(line.to_owned()),
        }
    }
}

fn ours(t: &Theirs) -> ScalarType {
    match t {
        Theirs::Char => ScalarType::I8,
        Theirs::UChar => ScalarType::U8,
        Theirs::Short => ScalarType::I16,
        Theirs::UShort => ScalarType::U16,
        Theirs::Int => ScalarType::I32,
        Theirs::UInt => ScalarType::U32,
        Theirs::Float => ScalarType::F32,
        Theirs::Double => ScalarType::F64,
    }
}

/// UTF-8, or else Latin-1, which older scanners write into comments.
fn decode(line: &[u8]) -> String {
    match std::str::from_utf8(line) {
        Ok(text) => text.to_owned(),
        Err(_) => line.iter().map(|&b| char::from(b)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> Result<Header, ReadError> {
        read(&mut Source::new(text.as_bytes()))
    }

    #[test]
    fn all_type_names_and_windows_line_ends_are_supported() {
        let names = [
            "char", "int8", "uchar", "uint8", "short", "int16", "ushort", "uint16", "int", "int32",
            "uint", "uint32", "int64", "uint64", "float", "float32", "double", "float64",
        ];
        let mut text = String::from(
            "ply\r\nformat binary_big_endian 1.0\r\nobj_info made by hand\r\n\r\nelement vertex 2\r\n",
        );
        for (k, n) in names.iter().enumerate() {
            text += &format!("property {n} p{k}\r\n");
        }
        text += "comment later\r\nelement face 1\r\nproperty list int64 uint64 vertex_indices\r\nend_header\r\n";
        let h = header(&text).unwrap();
        assert_eq!(h.encoding, Encoding::BinaryBigEndian);
        assert_eq!((h.comments[0].as_str(), h.obj_info[0].as_str()), ("later", "made by hand"));
        let sizes: Vec<usize> = h.elements[0].properties.iter().map(|p| p.scalar.size()).collect();
        assert_eq!(sizes, [1, 1, 1, 1, 2, 2, 2, 2, 4, 4, 4, 4, 8, 8, 4, 4, 8, 8]);
        assert_eq!(h.elements[0].properties[12].scalar, ScalarType::I64);
        let list = &h.elements[1].properties[0];
        assert_eq!((list.length, list.scalar), (Some(ScalarType::I64), ScalarType::U64));
    }

    #[test]
    fn errors_name_the_line_of_the_file_also_after_empty_lines() {
        let fault =
            header("ply\nformat ascii 1.0\n\n\nelement vertex -3\nend_header\n").err().unwrap();
        assert!(matches!(fault, ReadError::HeaderLine { line: 5, .. }), "{fault}");
        assert!(fault.to_string().contains("element vertex -3"), "{fault}");
    }

    #[test]
    fn names_may_have_any_characters_but_blanks() {
        let names = ["scalar_Illuminance_(PCV)", "Coord._X", "UVMap.001", "2nd", "höhe", "a:b/c#d"];
        let mut text = String::from("ply\nformat ascii 1.0\nelement vertex 0\n");
        names.iter().for_each(|n| text += &format!("property float {n}\n"));
        text += "element my.own 0\nproperty list uchar int in.dices\nend_header\n";
        let h = header(&text).unwrap();
        assert!(h.elements[0].properties.iter().map(|p| &p.name).eq(names));
        assert_eq!(
            (&*h.elements[1].name, &*h.elements[1].properties[0].name),
            ("my.own", "in.dices")
        );
        let fault =
            header(&text.replace("property float 2nd", "property floaty 2nd")).err().unwrap();
        assert!(fault.to_string().contains("property floaty 2nd"), "as in the file: {fault}");
        for name in ["re\u{7}d", "no\u{a0}break"] {
            let fault = header(&text.replace("2nd", name)).err().unwrap();
            assert!(matches!(fault, ReadError::HeaderLine { line: 7, .. }), "{fault}");
        }
    }

    #[test]
    fn comments_in_latin_1_are_accepted() {
        let text = b"ply\nformat ascii 1.0\ncomment M\xfcller\nend_header\n";
        assert_eq!(read(&mut Source::new(&text[..])).unwrap().comments, ["Müller"]);
    }

    #[test]
    fn many_properties_take_linear_time() {
        let mut text = String::from("ply\nformat ascii 1.0\nelement vertex 0\n");
        for k in 0..30_000 {
            text += &format!("property int64 p{k}\n");
        }
        assert_eq!(header(&(text + "end_header\n")).unwrap().elements[0].properties.len(), 30_000);
    }
}
