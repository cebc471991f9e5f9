//! Classes of garments, and which may be worn over which.

use serde::{Deserialize, Serialize};

/// The class of a garment.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum GarmentClass {
    /// Trousers and shorts.
    Legs,
    /// Skirts.
    Skirt,
    /// Dresses.
    Dress,
    /// Shirts, blouses, sweaters.
    Top,
    /// Cardigans, jackets, coats.
    Outer,
    /// Anything else: worn over and under everything.
    #[default]
    Other,
}

impl GarmentClass {
    /// Largest number of openings, those for head, limbs and trunk. Garments without sleeves, or open
    /// in front, have fewer. `None` if unknown.
    pub fn most_openings(self) -> Option<usize> {
        match self {
            Self::Skirt => Some(2),
            Self::Legs => Some(3),
            Self::Dress | Self::Top | Self::Outer => Some(4),
            Self::Other => None,
        }
    }

    /// Smallest number of openings: open in front, hem, front and neck or waist are one. `None` if unknown.
    pub fn least_openings(self) -> Option<usize> {
        match self {
            Self::Skirt => Some(1),
            Self::Legs | Self::Dress | Self::Top | Self::Outer => Some(3),
            Self::Other => None,
        }
    }
}

/// The layer of a garment. A hint: outfits may have any other order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LayerHint {
    /// Its class.
    pub class: GarmentClass,
    /// The order within its class, 0 innermost. Tops of order 2 and more hang over waistbands and are
    /// not tucked in.
    pub order: u8,
}

/// Words in names, with class and order. The first match counts, so that `suit_trousers` are trousers
/// and a `cardigan` is not a `coat`.
const WORDS: [(&str, GarmentClass, u8); 38] = [
    ("trousers", GarmentClass::Legs, 0),
    ("pants", GarmentClass::Legs, 0),
    ("jeans", GarmentClass::Legs, 0),
    ("leggings", GarmentClass::Legs, 0),
    ("tights", GarmentClass::Legs, 0),
    ("johns", GarmentClass::Legs, 0),
    ("shorts", GarmentClass::Legs, 0),
    ("skirt", GarmentClass::Skirt, 0),
    ("dress", GarmentClass::Dress, 0),
    ("gown", GarmentClass::Dress, 0),
    ("undershirt", GarmentClass::Top, 0),
    ("sweatshirt", GarmentClass::Top, 2),
    ("tshirt", GarmentClass::Top, 0),
    ("t-shirt", GarmentClass::Top, 0),
    ("tank", GarmentClass::Top, 0),
    ("tunic", GarmentClass::Top, 1),
    ("blouse", GarmentClass::Top, 1),
    ("shirt", GarmentClass::Top, 1),
    ("sweater", GarmentClass::Top, 2),
    ("pullover", GarmentClass::Top, 2),
    ("jumper", GarmentClass::Top, 2),
    ("turtleneck", GarmentClass::Top, 2),
    ("hoodie", GarmentClass::Top, 2),
    ("cardigan", GarmentClass::Outer, 0),
    ("vest", GarmentClass::Outer, 0),
    ("gilet", GarmentClass::Outer, 0),
    ("waistcoat", GarmentClass::Outer, 0),
    ("blazer", GarmentClass::Outer, 1),
    ("jacket", GarmentClass::Outer, 1),
    ("parka", GarmentClass::Outer, 2),
    ("coat", GarmentClass::Outer, 2),
    ("cape", GarmentClass::Outer, 3),
    ("cloak", GarmentClass::Outer, 3),
    ("poncho", GarmentClass::Outer, 3),
    ("longsleeve", GarmentClass::Top, 0),
    ("long-sleeve", GarmentClass::Top, 0),
    ("long_sleeve", GarmentClass::Top, 0),
    // As parsers of pictures call shirts and sweaters.
    ("upper", GarmentClass::Top, 1),
];

/// Words that are parts of others, and count alone, if none of the words above is in the name.
const WHOLE_WORDS: [(&str, GarmentClass, u8); 3] =
    [("tee", GarmentClass::Top, 0), ("top", GarmentClass::Top, 0), ("polo", GarmentClass::Top, 1)];

/// Words of tops that may be open in front.
const BUTTONED: [&str; 7] = ["tunic", "blouse", "shirt", "hoodie", "upper", "top", "polo"];

/// The word in an English name that determines its class.
fn word(name: &str) -> Option<&'static (&'static str, GarmentClass, u8)> {
    let name = name.to_ascii_lowercase();
    let is_word = |word| name.split(|c: char| !c.is_alphabetic()).any(|part| part == word);
    let found = WORDS.iter().find(|(word, ..)| name.contains(word));
    found.or_else(|| WHOLE_WORDS.iter().find(|(word, ..)| is_word(*word)))
}

/// Smallest number of openings of a garment of this name ([`GarmentClass::least_openings`]); of a T-shirt, which is
/// closed in front, all.
pub(crate) fn least_openings(name: &str) -> Option<usize> {
    let (word, class, _) = word(name)?;
    let is_closed = *class == GarmentClass::Top && !BUTTONED.contains(word);
    if is_closed { class.most_openings() } else { class.least_openings() }
}

impl LayerHint {
    /// The hint of an English name; [`GarmentClass::Other`] if no word matches.
    pub fn of_name(name: &str) -> Self {
        word(name)
            .map_or(Self::default(), |(_, class, order)| Self { class: *class, order: *order })
    }

    /// Whether a garment of hint `outer` may be worn over this one, directly or with layers between.
    pub(crate) fn may_be_under(&self, outer: &Self) -> bool {
        use GarmentClass::{Dress, Legs, Other, Outer, Skirt, Top};
        match (self.class, outer.class) {
            (Other, _) | (_, Other) => true,
            // One pair of trousers, one skirt or dress.
            (Legs, Legs) | (Skirt | Dress, Skirt | Dress) => false,
            // Skirts and dresses go over trousers, outer layers over all.
            (Skirt | Dress, Legs) | (Outer, Legs | Skirt | Dress | Top) => false,
            (Top, Top) | (Outer, Outer) => self.order < outer.order,
            // Thin tops can be tucked in.
            (Top, Legs | Skirt | Dress) => self.order < 2,
            (Legs | Skirt | Dress, Top)
            | (Legs, Skirt | Dress)
            | (Legs | Skirt | Dress | Top, Outer) => true,
        }
    }
}

/// Whether an outfit, inner to outer, is wearable: each garment may be worn under all that follow.
pub(crate) fn is_wearable(outfit: &[LayerHint]) -> bool {
    (1..outfit.len()).all(|k| outfit[..k].iter().all(|inner| inner.may_be_under(&outfit[k])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_determine_class_and_order() {
        let of = |name| (LayerHint::of_name(name).class, LayerHint::of_name(name).order);
        assert_eq!(of("a_suit_trousers"), (GarmentClass::Legs, 0));
        assert_eq!(of("suit_jacket"), (GarmentClass::Outer, 1));
        assert_eq!(of("TSHIRT"), (GarmentClass::Top, 0));
        assert_eq!(of("newton_shirt"), (GarmentClass::Top, 1));
        assert_eq!(of("flared_skirt"), (GarmentClass::Skirt, 0));
        assert_eq!(of("thing"), (GarmentClass::Other, 0));
        assert_eq!(
            (of("tee_m4"), of("Crop Top")),
            ((GarmentClass::Top, 0), (GarmentClass::Top, 0))
        );
        assert_eq!(
            (of("steel"), of("Upper-clothes").0),
            ((GarmentClass::Other, 0), GarmentClass::Top)
        );
        assert_eq!((of("long_johns").0, of("gilet").0), (GarmentClass::Legs, GarmentClass::Outer));
    }

    #[test]
    fn a_top_that_is_closed_in_front_has_four_openings() {
        let least = ["tshirt", "Sweater", "blouse", "coat", "skirt", "thing"].map(least_openings);
        assert_eq!(least, [Some(4), Some(4), Some(3), Some(3), Some(1), None]);
        assert_eq!(
            ["tee_m4", "jumper", "suit_shirt", "undershirt"].map(least_openings),
            [4, 4, 3, 4].map(Some)
        );
    }

    #[test]
    fn a_coat_goes_over_a_sweater_and_not_under_it() {
        let of = LayerHint::of_name;
        let wearable =
            |names: &[&str]| is_wearable(&names.iter().map(|n| of(n)).collect::<Vec<_>>());
        assert!(
            wearable(&["jeans", "tshirt", "sweater", "coat"]) && wearable(&["tshirt", "skirt"])
        );
        assert!(
            !wearable(&["coat", "sweater"])
                && !wearable(&["sweater", "jeans"])
                && !wearable(&["jeans", "trousers"])
        );
        assert!(
            !wearable(&["coat", "coat"]) && wearable(&["thing", "coat", "thing"]) && wearable(&[])
        );
    }
}
