//! Morph targets, and joints with their weights.

use super::accessor::Wanted;
use super::data::{Data, POSITION};
use super::document::entry;
use super::error::ReadError;
use super::joints::joint_name;
use super::placing::Affine;
use super::scene::Placed;
use if_core::math::{Real, Vector};

const JOINTS: Wanted =
    Wanted { what: "JOINTS", kind: "VEC4", is_whole: true, expected: "VEC4 of whole numbers" };
const WEIGHTS: Wanted = Wanted {
    what: "WEIGHTS",
    kind: "VEC4",
    is_whole: false,
    expected: "VEC4 of floats or normalised whole numbers",
};
const BIND: Wanted = Wanted {
    what: "inverseBindMatrices",
    kind: "MAT4",
    is_whole: false,
    expected: "MAT4 of floats",
};

/// Joints and weights of the vertices of a part.
#[derive(Clone, Debug)]
pub(super) struct Skinned {
    /// Names of the joints' nodes.
    pub(super) joints: Vec<String>,
    /// For each vertex as many joints.
    sets: usize,
    slots: Vec<(u32, f32)>,
}

impl Skinned {
    /// The joints of a vertex and their weights, without those of weight zero.
    pub(super) fn of(&self, vertex: usize) -> impl Iterator<Item = (usize, Real)> {
        let slots = &self.slots[vertex * self.sets..(vertex + 1) * self.sets];
        let used = slots.iter().filter(|(_, weight)| *weight != 0.0);
        used.map(|(joint, weight)| (*joint as usize, Real::from(*weight)))
    }
}

impl Data<'_> {
    /// The sum of the morph targets that have a weight; `None` if none has.
    pub(super) fn morph(
        &mut self,
        node: usize,
        at: [usize; 2],
        count: usize,
    ) -> Result<Option<Vec<Vector>>, ReadError> {
        let document = self.document;
        let primitive = self.primitive(at);
        let of_mesh = &document.meshes[at[0]].weights;
        let weights = document.nodes[node].weights.as_ref().unwrap_or(of_mesh);
        let mut sum: Option<Vec<Vector>> = None;
        for (target, &weight) in primitive.targets.iter().zip(weights) {
            let Some(&accessor) = target.get("POSITION").filter(|_| weight != 0.0) else {
                continue;
            };
            let offsets = self.counted(accessor, &POSITION, "POSITION of a morph target", count)?;
            let sum = sum.get_or_insert_with(|| vec![Vector::zeros(); count]);
            for (element, sum) in sum.iter_mut().enumerate() {
                *sum += Vector::from(offsets.values::<3>(&self.source, element)) * weight;
            }
        }
        Ok(sum)
    }

    /// The joints and weights of a primitive; `None` if it has none.
    pub(super) fn skinned(
        &mut self,
        at: [usize; 2],
        skin: usize,
        count: usize,
    ) -> Result<Option<Skinned>, ReadError> {
        let document = self.document;
        let skin = entry(&document.skins, "skin", skin)?;
        let attributes = &self.primitive(at).attributes;
        let mut found = Vec::new();
        for set in 0.. {
            let names = [format!("JOINTS_{set}"), format!("WEIGHTS_{set}")];
            let [Some(&joints), Some(&weights)] = names.map(|name| attributes.get(&name)) else {
                break;
            };
            let joints = self.counted(joints, &JOINTS, "JOINTS", count)?;
            found.push((joints, self.counted(weights, &WEIGHTS, "WEIGHTS", count)?));
        }
        if found.is_empty() {
            return Ok(None);
        }
        let mut slots = Vec::with_capacity(4 * found.len() * count);
        for element in 0..count {
            for (joints, weights) in &found {
                let joints: [Real; 4] = joints.values(&self.source, element);
                let weights: [Real; 4] = weights.values(&self.source, element);
                for (joint, weight) in joints.into_iter().zip(weights) {
                    if weight != 0.0 {
                        entry(&skin.joints, "joint", joint as usize)?;
                    }
                    slots.push((joint as u32, weight as f32));
                }
            }
        }
        let name = |&joint: &usize| {
            entry(&document.nodes, "joint node", joint)?;
            Ok(joint_name(document, joint))
        };
        let joints = skin.joints.iter().map(name).collect::<Result<_, ReadError>>()?;
        Ok(Some(Skinned { joints, sets: 4 * found.len(), slots }))
    }

    /// For each vertex the blend of its joints' maps.
    pub(super) fn joint_maps(
        &mut self,
        at: [usize; 2],
        skin: usize,
        placed: &Placed,
        (skinned, count): (&Skinned, usize),
    ) -> Result<Vec<Affine>, ReadError> {
        let document = self.document;
        let skin = entry(&document.skins, "skin", skin)?;
        let bind = match skin.inverse_bind_matrices {
            Some(accessor) => Some(self.elements(accessor, &BIND)?),
            None => None,
        };
        let mut joints = Vec::with_capacity(skin.joints.len());
        for (k, &joint) in skin.joints.iter().enumerate() {
            let world = entry(&placed.world, "joint node", joint)?;
            joints.push(match &bind {
                Some(bind) if k >= bind.count => {
                    let (what, index, count) = ("inverse bind matrix", k, bind.count);
                    return Err(ReadError::Index { what, index, count });
                }
                Some(bind) => world.after(&Affine::of_columns(&bind.values(&self.source, k))),
                None => *world,
            });
        }
        let common = common(&joints, &placed.world);
        let accessor = self.primitive(at).attributes.get("WEIGHTS_0").copied().unwrap_or_default();
        let mut slots: Vec<(usize, Real)> = Vec::new();
        let blend = |element: usize| {
            let mut sum = 0.0;
            let mut map = Affine { linear: Default::default(), shift: Vector::zeros() };
            // In one order, so that both sides of a seam get the same bits.
            slots.clear();
            slots.extend(skinned.of(element));
            slots.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            for &(joint, weight) in &slots {
                map.linear += joints[joint].linear * weight;
                map.shift += joints[joint].shift * weight;
                sum += weight;
            }
            let blend = Affine { linear: map.linear / sum, shift: map.shift / sum };
            let map = common.unwrap_or(blend);
            let expected = "weights must not cancel, nor joints flatten space";
            let found = format!("a sum of weights of {sum}");
            let fault = ReadError::Value { accessor, element, expected, found };
            if sum > 0.0 && map.is_invertible() { Ok(map) } else { Err(fault) }
        };
        (0..count).map(blend).collect()
    }
}

/// How far the maps of joints in the pose of binding differ, as files have them in single precision: relative to
/// the largest distance of a joint from the origin.
const ROUNDING: Real = 2e-6;

/// The map of the first joint, if those of all are the same but for rounding, as in the pose of binding: the sides
/// of a seam whose weights differ then stay together. `None` if they are not.
fn common(joints: &[Affine], world: &[Affine]) -> Option<Affine> {
    let first = joints.first().filter(|first| first.is_invertible())?;
    let size = first.linear.amax();
    let reach = world.iter().map(|joint| joint.shift.amax()).fold(0.0, Real::max);
    let is_same = |joint: &Affine| {
        (joint.linear - first.linear).amax() <= ROUNDING * size
            && (joint.shift - first.shift).amax() <= ROUNDING * reach
    };
    joints.iter().all(is_same).then_some(*first)
}
