//! Files and folders that appear whole or not at all.
//!
//! | what appears | with |
//! |---|---|
//! | one file | [`write_file`] |
//! | several files of one folder, together | [`FileSet`] |
//! | folders in a folder, one by one; or the files of one result in place of those of an earlier one | [`FolderWriter`] |
//!
//! All write into a hidden file or folder beside the final one (its name begins with `.ifg-`) and
//! rename it when everything is there. A program that ends early changes nothing; what it leaves is
//! removed by the next writer.

mod file;
mod file_set;
mod folders;
mod lock;

pub use file::write_file;
pub use file_set::{FileSet, FileSetError};
pub use folders::{FolderWriter, PATIENCE, is_hidden, names, restore, temporary_folder};
