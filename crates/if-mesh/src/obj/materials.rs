//! Files that an OBJ file and its material libraries refer to.

/// The contents of the `mtllib` lines.
pub(super) fn libraries(text: &[u8]) -> Vec<String> {
    statements(text).filter(|(key, _)| key == "mtllib").map(|(_, rest)| rest).collect()
}

/// The contents of the lines of a material library (`.mtl`) that name a texture: options of the
/// format, and a file name that may contain spaces. Paths are relative to the library's folder.
///
/// # Examples
///
/// ```
/// let mtl = b"newmtl cloth\nKd 1 0 0\nmap_Kd -s 2 2 1 textures/red cloth.png # woven\nbump folds.png\n";
/// assert_eq!(if_mesh::obj::textures(mtl), ["-s 2 2 1 textures/red cloth.png", "folds.png"]);
/// ```
pub fn textures(mtl: &[u8]) -> Vec<String> {
    const MAPS: [&str; 5] = ["bump", "disp", "decal", "refl", "norm"];
    let names_one = |key: &str| {
        key.to_ascii_lowercase().starts_with("map_")
            || MAPS.contains(&key.to_ascii_lowercase().as_str())
    };
    // A switch for the texture filter, without a file name.
    let is_switch = |key: &str| key.eq_ignore_ascii_case("map_aat");
    statements(mtl)
        .filter(|(key, _)| names_one(key) && !is_switch(key))
        .map(|(_, rest)| rest)
        .collect()
}

/// The first word of each line, and the rest of it without comment.
fn statements(text: &[u8]) -> impl Iterator<Item = (String, String)> + '_ {
    text.split(|b| matches!(b, b'\n' | b'\r')).filter_map(|line| {
        let line = String::from_utf8_lossy(without_comment(line));
        let (key, rest) = line.trim().split_once(char::is_whitespace)?;
        Some((key.to_owned(), rest.trim().to_owned()))
    })
}

/// A line up to its comment. A name may hold `#`: only at the start of a word a comment begins.
pub(super) fn without_comment(line: &[u8]) -> &[u8] {
    let starts = |at: usize| line[at] == b'#' && (at == 0 || line[at - 1].is_ascii_whitespace());
    &line[..(0..line.len()).find(|at| starts(*at)).unwrap_or(line.len())]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_among_comments_and_options() {
        let obj = b"# mtllib no.mtl\r\nmtllib a b.mtl # c\r\no shirt\n  mtllib\tc#1.mtl  \nmtllib\nusemtl d.mtl";
        assert_eq!(libraries(obj), ["a b.mtl", "c#1.mtl"]);
        let mtl = b"map_aat on\nMap_Kd a.png\nmap_bump -bm 0.2 b c.png\nnorm d.png\nKd 1 1 1\nillum 2\n\xff\xfe e.png";
        assert_eq!(textures(mtl), ["a.png", "-bm 0.2 b c.png", "d.png"]);
        assert!(textures(b"").is_empty());
    }
}
