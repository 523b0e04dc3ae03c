//! Same input, same bytes: however many threads share the work.

use antumbra::{Control, Options, Tolerance};
use antumbra_tests::bits::bits_of_meshes;
use antumbra_tests::cases::{build, fixture, fixtures, json_files};

/// Folders of scene files that are valid, by their path below `fixtures`.
const FOLDERS: [&str; 7] = [
    "basic",
    "alignment",
    "contact",
    "penetration",
    "eee",
    "hard",
    "regressions",
];

/// For interreflection, which takes longer.
const SCENES: [&str; 4] = [
    "basic/two-triangles",
    "alignment/box-under-rectangle",
    "contact/table",
    "penetration/crossing-triangles",
];

/// Runs in a pool of its own.
fn with_threads<T: Send>(n: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(n)
        .build()
        .expect("threads start");
    pool.install(work)
}

/// Every fixture, to a tolerance that all phases of refinement are needed for.
#[test]
fn meshes_are_bit_identical_for_any_number_of_threads() {
    let options = Options {
        tolerance: Tolerance::Relative(3e-3),
        ..Options::default()
    };
    let names = FOLDERS.iter().flat_map(|folder| {
        let files = json_files(&fixtures().join(folder));
        files.into_iter().filter_map(move |path| {
            let stem = path.file_stem()?.to_string_lossy().into_owned();
            Some(format!("{folder}/{stem}"))
        })
    });
    for name in names {
        let scene = build(&fixture(&name));
        let run = || {
            let meshed = antumbra::mesh(&scene, &options, &Control::NEVER);
            bits_of_meshes(&meshed.unwrap_or_else(|e| panic!("{name}: {e}")).mesh)
        };
        let one = with_threads(1, run);
        for n in [2, 7] {
            assert!(
                with_threads(n, run) == one,
                "{name}: {n} threads mesh differently from one"
            );
        }
    }
}

#[test]
fn solutions_are_bit_identical_for_any_number_of_threads() {
    let options = Options {
        tolerance: Tolerance::Relative(1e-2),
        ..Options::default()
    };
    for name in SCENES {
        let scene = build(&fixture(name));
        let run = || {
            let solved = antumbra::solve(&scene, &options, &Control::NEVER);
            let solved = solved.unwrap_or_else(|e| panic!("{name}: {e}"));
            let mut all = bits_of_meshes(&solved.mesh);
            let radiosity = solved.radiosity.expect("it was solved");
            all.extend([radiosity.iterations as u64, radiosity.residual.to_bits()]);
            let power = &radiosity.power;
            let watts = power
                .emitted
                .iter()
                .chain(&power.absorbed)
                .chain(&power.escaped);
            all.extend(watts.map(|v| v.to_bits()));
            all
        };
        let one = with_threads(1, run);
        for n in [2, 7] {
            assert!(
                with_threads(n, run) == one,
                "{name}: {n} threads solve differently from one"
            );
        }
    }
}
