//! What a file holds, in a few words.

pub(crate) use if_outfit::content::{Content, content, of_file};
