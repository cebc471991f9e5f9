//! The binary as a user meets it: exit codes, messages, files.

mod bad_input;
mod batch;
mod commands;
mod folder;
mod same_bytes;
