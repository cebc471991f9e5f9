//! Colouring of constraints, so that within a colour no two of them share a vertex.
//!
//! Colours are for speed on one thread: consecutive visits of a sweep never wait for a position
//! that was just written, and several of them fit into one SIMD register. The order depends on the
//! input alone.

/// An order of visiting constraints, colour by colour.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coloring {
    /// Numbers of the constraints in the order of visiting.
    pub order: Vec<u32>,
    /// Where each colour starts in `order`, and where the last one ends.
    pub starts: Vec<u32>,
}

impl Coloring {
    /// The ranges of `order`, one for each colour.
    pub fn ranges(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        self.starts.windows(2).map(|w| w[0] as usize..w[1] as usize)
    }
}

/// Greedy colouring: each tuple, by smallest vertex and then in the order given, gets the smallest
/// colour that none of its vertices has yet. Within a colour the order is kept, so that positions
/// are read forwards. (Colouring block by block for the nearest cache gained nothing up to 360,000
/// vertices.)
///
/// A vertex of valence `d` in tuples of `K` vertices forces at most `K (d − 1) + 1` colours.
///
/// # Panics
///
/// If a tuple names a vertex that is not below `vertex_count`.
pub fn color<const K: usize>(tuples: &[[u32; K]], vertex_count: usize) -> Coloring {
    let smallest = |t: u32| tuples[t as usize].iter().copied().min().unwrap_or(0);
    let mut order: Vec<u32> = (0..tuples.len() as u32).collect();
    order.sort_by_key(|&t| smallest(t));
    let mut uncolored = order.clone();
    let mut used = vec![0u64; vertex_count];
    let mut color_of = vec![0u32; tuples.len()];
    let mut base = 0;
    // 64 colours at a time: tuples without a free colour wait for the next word.
    while !uncolored.is_empty() {
        used.fill(0);
        uncolored.retain(|&t| {
            let tuple = &tuples[t as usize];
            let taken = tuple.iter().fold(0, |m, &v| m | used[v as usize]);
            if taken == u64::MAX {
                return true;
            }
            let c = taken.trailing_ones();
            color_of[t as usize] = base + c;
            for &v in tuple {
                used[v as usize] |= 1 << c;
            }
            false
        });
        base += 64;
    }
    order.sort_by_key(|&t| color_of[t as usize]);
    let mut starts = vec![0];
    for same in order.chunk_by(|&s, &t| color_of[s as usize] == color_of[t as usize]) {
        starts.push(starts[starts.len() - 1] + same.len() as u32);
    }
    Coloring { order, starts }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn check<const K: usize>(tuples: &[[u32; K]], vertices: usize) -> Coloring {
        let coloring = color(tuples, vertices);
        let mut seen = BTreeSet::new();
        for range in coloring.ranges() {
            let mut touched = BTreeSet::new();
            for &t in &coloring.order[range] {
                assert!(seen.insert(t));
                let tuple: BTreeSet<u32> = tuples[t as usize].into_iter().collect();
                for v in tuple {
                    assert!(touched.insert(v), "vertex {v} twice in a colour");
                }
            }
        }
        assert_eq!(seen.len(), tuples.len());
        coloring
    }

    #[test]
    fn no_colour_touches_a_vertex_twice() {
        let n = 12u32;
        let mut edges = Vec::new();
        for j in 0..n {
            for i in 0..n {
                let v = j * n + i;
                if i + 1 < n {
                    edges.push([v, v + 1]);
                }
                if j + 1 < n {
                    edges.push([v, v + n]);
                }
                if i + 1 < n && j + 1 < n {
                    edges.push([v, v + n + 1]);
                }
            }
        }
        let coloring = check(&edges, (n * n) as usize);
        assert!(coloring.ranges().count() <= 11, "{}", coloring.ranges().count());
        assert_eq!(coloring, color(&edges, (n * n) as usize));
    }

    #[test]
    fn a_star_of_two_hundred_edges_needs_two_hundred_colours() {
        let star: Vec<[u32; 2]> = (1..=200).map(|k| [0, k]).collect();
        assert_eq!(check(&star, 201).ranges().count(), 200);
    }

    #[test]
    fn nothing_has_no_colour_and_a_repeated_vertex_is_harmless() {
        assert_eq!(color::<2>(&[], 0).ranges().count(), 0);
        assert_eq!(check(&[[0, 0, 1], [2, 2, 2]], 3).ranges().count(), 1);
    }
}
