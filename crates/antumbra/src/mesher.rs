//! placeholder until the cells branch lands
/// Mesh generators.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mesher {
    /// Ours.
    Discontinuity,
}
impl Mesher {
    /// All.
    pub const ALL: [Self; 1] = [Self::Discontinuity];
    /// Key.
    #[must_use]
    pub fn key(self) -> &'static str {
        "discontinuity"
    }
}

impl Mesher {
    /// From key.
    #[must_use]
    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.key() == key)
    }
}
impl std::fmt::Display for Mesher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.key())
    }
}
