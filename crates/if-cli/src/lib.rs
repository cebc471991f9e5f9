//! `ifg`: layered outfits made intersection-free, from the command line. [`run`] is the program,
//! which the binary `ifg` and the console script of the Python package call.
//!
//! `cli` holds the commands; each command's file holds its arguments and what it does. The other
//! files are shared by several commands.

// Commands.
mod animate;
mod check;
mod clean;
mod cli;
mod cut;
mod demo;
mod extract;
mod fit;
mod fix;
mod reconstruct;
mod synth;
mod wardrobe;
// Arguments and inputs.
mod companions;
mod inputs;
mod load;
mod outfit_file;
mod values;
// Work and output.
mod batch_inputs;
mod buffers;
mod cancel;
mod end;
mod errors;
mod file_record;
mod not_kept;
mod order;
mod outcome;
mod output_error;
mod outputs;
mod peak_memory;
mod phase_table;
mod phases;
mod pictures;
mod print;
mod program;
mod progress;
mod receipt;
mod report_output;
mod report_page;
mod resolve_outfit;
mod shard;
mod shared_body;
mod staging;
mod table;
mod target;

#[doc(hidden)]
pub use errors::chain;
pub use program::run;
#[doc(hidden)]
pub use receipt::versions;
