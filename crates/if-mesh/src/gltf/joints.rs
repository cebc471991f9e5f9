//! Which nodes of a document are joints of skins.

use super::document::{Document, Skin};
use std::collections::BTreeMap;

/// The joints of all skins.
pub(super) struct Joints {
    pub(super) is_joint: Vec<bool>,
    /// The joint of which a node is a copy, which is no joint of its own.
    pub(super) same_as: Vec<Option<usize>>,
}

impl Joints {
    /// A joint of a skin that no `chosen` node has, by the name of an earlier one, is a copy of that: garments may
    /// have a copy of the armature.
    pub(super) fn of_skins(document: &Document, chosen: &[usize]) -> Self {
        let count = document.nodes.len();
        let mut is_chosen = vec![false; document.skins.len()];
        let skins = chosen.iter().filter_map(|node| document.nodes[*node].skin);
        skins.for_each(|skin| is_chosen.get_mut(skin).into_iter().for_each(|is| *is = true));
        if !is_chosen.contains(&true) {
            is_chosen.fill(true);
        }
        let (mut is_joint, mut same_as) = (vec![false; count], vec![None; count]);
        let mut of_name = BTreeMap::new();
        let joints = |of_chosen: bool| {
            let skins = document.skins.iter().zip(&is_chosen);
            let skins = skins.filter(move |(_, is_chosen)| **is_chosen == of_chosen);
            skins.flat_map(|(Skin { joints, .. }, _)| joints).copied().filter(|node| *node < count)
        };
        for node in joints(true) {
            is_joint[node] = true;
            of_name.entry(joint_name(document, node)).or_insert(node);
        }
        for node in joints(false) {
            let first = *of_name.entry(joint_name(document, node)).or_insert(node);
            if first == node {
                is_joint[node] = true;
            } else if !is_joint[node] {
                same_as[node] = Some(first);
            }
        }
        Self { is_joint, same_as }
    }
}

/// The name of a joint's node, or one made of its number.
pub(super) fn joint_name(document: &Document, node: usize) -> String {
    let name = document.nodes[node].name.as_ref().filter(|name| !name.is_empty());
    name.cloned().unwrap_or_else(|| format!("joint {node}"))
}
