//! Labels of a surface: votes of images, smoothing, and cuts along the borders.
//!
//! | step | call |
//! |---|---|
//! | label images of many frames vote on the vertices of a moving mesh | [`Voter`] |
//! | votes become smooth scores, so that every vertex gets a label and borders become lines | [`smooth_labels`] |
//! | the mesh is cut into one piece per label | [`cut`](cut()) |
//!
//! # Examples
//!
//! A tube with two labels, cut at its middle:
//!
//! ```
//! use if_core::{monitor::Silent, shapes::meshes::tube};
//! use if_mesh::labels::{CutParams, LabelVotes, SmoothLabelParams, cut, smooth_labels};
//! let mesh = tube(0.1, 1.0, 16, 20, false);
//! let given: Vec<u8> = mesh.vertices().iter().map(|p| if p.y < 0.5 { 1 } else { 2 }).collect();
//! let votes = LabelVotes::from_labels(&given, 3);
//! let scores = smooth_labels(&mesh, &votes, &SmoothLabelParams::default(), &mut Silent)?;
//! let pieces = cut(&mesh, &scores, &CutParams::default())?;
//! assert_eq!(pieces.iter().map(|p| p.label).collect::<Vec<_>>(), [1, 2]);
//! # Ok::<(), if_mesh::labels::LabelError>(())
//! ```

mod contradictions;
mod cut;
mod error;
mod image_edges;
mod laplacian;
mod origin;
mod scores;
mod sides;
mod smooth;
mod voter;
mod votes;

pub use contradictions::Contradiction;
pub use cut::{CutParams, Piece, cut};
pub use error::LabelError;
pub use origin::Origin;
pub use scores::LabelScores;
pub use smooth::{SmoothLabelParams, smooth_labels};
pub use voter::{Look, VoteParams, VoteReport, Voter};
pub use votes::{LabelVotes, UNDECIDED};
