//! What must be refused is refused, and the message names what it is about.

use antumbra_io::scene_file;
use antumbra_scene::Scene;
use std::path::Path;

#[test]
fn rejected_scenes_end_in_an_error_that_names_the_culprit() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/rejected");
    let mut n = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "json") {
            continue;
        }
        n += 1;
        let case: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let text = match &case["scene"] {
            serde_json::Value::String(text) => text.clone(),
            scene => scene.to_string(),
        };
        let (exit, said) = match scene_file::read(&text) {
            Err(error) => (3, error.to_string()),
            Ok(scene) => {
                let problems = Scene::build(&scene)
                    .map(|_| ())
                    .expect_err(&format!("{} was accepted", path.display()));
                let messages: Vec<String> = problems.into_iter().map(|p| p.message).collect();
                (4, messages.join("\n"))
            }
        };
        assert!(!said.is_empty());
        for name in case["names"].as_array().unwrap() {
            let name = name.as_str().unwrap();
            assert!(
                said.contains(name),
                "{}: '{name}' not in: {said}",
                path.display()
            );
        }
        if let Some(exits) = case["exits"].as_array() {
            assert!(
                exits.iter().any(|e| e == exit),
                "{}: exit {exit}",
                path.display()
            );
        }
    }
    assert!(n >= 22, "only {n} cases found");
}

#[test]
fn a_message_is_one_line_whatever_it_quotes() {
    let texts = [
        r#"{ "an\ntumbra": 1 }"#,
        r#"{ "antumbra": 1, "length_unit": "\u001b[2Jm\r\n" }"#,
    ];
    for text in texts {
        let message = scene_file::read(text).unwrap_err().to_string();
        assert!(!message.contains(char::is_control), "{message:?}");
    }
    let message = scene_file::read(texts[0]).unwrap_err().to_string();
    assert!(message.contains(r"`an\ntumbra`"), "{message}");
}
