//! The nodes of a scene and their transforms.

use super::document::{Document, Node, Skin, entry};
use super::error::ReadError;
use super::joints::{Joints, joint_name};
use super::placing::Affine;
use if_core::math::{Point, Vector};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion};

/// A joint of a skin, where the scene shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinJoint {
    /// The name of its node; `joint 7` if node 7 has none.
    pub name: String,
    /// The nearest joint above it; parents come before their children.
    pub parent: Option<usize>,
    /// In the units of the scene (metres by the specification).
    pub place: Point,
}

/// The nodes of a document, in space.
pub(super) struct Placed {
    /// For each node of the document its map to the scene.
    pub(super) world: Vec<Affine>,
    /// The nodes of the default scene, parents first.
    pub(super) shown: Vec<usize>,
    parent: Vec<Option<usize>>,
    /// All nodes, parents first.
    all: Vec<usize>,
}

impl Placed {
    pub(super) fn new(document: &Document) -> Result<Self, ReadError> {
        let count = document.nodes.len();
        let mut parent = vec![None; count];
        for (node, about) in document.nodes.iter().enumerate() {
            for &child in &about.children {
                entry(&document.nodes, "node", child)?;
                if child == node || parent[child].replace(node).is_some() {
                    return Err(ReadError::NotATree { node: child });
                }
            }
        }
        let roots: Vec<usize> = (0..count).filter(|node| parent[*node].is_none()).collect();
        let all = below(document, &roots)?;
        // What no root leads to is a ring.
        let mut is_reached = vec![false; count];
        all.iter().for_each(|node| is_reached[*node] = true);
        if let Some(node) = is_reached.iter().position(|is| !is) {
            return Err(ReadError::NotATree { node });
        }
        let mut world = vec![Affine::IDENTITY; count];
        for &node in &all {
            let own = local(node, &document.nodes[node])?;
            world[node] = parent[node].map_or(own, |p: usize| world[p].after(&own));
        }
        let shown = match document.scene.or((!document.scenes.is_empty()).then_some(0)) {
            Some(scene) => below(document, &entry(&document.scenes, "scene", scene)?.nodes)?,
            None => all.clone(),
        };
        Ok(Self { world, shown, parent, all })
    }

    /// The joints of all skins: in the order of their list, if all have the same one and parents come first in
    /// it; else as the scene lists them, parents first.
    /// Of [copies](Joints) only what is below them is added, to the joints that are copied.
    ///
    /// Of each node of the document the nearest joint above it, or itself, as well.
    pub(super) fn joints(
        &self,
        document: &Document,
        chosen: &[usize],
    ) -> (Vec<SkinJoint>, Vec<Option<usize>>) {
        let Joints { is_joint, same_as } = Joints::of_skins(document, chosen);
        let mut place = vec![None; document.nodes.len()];
        let (mut joints, mut nodes) = (Vec::new(), Vec::new());
        // What is below a copy comes after all that may be copied.
        let mut is_late = vec![false; document.nodes.len()];
        for &node in &self.all {
            is_late[node] =
                same_as[node].is_some() || self.parent[node].is_some_and(|p| is_late[p]);
        }
        let (late, early): (Vec<usize>, Vec<usize>) =
            self.all.iter().partition(|node| is_late[**node]);
        for node in early.into_iter().chain(late) {
            // Nodes that are no joint stand for the joint above them.
            let parent = self.parent[node].and_then(|p: usize| place[p]);
            place[node] = same_as[node].map_or(parent, |same: usize| place[same]);
            if is_joint[node] {
                place[node] = Some(joints.len());
                nodes.push(node);
                let name = joint_name(document, node);
                joints.push(SkinJoint { name, parent, place: self.world[node].shift.into() });
            }
        }
        // Skins without a joint of their own are none.
        let has_own = |skin: &&Skin| {
            skin.joints.iter().any(|node| is_joint.get(*node).is_none_or(|is_joint| *is_joint))
        };
        let mut skins = document.skins.iter().filter(has_own);
        let Some(first) = skins.next() else { return (joints, place) };
        if skins.any(|skin| skin.joints != first.joints) {
            return (joints, place);
        }
        let mut in_list = vec![None; document.nodes.len()];
        for (k, &node) in first.joints.iter().enumerate() {
            in_list.get_mut(node).into_iter().for_each(|at| *at = Some(k));
        }
        let listed: Option<Vec<usize>> = nodes.iter().map(|node| in_list[*node]).collect();
        let Some(listed) = listed else { return (joints, place) };
        let is_one_each = joints.len() == first.joints.len();
        let comes_after = |(k, joint): (usize, &SkinJoint)| {
            joint.parent.is_none_or(|parent| listed[parent] < listed[k])
        };
        if !is_one_each || !joints.iter().enumerate().all(comes_after) {
            return (joints, place);
        }
        place.iter_mut().for_each(|at| *at = at.map(|joint| listed[joint]));
        joints
            .iter_mut()
            .for_each(|joint| joint.parent = joint.parent.map(|parent| listed[parent]));
        let mut ordered: Vec<(usize, SkinJoint)> = listed.into_iter().zip(joints).collect();
        ordered.sort_unstable_by_key(|(k, _)| *k);
        (ordered.into_iter().map(|(_, joint)| joint).collect(), place)
    }

    /// The nodes of the layer `name`, parents first: the node of this name if it has a mesh, else
    /// all nodes below it.
    pub(super) fn layer(&self, document: &Document, name: &str) -> Result<Vec<usize>, ReadError> {
        let is_named = |node: &&usize| document.nodes[**node].name.as_deref() == Some(name);
        let mut named = self.shown.iter().filter(is_named);
        let Some(&node) = named.next() else {
            let with_mesh = self.shown.iter().map(|node| &document.nodes[*node]);
            let names = with_mesh.filter(|node| node.mesh.is_some());
            let names = names.filter_map(|node| node.name.clone()).collect();
            return Err(ReadError::NoNode { name: name.into(), names });
        };
        if let Some(&second) = named.next() {
            return Err(ReadError::SameName { name: name.into(), first: node, second });
        }
        let has_mesh = document.nodes[node].mesh.is_some();
        if has_mesh { Ok(vec![node]) } else { below(document, &[node]) }
    }
}

/// These nodes and all below them, parents first. The document is a forest, so that only `roots` can
/// lead to a node twice.
fn below(document: &Document, roots: &[usize]) -> Result<Vec<usize>, ReadError> {
    let mut is_seen = vec![false; document.nodes.len()];
    let mut stack: Vec<usize> = roots.iter().rev().copied().collect();
    let mut order = Vec::new();
    while let Some(node) = stack.pop() {
        let children = &entry(&document.nodes, "node", node)?.children;
        if std::mem::replace(&mut is_seen[node], true) {
            return Err(ReadError::NotATree { node });
        }
        order.push(node);
        stack.extend(children.iter().rev());
    }
    Ok(order)
}

/// The map of a node to its parent.
fn local(node: usize, about: &Node) -> Result<Affine, ReadError> {
    if let Some(matrix) = &about.matrix {
        return Ok(Affine::of_columns(matrix));
    }
    let [x, y, z, w] = about.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6)
        .ok_or(ReadError::Transform { node })?;
    let scale = Vector::from(about.scale.unwrap_or([1.0; 3]));
    let linear = turn.to_rotation_matrix().into_inner() * Matrix3::from_diagonal(&scale);
    Ok(Affine { linear, shift: Vector::from(about.translation.unwrap_or_default()) })
}
