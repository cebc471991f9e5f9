//! Disjoint sets that are joined.

/// Disjoint sets of the numbers from 0, each named by its smallest member, whatever the order of joining.
///
/// # Source
///
/// [Galler and Fischer 1964], with path halving [Tarjan and van Leeuwen 1984].
///
/// # Examples
///
/// ```
/// let mut sets = if_core::union_find::UnionFind::new(4);
/// sets.join(3, 1);
/// sets.join(3, 2);
/// assert_eq!((0..4).map(|k| sets.first(k)).collect::<Vec<_>>(), [0, 1, 1, 1]);
/// assert_eq!(sets.count(), 2);
/// ```
#[derive(Clone, Debug, Default)]
pub struct UnionFind {
    /// A smaller member of the same set; of the smallest one itself.
    smaller: Vec<u32>,
}

impl UnionFind {
    /// `len` sets of one number each.
    pub fn new(len: usize) -> Self {
        let mut sets = Self::default();
        sets.reset(len);
        sets
    }

    /// Makes it `len` sets of one number each, in the same memory.
    pub fn reset(&mut self, len: usize) {
        self.smaller.clear();
        self.smaller.extend(0..len as u32);
    }

    /// The smallest member of the set of `k`.
    ///
    /// # Panics
    ///
    /// If there is no `k`.
    pub fn first(&mut self, mut k: u32) -> u32 {
        let smaller = &mut self.smaller;
        while smaller[k as usize] != k {
            let next = smaller[smaller[k as usize] as usize];
            smaller[k as usize] = next;
            k = next;
        }
        k
    }

    /// Joins the sets of `a` and `b`.
    ///
    /// # Panics
    ///
    /// If one of them does not exist.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.first(a), self.first(b));
        self.smaller[a.max(b) as usize] = a.min(b);
    }

    /// For each number the smallest member of its set.
    pub fn into_firsts(mut self) -> Vec<u32> {
        // Smaller numbers lead to theirs already.
        for k in 0..self.smaller.len() {
            self.smaller[k] = self.smaller[self.smaller[k] as usize];
        }
        self.smaller
    }

    /// Number of sets.
    pub fn count(&self) -> usize {
        (0..).zip(&self.smaller).filter(|(k, smaller)| k == *smaller).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_named_by_their_smallest_member_in_any_order() {
        let mut joined: Vec<[u32; 2]> =
            (0..300u32).map(|k| [k * 37 % 101, (k * 53 + 7) % 101 / 3]).collect();
        joined.retain(|[a, b]| a % 4 == b % 4);
        // Each number takes the smallest name around it until nothing changes.
        let mut expected: Vec<u32> = (0..101).collect();
        for _ in 0..101 {
            for [a, b] in joined.iter().map(|pair| pair.map(|k| k as usize)) {
                let least = expected[a].min(expected[b]);
                (expected[a], expected[b]) = (least, least);
            }
        }
        for _ in 0..2 {
            let mut sets = UnionFind::new(3);
            sets.reset(101);
            joined.iter().for_each(|[a, b]| sets.join(*a, *b));
            let firsts: Vec<u32> = (0..101).map(|k| sets.first(k)).collect();
            assert_eq!(firsts, expected);
            let distinct: std::collections::BTreeSet<u32> = firsts.iter().copied().collect();
            assert!(distinct.len() > 4 && sets.count() == distinct.len());
            assert_eq!(sets.into_firsts(), expected);
            joined.reverse();
        }
        assert_eq!(UnionFind::default().count(), 0);
    }
}
