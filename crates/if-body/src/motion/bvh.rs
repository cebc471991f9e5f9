//! BVH files: a tree of joints with offsets, and a row of channels for each frame.

use if_core::math::{Real, Vector};
use nalgebra::{UnitQuaternion, Vector3};
use std::collections::HashSet;
use std::f64::consts::FRAC_PI_2;

/// A BVH file cannot be read, or its joints are not those of the skeleton.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum BvhError {
    /// Something else is expected.
    #[error("line {line}: expected {expected}, found `{found}`")]
    Syntax { line: usize, expected: &'static str, found: String },
    /// The file is cut off.
    #[error("the file ends where {expected} must follow; export it again")]
    End { expected: &'static str },
    /// A value is no number, or NaN or infinite.
    #[error("line {line}: `{found}` is not a finite number")]
    Number { line: usize, found: String },
    /// Not one value for each channel of each frame.
    #[error(
        "{values} values follow the frame time, but {frames} frames of {channels} channels \
         have {}; export the file again", (*frames as u128) * (*channels as u128)
    )]
    Values { values: usize, frames: usize, channels: usize },
    /// Two joints have the same name.
    #[error("two joints are called `{name}`; each needs its own name")]
    SameName { name: String },
    /// The person is upright neither in the rest pose nor in a frame.
    #[error(
        "the person in the rest pose is {height:.1} high, {width:.1} wide and {depth:.1} deep, in the units \
         of the file, and in no frame stands as the skeleton does; y or z must be up: export the motion so"
    )]
    NotUpright { height: Real, width: Real, depth: Real },
    /// Fewer than half of the skeleton's joints are in the file.
    #[error(
        "{found} of the skeleton's {joints} joints are in the file, among the others not `{missing}`; the file has \
         `{}` and others: rename the joints of the one like those of the other", in_file.join("`, `")
    )]
    Joints { found: usize, joints: usize, missing: String, in_file: Vec<String> },
}

/// A motion as the file has it.
#[derive(Debug)]
pub(super) struct Bvh {
    /// Parents before children; the first is the root.
    pub(super) joints: Vec<BvhJoint>,
    /// Seconds.
    pub(super) frame_time: Real,
    /// All channels of one frame after those of another.
    values: Vec<Real>,
    channels: usize,
    /// From the axes of the file to those with y up.
    upright: UnitQuaternion<Real>,
    /// From the axes of the frames to those of the rest pose.
    world: UnitQuaternion<Real>,
    /// The rotation of each joint in the pose that counts as rest: none, or that of a frame.
    rest: Vec<UnitQuaternion<Real>>,
}

/// A joint of the file.
#[derive(Debug)]
pub(super) struct BvhJoint {
    pub(super) name: String,
    pub(super) parent: Option<usize>,
    /// From its parent, in the rest pose, along the axes of the file.
    offset: Vector,
    /// The end of its bone, from the joint, where it has no children.
    end: Option<Vector>,
    channels: Vec<Channel>,
    /// Its first channel in a frame.
    first: usize,
}

#[derive(Clone, Copy, Debug)]
enum Channel {
    Position(usize),
    Rotation(usize),
}

const CHANNELS: [(&str, Channel); 6] = [
    ("Xposition", Channel::Position(0)),
    ("Yposition", Channel::Position(1)),
    ("Zposition", Channel::Position(2)),
    ("Xrotation", Channel::Rotation(0)),
    ("Yrotation", Channel::Rotation(1)),
    ("Zrotation", Channel::Rotation(2)),
];

impl BvhError {
    /// What is wrong with the file as a whole.
    pub(super) fn verdict(&self) -> &'static str {
        match self {
            Self::Joints { .. } => "the joints of the BVH file are not those of the skeleton",
            Self::NotUpright { .. } => "the BVH file has no upright person",
            _ => "the motion is no valid BVH file",
        }
    }
}

impl Bvh {
    /// Reads the text of a file.
    pub(super) fn read(text: &str) -> Result<Self, BvhError> {
        let mut words = Words::new(text);
        words.expect("HIERARCHY")?;
        words.expect("ROOT")?;
        let (joints, channels) = hierarchy(&mut words)?;
        let mut names = HashSet::new();
        if let Some(joint) = joints.iter().find(|joint| !names.insert(&joint.name)) {
            return Err(BvhError::SameName { name: joint.name.clone() });
        }
        words.label("Frames:")?;
        let (line, word) = words.next("the number of frames")?;
        let frames = word.parse::<usize>().map_err(|_| BvhError::Syntax {
            line,
            expected: "the number of frames",
            found: word.into(),
        })?;
        words.expect("Frame")?;
        words.label("Time:")?;
        let frame_time = words.number("the frame time")?;
        let mut values = Vec::new();
        while words.peek().is_some() {
            values.push(words.number("a value")?);
        }
        if frames.checked_mul(channels) != Some(values.len()) {
            return Err(BvhError::Values { values: values.len(), frames, channels });
        }
        let (upright, world) = (UnitQuaternion::identity(), UnitQuaternion::identity());
        let rest = vec![UnitQuaternion::identity(); joints.len()];
        Ok(Self { joints, frame_time, values, channels, upright, world, rest })
    }

    /// Takes an axis of the file as up: y as it is; or z, then its y axis points backwards.
    pub(super) fn stand_along(&mut self, axis: usize) {
        self.upright = match axis {
            2 => UnitQuaternion::from_axis_angle(&Vector::x_axis(), -FRAC_PI_2),
            _ => UnitQuaternion::identity(),
        };
        self.rest.fill(UnitQuaternion::identity());
    }

    /// Takes the pose of a frame as the rest pose.
    pub(super) fn rest_as_in(&mut self, frame: usize) {
        self.rest = self.turns(self.rows().nth(frame).expect("there is such a frame"));
    }

    /// Turns what the frames show, and not the rest pose.
    pub(super) fn turn_frames(&mut self, by: UnitQuaternion<Real>) {
        self.world = by;
    }

    /// From a joint to the end of its bone in the rest pose, where it has no children.
    pub(super) fn end(&self, joint: usize) -> Option<Vector> {
        self.joints[joint].end.map(|end| self.rest[joint] * (self.upright * end))
    }

    /// A joint and all above it, the root first.
    pub(super) fn path(&self, joint: usize) -> Vec<usize> {
        let above = |j: &usize| self.joints[*j].parent;
        let mut path: Vec<usize> = std::iter::successors(Some(joint), above).collect();
        path.reverse();
        path
    }

    /// The channels of each frame. A file without channels has no values, and no frames.
    fn rows(&self) -> std::slice::Chunks<'_, Real> {
        self.values.chunks(self.channels.max(1))
    }

    /// The number of frames.
    pub(super) fn len(&self) -> usize {
        self.rows().len()
    }

    /// The rotations of all joints in the world, in the frame with these channels.
    fn turns(&self, row: &[Real]) -> Vec<UnitQuaternion<Real>> {
        let mut turns: Vec<UnitQuaternion<Real>> = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let mut turn = UnitQuaternion::identity();
            for (channel, value) in joint.channels.iter().zip(&row[joint.first..]) {
                if let Channel::Rotation(axis) = channel {
                    let about = self.upright * Vector3::ith_axis(*axis);
                    turn *= UnitQuaternion::from_axis_angle(&about, value.to_radians());
                }
            }
            turns.push(joint.parent.map_or(self.world, |p| turns[p]) * turn);
        }
        turns
    }

    /// The position of the joint `at` in each frame, and the rotations of all joints in the world, from the
    /// rest pose.
    pub(super) fn frames(
        &self,
        at: usize,
    ) -> impl Iterator<Item = (Vector, Vec<UnitQuaternion<Real>>)> {
        let path = self.path(at);
        self.rows().map(move |row| {
            let mut turns = self.turns(row);
            let mut position = Vector::zeros();
            for joint in path.iter().map(|j| &self.joints[*j]) {
                let from_parent = self.upright * joint.translation(row);
                position += joint.parent.map_or(self.world, |p| turns[p]) * from_parent;
            }
            turns.iter_mut().zip(&self.rest).for_each(|(turn, rest)| *turn *= rest.inverse());
            (position, turns)
        })
    }

    /// Positions of all joints in the rest pose, from the root.
    pub(super) fn rest(&self) -> Vec<Vector> {
        let mut rest: Vec<Vector> = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let from = |p: usize| rest[p] + self.rest[p] * (self.upright * joint.offset);
            rest.push(joint.parent.map_or(Vector::zeros(), from));
        }
        rest
    }
}

impl BvhJoint {
    /// Whether frames may move it: others are ends of bones.
    pub(super) fn has_channels(&self) -> bool {
        !self.channels.is_empty()
    }

    /// From its parent in a frame: its offset, but for the coordinates that have channels.
    fn translation(&self, row: &[Real]) -> Vector {
        let mut translation = self.offset;
        for (channel, value) in self.channels.iter().zip(&row[self.first..]) {
            if let Channel::Position(axis) = channel {
                translation[*axis] = *value;
            }
        }
        translation
    }
}

/// The joints after `ROOT`, up to `MOTION`, and the number of their channels. Joints are kept on a
/// list, not on the call stack, whatever the depth.
fn hierarchy(words: &mut Words<'_>) -> Result<(Vec<BvhJoint>, usize), BvhError> {
    let mut joints = vec![joint(words, None)?];
    let (mut current, mut channels) = (Some(0), 0);
    while let Some(at) = current {
        let (line, word) = words.next("a joint")?;
        match word {
            "OFFSET" => joints[at].offset = words.vector()?,
            "CHANNELS" if joints[at].channels.is_empty() => {
                joints[at].first = channels;
                joints[at].channels = channel_list(words)?;
                channels += joints[at].channels.len();
            }
            "JOINT" => {
                joints.push(joint(words, Some(at))?);
                current = Some(joints.len() - 1);
            }
            "End" => {
                end_site(words)?;
                words.expect("OFFSET")?;
                joints[at].end = Some(words.vector()?);
                words.expect("}")?;
            }
            "}" => current = joints[at].parent,
            _ => {
                let expected = "OFFSET, one list of CHANNELS, JOINT, End Site or }";
                return Err(BvhError::Syntax { line, expected, found: word.into() });
            }
        }
    }
    match words.next("MOTION")? {
        (_, word) if word.eq_ignore_ascii_case("MOTION") => Ok((joints, channels)),
        (line, word) => {
            let is_root = word.eq_ignore_ascii_case("ROOT");
            let expected = if is_root { "MOTION (one person a file)" } else { "MOTION" };
            Err(BvhError::Syntax { line, expected, found: word.into() })
        }
    }
}

/// What follows `End` up to the brace: `Site`, and in some programs the name of the bone's end.
fn end_site(words: &mut Words<'_>) -> Result<(), BvhError> {
    loop {
        match words.next("{")? {
            (_, "{") => return Ok(()),
            (line, "}") => return Err(BvhError::Syntax { line, expected: "{", found: "}".into() }),
            _ => {}
        }
    }
}

/// A joint's name and opening brace. Names may have blanks.
fn joint(words: &mut Words<'_>, parent: Option<usize>) -> Result<BvhJoint, BvhError> {
    let mut name = String::new();
    loop {
        let (_, word) = words.next("the name of a joint and {")?;
        if word == "{" {
            let (offset, end, channels) = (Vector::zeros(), None, Vec::new());
            return Ok(BvhJoint { name, parent, offset, end, channels, first: 0 });
        }
        if !name.is_empty() {
            name.push(' ');
        }
        name.push_str(word);
    }
}

fn channel_list(words: &mut Words<'_>) -> Result<Vec<Channel>, BvhError> {
    const EXPECTED: &str = "the number of channels, from 0 to 6";
    let (line, word) = words.next(EXPECTED)?;
    let count = word.parse::<usize>().ok().filter(|n| *n <= 6);
    let syntax =
        |line, expected, found: &str| BvhError::Syntax { line, expected, found: found.into() };
    let count = count.ok_or_else(|| syntax(line, EXPECTED, word))?;
    let mut list = Vec::with_capacity(count);
    for _ in 0..count {
        let expected = "a channel, as Xposition or Zrotation";
        let (line, word) = words.next(expected)?;
        let found = CHANNELS.iter().find(|(name, _)| name.eq_ignore_ascii_case(word));
        list.push(found.ok_or_else(|| syntax(line, expected, word))?.1);
    }
    Ok(list)
}

/// The words of a text, with the numbers of their lines.
struct Words<'a> {
    words: std::iter::Peekable<Box<dyn Iterator<Item = (usize, &'a str)> + 'a>>,
    /// What follows a label without a space.
    rest: Option<(usize, &'a str)>,
}

impl<'a> Words<'a> {
    fn new(text: &'a str) -> Self {
        // Braces are words of their own, also right after a name.
        let parts = |word: &'a str| {
            word.split_inclusive(['{', '}']).flat_map(|part| {
                let (word, brace) = part.split_at(part.trim_end_matches(['{', '}']).len());
                [word, brace].into_iter().filter(|part| !part.is_empty())
            })
        };
        let of_line = move |(line, text): (usize, &'a str)| {
            text.split_whitespace().flat_map(parts).map(move |word| (line + 1, word))
        };
        let words: Box<dyn Iterator<Item = _>> =
            Box::new(text.lines().enumerate().flat_map(of_line));
        Self { words: words.peekable(), rest: None }
    }

    fn peek(&mut self) -> Option<&(usize, &'a str)> {
        self.rest.as_ref().or_else(|| self.words.peek())
    }

    fn next(&mut self, expected: &'static str) -> Result<(usize, &'a str), BvhError> {
        self.rest.take().or_else(|| self.words.next()).ok_or(BvhError::End { expected })
    }

    fn expect(&mut self, expected: &'static str) -> Result<(), BvhError> {
        let (line, found) = self.next(expected)?;
        if found.eq_ignore_ascii_case(expected) {
            Ok(())
        } else {
            Err(BvhError::Syntax { line, expected, found: found.into() })
        }
    }

    /// A label that ends in a colon, before which a space may stand, and none after it.
    fn label(&mut self, expected: &'static str) -> Result<(), BvhError> {
        let syntax =
            |line, found: &str| BvhError::Syntax { line, expected, found: found.to_owned() };
        let (line, word) = self.next(expected)?;
        let name = expected.trim_end_matches(':');
        let after = match word.split_at_checked(name.len()) {
            Some((first, after)) if first.eq_ignore_ascii_case(name) => after,
            _ => return Err(syntax(line, word)),
        };
        let (line, after) = if after.is_empty() { self.next(expected)? } else { (line, after) };
        let after = after.strip_prefix(':').ok_or_else(|| syntax(line, word))?;
        self.rest = Some((line, after)).filter(|(_, after)| !after.is_empty());
        Ok(())
    }

    fn number(&mut self, expected: &'static str) -> Result<Real, BvhError> {
        let (line, word) = self.next(expected)?;
        let number = word.parse::<Real>().ok().filter(|x| x.is_finite());
        number.ok_or_else(|| BvhError::Number { line, found: word.into() })
    }

    fn vector(&mut self) -> Result<Vector, BvhError> {
        let mut v = Vector::zeros();
        for k in 0..3 {
            v[k] = self.number("an offset of three numbers")?;
        }
        Ok(v)
    }
}
