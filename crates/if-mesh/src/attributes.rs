//! What vertices carry beside their positions, when a mesh gets other vertices.

use crate::ply::{Column, Property, with_column};
use if_core::math::Real;
use serde::Serialize;

/// What a vertex of a changed mesh was made of.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// It is this vertex of the mesh before, or a copy of it.
    Vertex(u32),
    /// It is new: vertices of the mesh before with weights above zero, that of the largest weight
    /// first.
    Blend(Vec<(u32, Real)>),
}

impl Source {
    /// The vertex that counts most.
    pub fn nearest(&self) -> u32 {
        match self {
            Self::Vertex(v) => *v,
            Self::Blend(parts) => parts.first().map_or(0, |p| p.0),
        }
    }

    pub(crate) fn parts(&self) -> Vec<(u32, Real)> {
        match self {
            Self::Vertex(v) => vec![(*v, 1.0)],
            Self::Blend(parts) => parts.clone(),
        }
    }
}

/// How a property of a new vertex follows from those of others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub enum Rule {
    /// The weighted mean; rounded where the numbers are whole.
    Mean,
    /// The value with most weight: labels, marks, ids. Of two with the same weight the smaller.
    Majority,
    /// One of three components of a unit vector.
    Normal,
    /// Joint ids and weights of linear-blend skinning: joints are united, the heaviest kept, and
    /// their weights divided by their sum.
    Skinning,
    /// The list of the vertex that counts most.
    Nearest,
}

/// The properties of the vertices of a mesh.
///
/// # Examples
///
/// ```
/// use if_mesh::attributes::{Rule, Source, VertexAttributes};
/// use if_mesh::ply::{Column, Property};
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

/// Why properties do not belong to a mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum AttributeError {
    /// A property has another number of records than the mesh has vertices.
    #[error(
        "property `{name}` has {records} records for {vertices} vertices; leave it out, or give one for each vertex"
    )]
    Length { name: String, records: usize, vertices: usize },
}

impl VertexAttributes {
    /// Takes `properties` of `vertices` vertices, with the rules that names and types suggest:
    ///
    /// | names | rule |
    /// |---|---|
    /// | `j0`, `j1`, … with `w0`, `w1`, …, as many of both | [`Rule::Skinning`] |
    /// | `nx`, `ny`, `nz`, all three | [`Rule::Normal`] |
    /// | `red`, `green`, `blue`, `alpha`, with or without `diffuse_` before | [`Rule::Mean`] |
    /// | lists | [`Rule::Nearest`] |
    /// | others of `float` and `double` | [`Rule::Mean`] |
    /// | others | [`Rule::Majority`] |
    ///
    /// # Errors
    ///
    /// A property that is not as long as there are vertices.
    pub fn new(vertices: usize, properties: Vec<Property>) -> Result<Self, AttributeError> {
        if let Some(p) = properties.iter().find(|p| p.records() != vertices) {
            return Err(AttributeError::Length {
                name: p.name.clone(),
                records: p.records(),
                vertices,
            });
        }
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
                _ if p.values.scalar_type().is_integer() => Rule::Majority,
                _ => Rule::Mean,
            }
        };
        let rules = properties.iter().map(rule).collect();
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

    /// The properties themselves.
    pub fn into_properties(self) -> Vec<Property> {
        self.properties
    }

    /// The properties of vertices made of these.
    ///
    /// Copies keep their bits.
    ///
    /// # Panics
    ///
    /// If a source names a vertex that is not there.
    pub fn derive(&self, sources: &[Source]) -> Self {
        let mut made: Vec<Property> = self.properties.iter().map(|p| nearest(p, sources)).collect();
        for (k, source) in sources.iter().enumerate() {
            let Source::Blend(parts) = source else { continue };
            let total: Real = parts.iter().map(|p| p.1).sum();
            if total.is_nan() || total <= 0.0 {
                continue;
            }
            for (p, rule) in self.rules.iter().enumerate() {
                let old = |v: u32| get(&self.properties[p].values, v as usize);
                let value = match rule {
                    Rule::Mean | Rule::Normal => {
                        parts.iter().map(|&(v, w)| w * old(v)).sum::<Real>() / total
                    }
                    Rule::Majority => {
                        let value = majority(parts.iter().map(|&(v, w)| (old(v), w)));
                        // Its own bits: a real number does not hold all of 64.
                        if let Some((v, _)) = parts.iter().find(|(v, _)| old(*v) == value) {
                            copy(&self.properties[p].values, *v as usize, &mut made[p].values, k);
                        }
                        continue;
                    }
                    Rule::Skinning | Rule::Nearest => continue,
                };
                set(&mut made[p].values, k, value);
            }
            self.normalise(&mut made, k);
            self.skin(&mut made, k, source);
        }
        Self { vertices: sources.len(), properties: made, rules: self.rules.clone() }
    }

    /// Gives the normal of record `k` the length 1.
    fn normalise(&self, made: &mut [Property], k: usize) {
        let axes: Vec<usize> = (0..made.len()).filter(|p| self.rules[*p] == Rule::Normal).collect();
        let length = axes.iter().map(|&p| get(&made[p].values, k).powi(2)).sum::<Real>().sqrt();
        if length > 0.0 {
            axes.iter().for_each(|&p| {
                let value = get(&made[p].values, k) / length;
                set(&mut made[p].values, k, value);
            });
        }
    }

    /// Joints and weights of record `k`.
    fn skin(&self, made: &mut [Property], k: usize, source: &Source) {
        let column = |name: String| made.iter().position(|p| p.name == name && p.lists.is_none());
        let slot = |k: usize| Some((column(format!("j{k}"))?, column(format!("w{k}"))?));
        let slots: Vec<(usize, usize)> = (0..)
            .map_while(slot)
            .take_while(|s| self.rules[s.0] == Rule::Skinning && self.rules[s.1] == Rule::Skinning)
            .collect();
        if slots.is_empty() {
            return;
        }
        let mut united: Vec<(Real, Real)> = Vec::new();
        for (v, weight) in source.parts() {
            for &(j, w) in &slots {
                let joint = get(&self.properties[j].values, v as usize);
                let share = weight * get(&self.properties[w].values, v as usize);
                match united.iter_mut().find(|u| u.0 == joint) {
                    Some(u) => u.1 += share,
                    None => united.push((joint, share)),
                }
            }
        }
        united.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.total_cmp(&b.0)));
        let all: Real = united.iter().map(|u| u.1).sum();
        united.truncate(slots.len());
        let total: Real = united.iter().map(|u| u.1).sum();
        if total.is_nan() || total <= 0.0 {
            return; // nothing holds this vertex: the copy of the nearest stays
        }
        // Whole numbers stand for shares of their sum, 255 or 65535 as a rule; what rounding takes
        // from it or adds the largest gets.
        let whole =
            slots.iter().all(|s| !matches!(made[s.1].values, Column::F32(_) | Column::F64(_)));
        let of_all: Real = source.parts().iter().map(|(_, weight)| weight).sum();
        let sum = if whole { (all / of_all).round() } else { 1.0 };
        let mut shares: Vec<Real> = united.iter().map(|u| u.1 / total * sum).collect();
        if whole {
            shares.iter_mut().for_each(|s| *s = s.round());
            shares[0] += sum - shares.iter().sum::<Real>();
        }
        for (n, &(j, w)) in slots.iter().enumerate() {
            set(&mut made[j].values, k, united.get(n).unwrap_or(&united[0]).0);
            set(&mut made[w].values, k, shares.get(n).copied().unwrap_or(0.0));
        }
    }
}

/// The value with most weight.
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

fn get(column: &Column, k: usize) -> Real {
    with_column!(column, v => v[k] as Real)
}

/// Copies an entry to that of another column of the same type.
fn copy(from: &Column, v: usize, to: &mut Column, k: usize) {
    match (from, to) {
        (Column::I64(a), Column::I64(b)) => b[k] = a[v],
        (Column::U64(a), Column::U64(b)) => b[k] = a[v],
        // All others are real numbers.
        (from, to) => set(to, k, get(from, v)),
    }
}

/// Writes a number: rounded for whole types, which also saturate.
fn set(column: &mut Column, k: usize, value: Real) {
    match column {
        Column::F32(v) => v[k] = value as f32,
        Column::F64(v) => v[k] = value,
        Column::I8(v) => v[k] = value.round() as i8,
        Column::U8(v) => v[k] = value.round() as u8,
        Column::I16(v) => v[k] = value.round() as i16,
        Column::U16(v) => v[k] = value.round() as u16,
        Column::I32(v) => v[k] = value.round() as i32,
        Column::U32(v) => v[k] = value.round() as u32,
        Column::I64(v) => v[k] = value.round() as i64,
        Column::U64(v) => v[k] = value.round() as u64,
    }
}

/// The property with the record of the vertex that counts most.
fn nearest(property: &Property, sources: &[Source]) -> Property {
    let mut lists = property.lists.as_ref().map(|_| vec![0u32]);
    let mut picked = Vec::with_capacity(sources.len());
    for source in sources {
        picked.extend(property.range(source.nearest() as usize));
        if let Some(lists) = &mut lists {
            lists.push(picked.len() as u32);
        }
    }
    fn pick<T: Copy>(from: &[T], picked: &[usize]) -> Vec<T> {
        picked.iter().map(|&k| from[k]).collect()
    }
    let values = match &property.values {
        Column::I8(v) => Column::I8(pick(v, &picked)),
        Column::U8(v) => Column::U8(pick(v, &picked)),
        Column::I16(v) => Column::I16(pick(v, &picked)),
        Column::U16(v) => Column::U16(pick(v, &picked)),
        Column::I32(v) => Column::I32(pick(v, &picked)),
        Column::U32(v) => Column::U32(pick(v, &picked)),
        Column::I64(v) => Column::I64(pick(v, &picked)),
        Column::U64(v) => Column::U64(pick(v, &picked)),
        Column::F32(v) => Column::F32(pick(v, &picked)),
        Column::F64(v) => Column::F64(pick(v, &picked)),
    };
    Property { name: property.name.clone(), values, lists }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn half(a: u32, b: u32) -> Source {
        Source::Blend(vec![(a, 0.5), (b, 0.5)])
    }

    #[test]
    fn colours_are_means_and_labels_are_not() {
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
    fn ids_of_64_bits_keep_them_where_the_majority_decides() {
        let id = (1i64 << 53) + 1;
        let made =
            VertexAttributes::new(3, vec![Property::new("id", Column::I64(vec![id, id, id]))])
                .unwrap();
        let made = made.derive(&[Source::Blend(vec![(0, 0.4), (1, 0.3), (2, 0.3)])]);
        assert_eq!(made.properties()[0].values, Column::I64(vec![id]));
    }

    #[test]
    fn whole_skinning_weights_keep_their_sum() {
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
        // 6: 127.5, 4: 64, 5: 63.5, of 255: two are rounded up, and the largest gives one back.
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
    fn skinning_is_united_cut_and_of_sum_one() {
        let properties = vec![
            Property::new("j0", Column::U8(vec![4, 9])),
            Property::new("j1", Column::U8(vec![5, 4])),
            Property::new("w0", Column::F32(vec![0.5, 0.75])),
            Property::new("w1", Column::F32(vec![0.5, 0.25])),
        ];
        let made =
            VertexAttributes::new(2, properties).unwrap().derive(&[half(0, 1), Source::Vertex(1)]);
        // 9: 0.375, 4: 0.25 + 0.125, 5: 0.25. The two heaviest stay, 4 before 9.
        assert_eq!(made.properties()[0].values, Column::U8(vec![4, 9]));
        assert_eq!(made.properties()[1].values, Column::U8(vec![9, 4]));
        assert_eq!(made.properties()[2].values, Column::F32(vec![0.5, 0.75]));
        assert_eq!(made.properties()[3].values, Column::F32(vec![0.5, 0.25]));
    }

    #[test]
    fn normals_have_length_one_and_lists_are_copied() {
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
    fn properties_of_another_length_are_refused() {
        let short = vec![Property::new("label", Column::U8(vec![1]))];
        let error = VertexAttributes::new(2, short).unwrap_err();
        assert_eq!(error, AttributeError::Length { name: "label".into(), records: 1, vertices: 2 });
        assert_eq!(VertexAttributes::none(0).derive(&[]).vertices(), 0);
    }
}
