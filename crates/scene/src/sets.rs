//! What hangs together: disjoint sets of numbers.
//!
//! # Source
//!
//! Tarjan & van Leeuwen 1984, with paths halved.

/// Disjoint sets of numbers, each known by its smallest.
pub(crate) struct Sets(Vec<usize>);

impl Sets {
    /// `n` sets of one number each.
    pub(crate) fn new(n: usize) -> Self {
        Self((0..n).collect())
    }

    /// The smallest number of the set that has this one.
    pub(crate) fn first_of(&mut self, mut i: usize) -> usize {
        while self.0[i] != i {
            self.0[i] = self.0[self.0[i]];
            i = self.0[i];
        }
        i
    }

    /// Makes one set of those that have these numbers.
    pub(crate) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.first_of(a), self.first_of(b));
        self.0[a.max(b)] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_sets_are_known_by_the_smallest_number() {
        let mut sets = Sets::new(6);
        for (a, b) in [(4, 5), (3, 1), (5, 3)] {
            sets.join(a, b);
        }
        let firsts: Vec<usize> = (0..6).map(|i| sets.first_of(i)).collect();
        assert_eq!(firsts, [0, 1, 2, 1, 1, 1]);
    }
}
