//! A part of a list, for one of several machines.

use std::ops::Range;
use std::str::FromStr;

/// `2/8`: the second of eight parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    /// From 1.
    number: usize,
    count: usize,
}

impl Shard {
    /// The items of this part: every `count`-th.
    pub(crate) fn of<T>(self, items: impl IntoIterator<Item = T>) -> Vec<T> {
        items.into_iter().skip(self.number - 1).step_by(self.count).collect()
    }

    /// The items of this part where neighbours belong together: one after the other.
    pub(crate) fn range(self, items: usize) -> Range<usize> {
        let bound = |part: usize| (part as u128 * items as u128 / self.count as u128) as usize;
        bound(self.number - 1)..bound(self.number)
    }

    /// `2-of-8`, a name for a file.
    pub(crate) fn name(self) -> String {
        format!("{}-of-{}", self.number, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (number, count) = text.split_once('/').unwrap_or(("", ""));
        match (number.trim().parse(), count.trim().parse()) {
            (Ok(number), Ok(count)) if (1..=count).contains(&number) => Ok(Self { number, count }),
            _ => Err("give the number of this part and how many there are, from 1/8 to 8/8".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_have_every_item_once() {
        let shard = |text: &str| text.parse::<Shard>();
        let mut all: Vec<usize> =
            (1..=3).flat_map(|k| shard(&format!("{k}/3")).unwrap().of(0..10)).collect();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..10));
        assert_eq!(shard("2/3").unwrap().of(0..10), [1, 4, 7]);
        assert!((1..=3).flat_map(|k| shard(&format!("{k}/3")).unwrap().range(10)).eq(0..10));
        assert_eq!(shard("2/3").unwrap().range(10), 3..6);
        assert!(shard("1/3").unwrap().range(2).is_empty());
        assert!(shard("3/3").unwrap().of(0..2).is_empty());
        for text in ["", "1", "0/3", "4/3", "0/0", "-1/3", "1/3/5", "a/b"] {
            assert!(shard(text).is_err(), "{text}");
        }
    }
}
