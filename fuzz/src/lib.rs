//! What the fuzz targets share: the laws of readers, and inputs made of bytes.

pub mod adversary;
pub mod readers;

/// Bytes as choices: the same bytes make the same choices, and a changed byte changes
/// few of them. When they have run out, every choice is the first.
#[derive(Debug)]
pub struct Choices<'a>(&'a [u8]);

impl<'a> Choices<'a> {
    /// The choices that the bytes make.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    /// Are there bytes left?
    #[must_use]
    pub fn are_left(&self) -> bool {
        !self.0.is_empty()
    }

    /// From 0 to `n - 1`, for `n` up to 256.
    pub fn below(&mut self, n: usize) -> usize {
        let Some((&byte, rest)) = self.0.split_first() else {
            return 0;
        };
        self.0 = rest;
        usize::from(byte) % n
    }

    /// One of some.
    pub fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }
}
