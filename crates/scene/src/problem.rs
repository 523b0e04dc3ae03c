//! What is wrong with a scene, or merely worth saying.

/// Is the scene refused because of it?
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The scene cannot be built: exit code 4.
    Error,
    /// The scene was built; what was done about it is said in the message.
    Warning,
}

/// One finding of the check of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Refused or only said.
    pub severity: Severity,
    /// A short stable key of the kind of finding, such as `non-planar`.
    pub kind: &'static str,
    /// The surfaces (or the material) it is about, by name.
    pub names: Vec<String>,
    /// The number found, where there is one.
    pub found: Option<f64>,
    /// The number allowed, where there is one.
    pub allowed: Option<f64>,
    /// One line, lower case, without full stop: what, which, found, allowed.
    pub message: String,
}

/// The first few of some surfaces by name, and how many more there are.
pub(crate) fn named(surfaces: &[String]) -> String {
    const NAMED: usize = 8;
    let named = surfaces.iter().take(NAMED);
    let named: Vec<String> = named.map(|name| format!("'{name}'")).collect();
    let more = match surfaces.len().saturating_sub(NAMED) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    format!("{}{more}", named.join(", "))
}
