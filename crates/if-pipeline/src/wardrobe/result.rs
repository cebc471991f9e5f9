//! Results of combinations, and the parameters that decide them.

use super::body::BodyInfo;
use super::combination::Combination;
use super::dresser::TurnedBone;
use super::layer_fields::{Fields, GarmentField};
use if_body::align::{self, AlignParams, AlignReport};
use if_core::parameter::ParameterError;
use if_outfit::files::ResolvedFiles;
use if_outfit::outfit::Outfit;
use if_outfit::report::ResolveReport;
use if_outfit::resolve::ResolveParams;
use if_outfit::{Cleanness, EffortParams, Method, Pinch};
use if_render::Image;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// The version of `result.json`.
pub(super) const FORMAT: u32 = 3;

/// [`EffortParams::untangle_strain`] of results: most intersections of a garment with itself are folds that the
/// alignment made, whose lengths are as far from those at rest. At half of it 26 to 188 pairs of five garments on a
/// striding body and on another one stay.
const UNTANGLE_STRAIN: f64 = 1.0;

/// Parameters of matching. Those of the alignment are the [`Dresser`](super::dresser::Dresser)'s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MatchParams {
    /// Resolving of the outfit, by default as elsewhere but for `effort.untangle_strain`, 1.
    pub resolve: ResolveParams,
    /// What [`Method::Paper`] reads of the garments; with the other method only
    /// [`Fields::Meshes`].
    pub fields: Fields,
    /// Whether meshes are written.
    pub meshes: bool,
    /// Whether the body is written, too.
    pub body: bool,
    /// Whether meshes are written even if intersections remain.
    pub unproven: bool,
    /// Height of the pictures in pixels; 0 for none.
    pub picture_height: u32,
    /// Names and versions of everything that results depend on, for keys and records.
    pub tool: BTreeMap<String, String>,
}

/// Root mean square of the strain by an alignment beyond which a garment may be made for another size. Between a
/// woman of 1.59 m and a man of 1.73 m it is at most 0.25.
const DRAWN: f64 = 0.3;

/// Valid heights of pictures, in pixels.
const PICTURE_HEIGHTS: RangeInclusive<u32> = 16..=8192;

impl MatchParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let height = self.picture_height;
        let drawable = height == 0 || PICTURE_HEIGHTS.contains(&height);
        let range = "0 for no pictures, or from 16 to 8192 (pixels)";
        ParameterError::check("picture_height", height.into(), drawable, range)?;
        let reads = self.fields == Fields::Meshes || self.resolve.effort.method == Method::Paper;
        let range = "0, `meshes`: other `fields` are read by `--method paper` (`resolve.effort.method`) only";
        ParameterError::check("fields", 1.0, reads, range)?;
        let stays = self.resolve.goal.pinch == Pinch::Keep;
        let range = "0, `keep`: results are on the wardrobe's body, which stays as it is; `ifg fix --pinch yield` takes files";
        ParameterError::check("resolve.goal.pinch", 1.0, stays, range)?;
        self.resolve.validate().map_err(|e| e.within("resolve"))
    }
}

impl Default for MatchParams {
    fn default() -> Self {
        Self {
            resolve: ResolveParams {
                effort: EffortParams { untangle_strain: UNTANGLE_STRAIN, ..Default::default() },
                ..Default::default()
            },
            fields: Fields::default(),
            meshes: true,
            body: false,
            unproven: false,
            picture_height: 480,
            tool: BTreeMap::from([("if-pipeline".into(), env!("CARGO_PKG_VERSION").into())]),
        }
    }
}

/// How a combination ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Free of intersections.
    Clean,
    /// Intersections remain.
    Remaining,
    /// It failed with an error.
    Failed,
}

/// The result of a combination: `result.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatchResult {
    /// The version of the format.
    pub result: u32,
    /// Hash of everything that decides the result.
    pub key: String,
    /// The combination.
    pub combination: Combination,
    /// How it ended.
    pub state: State,
    /// The error, if any.
    pub error: Option<Fault>,
    /// Report of each garment's alignment, inner to outer.
    pub alignments: Vec<AlignReport>,
    /// Where a garment's own body stands in another pose, inner to outer.
    pub turned: Vec<Option<TurnedBone>>,
    /// What [`Method::Paper`] read of each garment below another, inner to outer; empty with
    /// [`Fields::Meshes`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fields: Vec<GarmentField>,
    /// Report of resolving; its seconds are zero.
    pub report: Option<ResolveReport>,
    /// Everything that the key is the hash of.
    pub request: MatchRequest,
    /// The other files that are the same in every run.
    pub outputs: Vec<crate::asset::FileInfo>,
}

impl MatchResult {
    /// What a person should know, in sentences: how garments fared on the way to the body, that they meet
    /// themselves though they did not at rest, and [`ResolveReport::notes`].
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for (k, (name, alignment)) in self.aligned().enumerate() {
            let turned = self.turned.get(k).and_then(Option::as_ref);
            notes.extend(self.alignment_note(name, alignment, turned));
            let rest = alignment.own_pairs;
            let left = self.own_pairs_of(k).filter(|left| *left > rest);
            notes.extend(left.map(|left| {
                format!(
                    "`{name}` meets itself in {left} pairs of triangles, at rest in {rest}: folded on the way to `{}`",
                    self.combination.body
                )
            }));
        }
        notes.extend(self.report.iter().flat_map(|report| report.notes(&self.combination.body)));
        notes
    }

    /// What alignment did to a garment, if a person should know.
    fn alignment_note(
        &self,
        name: &str,
        alignment: &AlignReport,
        turned: Option<&TurnedBone>,
    ) -> Option<String> {
        let body = &self.combination.body;
        let strain = 1e2 * alignment.strain.p99;
        if alignment.method == align::Method::Similarity {
            return Some(format!(
                "`{name}` was only turned, scaled and moved to `{body}`: the two bodies could not be registered ({:.0} mm off); add their `--template`",
                1e3 * alignment.residual
            ));
        }
        if let Some(TurnedBone { bone, degrees }) = turned {
            return Some(format!(
                "`{name}`: its own body stands in another pose than `{body}` (`{bone}` is turned by {degrees:.0}°), and one edge in a hundred was strained by {strain:.0} % or more; bodies in one pose keep the shape"
            ));
        }
        (alignment.strain.rms > DRAWN).then(|| {
            format!(
                "`{name}`: to fit `{body}`, one edge in a hundred was strained by {strain:.0} % or more; is it made for another size?"
            )
        })
    }

    /// Names of garments with the reports of their alignment.
    fn aligned(&self) -> impl Iterator<Item = (&String, &AlignReport)> {
        self.combination.garments.iter().zip(&self.alignments)
    }

    /// Triangle pairs of a garment that intersect in the result; `None` without one.
    fn own_pairs_of(&self, garment: usize) -> Option<usize> {
        Some(self.report.as_ref()?.layers.get(garment)?.own_pairs.after)
    }

    /// Triangle pairs of the garments that intersect one of the same garment: at rest, on their own bodies, and in
    /// the result.
    pub fn own_pairs(&self) -> [usize; 2] {
        let rest = self.alignments.iter().map(|alignment| alignment.own_pairs).sum();
        let after = (0..self.alignments.len()).filter_map(|k| self.own_pairs_of(k)).sum();
        [rest, after]
    }

    /// How clean the result is; `None` if there is none.
    pub fn cleanness(&self) -> Option<Cleanness> {
        self.report.as_ref().map(|report| report.after.cleanness())
    }
}

/// Everything that decides a result; its hash is the key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MatchRequest {
    /// The version of the format.
    pub format: u32,
    /// The build of the libraries.
    pub build: String,
    /// Parameters.
    pub params: MatchParams,
    /// Those of the alignment of the garments.
    pub align: AlignParams,
    /// The body.
    pub body: BodyInfo,
    /// The garments, inner to outer.
    pub garments: Vec<RequestedGarment>,
}

/// A garment of a request.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RequestedGarment {
    /// Its name.
    pub name: String,
    /// SHA-256 of its mesh.
    pub mesh: String,
    /// Whether it has skinning weights.
    pub skinned: bool,
    /// SHA-256 of the files of its φ; empty with [`Fields::Meshes`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub phi: Vec<String>,
    /// The body that it was made on.
    pub body: BodyInfo,
}

/// A recorded error.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// Its kind: [`WardrobeError::kind`](super::WardrobeError::kind).
    pub kind: String,
    /// Its message.
    pub message: String,
}

/// Seconds, in the order spent: `timings.json`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timings {
    /// Reading and aligning; almost none if the dresser has the garments already.
    pub align: f64,
    /// Resolving, including verification.
    pub resolve: f64,
    /// Drawing.
    pub pictures: f64,
    /// Writing.
    pub write: f64,
    /// All.
    pub total: f64,
}

/// A resolved combination in memory.
#[derive(Clone, Debug)]
pub struct Matched {
    /// The recorded result.
    pub result: MatchResult,
    /// The aligned outfit, if alignment succeeded.
    pub before: Option<Outfit>,
    /// The resolved outfit as far as possible, with the files of its garments.
    pub after: Option<ResolvedFiles>,
    /// Pictures before and after.
    pub pictures: Option<[Image; 2]>,
    /// Seconds.
    pub timings: Timings,
}
