//! What moves the outfit: a motion of a skeleton, or a folder of bodies.

use super::faults::AnimateFault;
use crate::errors;
use crate::outfit_file::OutfitSpec;
use clap::Args;
use if_body::{BodySequence, Motion, Skeleton};
use if_mesh::file::{Content, MeshFile};
use if_outfit::files::OutfitFiles;
use if_outfit::outfit::Outfit;
use if_pipeline::animate::{BoundOutfit, MovingOutfit, SkinnedOutfit};
use std::num::NonZeroUsize;
use std::ops::Range;
use std::path::PathBuf;

#[derive(Args, Debug, Clone)]
pub(crate) struct SourceArgs {
    /// The motion: a pose for each frame (.json, docs/animate.md; .bvh), or a folder with the mesh of
    /// the body in each.
    #[arg(long, value_name = "FILE|FOLDER")]
    pub(crate) motion: PathBuf,
    /// The skeleton (.json, or a glTF file with a skin); by default `skeleton.json` beside the body, else the
    /// skin's in its glTF file.
    #[arg(long, value_name = "FILE")]
    pub(crate) skeleton: Option<PathBuf>,
    /// Take every N-th frame of the motion only.
    #[arg(long, value_name = "N", default_value = "1")]
    pub(crate) every: NonZeroUsize,
    /// Take this frame of the motion only, or these, such as `37` or `20-29`, from 0; with --every,
    /// every N-th of them.
    #[arg(long, value_name = "N|FIRST-LAST")]
    pub(crate) frames: Option<String>,
    /// Frames per second of a folder of bodies; 30 by default.
    #[arg(long, value_name = "RATE")]
    pub(crate) fps: Option<f64>,
}

const FRAMES_PER_SECOND: f64 = 30.0;

/// A motion that was read.
pub(super) enum Source {
    Poses(Skeleton, Motion),
    Bodies(BodySequence),
}

impl Source {
    /// Reads the motion, and checks that it fits the outfit.
    pub(super) fn read(
        args: &SourceArgs,
        spec: &OutfitSpec,
        files: &OutfitFiles,
    ) -> Result<Self, AnimateFault> {
        if args.motion.is_dir() {
            if args.skeleton.is_some() {
                return Err(AnimateFault::NoUse {
                    what: "a folder of bodies",
                    option: "--skeleton",
                });
            }
            let rate = args.fps.unwrap_or(FRAMES_PER_SECOND);
            let body = &files.outfit().body.mesh;
            let sequence = BodySequence::open(&args.motion, body, rate)
                .map_err(|source| AnimateFault::Bodies { path: args.motion.clone(), source })?;
            if let Some([before, after]) = sequence.gaps().first() {
                let [before, after] = [before, after].map(|path| path.display());
                errors::note(&format!(
                    "between `{before}` and `{after}` frames seem to be missing; one follows the other at once"
                ));
            }
            let sequence = sequence.part(args.range(sequence.len())?).every(args.every.get());
            return Ok(Self::Bodies(sequence));
        }
        let fault = |source| AnimateFault::Motion { path: args.motion.clone(), source };
        args.motion.metadata().map_err(|error| fault(error.into()))?;
        let skeleton = args.skeleton(spec, files)?;
        let motion = Motion::read_path(&args.motion, &skeleton).map_err(fault)?;
        if args.fps.is_some() {
            return Err(AnimateFault::NoUse { what: "a motion of poses", option: "--fps" });
        }
        let motion = motion.part(args.range(motion.poses.len())?).every(args.every.get());
        let source = Self::Poses(skeleton, motion);
        source.moved(files.outfit().clone(), files)?;
        Ok(source)
    }

    /// Number of frames that are taken.
    pub(super) fn frames(&self) -> usize {
        match self {
            Self::Poses(_, motion) => motion.poses.len(),
            Self::Bodies(sequence) => sequence.len(),
        }
    }

    /// The clean outfit with what moves it.
    pub(super) fn moved(
        &self,
        outfit: Outfit,
        files: &OutfitFiles,
    ) -> Result<MovingOutfit, AnimateFault> {
        let fault = |source| AnimateFault::Skin { source };
        Ok(match self {
            Self::Poses(skeleton, motion) => {
                let files = files.files();
                let outfit = SkinnedOutfit::from_files(outfit, skeleton.clone(), files);
                MovingOutfit::Poses(Box::new(outfit.map_err(fault)?), motion.clone())
            }
            Self::Bodies(sequence) => {
                let bound = BoundOutfit::new(outfit, sequence.clone()).map_err(fault)?;
                MovingOutfit::Bodies(Box::new(bound))
            }
        })
    }
}

impl SourceArgs {
    /// The skeleton that is given, or that of the body.
    fn skeleton(&self, spec: &OutfitSpec, files: &OutfitFiles) -> Result<Skeleton, AnimateFault> {
        let beside = || spec.body.path.with_file_name("skeleton.json");
        let path = self.skeleton.clone().unwrap_or_else(beside);
        match files.files().next().map(MeshFile::content) {
            Some(Content::Gltf(body)) if self.skeleton.is_none() && !path.exists() => {
                let path = &spec.body.path;
                if body.joints().is_empty() {
                    return Err(AnimateFault::NoSkin { path: path.clone() });
                }
                Skeleton::from_gltf(body.joints())
                    .and_then(|skeleton| skeleton.scaled(spec.scale))
                    .map_err(|source| AnimateFault::Skeleton { path: path.clone(), source })
            }
            _ => Skeleton::read_path(&path)
                .map_err(|source| AnimateFault::Skeleton { path: path.clone(), source }),
        }
    }

    /// The number in the motion of a frame of those that are taken.
    pub(super) fn number(&self, frame: usize) -> usize {
        let first = self.ends().ok().flatten().map_or(0, |(first, _)| first);
        first + frame * self.every.get()
    }

    /// The frames that are to be taken, of `count`, before every N-th of them is.
    fn range(&self, count: usize) -> Result<Range<usize>, AnimateFault> {
        let Some((first, last)) = self.ends()? else { return Ok(0..count) };
        if last < first {
            return Err(self.fault("the last frame is before the first".into()));
        }
        if last >= count {
            let fault = format!("the motion has {count} frames, the last is {}", count - 1);
            return Err(self.fault(fault));
        }
        Ok(first..last + 1)
    }

    /// The first and the last frame of --frames.
    fn ends(&self) -> Result<Option<(usize, usize)>, AnimateFault> {
        let number = |part: &str| {
            let number = part.trim().parse::<usize>();
            number.map_err(|_| self.fault(format!("`{part}` is no frame")))
        };
        let Some(text) = &self.frames else { return Ok(None) };
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        Ok(Some((number(first)?, number(last)?)))
    }

    fn fault(&self, fault: String) -> AnimateFault {
        AnimateFault::Frames { text: self.frames.clone().unwrap_or_default(), fault }
    }
}
