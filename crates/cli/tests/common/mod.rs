//! Child processes of the command, and scenes that are too large for them.
#![allow(dead_code, reason = "not every test needs everything")]
#![allow(clippy::unwrap_used, reason = "a failing test says where")]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

/// The command.
pub(crate) fn antumbra() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_antumbra"));
    command.stdin(Stdio::null());
    command
}

/// A fixture of the project.
pub(crate) fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures")
        .join(name)
}

/// An empty folder of this test's own.
pub(crate) fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// The names in a folder, sorted.
pub(crate) fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// What a process ended with.
pub(crate) struct Ended {
    pub(crate) status: ExitStatus,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Ended {
    pub(crate) fn code(&self) -> Option<i32> {
        self.status.code()
    }

    pub(crate) fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|e| panic!("{e} in: {}\n{}", self.stdout, self.stderr))
    }
}

/// Longer than any of these runs takes on a machine that others use too: a guard against
/// hanging for ever, no measurement.
const HANGS: Duration = Duration::from_secs(300);

/// Waits for a process, whose output goes through pipes.
pub(crate) fn wait(mut child: Child) -> Ended {
    let id = child.id();
    let (sent, ended) = std::sync::mpsc::channel();
    let guard = std::thread::spawn(move || {
        if ended.recv_timeout(HANGS).is_err() {
            let _ = Command::new("kill")
                .args(["-KILL", &id.to_string()])
                .status();
        }
    });
    let read = |pipe: Option<Box<dyn std::io::Read + Send>>| {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            if let Some(mut pipe) = pipe {
                let _ = pipe.read_to_end(&mut bytes);
            }
            String::from_utf8(bytes).unwrap()
        })
    };
    let stdout = read(child.stdout.take().map(|p| Box::new(p) as _));
    let stderr = read(child.stderr.take().map(|p| Box::new(p) as _));
    let status = child.wait().unwrap();
    let _ = sent.send(());
    guard.join().unwrap();
    Ended {
        status,
        stdout: stdout.join().unwrap(),
        stderr: stderr.join().unwrap(),
    }
}

/// Starts a command with its output in pipes.
pub(crate) fn start(command: &mut Command) -> Child {
    command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Runs a command to its end.
pub(crate) fn run(command: &mut Command) -> Ended {
    wait(start(command))
}

/// `n` × `n` boxes that stand on a floor, each turned and sized differently, under four
/// lamps: minutes of work for some hundreds of them.
pub(crate) fn hall(n: u32) -> String {
    let mut text = String::from(
        "{\"antumbra\": 1, \"materials\": {\"grey\": {\"reflectance\": 0.5}, \"lamp\": {\"exitance\": 1}}, \"surfaces\": [\n",
    );
    let half = f64::from(n) / 2.0;
    let mut add = |name: String, material: &str, corners: [[f64; 3]; 4]| {
        let _ = writeln!(
            text,
            "{{\"name\": \"{name}\", \"material\": \"{material}\", \"vertices\": {corners:?}}},"
        );
    };
    for (k, (x, y)) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
        .into_iter()
        .enumerate()
    {
        let (x, y) = (x * half / 2.0, y * half / 2.0);
        let (a, b) = ([x - 0.5, y - 0.5], [x + 0.5, y + 0.5]);
        let corners = [
            [a[0], b[1], 3.0],
            [b[0], b[1], 3.0],
            [b[0], a[1], 3.0],
            [a[0], a[1], 3.0],
        ];
        add(format!("lamp-{k}"), "lamp", corners);
    }
    for i in 0..n {
        for j in 0..n {
            let k = f64::from(i * n + j);
            let turn = 0.7 * k;
            let (width, height) = (0.2 + 0.1 * (1.3 * k).sin(), 0.6 + 0.4 * (2.1 * k).cos());
            let middle = [f64::from(i) + 0.5 - half, f64::from(j) + 0.5 - half];
            let p = |x: f64, y: f64, z: f64| {
                let (sin, cos) = turn.sin_cos();
                [
                    middle[0] + width * (x * cos - y * sin),
                    middle[1] + width * (x * sin + y * cos),
                    height * z,
                ]
            };
            let (o, l) = (-1.0, 1.0);
            let ring = [(o, o), (l, o), (l, l), (o, l)];
            add(
                format!("box-{i}-{j}-top"),
                "grey",
                ring.map(|(x, y)| p(x, y, 1.0)),
            );
            for side in 0..4 {
                let (a, b) = (ring[side], ring[(side + 1) % 4]);
                let corners = [
                    p(a.0, a.1, 0.0),
                    p(b.0, b.1, 0.0),
                    p(b.0, b.1, 1.0),
                    p(a.0, a.1, 1.0),
                ];
                add(format!("box-{i}-{j}-{side}"), "grey", corners);
            }
        }
    }
    let floor = [
        [-half, -half, 0.0],
        [half, -half, 0.0],
        [half, half, 0.0],
        [-half, half, 0.0],
    ];
    add("floor".into(), "grey", floor);
    text.truncate(text.trim_end().trim_end_matches(',').len());
    text.push_str("\n]}\n");
    text
}
