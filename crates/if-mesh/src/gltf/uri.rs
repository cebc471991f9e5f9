//! URIs of buffers and images.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use std::path::{Component, Path, PathBuf};

/// Where the data of a URI are.
#[derive(Debug, PartialEq)]
pub(super) enum Uri {
    /// In the URI, after this beginning of it.
    Data { start: String, bytes: Vec<u8> },
    /// In a file of the same folder or below.
    Path(PathBuf),
}

/// Reads a URI. The error says what it should be.
pub(super) fn parse(uri: &str) -> Result<Uri, &'static str> {
    if let Some(data) = uri.strip_prefix("data:") {
        let comma = data.find(',').filter(|&comma| data[..comma].ends_with(";base64"));
        let start = comma.ok_or("data URIs must be base64")? + "data:,".len();
        let bytes = BASE64_STANDARD.decode(&uri[start..]);
        let bytes = bytes.map_err(|_| "the base64 of the data URI is damaged")?;
        return Ok(Uri::Data { start: uri[..start].into(), bytes });
    }
    let path = PathBuf::from(unescaped(uri).ok_or("the URI is not UTF-8")?);
    if !is_below(&path) {
        return Err(BELOW);
    }
    let parts = path.components().filter(|part| matches!(part, Component::Normal(_)));
    Ok(Uri::Path(parts.collect()))
}

const BELOW: &str =
    "it must be a data URI, or the path of a file in the folder of this file or below";

/// The data URI with other bytes.
pub(super) fn data(start: &str, bytes: &[u8]) -> String {
    format!("{start}{}", BASE64_STANDARD.encode(bytes))
}

/// A URI for a message.
pub(super) fn shortened(uri: &str) -> String {
    const SHOWN: usize = 60;
    match uri.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &uri[..end]),
        None => uri.into(),
    }
}

/// Whether the path cannot leave the folder that it starts in.
fn is_below(path: &Path) -> bool {
    let is_plain = |part: &str| !part.contains(['\\', ':', '\0']);
    path.file_name().is_some()
        && path.to_str().is_some_and(is_plain)
        && path.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir))
}

/// The text with its escapes (`%20`) resolved.
fn unescaped(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        let hex = |k: usize| after.get(k).and_then(|&digit| (digit as char).to_digit(16));
        match (byte, hex(0), hex(1)) {
            (b'%', Some(high), Some(low)) => {
                bytes.push((16 * high + low) as u8);
                rest = &after[2..];
            }
            _ => {
                bytes.push(byte);
                rest = after;
            }
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_stay_in_the_folder() {
        let path = |uri: &str| parse(uri).ok();
        let found = |path: &str| Some(Uri::Path(path.into()));
        assert_eq!(path("coat.bin"), found("coat.bin"));
        assert_eq!(path("./parts/my%20coat%2Bhat.bin"), found("parts/my coat+hat.bin"));
        assert_eq!(path("50%.bin"), found("50%.bin"));
        for uri in [
            "",
            ".",
            "../coat.bin",
            "a/../../b.bin",
            "/etc/passwd",
            "%2e%2e/coat.bin",
            "%2Fetc/passwd",
            "file:///etc/passwd",
            "http://host/coat.bin",
            "C:\\coat.bin",
            "..\\coat.bin",
            "a%00.bin",
            "a%FF.bin",
        ] {
            assert!(parse(uri).is_err(), "{uri}");
        }
    }

    #[test]
    fn data_uris_are_read_and_written() {
        let uri = "data:application/octet-stream;base64,AAEC/w==";
        let Ok(Uri::Data { start, bytes }) = parse(uri) else { panic!() };
        assert_eq!(bytes, [0, 1, 2, 255]);
        assert_eq!(data(&start, &bytes), uri);
        for bad in ["data:,AAEC", "data:text/plain,abc", "data:;base64,A*", "data:"] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
