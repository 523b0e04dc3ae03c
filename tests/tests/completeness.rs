//! No critical curve is missing: inside an element of a mesh with the curves of all
//! kinds of events, all points have one visible structure.
//!
//! `ANTUMBRA_PAIRS=200000 cargo test -p antumbra-tests --test completeness` looks at
//! more pairs of points; `-- --ignored` at larger scenes, `-- --nocapture` shows the
//! tables of those that pass too.

use antumbra::scene::{EdgeId, FaceId};
use antumbra::{Control, EventKinds, Events, Options, Outcome, Scene, Tolerance};
use antumbra_tests::cases::{build, fixture, fixtures, json_files};
use antumbra_tests::meshes::triangles;
use antumbra_tests::random::SplitMix;
use antumbra_tests::structure::{ApparentVertex, Corner, Kind, Rim, Site, Structure, Structures};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::fmt::Write as _;

/// Pairs that differ, of all pairs: room for curves that the mesh moved by a few
/// pixels and for arcs beside their chords, but for no missing curve.
const ALLOWED: f64 = 2e-3;
/// Below this margin, rounding may have decided.
const SURE: f64 = 1e-9;
/// Elements smaller than this part of their receiver are left out: pixels of the
/// arrangement show in them.
const SMALLEST: f64 = 1e-6;

/// Pairs of points per fixture.
fn n_pairs() -> u64 {
    let asked = std::env::var("ANTUMBRA_PAIRS").ok();
    asked.and_then(|n| n.parse().ok()).unwrap_or(10_000)
}

/// What was found in one fixture.
struct Row {
    name: String,
    n_elements: usize,
    /// Pairs of which at least one point sees something, surely.
    n_pairs: usize,
    n_differing: usize,
    /// Pairs with apparent vertices of this kind among what differs.
    by_kind: [usize; 4],
    /// Pairs by the first event between their points.
    by_event: [usize; 8],
    /// A pair of every event, in words.
    examples: Vec<String>,
}

impl Row {
    fn share(&self) -> f64 {
        self.n_differing as f64 / self.n_pairs.max(1) as f64
    }
}

/// Two points of one element, and what they see.
struct Pair {
    receiver: FaceId,
    points: [DVec3; 2],
    structures: [Structure; 2],
}

impl Pair {
    /// The apparent vertices that only one of the points sees.
    fn difference(&self) -> Vec<&ApparentVertex> {
        self.structures[0].difference(&self.structures[1])
    }

    /// Two points of the segment between them that are as near to each other as
    /// can be and still differ: on both sides of the first critical curve.
    ///
    /// `None` if all there is between them is crossings that rise over the horizon
    /// or set: what they add to the light begins with its third derivative.
    fn narrowed(&self, structures: &Structures<'_>) -> Option<Self> {
        let [mut here, mut there] = self.structures.clone();
        let [mut a, mut b] = self.points;
        while here != there {
            while a.distance(b) > NARROW {
                let middle = (a + b) / 2.0;
                let between = structures.at(self.receiver, middle).structure;
                if between == here {
                    a = middle;
                } else {
                    (b, there) = (middle, between);
                }
            }
            let narrowed = Self {
                receiver: self.receiver,
                points: [a, b],
                structures: [here, there],
            };
            if !narrowed.is_at_horizon() {
                return Some(narrowed);
            }
            let [_, beyond] = narrowed.structures;
            (a, b) = (b, self.points[1]);
            (here, there) = (beyond, self.structures[1].clone());
        }
        None
    }

    /// Is the only difference one crossing? Anywhere else it would meet a third
    /// feature.
    fn is_at_horizon(&self) -> bool {
        let is_crossing = |v: &&ApparentVertex| {
            let kind = v.site.kind();
            kind == Kind::EmitterCrossing || kind == Kind::OccluderCrossing
        };
        let difference = self.difference();
        difference.len() == 1 && difference.iter().all(is_crossing)
    }

    /// The event between two narrowed points: told by the features of what appears
    /// and disappears there.
    fn event(&self, scene: &Scene) -> Missing {
        let mut corners = Vec::new();
        let mut crossing = Vec::new();
        let mut rims = Vec::new();
        let mut is_at_emitter = false;
        for vertex in self.difference() {
            rims.extend(vertex.bounds.iter().map(|bound| bound.rim));
            match vertex.site {
                Site::EmitterVertex(c) | Site::OccluderVertex(c) => corners.push(c),
                Site::EmitterCrossing { emitter, occluder } => {
                    crossing.extend([emitter, occluder]);
                }
                Site::OccluderCrossing(both) => crossing.extend(both),
            }
            let kind = vertex.site.kind();
            is_at_emitter |= kind == Kind::EmitterVertex || kind == Kind::EmitterCrossing;
        }
        for features in [&mut crossing, &mut rims] {
            features.sort();
            features.dedup();
        }
        if let Some(event) = aligned(scene, self.points[0], &rims) {
            return event;
        }
        corners.sort();
        corners.dedup();
        let ends_in = |rim: &Rim, corner: &Corner| match (rim, corner) {
            (Rim::Edge(e), Corner::Vertex(v)) => scene.edges[e.index()].ends.contains(v),
            _ => false,
        };
        crossing.retain(|rim| !corners.iter().any(|corner| ends_in(rim, corner)));
        match (corners.len(), crossing.len(), is_at_emitter) {
            (1, 1, true) => Missing::EmitterVe,
            (1, 1, false) => Missing::OtherVe,
            (0, 3, true) => Missing::EmitterEee,
            (0, 3, false) => Missing::OtherEee,
            _ => Missing::Several,
        }
    }
}

/// The event by which a point is in the plane of a face, or in one plane with two
/// edges.
fn aligned(scene: &Scene, point: DVec3, rims: &[Rim]) -> Option<Missing> {
    let edges: Vec<EdgeId> = rims
        .iter()
        .filter_map(|rim| match rim {
            Rim::Edge(e) => Some(*e),
            Rim::Cut(_) => None,
        })
        .collect();
    let faces = |e: &EdgeId| scene.edges[e.index()].faces.iter().copied();
    let is_edge_on = |f: FaceId| {
        let plane = &scene.planes[scene.face(f).plane.index()];
        plane.distance(point).abs() < 10.0 * NARROW
    };
    if edges.iter().flat_map(faces).any(is_edge_on) {
        return Some(Missing::Facet);
    }
    let normal = |e: &EdgeId| {
        let ends = scene.edges[e.index()].ends;
        let [a, b] = ends.map(|v| scene.position(v) - point);
        a.cross(b).normalize_or_zero()
    };
    let is_emitters = |e: &EdgeId| faces(e).any(|f| scene.material(f).is_emitter());
    for (i, e) in edges.iter().enumerate() {
        for f in &edges[i + 1..] {
            if normal(e).cross(normal(f)).length() < 1e-8 {
                let is_at_emitter = is_emitters(e) || is_emitters(f);
                return Some(if is_at_emitter {
                    Missing::EmitterEe
                } else {
                    Missing::OtherEe
                });
            }
        }
    }
    None
}

/// Length of a narrowed pair, scene units.
const NARROW: f64 = 1e-11;

/// The event whose curve is missing between two points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Missing {
    /// A vertex and an edge, one of them the emitter's.
    EmitterVe,
    /// A vertex and an edge of occluders.
    OtherVe,
    /// An edge of the emitter and one of an occluder, in one plane.
    EmitterEe,
    /// Two edges of occluders in one plane.
    OtherEe,
    /// Three edges, one of them the emitter's.
    EmitterEee,
    /// Three edges of occluders.
    OtherEee,
    /// The plane of a face.
    Facet,
    /// Several events at once, or anything else.
    Several,
}

impl Missing {
    const ALL: [Self; 8] = [
        Self::EmitterVe,
        Self::OtherVe,
        Self::EmitterEe,
        Self::OtherEe,
        Self::EmitterEee,
        Self::OtherEee,
        Self::Facet,
        Self::Several,
    ];

    /// With a dash if no feature of an emitter takes part.
    fn name(self) -> &'static str {
        match self {
            Self::EmitterVe => "ve",
            Self::OtherVe => "ve'",
            Self::EmitterEe => "ee",
            Self::OtherEe => "ee'",
            Self::EmitterEee => "eee",
            Self::OtherEee => "eee'",
            Self::Facet => "facet",
            Self::Several => "other",
        }
    }
}

/// The coarsest mesh with the curves of all events, so fine that chords lie on their
/// arcs: what refinement cuts into pieces stays in one cell of the arrangement.
fn meshed(name: &str) -> (Scene, Outcome) {
    let scene = build(&fixture(name));
    let options = Options {
        tolerance: Tolerance::Relative(1e-11),
        degree: Some(1),
        most_elements: 1,
        ..Options::with_events(Events::Kinds(EventKinds::ALL))
    };
    let meshed =
        antumbra::mesh(&scene, &options, &Control::NEVER).unwrap_or_else(|e| panic!("{name}: {e}"));
    (scene, meshed)
}

fn row(name: &str, n_pairs: u64) -> Row {
    let (scene, Outcome { mesh: direct, .. }) = meshed(name);
    let structures = Structures::new(&scene);
    let elements: Vec<(usize, u32)> = direct
        .receivers
        .iter()
        .enumerate()
        .flat_map(|(r, receiver)| {
            let smallest = triangles(receiver).total_area() * SMALLEST;
            let is_large = move |t: &u32| triangles(receiver).area(*t) > smallest;
            let n = receiver.n_elements() as u32;
            (0..n).filter(is_large).map(move |t| (r, t))
        })
        .collect();
    // Every element is as likely as the next.
    let pick = |seed: u64| -> Option<Pair> {
        let mut random = SplitMix::new(seed);
        let (r, t) = elements[(random.unit() * elements.len() as f64) as usize];
        let receiver = &direct.receivers[r];
        let corners = triangles(receiver).corners(t);
        let points = [(); 2].map(|()| receiver.chart.to_space(inside(corners, &mut random)));
        let [a, b] = points.map(|p| structures.at(receiver.face, p));
        let is_dark = a.structure.is_empty() && b.structure.is_empty();
        let is_sure = a.margin.min(b.margin) > SURE;
        (is_sure && !is_dark).then_some(Pair {
            receiver: receiver.face,
            points,
            structures: [a.structure, b.structure],
        })
    };
    let pairs: Vec<Pair> = (0..n_pairs).into_par_iter().filter_map(pick).collect();
    let differing: Vec<(&Pair, Pair)> = pairs
        .par_iter()
        .filter_map(|pair| Some((pair, pair.narrowed(&structures)?)))
        .collect();
    let has = |pair: &Pair, kind: Kind| pair.difference().iter().any(|v| v.site.kind() == kind);
    let events: Vec<Missing> = differing.iter().map(|d| d.1.event(&scene)).collect();
    let example = |&event: &Missing| {
        let at = events.iter().position(|&e| e == event)?;
        let (pair, narrowed) = &differing[at];
        Some(describe(&scene, event, pair, narrowed))
    };
    Row {
        name: name.to_owned(),
        n_elements: elements.len(),
        n_pairs: pairs.len(),
        n_differing: differing.len(),
        by_kind: Kind::ALL.map(|kind| differing.iter().filter(|d| has(d.0, kind)).count()),
        by_event: Missing::ALL.map(|event| events.iter().filter(|&&e| e == event).count()),
        examples: Missing::ALL.iter().filter_map(example).collect(),
    }
}

/// A uniform point of a triangle.
fn inside([a, b, c]: [DVec2; 3], random: &mut SplitMix) -> DVec2 {
    let (mut s, mut t) = (random.unit(), random.unit());
    if s + t > 1.0 {
        (s, t) = (1.0 - s, 1.0 - t);
    }
    a + (b - a) * s + (c - a) * t
}

/// A pair in words, coordinates in file units.
fn describe(scene: &Scene, event: Missing, pair: &Pair, narrowed: &Pair) -> String {
    let file = |p: DVec3| scene.frame.to_file(p);
    let receiver = &scene.surface_of(pair.receiver).name;
    let ([a, b], at) = (pair.points.map(file), file(narrowed.points[0]));
    let name = event.name();
    let mut text = format!("{name} on {receiver} between {a} and {b}, at {at}:");
    let vertex = |v| format!("{}", file(scene.position(v)));
    let edge = |e: EdgeId| {
        let edge = &scene.edges[e.index()];
        let faces: Vec<&str> = edge
            .faces
            .iter()
            .map(|&f| scene.surface_of(f).name.as_str())
            .collect();
        let [a, b] = edge.ends.map(vertex);
        format!("{a}–{b} of {}", faces.join(" and "))
    };
    let rim = |rim: Rim| match rim {
        Rim::Edge(e) => edge(e),
        Rim::Cut(f) => format!("{} in the emitter's plane", scene.surface_of(f).name),
    };
    let corner = |corner: Corner| match corner {
        Corner::Vertex(v) => vertex(v),
        Corner::Pierce(e) => format!("{} in the emitter's plane", edge(e)),
        Corner::Touch([a, b]) => format!("{} on {}", rim(a), rim(b)),
        Corner::Inner => "a border between pieces".to_owned(),
    };
    for v in narrowed.difference() {
        let site = match v.site {
            Site::EmitterVertex(c) => format!("emitter vertex {}", corner(c)),
            Site::OccluderVertex(c) => format!("occluder vertex {}", corner(c)),
            Site::EmitterCrossing { emitter, occluder } => {
                format!("emitter edge {} with {}", rim(emitter), rim(occluder))
            }
            Site::OccluderCrossing([a, b]) => {
                format!("occluder edges {} with {}", rim(a), rim(b))
            }
        };
        let _ = write!(text, "\n      {site}");
    }
    text
}

fn table(rows: &[Row]) -> String {
    // What differs: vertices of emitters and occluders, crossings with emitters and
    // of occluders; then the event between.
    let mut table = format!(
        "{:<36} {:>8} {:>6} {:>6} {:>8} {:>6} {:>6} {:>6} {:>6} ",
        "fixture", "elements", "pairs", "differ", "share", "emit-v", "occl-v", "emit-x", "occl-x"
    );
    for event in Missing::ALL {
        let _ = write!(table, " {:>5}", event.name());
    }
    table += "\n";
    for row in rows {
        let _ = write!(
            table,
            "{:<36} {:>8} {:>6} {:>6} {:>8.1e}",
            row.name,
            row.n_elements,
            row.n_pairs,
            row.n_differing,
            row.share(),
        );
        for n in row.by_kind {
            let _ = write!(table, " {n:>6}");
        }
        table += " ";
        for n in row.by_event {
            let _ = write!(table, " {n:>5}");
        }
        table += "\n";
    }
    table
}

/// Asserts that the structure is one in every element of these fixtures' meshes.
/// Returns the table of what was looked at.
fn structure_is_constant(names: &[String]) -> String {
    let rows: Vec<Row> = names.iter().map(|name| row(name, n_pairs())).collect();
    let table = table(&rows);
    let failing: Vec<String> = rows
        .iter()
        .filter(|row| row.share() > ALLOWED)
        .map(|row| {
            let examples = row.examples.join("\n    ");
            format!("  {}\n    {examples}", row.name)
        })
        .collect();
    assert!(
        failing.is_empty(),
        "structures differ inside elements of {} of {} fixtures (allowed: {ALLOWED:e} of the pairs):\n{table}{}",
        failing.len(),
        rows.len(),
        failing.join("\n")
    );
    for row in &rows {
        assert!(row.n_pairs > 0, "{}: no pair was compared", row.name);
    }
    table
}

fn in_folder(folder: &str) -> Vec<String> {
    json_files(&fixtures().join(folder))
        .iter()
        .filter_map(|p| p.file_stem())
        .map(|s| format!("{folder}/{}", s.to_string_lossy()))
        .collect()
}

const LARGE: [&str; 2] = ["eee/boxes-16", "eee/boxes-64"];

#[test]
fn structure_is_constant_in_elements_of_basic_scenes() {
    println!("{}", structure_is_constant(&in_folder("basic")));
}

#[test]
fn structure_is_constant_in_elements_where_edges_are_aligned() {
    println!("{}", structure_is_constant(&in_folder("alignment")));
}

#[test]
fn structure_is_constant_in_elements_around_contacts() {
    println!("{}", structure_is_constant(&in_folder("contact")));
}

#[test]
fn structure_is_constant_in_elements_where_things_penetrate() {
    println!("{}", structure_is_constant(&in_folder("penetration")));
}

#[test]
fn structure_is_constant_in_elements_where_penumbras_overlap() {
    let mut names = in_folder("eee");
    names.retain(|name| !LARGE.contains(&name.as_str()));
    println!("{}", structure_is_constant(&names));
}

#[test]
#[ignore = "takes a minute"]
fn structure_is_constant_in_elements_under_sixteen_boxes() {
    println!("{}", structure_is_constant(&["eee/boxes-16".to_owned()]));
}

#[test]
#[ignore = "takes ten minutes"]
fn structure_is_constant_in_elements_under_sixty_four_boxes() {
    println!("{}", structure_is_constant(&["eee/boxes-64".to_owned()]));
}
