//! Properties of vertices, carried along when a mesh gets other vertices. They are independent of
//! files' formats.

mod column;
mod property;
mod rule;
mod source;

pub(crate) use column::with_column;
pub use column::{Column, ScalarType};
pub use property::Property;
pub use rule::Rule;
pub use source::Source;

use crate::normals::Turns;
use if_core::math::Real;

/// The properties of the vertices of a mesh.
///
/// # Examples
///
/// ```
/// use if_mesh::attributes::{Column, Property, Rule, Source, VertexAttributes};
/// let label = Property::new("label", Column::U8(vec![1, 1, 2]));
/// let heat = Property::new("heat", Column::F32(vec![0.0, 1.0, 4.0]));
/// let vertices = VertexAttributes::new(3, vec![label, heat])?;
/// assert_eq!(vertices.rules(), [Rule::Majority, Rule::Mean]);
/// let made = vertices.derive(&[Source::Vertex(2), Source::Blend(vec![(0, 0.5), (1, 0.25), (2, 0.25)])]);
/// assert_eq!(made.properties()[0].values, Column::U8(vec![2, 1]));
/// assert_eq!(made.properties()[1].values, Column::F32(vec![4.0, 1.25]));
/// # Ok::<(), if_mesh::attributes::AttributeError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Default)]
pub struct VertexAttributes {
    vertices: usize,
    properties: Vec<Property>,
    rules: Vec<Rule>,
}

/// Properties that do not belong to the mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum AttributeError {
    /// Not one record for each vertex.
    #[error(
        "property `{name}` has {records} records for {vertices} vertices; leave it out, or give one for each vertex"
    )]
    Count { name: String, records: usize, vertices: usize },
    /// The lists of a property do not divide its values.
    #[error(
        "the lists of property `{name}` do not divide its {values} values; they must ascend from 0 to that number"
    )]
    Lists { name: String, values: usize },
}

impl VertexAttributes {
    /// Takes `properties` of `vertices` vertices. Their rules follow from names and types:
    ///
    /// | names | rule |
    /// |---|---|
    /// | `j0`, `j1`, … with `w0`, `w1`, …, as many of both | [`Rule::Skinning`] |
    /// | `nx`, `ny`, `nz`, all three | [`Rule::Normal`] |
    /// | `red`, `green`, `blue`, `alpha`, with or without the prefix `diffuse_` | [`Rule::Mean`] |
    /// | lists | [`Rule::Nearest`] |
    /// | `label`, of whole numbers in any type | [`Rule::Majority`] |
    /// | others of `f32` and `f64` | [`Rule::Mean`] |
    /// | others | [`Rule::Majority`] |
    ///
    /// # Errors
    ///
    /// A property whose number of records is not the number of vertices, or whose lists do not divide
    /// its values.
    pub fn new(vertices: usize, properties: Vec<Property>) -> Result<Self, AttributeError> {
        if let Some(p) = properties.iter().find(|p| p.records() != vertices) {
            let (name, records) = (p.name.clone(), p.records());
            return Err(AttributeError::Count { name, records, vertices });
        }
        if let Some(p) = properties.iter().find(|p| !p.lists_divide_values()) {
            return Err(AttributeError::Lists { name: p.name.clone(), values: p.values.len() });
        }
        let rules = rule::rules(&properties);
        Ok(Self { vertices, properties, rules })
    }

    /// Vertices without properties.
    pub fn none(vertices: usize) -> Self {
        Self { vertices, ..Self::default() }
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.vertices
    }

    /// The properties, in the order given.
    pub fn properties(&self) -> &[Property] {
        &self.properties
    }

    /// The rule of each property.
    pub fn rules(&self) -> &[Rule] {
        &self.rules
    }

    /// The properties, by value.
    pub fn into_properties(self) -> Vec<Property> {
        self.properties
    }

    /// The properties of vertices with these sources. Copies keep their bits.
    ///
    /// # Panics
    ///
    /// If a source names a vertex out of range.
    pub fn derive(&self, sources: &[Source]) -> Self {
        // All vertices start with the record of their nearest source; blends then follow the rules.
        let mut made: Vec<Property> = self.properties.iter().map(|p| nearest(p, sources)).collect();
        for (k, source) in sources.iter().enumerate() {
            let Source::Blend(parts) = source else { continue };
            let total: Real = parts.iter().map(|p| p.1).sum();
            if total.is_nan() || total <= 0.0 {
                continue;
            }
            for (p, rule) in self.rules.iter().enumerate() {
                let values = &self.properties[p].values;
                let old = |v: u32| values.get(v as usize);
                match rule {
                    Rule::Mean | Rule::Normal => {
                        let sum = parts.iter().map(|&(v, w)| w * old(v)).sum::<Real>();
                        made[p].values.set(k, sum / total);
                    }
                    Rule::Majority => {
                        let value = majority(parts.iter().map(|&(v, w)| (old(v), w)));
                        // Copied from a source with that value: `f64` does not hold all 64-bit ids.
                        if let Some((v, _)) = parts.iter().find(|(v, _)| old(*v) == value) {
                            made[p].values.set_from(k, values, *v as usize);
                        }
                    }
                    Rule::Skinning | Rule::Nearest => {}
                }
            }
            self.normalise(&mut made, k, parts);
            self.blend_skinning(&mut made, k, source);
        }
        Self { vertices: sources.len(), properties: made, rules: self.rules.clone() }
    }

    /// Gives the normal of record `k` the length 1, or as integers the mean length of its sources.
    /// Unsigned ones are offsets from a middle, and stay means.
    fn normalise(&self, made: &mut [Property], k: usize, parts: &[(u32, Real)]) {
        let axes: Vec<usize> = (0..made.len()).filter(|p| self.rules[*p] == Rule::Normal).collect();
        let length = |of: &[Property], k: usize| {
            axes.iter().map(|&p| of[p].values.get(k).powi(2)).sum::<Real>().sqrt()
        };
        let to = match axes.first().map(|&p| &made[p].values) {
            Some(Column::F32(_) | Column::F64(_)) => 1.0,
            Some(Column::I8(_) | Column::I16(_) | Column::I32(_) | Column::I64(_)) => {
                let total: Real = parts.iter().map(|p| p.1).sum();
                parts.iter().map(|p| p.1 * length(&self.properties, p.0 as usize)).sum::<Real>()
                    / total
            }
            _ => return,
        };
        let found = length(made, k);
        if found > 0.0 {
            axes.iter().for_each(|&p| {
                let value = made[p].values.get(k) / found * to;
                made[p].values.set(k, value);
            });
        }
    }

    /// Whether the vertices have normals.
    pub(crate) fn has_normals(&self) -> bool {
        self.rules.contains(&Rule::Normal)
    }

    /// Turns the normals, if there are any, with the surface.
    pub(crate) fn turn_normals(&mut self, turns: &Turns) {
        let place = |name| self.properties.iter().position(|p| p.name == name);
        let axes = ["nx", "ny", "nz"].map(place);
        if let (true, [Some(x), Some(y), Some(z)]) = (self.has_normals(), axes) {
            let axes = self.properties.get_disjoint_mut([x, y, z]);
            turns.turn(axes.expect("properties of different names").map(|p| &mut p.values));
        }
    }

    /// Blends joints and weights into record `k`.
    fn blend_skinning(&self, made: &mut [Property], k: usize, source: &Source) {
        // Pairs of properties: joint id and weight.
        let column = |name: String| made.iter().position(|p| p.name == name && p.lists.is_none());
        let slot = |k: usize| Some((column(format!("j{k}"))?, column(format!("w{k}"))?));
        let slots: Vec<(usize, usize)> = (0..)
            .map_while(slot)
            .take_while(|s| self.rules[s.0] == Rule::Skinning && self.rules[s.1] == Rule::Skinning)
            .collect();
        if slots.is_empty() {
            return;
        }
        // Total weight of each joint, the heaviest first.
        let mut merged: Vec<(Real, Real)> = Vec::new();
        for (v, weight) in source.parts() {
            for &(j, w) in &slots {
                let joint = self.properties[j].values.get(v as usize);
                let share = weight * self.properties[w].values.get(v as usize);
                match merged.iter_mut().find(|u| u.0 == joint) {
                    Some(u) => u.1 += share,
                    None => merged.push((joint, share)),
                }
            }
        }
        merged.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.total_cmp(&b.0)));
        let all: Real = merged.iter().map(|u| u.1).sum();
        merged.truncate(slots.len());
        let total: Real = merged.iter().map(|u| u.1).sum();
        if total.is_nan() || total <= 0.0 {
            return; // no joint has weight: the copy of the nearest source stays
        }
        // Integer weights are shares of their sum, usually 255 or 65535; the heaviest joint takes
        // the rounding error.
        let whole =
            slots.iter().all(|s| !matches!(made[s.1].values, Column::F32(_) | Column::F64(_)));
        let of_all: Real = source.parts().iter().map(|(_, weight)| weight).sum();
        let sum = if whole { (all / of_all).round() } else { 1.0 };
        let mut shares: Vec<Real> = merged.iter().map(|u| u.1 / total * sum).collect();
        if whole {
            shares.iter_mut().for_each(|s| *s = s.round());
            shares[0] += sum - shares.iter().sum::<Real>();
        }
        for (n, &(j, w)) in slots.iter().enumerate() {
            made[j].values.set(k, merged.get(n).unwrap_or(&merged[0]).0);
            made[w].values.set(k, shares.get(n).copied().unwrap_or(0.0));
        }
    }
}

/// The value of the largest total weight, the smaller one of equals.
fn majority(votes: impl Iterator<Item = (Real, Real)>) -> Real {
    let mut sums: Vec<(Real, Real)> = Vec::new();
    for (value, weight) in votes {
        match sums.iter_mut().find(|s| s.0 == value) {
            Some(s) => s.1 += weight,
            None => sums.push((value, weight)),
        }
    }
    sums.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.total_cmp(&b.0)));
    sums.first().map_or(0.0, |s| s.0)
}

/// The property with the record of each vertex's nearest source.
fn nearest(property: &Property, sources: &[Source]) -> Property {
    let mut lists = property.lists.as_ref().map(|_| vec![0u32]);
    let mut picked = Vec::with_capacity(sources.len());
    for source in sources {
        picked.extend(property.range(source.nearest() as usize));
        if let Some(lists) = &mut lists {
            lists.push(picked.len() as u32);
        }
    }
    Property { name: property.name.clone(), values: property.values.picked(&picked), lists }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn half(a: u32, b: u32) -> Source {
        Source::Blend(vec![(a, 0.5), (b, 0.5)])
    }

    #[test]
    fn colours_are_averaged_and_labels_decided_by_majority() {
        let properties = vec![
            Property::new("red", Column::U8(vec![0, 255])),
            Property::new("label", Column::U8(vec![3, 7])),
            Property::new("big", Column::I64(vec![i64::MAX - 1, 5])),
        ];
        let made = VertexAttributes::new(2, properties).unwrap();
        assert_eq!(made.rules(), [Rule::Mean, Rule::Majority, Rule::Majority]);
        let made =
            made.derive(&[half(0, 1), Source::Blend(vec![(1, 0.6), (0, 0.4)]), Source::Vertex(0)]);
        assert_eq!(made.properties()[0].values, Column::U8(vec![128, 153, 0]));
        assert_eq!(
            made.properties()[1].values,
            Column::U8(vec![3, 7, 3]),
            "a tie goes to the smaller"
        );
        let Column::I64(big) = &made.properties()[2].values else { panic!("another type") };
        assert_eq!(big[2], i64::MAX - 1, "a copy keeps its bits");
    }

    #[test]
    fn labels_stored_as_floats_are_decided_by_majority_unless_some_are_fractions() {
        let rules = |name: &str, values: Vec<f32>| {
            let property = Property::new(name, Column::F32(values));
            VertexAttributes::new(2, vec![property]).unwrap()
        };
        let made = rules("label", vec![1.0, 3.0]);
        assert_eq!(made.rules(), [Rule::Majority]);
        let made = made.derive(&[Source::Blend(vec![(1, 0.6), (0, 0.4)])]);
        assert_eq!(made.properties()[0].values, Column::F32(vec![3.0]));
        assert_eq!(rules("label", vec![1.0, 2.5]).rules(), [Rule::Mean]);
        assert_eq!(rules("label", vec![1.0, f32::NAN]).rules(), [Rule::Mean]);
        assert_eq!(rules("heat", vec![1.0, 3.0]).rules(), [Rule::Mean]);
    }

    #[test]
    fn normals_of_whole_numbers_keep_their_length() {
        let column = |name: &str, of: [i8; 2]| Property::new(name, Column::I8(of.to_vec()));
        let properties = vec![column("nx", [127, 0]), column("ny", [0, 127]), column("nz", [0, 0])];
        let made = VertexAttributes::new(2, properties).unwrap().derive(&[half(0, 1)]);
        let of = |k: usize| made.properties()[k].values.clone();
        assert_eq!(
            [of(0), of(1), of(2)],
            [Column::I8(vec![90]), Column::I8(vec![90]), Column::I8(vec![0])]
        );
    }

    #[test]
    fn a_majority_of_64_bit_ids_keeps_all_bits() {
        let id = (1i64 << 53) + 1;
        let made =
            VertexAttributes::new(3, vec![Property::new("id", Column::I64(vec![id, id, id]))])
                .unwrap();
        let made = made.derive(&[Source::Blend(vec![(0, 0.4), (1, 0.3), (2, 0.3)])]);
        assert_eq!(made.properties()[0].values, Column::I64(vec![id]));
    }

    #[test]
    fn integer_skinning_weights_keep_their_sum() {
        let properties = vec![
            Property::new("j0", Column::U8(vec![4, 6])),
            Property::new("j1", Column::U8(vec![5, 7])),
            Property::new("j2", Column::U8(vec![6, 8])),
            Property::new("w0", Column::U8(vec![128, 255])),
            Property::new("w1", Column::U8(vec![127, 0])),
            Property::new("w2", Column::U8(vec![0, 0])),
        ];
        let made = VertexAttributes::new(2, properties).unwrap().derive(&[half(0, 1), half(0, 0)]);
        let column = |k: usize| made.properties()[k].values.clone();
        // 6: 127.5, 4: 64, 5: 63.5, of 255: two are rounded up, and the largest is reduced by one.
        assert_eq!(
            [column(0), column(1), column(2)],
            [Column::U8(vec![6, 4]), Column::U8(vec![4, 5]), Column::U8(vec![5, 6])]
        );
        assert_eq!(
            [column(3), column(4), column(5)],
            [Column::U8(vec![127, 128]), Column::U8(vec![64, 127]), Column::U8(vec![64, 0])]
        );
    }

    #[test]
    fn skinning_is_merged_truncated_and_normalised() {
        let properties = vec![
            Property::new("j0", Column::U8(vec![4, 9])),
            Property::new("j1", Column::U8(vec![5, 4])),
            Property::new("w0", Column::F32(vec![0.5, 0.75])),
            Property::new("w1", Column::F32(vec![0.5, 0.25])),
        ];
        let made =
            VertexAttributes::new(2, properties).unwrap().derive(&[half(0, 1), Source::Vertex(1)]);
        // 9: 0.375, 4: 0.25 + 0.125, 5: 0.25. The two heaviest are kept, 4 before 9.
        assert_eq!(made.properties()[0].values, Column::U8(vec![4, 9]));
        assert_eq!(made.properties()[1].values, Column::U8(vec![9, 4]));
        assert_eq!(made.properties()[2].values, Column::F32(vec![0.5, 0.75]));
        assert_eq!(made.properties()[3].values, Column::F32(vec![0.5, 0.25]));
    }

    #[test]
    fn normals_are_normalised_and_lists_are_copied() {
        let properties = vec![
            Property::new("nx", Column::F64(vec![1.0, 0.0])),
            Property::new("ny", Column::F64(vec![0.0, 1.0])),
            Property::new("nz", Column::F64(vec![0.0, 0.0])),
            Property {
                name: "ids".into(),
                values: Column::I32(vec![1, 2, 3]),
                lists: Some(vec![0, 1, 3]),
            },
        ];
        let made = VertexAttributes::new(2, properties)
            .unwrap()
            .derive(&[half(0, 1), Source::Blend(vec![(1, 0.9), (0, 0.1)])]);
        let Column::F64(nx) = &made.properties()[0].values else { panic!("another type") };
        approx::assert_relative_eq!(nx[0], 0.5f64.sqrt(), max_relative = 1e-15);
        assert_eq!(made.properties()[3].lists, Some(vec![0, 1, 3]));
        assert_eq!(made.properties()[3].values, Column::I32(vec![1, 2, 3]));
    }

    #[test]
    fn properties_of_another_length_are_rejected() {
        let short = vec![Property::new("label", Column::U8(vec![1]))];
        let error = VertexAttributes::new(2, short).unwrap_err();
        assert_eq!(error, AttributeError::Count { name: "label".into(), records: 1, vertices: 2 });
        for lists in [vec![0, 1, 9], vec![0, 3, 1], vec![1, 2, 3], vec![0, 1, 2]] {
            let property =
                Property { lists: Some(lists), ..Property::new("ids", Column::U8(vec![7; 3])) };
            let error = VertexAttributes::new(2, vec![property]).unwrap_err();
            assert_eq!(error, AttributeError::Lists { name: "ids".into(), values: 3 });
        }
        assert_eq!(VertexAttributes::none(0).derive(&[]).vertices(), 0);
    }
}
