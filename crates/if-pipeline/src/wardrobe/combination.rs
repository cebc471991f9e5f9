//! Combinations of garments and bodies: listed, or drawn at random.

use super::{Wardrobe, WardrobeError};
use crate::asset::{AssetInfo, LayerHint, check_name, is_wearable};
use if_core::parameter::ParameterError;
use if_core::random::SplitMix64;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Garments on a body.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Combination {
    /// The body's name.
    pub body: String,
    /// The garments' names, inner to outer.
    pub garments: Vec<String>,
}

impl std::fmt::Display for Combination {
    /// `jeans < tshirt on anna`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} on {}", self.garments.join(" < "), self.body)
    }
}

impl Combination {
    /// Checks that names are valid, and that there is at least one garment and none twice.
    ///
    /// # Errors
    ///
    /// The first violation.
    pub fn check(&self) -> Result<(), WardrobeError> {
        self.check_names()?;
        let names = &self.garments;
        if names.is_empty() {
            return Err(WardrobeError::NoGarments { body: self.body.clone() });
        }
        match (1..names.len()).find(|k| names[..*k].contains(&names[*k])) {
            Some(k) => Err(WardrobeError::Twice { name: names[k].clone() }),
            None => Ok(()),
        }
    }

    /// Checks that all names are valid ([`check_name`]).
    ///
    /// # Errors
    ///
    /// The first invalid name.
    pub fn check_names(&self) -> Result<(), WardrobeError> {
        Ok(std::iter::once(&self.body)
            .chain(&self.garments)
            .try_for_each(|name| check_name(name))?)
    }
}

/// A list of combinations, as in a file:
///
/// ```toml
/// [[outfit]]
/// body = "anna"
/// garments = ["jeans", "tshirt", "coat"] # inner to outer
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Combinations {
    /// The combinations, in order.
    pub outfit: Vec<Combination>,
}

/// The order of garments in random combinations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// Wearable by their layer hints: a coat over a sweater, one pair of trousers.
    #[default]
    Worn,
    /// Any order: a coat below a T-shirt, two pairs of trousers.
    Any,
}

/// Parameters of [`random`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RandomParams {
    /// Number of combinations.
    pub count: usize,
    /// Random seed.
    pub seed: u64,
    /// Least number of garments.
    pub least: usize,
    /// Largest number of garments.
    pub most: usize,
    /// The order.
    pub order: Order,
    /// The bodies, used in turn; empty for all.
    pub bodies: Vec<String>,
}

impl Default for RandomParams {
    fn default() -> Self {
        Self { count: 200, seed: 1, least: 2, most: 4, order: Order::Worn, bodies: Vec::new() }
    }
}

/// Most combinations that are drawn: all that are listed lie in memory.
const MOST: usize = 1_000_000;

/// Draws distinct combinations. The number of garments is drawn first, so that all numbers are
/// equally frequent.
///
/// # Errors
///
/// A body is missing, the range is empty, more than a million combinations are asked for, or there are too few.
pub fn random(
    wardrobe: &Wardrobe,
    params: &RandomParams,
) -> Result<Vec<Combination>, WardrobeError> {
    let RandomParams { count, least, most, .. } = *params;
    let range = "at most a million combinations";
    ParameterError::check("count", count as f64, count <= MOST, range)?;
    if least < 1 || least > most {
        return Err(WardrobeError::Sizes { least, most });
    }
    let bodies: Vec<String> = if params.bodies.is_empty() {
        wardrobe.bodies().keys().cloned().collect()
    } else {
        params.bodies.clone()
    };
    for body in &bodies {
        wardrobe.body_info(body)?;
    }
    // Garments whose body was replaced cannot be used.
    let has_body =
        |(name, info): &(&String, &AssetInfo)| wardrobe.body_like(name, &info.body).is_ok();
    let garments: Vec<(&String, LayerHint)> = wardrobe
        .garments()
        .iter()
        .filter(has_body)
        .map(|(name, info)| (name, info.layer))
        .collect();
    let mut random = SplitMix64::new(params.seed);
    let mut seen = BTreeSet::new();
    let mut found: Vec<Combination> = Vec::new();
    // About one draw of four garments in a hundred is wearable. After so many unsuccessful draws
    // there is probably no new combination.
    const PATIENCE: usize = 20_000;
    let mut vain = 0;
    let mut deck: Vec<usize> = (0..garments.len()).collect();
    let mut swaps = Vec::new();
    while found.len() < count && vain < PATIENCE && !bodies.is_empty() {
        vain += 1;
        let size = least + random.below(most - least + 1);
        if size > garments.len() {
            continue;
        }
        // The first `size` places of a shuffle of a sorted deck.
        swaps.drain(..).rev().for_each(|(k, other)| deck.swap(k, other));
        for k in 0..size {
            let other = k + random.below(deck.len() - k);
            deck.swap(k, other);
            swaps.push((k, other));
        }
        let drawn = &deck[..size];
        let hints: Vec<LayerHint> = drawn.iter().map(|g| garments[*g].1).collect();
        if params.order == Order::Worn && !is_wearable(&hints) {
            continue;
        }
        let combination = Combination {
            body: bodies[found.len() % bodies.len()].clone(),
            garments: drawn.iter().map(|g| garments[*g].0.clone()).collect(),
        };
        if seen.insert(combination.clone()) {
            found.push(combination);
            vain = 0;
        }
    }
    if found.len() < count {
        return Err(WardrobeError::TooFew { found: found.len(), count, least, most });
    }
    Ok(found)
}
