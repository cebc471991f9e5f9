//! How properties of new vertices follow from those of their sources.

use super::column::Column;
use super::property::Property;
use serde::Serialize;

/// How a property of a new vertex follows from those of its sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub enum Rule {
    /// The weighted mean; rounded for integers.
    Mean,
    /// The value of the largest total weight: labels, marks, ids. Ties go to the smaller value.
    Majority,
    /// One of three components of a unit vector.
    Normal,
    /// Joint ids and weights of linear-blend skinning: joints are merged, the heaviest kept, and
    /// their weights divided by their sum.
    Skinning,
    /// The list of the source of the largest weight.
    Nearest,
}

/// The rule of each property, by names and types
/// ([`VertexAttributes::new`](super::VertexAttributes::new)).
pub(super) fn rules(properties: &[Property]) -> Vec<Rule> {
    let has = |name: &str| properties.iter().any(|p| p.name == name && p.lists.is_none());
    let normals = ["nx", "ny", "nz"].into_iter().all(has);
    let skinned = (0..).take_while(|k| has(&format!("j{k}")) && has(&format!("w{k}"))).count();
    let rule = |p: &Property| {
        let name = p.name.strip_prefix("diffuse_").unwrap_or(&p.name);
        let joint = p.name.strip_prefix(['j', 'w']).and_then(|k| k.parse::<usize>().ok());
        match name {
            _ if p.lists.is_some() => Rule::Nearest,
            _ if joint.is_some_and(|k| k < skinned) => Rule::Skinning,
            "nx" | "ny" | "nz" if normals => Rule::Normal,
            "red" | "green" | "blue" | "alpha" => Rule::Mean,
            "label" if is_whole(&p.values) => Rule::Majority,
            _ if p.values.scalar_type().is_integer() => Rule::Majority,
            _ => Rule::Mean,
        }
    };
    properties.iter().map(rule).collect()
}

/// Whether all values are whole numbers. Writers without integers, as those of point clouds, store labels
/// as floats.
fn is_whole(values: &Column) -> bool {
    values.to_f64().iter().all(|x| x.fract() == 0.0)
}
