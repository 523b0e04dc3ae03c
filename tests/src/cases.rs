//! Cases with known answers: `fixtures/validation`, one JSON file a case.

use antumbra::io::scene_file;
use antumbra::{Scene, SceneInput};
use glam::DVec3;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Where a value is asked for.
#[derive(Clone, Debug, PartialEq)]
pub enum Probe {
    /// On a surface, by name.
    Surface(String, DVec3),
    /// A free sensor with its normal.
    Free(DVec3, DVec3),
}

/// A case: a scene, points and what is known at them.
#[derive(Clone, Debug)]
pub struct Case {
    /// File name without extension.
    pub id: String,
    /// `irradiance` or `radiosity`.
    pub kind: String,
    /// The scene.
    pub scene: SceneInput,
    /// Where values are known.
    pub points: Vec<Probe>,
    /// Known direct irradiance in the first band, or total irradiance if the
    /// kind is `radiosity`.
    pub values: Vec<f64>,
    /// Allowed error of exact values, relative to the largest.
    pub atol_exact: f64,
    /// Tolerances to mesh with.
    pub tolerances: Vec<f64>,
    /// Fraction of the points that lie nearer to a jump than a mesh resolves.
    pub wrong_side_fraction: f64,
    /// Allowed error of total irradiance, relative to the largest.
    pub rtol: f64,
}

#[derive(Deserialize)]
struct CaseFile {
    kind: String,
    scene: serde_json::Value,
    points: Vec<Vec<serde_json::Value>>,
    #[serde(default)]
    direct: Vec<f64>,
    #[serde(default)]
    irradiance: Vec<f64>,
    #[serde(default = "default_atol")]
    atol_exact: f64,
    #[serde(default)]
    tolerances: Vec<f64>,
    #[serde(default)]
    wrong_side_fraction: f64,
    #[serde(default)]
    rtol: f64,
}

fn default_atol() -> f64 {
    1e-9
}

/// The folder of all fixtures.
#[must_use]
pub fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures")
}

/// All cases of a folder of `fixtures/validation`, by name.
///
/// # Panics
///
/// If the folder holds no case, or a file is none.
#[must_use]
pub fn folder(name: &str) -> Vec<Case> {
    let mut cases: Vec<Case> = json_files(&fixtures().join("validation").join(name))
        .iter()
        .map(|path| read_case(path))
        .collect();
    cases.sort_by(|a, b| a.id.cmp(&b.id));
    assert!(!cases.is_empty(), "no case in fixtures/validation/{name}");
    cases
}

/// The JSON files of a folder, sorted.
///
/// # Panics
///
/// If there is no such folder.
#[must_use]
pub fn json_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "json"))
        .collect();
    files.sort();
    files
}

/// The scene of a fixture, by its path inside `fixtures` without extension.
///
/// # Panics
///
/// If it is missing or cannot be read.
#[must_use]
pub fn fixture(path: &str) -> SceneInput {
    let path = fixtures().join(format!("{path}.json"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    scene_file::read(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Builds a scene that is known to be valid.
///
/// # Panics
///
/// With all problems, if it is not.
#[must_use]
pub fn build(input: &SceneInput) -> Scene {
    match Scene::build(input) {
        Ok(built) => built.scene,
        Err(problems) => {
            let messages: Vec<String> = problems.into_iter().map(|p| p.message).collect();
            panic!("the scene is refused:\n  {}", messages.join("\n  "))
        }
    }
}

fn read_case(path: &Path) -> Case {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let file: CaseFile =
        serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let scene = scene_file::read(&file.scene.to_string())
        .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let points = file.points.iter().map(|p| read_point(p)).collect();
    let values = if file.kind == "radiosity" {
        file.irradiance
    } else {
        file.direct
    };
    Case {
        id: path
            .file_stem()
            .map_or_else(String::new, |s| s.to_string_lossy().into_owned()),
        kind: file.kind,
        scene,
        points,
        values,
        atol_exact: file.atol_exact,
        tolerances: file.tolerances,
        wrong_side_fraction: file.wrong_side_fraction,
        rtol: file.rtol,
    }
}

fn read_point(fields: &[serde_json::Value]) -> Probe {
    let number = |i: usize| -> f64 {
        fields[i]
            .as_f64()
            .unwrap_or_else(|| panic!("a coordinate is no number: {}", fields[i]))
    };
    let vector = |i: usize| DVec3::new(number(i), number(i + 1), number(i + 2));
    let surface = fields[0].as_str().unwrap_or_default();
    if surface.is_empty() {
        Probe::Free(vector(1), vector(4))
    } else {
        Probe::Surface(surface.to_owned(), vector(1))
    }
}

/// A case of form factors between surfaces.
#[derive(Clone, Debug)]
pub struct FactorCase {
    /// File name without extension.
    pub id: String,
    /// The scene.
    pub scene: SceneInput,
    /// Names of surfaces, the order of `factors`.
    pub names: Vec<String>,
    /// The factor from the first index to the second, where it is known.
    pub factors: Vec<Vec<Option<f64>>>,
    /// Allowed error, absolute.
    pub atol: f64,
}

#[derive(Deserialize)]
struct FactorCaseFile {
    scene: serde_json::Value,
    names: Vec<String>,
    #[serde(rename = "F")]
    factors: Vec<Vec<Option<f64>>>,
    atol: f64,
}

/// The cases of `fixtures/validation/factors`, by name.
///
/// # Panics
///
/// If there is none, or a file is none.
#[must_use]
pub fn factor_cases() -> Vec<FactorCase> {
    let files = json_files(&fixtures().join("validation/factors"));
    assert!(!files.is_empty(), "no case in fixtures/validation/factors");
    files.iter().map(|path| read_factor_case(path)).collect()
}

fn read_factor_case(path: &Path) -> FactorCase {
    let fail = |e: String| -> ! { panic!("{}: {e}", path.display()) };
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| fail(e.to_string()));
    let file: FactorCaseFile = serde_json::from_str(&text).unwrap_or_else(|e| fail(e.to_string()));
    FactorCase {
        id: path
            .file_stem()
            .map_or_else(String::new, |s| s.to_string_lossy().into_owned()),
        scene: scene_file::read(&file.scene.to_string()).unwrap_or_else(|e| fail(e.to_string())),
        names: file.names,
        factors: file.factors,
        atol: file.atol,
    }
}
