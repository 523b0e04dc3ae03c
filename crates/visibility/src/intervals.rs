//! Sets of disjoint intervals on a line.

/// Disjoint closed intervals in ascending order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Intervals(Vec<(f64, f64)>);

impl Intervals {
    pub(crate) fn one(from: f64, to: f64) -> Self {
        if from < to {
            Self(vec![(from, to)])
        } else {
            Self::default()
        }
    }

    pub(crate) fn from_sorted(intervals: Vec<(f64, f64)>) -> Self {
        Self(intervals)
    }

    /// The union of intervals in any order.
    pub(crate) fn union(mut intervals: Vec<(f64, f64)>) -> Self {
        intervals.sort_by(|x, y| x.0.total_cmp(&y.0));
        let mut merged: Vec<(f64, f64)> = Vec::new();
        for (from, to) in intervals {
            match merged.last_mut() {
                Some(last) if last.1 >= from => last.1 = last.1.max(to),
                _ => merged.push((from, to)),
            }
        }
        Self(merged)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.0.iter().copied()
    }

    /// Removes the open interval `from..to`.
    pub(crate) fn subtract(&mut self, from: f64, to: f64) {
        if from >= to || !self.0.iter().any(|&(a, b)| a < to && b > from) {
            return;
        }
        let mut rest = Vec::with_capacity(self.0.len() + 1);
        for &(a, b) in &self.0 {
            if b <= from || a >= to {
                rest.push((a, b));
                continue;
            }
            if a < from {
                rest.push((a, from));
            }
            if b > to {
                rest.push((to, b));
            }
        }
        self.0 = rest;
    }

    /// What lies in both.
    pub(crate) fn intersect(&self, other: &Self) -> Self {
        let mut both = Vec::new();
        for &(a, b) in &self.0 {
            for &(c, d) in &other.0 {
                let (from, to) = (a.max(c), b.min(d));
                if from < to {
                    both.push((from, to));
                }
            }
        }
        Self(both)
    }

    /// Drops what is shorter than `length`.
    pub(crate) fn drop_shorter(&mut self, length: f64) {
        self.0.retain(|&(a, b)| b - a > length);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subtraction_keeps_both_ends() {
        let mut set = Intervals::one(0.0, 10.0);
        set.subtract(2.0, 3.0);
        set.subtract(-5.0, 0.5);
        set.subtract(9.0, 12.0);
        assert_eq!(set, Intervals(vec![(0.5, 2.0), (3.0, 9.0)]));
        assert_eq!(
            set.intersect(&Intervals::one(1.0, 4.0)),
            Intervals(vec![(1.0, 2.0), (3.0, 4.0)])
        );
    }
}
