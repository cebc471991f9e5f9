//! Lists of items, one for each row, in contiguous memory (compressed sparse rows).

/// For each row, a list of items: the neighbours of each vertex, the entries of a sparse matrix.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows<T> {
    start: Vec<u32>,
    items: Vec<T>,
}

impl<T: Copy + Default> Rows<T> {
    /// `rows` rows with the items of `pairs` of (row, item). In a row, items keep the order of
    /// `pairs`, which is iterated twice.
    ///
    /// # Panics
    ///
    /// If a row is not below `rows`, or if there are 2³² items or more.
    pub fn new(rows: usize, pairs: impl Iterator<Item = (u32, T)> + Clone) -> Self {
        let mut start = vec![0_u32; rows + 1];
        pairs.clone().for_each(|(row, _)| start[row as usize + 1] += 1);
        for row in 0..rows {
            start[row + 1] = start[row].checked_add(start[row + 1]).expect("fewer than 2³² items");
        }
        let mut next = start.clone();
        let mut items = vec![T::default(); start[rows] as usize];
        pairs.for_each(|(row, item)| {
            let at = &mut next[row as usize];
            items[*at as usize] = item;
            *at += 1;
        });
        Self { start, items }
    }
}

impl<T> Rows<T> {
    /// The items of `row`.
    ///
    /// # Panics
    ///
    /// If `row` is out of range.
    #[inline]
    pub fn of(&self, row: usize) -> &[T] {
        &self.items[self.start[row] as usize..self.start[row + 1] as usize]
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.start.len().saturating_sub(1)
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_of_a_row_keep_their_order() {
        let pairs = [(2, 'a'), (0, 'b'), (2, 'c'), (3, 'd'), (2, 'a')];
        let rows = Rows::new(5, pairs.into_iter());
        let lists: Vec<&[char]> = (0..rows.len()).map(|row| rows.of(row)).collect();
        assert_eq!(lists, [&['b'][..], &[], &['a', 'c', 'a'], &['d'], &[]]);
        let none = Rows::<u8>::new(0, std::iter::empty());
        assert!(none.is_empty() && Rows::<u8>::default().is_empty() && !rows.is_empty());
    }
}
