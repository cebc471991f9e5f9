//! Files and folders that appear whole or not at all.
//!
//! | what appears | with |
//! |---|---|
//! | one file | [`write_file`] |
//! | several files of one folder, together | [`FileSet`] |
//! | folders in a folder, one by one; or the files of one result in place of those of an earlier one | [`FolderWriter`] |
//!
//! All write into a hidden file or folder beside the final one (its name begins with `.ifg-`) and
//! rename it when everything is there. A program that ends early changes nothing. What it leaves of
//! folders the next writer removes, and of files [`remove_partial`] and [`remove_partial_of`].

mod file;
mod file_set;
mod folders;
mod lock;

pub use file::{remove_partial, remove_partial_of, write_file};
pub use file_set::{FileSet, FileSetError};
pub use folders::{FolderShare, FolderWriter, PATIENCE, is_hidden, names, restore};
