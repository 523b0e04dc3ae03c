//! The walk front to back: cones, and what may still reach into them.

use super::boxes::{Block, Ray};
use super::cones::{Cone, Margins, Side};
use super::cover::{Inside, Peeler, opposite};
use super::deal::Dealer;
use super::place::{quarters, settle, side_along};
use super::screens::Screens;
use super::seen::{Seen, Sights, nearer_than};
use super::{MapTotals, Place, VisiblePart};
use crate::evaluator::Evaluator;
use crate::lambert::contour_sum;
use glam::DVec3;

/// What lies this much farther away than what is hit is not asked for.
const BEYOND: f64 = 1.0 + 1e-9;

/// A form factor this small is the rounding of the cuts: nothing is told of its cone. Ten
/// thousand of them are still less than what sums are off by.
const FAINT: f64 = f64::EPSILON / 16.0;

/// Working memory of visibility maps, for one thread.
#[derive(Debug, Default)]
pub struct MapScratch {
    cone: Cone,
    list: Vec<Item>,
    pending: Stack,
    peeler: Peeler,
    sights: Sights,
    /// Screens looked at so far.
    seen: Vec<Option<Seen>>,
    /// Per screen of the scene: when it was last looked at, and its place in `seen`.
    looked: Vec<(u64, u32)>,
    /// The number of this map, to know what was looked at for earlier ones.
    now: u64,
    dealer: Dealer,
}

/// What may reach into a cone.
#[derive(Clone, Copy, Debug)]
struct Item {
    /// Squared distance from the point at least: less is looked at earlier.
    distance_sq: f64,
    what: What,
}

#[derive(Clone, Copy, Debug)]
enum What {
    Node(u32),
    Screen(u32),
}

/// Cones that wait, the last first.
#[derive(Debug, Default)]
struct Stack {
    waiting: Vec<Waiting>,
    corners: Vec<DVec3>,
    sides: Vec<Side>,
    items: Vec<Item>,
}

/// Where a waiting cone begins in the vectors of its [`Stack`].
#[derive(Clone, Copy, Debug)]
struct Waiting {
    corners: usize,
    items: usize,
    cover: Option<u32>,
}

impl Stack {
    fn push(&mut self, cone: &Cone, items: impl Iterator<Item = Item>, cover: Option<u32>) {
        self.waiting.push(Waiting {
            corners: self.corners.len(),
            items: self.items.len(),
            cover,
        });
        self.corners.extend_from_slice(&cone.corners);
        self.sides.extend_from_slice(&cone.sides);
        self.items.extend(items);
    }

    /// Takes the last cone and its list; returns what covers it so far.
    fn pop(&mut self, cone: &mut Cone, list: &mut Vec<Item>) -> Option<Option<u32>> {
        let last = self.waiting.pop()?;
        cone.assign(&self.corners[last.corners..], &self.sides[last.corners..]);
        list.clear();
        list.extend_from_slice(&self.items[last.items..]);
        self.corners.truncate(last.corners);
        self.sides.truncate(last.corners);
        self.items.truncate(last.items);
        Some(last.cover)
    }
}

impl Evaluator<'_> {
    /// Everything that is seen from a place: calls `visit` with each convex part.
    ///
    /// * `epsilon` — cones whose form factor is smaller are not divided: what lies in
    ///   their middle gets all of it. 0 is exact.
    ///
    /// The parts, the sky and what is too narrow to be told ([`MapTotals::slits`], mostly 0)
    /// add up to 1. Faces in the place's own plane are not seen, nor
    /// are faces seen edge-on. Of coplanar faces that overlap, those that show their front
    /// are seen, emitters first.
    pub fn visible_faces(
        &self,
        place: &Place,
        epsilon: f64,
        scratch: &mut MapScratch,
        visit: impl FnMut(VisiblePart<'_>),
    ) -> MapTotals {
        let screens = self.screens();
        let place = settle(place, screens);
        let radius = place.approach.map_or(0.0, |a| a.radius);
        scratch.begin(screens.len());
        let margins = Margins {
            slack: 4.0 * radius + self.scene().plane_tolerance(),
            reach: screens.farthest_from(place.point),
        };
        let mut walk = Walk {
            screens,
            up: side_along(place.normal, place.point, margins),
            margins,
            rounding: self.scene().rounding(),
            place,
            epsilon,
            scratch,
            totals: MapTotals::default(),
            sum: 0.0,
            visit,
        };
        walk.run();
        debug_assert!(
            (walk.sum + walk.totals.sky + walk.totals.slits - 1.0).abs() <= 1e-12,
            "parts {}, {:?} are not the hemisphere",
            walk.sum,
            walk.totals
        );
        walk.totals
    }
}

impl MapScratch {
    fn begin(&mut self, n_screens: usize) {
        if self.looked.len() != n_screens {
            // Numbers of another scene's screens mean nothing here.
            self.looked.clear();
            self.looked.resize(n_screens, (0, 0));
        }
        self.now += 1;
        self.seen.clear();
        self.sights.clear();
        self.peeler.n_tests = 0;
    }
}

struct Walk<'a, V> {
    screens: &'a Screens,
    place: Place,
    /// The horizon.
    up: Side,
    margins: Margins,
    rounding: f64,
    epsilon: f64,
    scratch: &'a mut MapScratch,
    totals: MapTotals,
    /// Of the factors of all parts.
    sum: f64,
    visit: V,
}

impl<V: FnMut(VisiblePart<'_>)> Walk<'_, V> {
    fn run(&mut self) {
        let root = (!self.screens.hierarchy.nodes.is_empty()).then_some(0);
        for (corners, sides) in quarters(&self.place, self.margins) {
            self.scratch.cone.assign(&corners, &sides);
            let items = root.into_iter().map(|root| Item {
                distance_sq: 0.0,
                what: What::Node(root),
            });
            self.scratch.pending.push(&self.scratch.cone, items, None);
            while let Some(cover) = self
                .scratch
                .pending
                .pop(&mut self.scratch.cone, &mut self.scratch.list)
            {
                self.finish(cover);
            }
        }
        self.totals.n_halves = self.scratch.peeler.n_tests;
    }

    /// Follows one cone until nothing more reaches into it; what is cut off waits.
    fn finish(&mut self, mut cover: Option<u32>) {
        if self.epsilon > 0.0 && self.weight() < self.epsilon {
            let cover = self.look_through_middle(cover);
            self.emit(cover, true);
            return;
        }
        while let Some(item) = self.scratch.list.pop() {
            match item.what {
                What::Node(node) => self.open(node, cover),
                What::Screen(screen) => cover = self.meet(screen, cover),
            }
        }
        self.emit(cover, false);
    }

    /// The form factor of the cone.
    fn weight(&self) -> f64 {
        contour_sum(&self.scratch.cone.corners, self.place.normal)
    }

    /// Puts what is below a node, and may reach into the cone, into the list.
    fn open(&mut self, node: u32, cover: Option<u32>) {
        let screens = self.screens;
        let hierarchy = &screens.hierarchy;
        let node = &hierarchy.nodes[node as usize];
        if self.is_box_hidden(&node.block, cover) {
            return;
        }
        if node.n_items == 0 {
            for child in [node.first, node.first + 1] {
                self.insert(What::Node(child), &hierarchy.nodes[child as usize].block);
            }
        } else {
            for &screen in hierarchy.items_of(node) {
                self.insert(What::Screen(screen), &screens.blocks[screen as usize]);
            }
        }
    }

    fn insert(&mut self, what: What, block: &Block) {
        let scratch = &mut *self.scratch;
        self.totals.n_boxes += 1;
        let mut sides = scratch.cone.sides.iter();
        if !sides.all(|side| side.is_reached_by(block)) || !self.up.is_reached_by(block) {
            return;
        }
        let distance_sq = block.distance_sq(self.place.point);
        let at = scratch
            .list
            .partition_point(|item| item.distance_sq > distance_sq);
        scratch.list.insert(at, Item { distance_sq, what });
    }

    /// Is all of a box behind what covers the cone?
    fn is_box_hidden(&self, block: &Block, cover: Option<u32>) -> bool {
        let Some(cover) = cover else {
            return false;
        };
        let cover = self.seen(cover);
        if cover.touches {
            let slack = self.margins.slack;
            return block.distance_sq(self.place.point) > slack * slack;
        }
        let nearest = block.least_along(cover.normal) - cover.normal.dot(self.place.point);
        nearest >= cover.height - 4.0 * self.rounding
    }

    /// What covers the cone after a screen was met; the cone is cut down to what is covered.
    fn meet(&mut self, screen: u32, cover: Option<u32>) -> Option<u32> {
        let Some(at) = self.look(screen) else {
            return cover;
        };
        if self.is_hidden(at, screen, cover) || self.is_beside(at) {
            return cover;
        }
        let seen = self.seen(at);
        let scratch = &mut *self.scratch;
        let halves = scratch.sights.halves(&seen);
        let inside = scratch
            .peeler
            .peel(&scratch.cone, halves, self.place.point, self.margins);
        match inside {
            Inside::Nothing => return cover,
            Inside::Whole => {}
            Inside::Part => self.part(cover),
        }
        let Some(before) = cover else {
            return Some(at);
        };
        self.nearer(at, before)
    }

    /// Which of two screens that both fill the cone covers it; where they cross, the cone
    /// is divided.
    fn nearer(&mut self, at: u32, before: u32) -> Option<u32> {
        let (seen, cover) = (self.seen(at), self.seen(before));
        if seen.touches != cover.touches {
            return Some(if seen.touches { at } else { before });
        }
        let half = nearer_than(&seen, &cover, self.rounding);
        let scratch = &mut *self.scratch;
        let inside = scratch
            .peeler
            .peel(&scratch.cone, &[half], self.place.point, self.margins);
        match inside {
            Inside::Nothing => Some(before),
            Inside::Whole => Some(at),
            Inside::Part => {
                self.part(Some(before));
                Some(at)
            }
        }
    }

    /// After a cone was peeled: its pieces wait, each with what reaches into it, and what
    /// is left takes its place.
    fn part(&mut self, cover: Option<u32>) {
        let (point, margins, screens) = (self.place.point, self.margins, self.screens);
        let scratch = &mut *self.scratch;
        let mut n_boxes = 0;
        let mut reaches = |side: &Side, item: &Item| {
            n_boxes += 1;
            side.is_reached_by(match item.what {
                What::Node(node) => &screens.hierarchy.nodes[node as usize].block,
                What::Screen(screen) => &screens.blocks[screen as usize],
            })
        };
        for (piece, half) in scratch.peeler.pieces() {
            let side = Side::new(&opposite(half), point, margins);
            let items = scratch.list.iter().filter(|item| reaches(&side, item));
            scratch.pending.push(piece, items.copied(), cover);
            // What is cut off later lies on the inner side of this cut.
            let side = Side::new(half, point, margins);
            scratch.list.retain(|item| reaches(&side, item));
        }
        let rest = scratch.peeler.rest();
        scratch.cone.assign(&rest.corners, &rest.sides);
        self.totals.n_boxes += n_boxes;
    }

    /// What is seen in the middle of the cone, and lies in front of its cover.
    fn look_through_middle(&mut self, mut cover: Option<u32>) -> Option<u32> {
        let (screens, point) = (self.screens, self.place.point);
        let middle = self.scratch.cone.middle();
        let ray = Ray::new(point, middle, self.margins.slack);
        let depth = |seen: Option<Seen>| seen.map_or(f64::INFINITY, |s| s.depth(middle) * BEYOND);
        let mut longest = depth(cover.map(|cover| self.seen(cover)));
        while let Some(item) = self.scratch.list.pop() {
            match item.what {
                What::Node(node) => {
                    let node = &screens.hierarchy.nodes[node as usize];
                    self.totals.n_boxes += 1;
                    if !ray.meets(&node.block, longest) {
                        continue;
                    }
                    let items = |what: fn(u32) -> What| {
                        move |id: u32| Item {
                            distance_sq: 0.0,
                            what: what(id),
                        }
                    };
                    if node.n_items == 0 {
                        let children = [node.first + 1, node.first].map(items(What::Node));
                        self.scratch.list.extend(children);
                    } else {
                        let leaf = screens.hierarchy.items_of(node).iter().copied();
                        self.scratch.list.extend(leaf.map(items(What::Screen)));
                    }
                }
                What::Screen(screen) => {
                    self.totals.n_boxes += 1;
                    if ray.meets(&screens.blocks[screen as usize], longest)
                        && let Some(at) = self.look(screen)
                        && !self.is_hidden(at, screen, cover)
                        && self.is_hit(at, middle, cover)
                    {
                        cover = Some(at);
                        longest = depth(Some(self.seen(at)));
                    }
                }
            }
        }
        cover
    }

    /// Is a screen hit in a direction, in front of what is hit there already?
    fn is_hit(&self, at: u32, direction: DVec3, cover: Option<u32>) -> bool {
        let seen = self.seen(at);
        let halves = self.scratch.sights.halves(&seen);
        if !halves.iter().all(|half| half.value(direction) >= 0.0) {
            return false;
        }
        let Some(cover) = cover.map(|cover| self.seen(cover)) else {
            return true;
        };
        if seen.touches != cover.touches {
            return seen.touches;
        }
        nearer_than(&seen, &cover, self.rounding).value(direction) > 0.0
    }

    fn seen(&self, at: u32) -> Seen {
        self.scratch.seen[at as usize].expect("only what is seen covers")
    }

    /// A screen from the point, looked at once; `None` if it is edge-on or in the plane of
    /// the place.
    fn look(&mut self, screen: u32) -> Option<u32> {
        let scratch = &mut *self.scratch;
        let (when, at) = scratch.looked[screen as usize];
        if when == scratch.now {
            return scratch.seen[at as usize].map(|_| at);
        }
        let at = scratch.seen.len() as u32;
        scratch.looked[screen as usize] = (scratch.now, at);
        let of = self.screens.get(screen);
        let corners = self.screens.corners(screen);
        let mut seen = None;
        if self.place.plane != Some(of.plane) {
            self.totals.n_looks += 1;
            let sights = &mut scratch.sights;
            seen = sights.look(corners, of.normal, &self.place, self.rounding);
        }
        if let Some(seen) = &mut seen {
            seen.screen = screen;
        }
        scratch.seen.push(seen);
        seen.map(|_| at)
    }

    /// Is all of a screen behind what covers the cone, or in its plane?
    fn is_hidden(&self, at: u32, screen: u32, cover: Option<u32>) -> bool {
        let Some(cover) = cover.map(|cover| self.seen(cover)) else {
            return false;
        };
        let plane = |screen: u32| self.screens.get(screen).plane;
        plane(cover.screen) == plane(screen)
            || self
                .scratch
                .sights
                .is_behind(&self.seen(at), &cover, self.rounding)
    }

    /// Does a side of the cone have all of a screen outside?
    fn is_beside(&self, at: u32) -> bool {
        let corners = self.scratch.sights.corners(&self.seen(at));
        self.scratch
            .cone
            .sides
            .iter()
            .any(|side| corners.iter().all(|&c| side.normal.dot(c) < -side.margin))
    }

    /// The cone is finished: its parts go to who asked.
    fn emit(&mut self, cover: Option<u32>, is_ended: bool) {
        self.totals.n_cones += 1;
        let scratch = &mut *self.scratch;
        let factor = contour_sum(&scratch.cone.corners, self.place.normal);
        if factor < FAINT || scratch.cone.is_slit() {
            self.totals.slits += factor;
            return;
        }
        match cover {
            None => self.totals.sky += factor,
            Some(cover) => {
                let seen = scratch.seen[cover as usize].expect("only what is seen covers");
                self.sum += scratch.dealer.deal(
                    self.screens,
                    (&self.place, self.rounding),
                    (&seen, &scratch.cone, factor),
                    is_ended,
                    &mut self.visit,
                );
            }
        }
        if is_ended {
            self.totals.n_ended += 1;
            self.totals.ended += factor;
        }
    }
}
