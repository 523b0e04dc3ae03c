//! Rooms that are not closed, and the surface at fault.
//!
//! A wall that was written down in the wrong place leaves a room open: light
//! escapes, and no number says so. The check works on edges. Written-down
//! coordinates do not meet to the last digit, so corners within 10⁻⁴ of the scene
//! count as one here, and edges are cut where corners lie on them. A stretch of
//! edge is *free* if an odd number of surfaces end in it, whatever the way they
//! face, and it does not lie on another (a box without bottom on a floor is closed
//! by the floor).
//!
//! A surface with more than half of its border free is *loose*: a plate, a lamp, a
//! partition, the pane in a window, or the misplaced wall. Loose surfaces are set
//! aside first, the loosest before the others, so that what they leave open shows;
//! if nothing is open without them, all is well. The surfaces that remain form
//! components, and a component is a room that is open if
//!
//! 1. it has free stretches;
//! 2. they are less than half of all its edges: so it is with every box that lacks
//!    one side, and with none that lacks two that meet;
//! 3. it surrounds something: its area vectors, which cancel in a closed shell,
//!    add up to less than 0.6 of its area. A sheet has 1, a half cylinder 0.64, a
//!    box of 12 m × 14 m × 3 m without ceiling 0.52.
//!
//! Of what surrounds something, open or not, surfaces may face the wrong way
//! ([`flipped`]).

mod flipped;
mod joints;

use crate::build::short;
use crate::bvh::Aabb;
use crate::problem::{Problem, Severity};
use crate::scene::{Scene, SurfaceId};
use antumbra_geom::{Control, Stop};
use glam::DVec3;
use joints::{Component, Joints};
use std::collections::BTreeMap;

/// Free edges of a room, relative to all its edges.
const MOSTLY_JOINED: f64 = 0.5;
/// Sum of the area vectors of a room, relative to its area.
const SURROUNDING: f64 = 0.6;

/// A room that light can leave.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenRoom {
    /// What encloses it, ascending.
    pub surfaces: Vec<SurfaceId>,
    /// Length of the edges at which it is open, file units.
    pub gap_length: f64,
    /// The smallest box of these edges, file units.
    pub gap_from: DVec3,
    /// Its other corner.
    pub gap_to: DVec3,
    /// The surfaces that end there, and along what length, the longest first.
    pub rim: Vec<(SurfaceId, f64)>,
    /// Surfaces at or in it that have no partner along most of their border, and along
    /// which part, the largest first: perhaps one of them is what is missing.
    pub loose: Vec<(SurfaceId, f64)>,
}

impl OpenRoom {
    /// The finding, for the report of a check.
    #[must_use]
    pub fn problem(&self, scene: &Scene) -> Problem {
        let name = |&(surface, _): &(SurfaceId, f64)| scene.surfaces[surface.index()].name.clone();
        let unit = scene.length_unit.symbol();
        let length = |x: f64| format!("{} {unit}", short(round(x)));
        let point = |p: DVec3| {
            let [x, y, z] = p.to_array().map(|x| short(round(x)));
            format!("({x}, {y}, {z})")
        };
        let mut message = String::new();
        if !self.loose.is_empty() {
            let loose = listed(&self.loose, |item| {
                format!("'{}' ({:.0} % of it)", name(item), 100.0 * item.1)
            });
            message += &format!("no partner for the border of {loose}, and ");
        }
        let rim = listed(&self.rim, |item| {
            format!("'{}' ({})", name(item), length(item.1))
        });
        message += &format!(
            "a room of {} surfaces is open: between {} and {} its edges join nothing, {} in all, at {rim}",
            self.surfaces.len(),
            point(self.gap_from),
            point(self.gap_to),
            length(self.gap_length),
        );
        Problem {
            severity: Severity::Warning,
            kind: "open-room",
            names: self.loose.iter().chain(&self.rim).map(name).collect(),
            found: Some(round(self.gap_length)),
            allowed: Some(0.0),
            message,
        }
    }
}

/// Six digits: the joints are not known to more.
fn round(x: f64) -> f64 {
    let x: f64 = format!("{x:.5e}").parse().unwrap_or(x);
    x + 0.0
}

/// Up to four items, and how many more there are.
fn listed<T>(items: &[T], text: impl Fn(&T) -> String) -> String {
    const SHOWN: usize = 4;
    let mut all = items
        .iter()
        .take(SHOWN)
        .map(text)
        .collect::<Vec<_>>()
        .join(", ");
    if items.len() > SHOWN {
        all += &format!(" and {} more", items.len() - SHOWN);
    }
    all
}

impl Scene {
    /// Sets of surfaces that look like rooms but are open, in the order of their
    /// first surfaces.
    #[must_use]
    pub fn open_rooms(&self) -> Vec<OpenRoom> {
        let joints = Joints::new(self, Stop::NEVER);
        let components = joints.components();
        let loose = joints.without_partners();
        let rooms = components.iter().map(|c| open(&joints, &loose, c));
        rooms.flatten().collect()
    }

    /// What is wrong with rooms: surfaces that face the wrong way, and rooms that are open.
    ///
    /// Nothing if it is stopped: what is not looked at may lie beside what is.
    #[must_use]
    pub fn room_problems(&self, control: &Control<'_>) -> Option<Vec<Problem>> {
        let problems = self.rooms_or_stop(control.stop);
        (!control.stop.is_wanted()).then_some(problems)
    }

    /// What is found after a stop means nothing.
    fn rooms_or_stop(&self, stop: Stop<'_>) -> Vec<Problem> {
        let joints = Joints::new(self, stop);
        if stop.is_wanted() {
            return Vec::new();
        }
        let components = joints.components();
        let loose = joints.without_partners();
        let middles = flipped::Middles::default();
        let going_on = || components.iter().take_while(|_| !stop.is_wanted());
        let flipped = going_on().flat_map(|c| flipped::find(&joints, &middles, c));
        let open = going_on().filter_map(|c| open(&joints, &loose, c));
        let mut problems: Vec<Problem> = flipped.collect();
        problems.extend(open.map(|room| room.problem(self)));
        problems
    }
}

/// What is wrong with a component, if it is a room that is open.
fn open(
    joints: &Joints<'_>,
    loose: &BTreeMap<SurfaceId, f64>,
    component: &Component,
) -> Option<OpenRoom> {
    let scene = joints.scene;
    let mut whole = 0.0;
    let mut gap = 0.0;
    let mut bounds = Aabb::EMPTY;
    let mut rim: BTreeMap<SurfaceId, f64> = BTreeMap::new();
    let mut beside: BTreeMap<SurfaceId, f64> = BTreeMap::new();
    for stretch in joints.of(component) {
        if joints.stop.is_wanted() {
            return None;
        }
        whole += joints.length(stretch);
        for run in &stretch.runs {
            if let Some(&share) = loose.get(&run.surface) {
                beside.insert(run.surface, share);
            }
        }
        let Some(first) = joints.ends_free(stretch) else {
            continue;
        };
        for &[from, to] in joints.free(stretch) {
            let length = from.distance(to);
            gap += length;
            bounds = bounds.union(Aabb::of([from, to]));
            *rim.entry(first).or_default() += length;
        }
    }
    if gap <= 10.0 * joints.tolerance || gap >= MOSTLY_JOINED * whole {
        return None;
    }
    if joints.area_vectors(&joints.shells(component)) >= SURROUNDING {
        return None;
    }
    let to_file = |length: f64| scene.frame.length_to_file(length);
    let by_size = |sizes: BTreeMap<SurfaceId, f64>| {
        let mut sizes: Vec<(SurfaceId, f64)> = sizes.into_iter().collect();
        // As they are shown: equal ones in the order of the file.
        sizes.sort_by(|a, b| round(b.1).total_cmp(&round(a.1)).then(a.0.cmp(&b.0)));
        sizes
    };
    Some(OpenRoom {
        surfaces: component.surfaces.clone(),
        gap_length: to_file(gap),
        gap_from: scene.frame.to_file(bounds.min),
        gap_to: scene.frame.to_file(bounds.max),
        rim: by_size(rim)
            .into_iter()
            .map(|(s, x)| (s, to_file(x)))
            .collect(),
        loose: by_size(beside),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::{MaterialInput, SceneInput, SurfaceInput};
    use glam::dvec3;

    fn surface(name: &str, corners: &[DVec3]) -> SurfaceInput {
        SurfaceInput {
            name: name.to_owned(),
            material: "white".to_owned(),
            vertices: corners.to_vec(),
            holes: Vec::new(),
        }
    }

    fn open_rooms(surfaces: Vec<SurfaceInput>) -> Vec<Problem> {
        let input = SceneInput {
            materials: vec![MaterialInput {
                name: "white".to_owned(),
                reflectance: vec![0.5],
                exitance: vec![1.0],
                two_sided: false,
            }],
            surfaces,
            ..SceneInput::default()
        };
        let scene = Scene::build(&input).unwrap().scene;
        let rooms = scene.open_rooms();
        rooms.iter().map(|room| room.problem(&scene)).collect()
    }

    /// The walls over a plan, then floor and ceiling, facing inwards.
    fn room(plan: &[(f64, f64)], height: f64) -> Vec<SurfaceInput> {
        let at = |(x, y): (f64, f64), z: f64| dvec3(x, y, z);
        let n = plan.len();
        let mut surfaces: Vec<SurfaceInput> = (0..n)
            .map(|i| {
                let (a, b) = (plan[i], plan[(i + 1) % n]);
                let corners = [at(b, 0.0), at(a, 0.0), at(a, height), at(b, height)];
                surface(&format!("wall-{i}"), &corners)
            })
            .collect();
        let floor: Vec<DVec3> = plan.iter().map(|&p| at(p, 0.0)).collect();
        let ceiling: Vec<DVec3> = plan.iter().rev().map(|&p| at(p, height)).collect();
        surfaces.push(surface("floor", &floor));
        surfaces.push(surface("ceiling", &ceiling));
        surfaces
    }

    const BOX: [(f64, f64); 4] = [(0.0, 0.0), (6.0, 0.0), (6.0, 5.0), (0.0, 5.0)];
    const L: [(f64, f64); 6] = [
        (0.0, 0.0),
        (6.0, 0.0),
        (6.0, 2.0),
        (3.0, 2.0),
        (3.0, 5.0),
        (0.0, 5.0),
    ];

    #[test]
    fn closed_rooms_are_closed_with_whatever_stands_in_them() {
        assert_eq!(open_rooms(room(&BOX, 3.0)), []);
        assert_eq!(open_rooms(room(&L, 3.0)), []);
        let mut furnished = room(&BOX, 3.0);
        // A box without bottom, a partition on three sides, a lamp below the ceiling.
        let mut chest = room(&[(1.0, 1.0), (1.0, 2.0), (2.0, 2.0), (2.0, 1.0)], 2.5);
        chest.retain(|s| s.name != "floor");
        for s in &mut chest {
            s.name = format!("chest-{}", s.name);
        }
        furnished.append(&mut chest);
        let upright = [(3.0, 0.0), (5.0, 0.0), (5.0, 3.0), (3.0, 3.0)];
        furnished.push(surface(
            "partition",
            &upright.map(|(y, z)| dvec3(4.0, y, z)),
        ));
        let flat = [(4.5, 1.0), (5.0, 1.0), (5.0, 2.0), (4.5, 2.0)];
        furnished.push(surface("lamp", &flat.map(|(x, y)| dvec3(x, y, 2.9))));
        assert_eq!(open_rooms(furnished), []);
    }

    #[test]
    fn room_without_ceiling_is_open_along_its_walls() {
        let mut surfaces = room(&BOX, 3.0);
        surfaces.pop();
        let found = open_rooms(surfaces);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].names, ["wall-0", "wall-2", "wall-1", "wall-3"]);
        assert_eq!(found[0].found, Some(22.0));
        assert_eq!(
            found[0].message,
            "a room of 5 surfaces is open: between (0, 0, 3) and (6, 5, 3) its edges join nothing, 22 m in all, at 'wall-0' (6 m), 'wall-2' (6 m), 'wall-1' (5 m), 'wall-3' (5 m)"
        );
    }

    #[test]
    fn wall_in_the_wrong_place_is_named_first() {
        let mut surfaces = room(&L, 3.0);
        // The wall at the inner corner, pushed into the room where it fits as well.
        for p in &mut surfaces[2].vertices {
            p.x -= 3.0;
        }
        let found = open_rooms(surfaces);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].names[0], "wall-2", "{}", found[0].message);
        assert_eq!(found[0].found, Some(9.0));
    }

    #[test]
    fn corners_that_miss_by_rounding_are_joined_and_others_are_not() {
        let with_miss = |miss: f64| {
            let mut surfaces = room(&BOX, 3.0);
            surfaces[1].vertices[0].z += miss;
            surfaces[1].vertices[1].z += miss;
            open_rooms(surfaces)
        };
        assert_eq!(with_miss(3e-4), []);
        let found = with_miss(0.05);
        assert_eq!(found.len(), 1);
        assert!(found[0].names.iter().any(|n| n == "wall-1"), "{found:?}");
    }

    #[test]
    fn sheets_and_corners_are_no_rooms() {
        let mut surfaces = room(&BOX, 3.0);
        surfaces.truncate(2);
        surfaces.push(room(&BOX, 3.0).remove(4));
        assert_eq!(open_rooms(surfaces), []);
        // A fine sheet has few free edges, but surrounds nothing.
        let sheet = (0..64).map(|k| {
            let (x, y) = (f64::from(k % 8), f64::from(k / 8));
            let bump = |x: f64, y: f64| dvec3(x, y, 0.1 * x * x);
            let corners = [
                bump(x, y),
                bump(x + 1.0, y),
                bump(x + 1.0, y + 1.0),
                bump(x, y + 1.0),
            ];
            surface(&format!("sheet-{k}"), &corners)
        });
        assert_eq!(open_rooms(sheet.collect()), []);
    }

    /// The names of flipped surfaces, by room.
    fn flipped(surfaces: Vec<SurfaceInput>, two_sided: bool) -> Vec<Vec<String>> {
        let input = SceneInput {
            materials: vec![MaterialInput {
                name: "white".to_owned(),
                reflectance: vec![0.5],
                exitance: vec![0.0],
                two_sided,
            }],
            surfaces,
            ..SceneInput::default()
        };
        let scene = Scene::build(&input).unwrap().scene;
        let problems = scene.room_problems(&Control::NEVER).into_iter().flatten();
        let flipped = problems.filter(|p| p.kind == "flipped");
        flipped.map(|p| p.names).collect()
    }

    fn turn(surfaces: &mut [SurfaceInput], names: &[&str]) {
        for surface in surfaces {
            if names.contains(&surface.name.as_str()) {
                surface.vertices.reverse();
            }
        }
    }

    /// Every quadrilateral as two triangles.
    fn in_triangles(surfaces: &[SurfaceInput]) -> Vec<SurfaceInput> {
        let halves = surfaces.iter().flat_map(|s| {
            (1..s.vertices.len() - 1).map(|k| {
                let corners = [s.vertices[0], s.vertices[k], s.vertices[k + 1]];
                surface(&format!("{}/{k}", s.name), &corners)
            })
        });
        halves.collect()
    }

    /// A box that stands in the room or hangs in it, facing outwards.
    fn chest(name: &str, low: DVec3, high: DVec3) -> Vec<SurfaceInput> {
        let plan = [
            (low.x, low.y),
            (low.x, high.y),
            (high.x, high.y),
            (high.x, low.y),
        ];
        let mut sides = room(&plan, high.z - low.z);
        for side in &mut sides {
            side.name = format!("{name}-{}", side.name);
            for p in &mut side.vertices {
                p.z += low.z;
            }
        }
        sides
    }

    #[test]
    fn reversed_walls_are_named() {
        for reversed in [
            &["wall-2"][..],
            &["floor"],
            &["wall-0", "wall-3"],
            &["ceiling", "wall-1"],
        ] {
            for plan in [&BOX[..], &L] {
                let mut surfaces = room(plan, 3.0);
                turn(&mut surfaces, reversed);
                let mut found = flipped(surfaces.clone(), false);
                assert_eq!(found.len(), 1, "{reversed:?}");
                found[0].sort_unstable();
                let mut expected = reversed.to_vec();
                expected.sort_unstable();
                assert_eq!(found[0], expected);
                assert_eq!(flipped(surfaces.clone(), true), [[""; 0]; 0], "no backs");
                if plan.len() > 4 {
                    continue;
                }
                let found = flipped(in_triangles(&surfaces), false);
                let halves = found[0].iter().map(|name| name.split('/').next().unwrap());
                let mut halves: Vec<&str> = halves.collect();
                halves.sort_unstable();
                halves.dedup();
                assert_eq!(halves, expected, "in triangles");
                assert_eq!(
                    flipped(surfaces, true),
                    [[""; 0]; 0],
                    "backs are fronts too"
                );
            }
        }
    }

    #[test]
    fn walls_that_end_within_an_edge_are_told_too() {
        // The first wall in two, upright: the floor's edge has a corner in it.
        let mut surfaces = room(&BOX, 3.0);
        let half = |name: &str, from: f64, to: f64| {
            let corners = [(to, 0.0), (from, 0.0), (from, 3.0), (to, 3.0)];
            surface(name, &corners.map(|(x, z)| dvec3(x, 0.0, z)))
        };
        surfaces[0] = half("left", 0.0, 2.5);
        surfaces.push(half("right", 2.5, 6.0));
        assert_eq!(flipped(surfaces.clone(), false), [[""; 0]; 0]);
        turn(&mut surfaces, &["right"]);
        assert_eq!(flipped(surfaces, false), [["right"]]);
    }

    #[test]
    fn what_a_room_holds_tells_its_inside() {
        // Most of it is turned, and it is a room all the same: something hangs in it.
        let mut surfaces = room(&BOX, 3.0);
        turn(&mut surfaces, &["floor", "ceiling", "wall-0", "wall-2"]);
        let few = flipped(surfaces.clone(), false);
        assert_eq!(few, [["wall-1", "wall-3"]], "without: the smaller part");
        surfaces.extend(chest("lamp", dvec3(2.0, 2.0, 1.0), dvec3(3.0, 3.0, 2.0)));
        let found = flipped(surfaces, false);
        assert_eq!(found, [["wall-0", "wall-2", "floor", "ceiling"]]);
    }

    #[test]
    fn nothing_is_said_of_what_may_face_as_it_likes() {
        let nothing = [[""; 0]; 0];
        // Furniture in the open, at a wall, in a corner and off the floor.
        let mut furnished = room(&BOX, 3.0);
        let z = |x: f64, y: f64, z: f64| dvec3(x, y, z);
        furnished.extend(chest("a", z(2.0, 2.0, 0.0), z(3.0, 3.0, 1.0)));
        furnished.extend(chest("b", z(5.0, 2.0, 0.0), z(6.0, 3.0, 2.0)));
        furnished.extend(chest("c", z(0.0, 0.0, 0.0), z(1.0, 1.0, 3.0)));
        furnished.extend(chest("d", z(4.0, 1.0, 1.0), z(4.5, 1.5, 1.1)));
        furnished.extend(chest("e", z(2.0, 2.0, 1.0), z(3.0, 3.0, 2.0)));
        assert_eq!(flipped(furnished, false), nothing);
        // The same outside in: consistent, whatever it is.
        let mut outside_in = room(&L, 3.0);
        let names: Vec<String> = outside_in.iter().map(|s| s.name.clone()).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        turn(&mut outside_in, &names);
        assert_eq!(flipped(outside_in, false), nothing);
        // Plates at an edge, one of which faces the other way, and plates back to back.
        let mut plates = room(&BOX, 3.0);
        plates.truncate(2);
        turn(&mut plates, &["wall-0"]);
        assert_eq!(flipped(plates, false), nothing);
        let mut sheets = room(&BOX, 3.0);
        sheets.truncate(1);
        let mut back = sheets[0].clone();
        back.name = "back".to_owned();
        sheets.push(back.clone());
        assert_eq!(flipped(sheets.clone(), false), nothing);
        sheets[1].vertices.reverse();
        assert_eq!(flipped(sheets, false), nothing);
        // Two rooms with a wall between them that faces one of them.
        let mut two = room(&BOX, 3.0);
        let mut beside = room(&[(6.0, 0.0), (9.0, 0.0), (9.0, 5.0), (6.0, 5.0)], 3.0);
        beside.remove(3);
        for s in &mut beside {
            s.name = format!("beside-{}", s.name);
        }
        two.append(&mut beside);
        assert_eq!(flipped(two, false), nothing);
    }
}
