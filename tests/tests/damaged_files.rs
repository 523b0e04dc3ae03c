//! View3D and Radiance files that were damaged: read, or refused with a word.

use antumbra::Scene;
use antumbra::io::rad::{self, RadFile};
use antumbra::io::vs3;
use antumbra::scene::LengthUnit;
use proptest::prelude::*;
use std::path::Path;

fn texts(names: &[&str]) -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures");
    let read =
        |name: &&str| std::fs::read_to_string(folder.join(name)).expect("the fixture exists");
    names.iter().map(read).collect()
}

/// What happens to files.
#[derive(Clone, Debug)]
enum Damage {
    /// A byte is replaced.
    Byte(usize, u8),
    /// The end is missing.
    Cut(usize),
    /// Two words change places.
    Swap(usize, usize),
    /// A word is something else.
    Word(usize, usize),
    /// A line is there twice.
    Twice(usize),
}

const WORDS: [&str; 12] = [
    "0",
    "-1",
    "1e308",
    "nan",
    "4294967295",
    "18446744073709551615",
    "S",
    "F",
    "3a",
    "!",
    "#",
    "é\u{2011}",
];

fn damage() -> impl Strategy<Value = Damage> {
    let place = any::<usize>;
    prop_oneof![
        (place(), any::<u8>()).prop_map(|(i, b)| Damage::Byte(i, b)),
        place().prop_map(Damage::Cut),
        (place(), place()).prop_map(|(i, j)| Damage::Swap(i, j)),
        (place(), 0..WORDS.len()).prop_map(|(i, w)| Damage::Word(i, w)),
        place().prop_map(Damage::Twice),
    ]
}

/// Places of words.
fn words(text: &str) -> Vec<(usize, usize)> {
    let start = text.as_ptr() as usize;
    text.split_whitespace()
        .map(|word| {
            let at = word.as_ptr() as usize - start;
            (at, at + word.len())
        })
        .collect()
}

fn damaged(text: &str, damages: &[Damage]) -> String {
    let mut text = text.to_owned();
    for damage in damages {
        if text.is_empty() {
            break;
        }
        let places = words(&text);
        match *damage {
            Damage::Byte(i, b) => {
                let mut bytes = text.into_bytes();
                let i = i % bytes.len();
                bytes[i] = b;
                text = String::from_utf8_lossy(&bytes).into_owned();
            }
            Damage::Cut(i) => {
                let end = (0..=i % text.len())
                    .rev()
                    .find(|&i| text.is_char_boundary(i));
                text.truncate(end.unwrap_or(0));
            }
            Damage::Swap(i, j) if !places.is_empty() => {
                let (i, j) = (i % places.len(), j % places.len());
                let (a, b) = (places[i.min(j)], places[i.max(j)]);
                if a != b {
                    text = [
                        &text[..a.0],
                        &text[b.0..b.1],
                        &text[a.1..b.0],
                        &text[a.0..a.1],
                        &text[b.1..],
                    ]
                    .concat();
                }
            }
            Damage::Word(i, w) if !places.is_empty() => {
                let (from, to) = places[i % places.len()];
                text.replace_range(from..to, WORDS[w]);
            }
            Damage::Twice(i) => {
                let lines: Vec<&str> = text.lines().collect();
                let i = i % lines.len();
                text = [&lines[..=i], &lines[i..]].concat().join("\n");
            }
            Damage::Swap(..) | Damage::Word(..) => {}
        }
    }
    text
}

fn one_line(message: &str) -> Result<(), TestCaseError> {
    prop_assert!(
        !message.is_empty() && !message.contains('\n'),
        "{message:?}"
    );
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_view3d_files_are_read_or_refused(
        which in 0..5usize,
        damages in prop::collection::vec(damage(), 1..4),
    ) {
        let names = [
            "real/view3d/facet.vs3",
            "real/view3d/test4.vs3",
            "real/view3d/test4a.vs3",
            "real/view3d/wdwdoor.vs3",
            "vs3/nested.vs3",
        ];
        let text = damaged(&texts(&names)[which], &damages);
        match vs3::read(&text, LengthUnit::Metre) {
            Err(error) => one_line(&error.to_string())?,
            Ok(input) => if let Ok(built) = Scene::build(&input) {
                // The check of the room takes what the check of the scene accepts.
                let _ = built.scene.open_rooms();
            }
        }
    }

    #[test]
    fn damaged_radiance_files_are_read_or_refused(
        damages in prop::collection::vec(damage(), 1..4),
        part in 0..4usize,
    ) {
        let names = [
            "real/pyradiance-room/materials.rad",
            "real/pyradiance-room/objects/ExteriorWalls.rad",
            "real/pyradiance-room/objects/InteriorWall.rad",
            "real/radiance-diorama/rect_fixture.rad",
        ];
        let files: Vec<RadFile> = texts(&names)
            .into_iter()
            .enumerate()
            .map(|(i, text)| RadFile {
                name: names[i].to_owned(),
                text: if i == part { damaged(&text, &damages) } else { text },
            })
            .collect();
        match rad::read(&files, &mut |_, _| Err("no file".to_owned()), LengthUnit::Metre) {
            Err(error) => one_line(&error.to_string())?,
            Ok(input) => if let Ok(built) = Scene::build(&input) {
                let _ = built.scene.open_rooms();
            }
        }
    }
}
