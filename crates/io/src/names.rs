//! Names that are unique and stay the same from run to run.

use std::collections::{BTreeMap, BTreeSet};

/// Gives every face a name of its own: that of its group, numbered from 1 where
/// the group has several faces; `surface.1`, … without a group.
pub(crate) struct Namer {
    /// Faces of each group, and how many of them have a name already.
    groups: BTreeMap<Option<String>, (usize, usize)>,
    taken: Taken,
}

impl Namer {
    pub(crate) fn new<'a>(groups: impl Iterator<Item = Option<&'a str>>) -> Self {
        let mut counts: BTreeMap<Option<String>, (usize, usize)> = BTreeMap::new();
        for group in groups {
            counts.entry(group.map(str::to_owned)).or_default().0 += 1;
        }
        Self {
            groups: counts,
            taken: Taken::default(),
        }
    }

    pub(crate) fn next(&mut self, group: Option<&str>) -> String {
        let (n, named) = self.groups.entry(group.map(str::to_owned)).or_default();
        *named += 1;
        let name = match group {
            Some(group) if *n == 1 => group.to_owned(),
            _ => format!("{}.{named}", group.unwrap_or("surface")),
        };
        self.taken.unique(&name)
    }
}

/// Names that are in use.
#[derive(Default)]
pub(crate) struct Taken {
    names: BTreeSet<String>,
    /// The next suffix to try, so that a thousand equal names take a thousand steps.
    next: BTreeMap<String, usize>,
}

impl Taken {
    /// The name, or with `_2`, `_3`, … if it is in use.
    pub(crate) fn unique(&mut self, name: &str) -> String {
        let mut unique = name.to_owned();
        while !self.names.insert(unique.clone()) {
            let k = self.next.entry(name.to_owned()).or_insert(2);
            unique = format!("{name}_{k}");
            *k += 1;
        }
        unique
    }
}
