//! Sets of curves, stored once each.

use std::collections::HashMap;
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};

use smallvec::SmallVec;

/// A set in a [`CurveSets`]; equal ids mean equal sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SetId(pub u32);

/// Sets of curve ids, interned: equal sets have one id.
#[derive(Clone, Debug, Default)]
pub struct CurveSets {
    /// The members of all sets, one set after the other.
    members: Vec<u32>,
    /// Where each set ends in `members`.
    ends: Vec<usize>,
    /// Sets by the hash of their members. For lookup only.
    by_hash: HashMap<u64, SmallVec<[u32; 1]>>,
}

impl CurveSets {
    /// The curves of a set: ascending, each once.
    ///
    /// # Panics
    ///
    /// If `id` comes from another `CurveSets`.
    #[must_use]
    pub fn get(&self, id: SetId) -> &[u32] {
        let i = id.0 as usize;
        let start = if i == 0 { 0 } else { self.ends[i - 1] };
        &self.members[start..self.ends[i]]
    }

    /// How many different sets there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Is there no set at all?
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The id of the set of these curves, in any order, with or without repetitions.
    pub fn intern(&mut self, curves: &[u32]) -> SetId {
        if curves.is_sorted_by(|a, b| a < b) {
            return self.intern_sorted(curves);
        }
        let mut sorted = curves.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        self.intern_sorted(&sorted)
    }

    /// The id of the union of some sets.
    pub fn union(&mut self, sets: &[SetId]) -> SetId {
        if let [only] = sets {
            return *only;
        }
        let curves: Vec<u32> = sets.iter().flat_map(|&s| self.get(s)).copied().collect();
        self.intern(&curves)
    }

    fn intern_sorted(&mut self, curves: &[u32]) -> SetId {
        let hash = BuildHasherDefault::<DefaultHasher>::default().hash_one(curves);
        let same_hash = self.by_hash.get(&hash).cloned().unwrap_or_default();
        if let Some(&found) = same_hash.iter().find(|&&s| self.get(SetId(s)) == curves) {
            return SetId(found);
        }
        let id = self.ends.len() as u32;
        self.members.extend_from_slice(curves);
        self.ends.push(self.members.len());
        self.by_hash.entry(hash).or_default().push(id);
        SetId(id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_sets_have_one_id_whatever_the_order() {
        let mut sets = CurveSets::default();
        let a = sets.intern(&[3, 1, 3]);
        assert_eq!(a, sets.intern(&[1, 3]));
        let b = sets.intern(&[2]);
        assert_ne!(a, b);
        let both = sets.union(&[a, b]);
        assert_eq!(sets.get(both), [1, 2, 3]);
        assert_eq!(sets.len(), 3);
    }
}
