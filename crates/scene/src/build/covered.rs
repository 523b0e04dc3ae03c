//! What bodies that stand on one another cover of each other.
//!
//! A floor under a box and a thin plate of two sheets look the same in their common plane:
//! two faces that look opposite ways. What meets them at their edges decides. Where a body
//! stands, both faces are *covered*: they receive and send nothing, and the border of what
//! is covered is an edge from here on. That is the limit of a body a hair above the floor.
//! `docs/design.md` ("Covered faces") has the rule and the cases behind it.

mod claim;
mod divide;
mod turn;

use super::outline::{Polygon, smallest_width, width};
use super::overlap::overlap_area;
use crate::bvh::{Aabb, BoxTree};
use crate::scene::{PlaneId, Scene};
use crate::sets::Sets;
use antumbra_geom::{Chart, DVec2, DVec3, Plane, Stop};
use claim::{Claim, lies_on};
use divide::Division;
use std::cell::OnceCell;
use std::collections::BTreeMap;
use turn::Turn;

/// A part of one side of a surface.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) polygon: Polygon,
    pub(super) plane: PlaneId,
    /// Does the polygon, seen from the front of its surface, face along its plane?
    pub(super) along: bool,
    pub(super) is_back: bool,
    pub(super) is_covered: bool,
    /// Is it one of several parts of its side?
    pub(super) is_divided: bool,
    /// With the first part of a front that was divided: the whole, which hides as one.
    pub(super) hiding: Option<Hiding>,
}

/// A front that was divided.
#[derive(Debug)]
pub(super) struct Hiding {
    pub(super) pieces: Vec<Vec<u32>>,
    /// Into how many parts.
    pub(super) n_parts: u32,
}

/// All polygons of a scene, with what is known of each.
pub(super) struct Sheets<'a> {
    pub(super) vertices: &'a mut Vec<DVec3>,
    pub(super) planes: &'a [Plane],
    pub(super) extent: f64,
    pub(super) list: Vec<Sheet>,
    /// Nobody looks at what is found after a stop.
    pub(super) stop: Stop<'a>,
}

/// A polygon of a surface, before anything is covered.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) polygon: Polygon,
    pub(super) surface: usize,
    pub(super) is_two_sided: bool,
    pub(super) plane: PlaneId,
    pub(super) along: bool,
}

impl Sheet {
    /// Its sides, by whether they are its back.
    fn sides(&self) -> impl Iterator<Item = bool> + use<> {
        [false, true]
            .into_iter()
            .take(1 + usize::from(self.is_two_sided))
    }

    fn loops(&self) -> impl Iterator<Item = &Vec<u32>> {
        std::iter::once(&self.polygon.outline).chain(&self.polygon.holes)
    }
}

/// One side of a sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    sheet: usize,
    is_back: bool,
}

/// Passes in which what was found decides more.
const MOST_PASSES: usize = 4;

impl Sheets<'_> {
    /// The parts of every surface, those of fronts before those of backs.
    ///
    /// * `n_surfaces` — how many there are, those without a sheet included.
    ///
    /// Also returns pairs of surfaces that cover each other but whose common part could
    /// not be found: these stay whole.
    pub(super) fn parts(mut self, n_surfaces: usize) -> (Vec<Vec<Part>>, Vec<[usize; 2]>) {
        let pairs = self.covering_pairs();
        let mut undivided = Vec::new();
        let mut divided: BTreeMap<Side, Vec<(Polygon, bool)>> = BTreeMap::new();
        for pairs in clusters(&pairs) {
            if self.stop.is_wanted() {
                break;
            }
            match self.divide(&pairs) {
                Some(parts) => divided.extend(parts),
                None => undivided.extend(pairs.iter().map(|pair| {
                    let surface = |side: Side| self.list[side.sheet].surface;
                    pair.map(surface)
                })),
            }
        }
        let mut parts: Vec<Vec<Part>> = (0..n_surfaces).map(|_| Vec::new()).collect();
        for (sheet, whole) in self.list.into_iter().enumerate() {
            for is_back in whole.sides() {
                let of_side = divided.remove(&Side { sheet, is_back });
                let of_side = of_side.unwrap_or_else(|| vec![(whole.polygon.clone(), false)]);
                let is_divided = of_side.len() > 1;
                let mut hiding = (is_divided && !is_back).then(|| Hiding {
                    pieces: whole.polygon.pieces.clone(),
                    n_parts: of_side.len() as u32,
                });
                let of_side = of_side.into_iter().map(|(polygon, is_covered)| Part {
                    polygon,
                    plane: whole.plane,
                    along: whole.along,
                    is_back,
                    is_covered,
                    is_divided,
                    hiding: hiding.take(),
                });
                parts[whole.surface].extend(of_side);
            }
        }
        for of_surface in &mut parts {
            of_surface.sort_by_key(|part| part.is_back);
        }
        (parts, undivided)
    }

    /// Sides that cover each other somewhere.
    fn covering_pairs(&self) -> Vec<[Side; 2]> {
        let candidates = self.opposed_pairs();
        if candidates.is_empty() {
            return Vec::new();
        }
        let mut turn = Turn::new(self);
        let planes = candidates.iter().map(|[a, _]| self.list[a.sheet].plane);
        let patches = self.patches(planes);
        // What is pressed together in one plane tells of the planes that meet it: so it is
        // with the back of a cabinet that fills a niche.
        for _ in 0..MOST_PASSES {
            let found = self.decided(&candidates, &patches, &turn);
            let pressed = found
                .iter()
                .map(|[a, b]| [a.sheet.min(b.sheet), a.sheet.max(b.sheet)]);
            let pressed = pressed.collect();
            let is_done = pressed == turn.covering || found.len() == candidates.len();
            if is_done {
                return found;
            }
            turn.covering = pressed;
        }
        self.decided(&candidates, &patches, &turn)
    }

    /// Those of the candidates that cover each other, as far as is known.
    fn decided(&self, candidates: &[[Side; 2]], patches: &Patches, turn: &Turn) -> Vec<[Side; 2]> {
        let mut claims: BTreeMap<usize, Claim> = BTreeMap::new();
        for side in candidates.iter().flatten() {
            if self.stop.is_wanted() {
                return Vec::new();
            }
            let patch = patches.of[side];
            claims
                .entry(patch)
                .or_insert_with(|| self.claim(&patches.sides[patch], turn));
        }
        let covers = |&&[a, b]: &&[Side; 2]| {
            let [x, y] = [a, b].map(|side| &claims[&patches.of[&side]]);
            self.stands_on(x, y, a, b)
                || self.stands_on(y, x, b, a)
                || lies_on(x, y)
                || lies_on(y, x)
        };
        candidates.iter().filter(covers).copied().collect()
    }

    /// Sides of different surfaces that overlap in one plane and look opposite ways.
    fn opposed_pairs(&self) -> Vec<[Side; 2]> {
        let mut by_plane: BTreeMap<PlaneId, Vec<usize>> = BTreeMap::new();
        for (i, sheet) in self.list.iter().enumerate() {
            by_plane.entry(sheet.plane).or_default().push(i);
        }
        let mut pairs = Vec::new();
        for (plane, sheets) in by_plane {
            let looks = |along: bool| {
                let mut sheets = sheets.iter().map(|&i| &self.list[i]);
                sheets.any(|s| s.is_two_sided || s.along == along)
            };
            if sheets.len() > 1 && looks(true) && looks(false) {
                self.opposed_pairs_in(plane, &sheets, &mut pairs);
            }
        }
        pairs
    }

    fn opposed_pairs_in(&self, plane: PlaneId, sheets: &[usize], pairs: &mut Vec<[Side; 2]>) {
        let chart = self.chart(plane);
        let boxes: Vec<(u32, Aabb)> = sheets
            .iter()
            .enumerate()
            .map(|(i, &sheet)| {
                let corners = self.flat(&chart, &self.list[sheet].polygon.outline);
                (i as u32, Aabb::of(corners.iter().map(|p| p.extend(0.0))))
            })
            .collect();
        let tree = BoxTree::new(&boxes);
        // The convex pieces of each, counter-clockwise in the chart, once somebody asks.
        let pieces: Vec<OnceCell<Vec<Vec<DVec2>>>> = vec![OnceCell::new(); sheets.len()];
        let pieces = |i: u32| {
            let i = i as usize;
            pieces[i]
                .get_or_init(|| self.flat_pieces(&chart, sheets[i]))
                .as_slice()
        };
        for &(i, query) in &boxes {
            if self.stop.is_wanted() {
                return;
            }
            let mut near = Vec::new();
            tree.visit(|b| b.meets(&query), |j| near.push(j));
            near.retain(|&j| j > i && boxes[j as usize].1.meets(&query));
            near.sort_unstable();
            for j in near {
                let [a, b] = [i, j].map(|k| sheets[k as usize]);
                let combinations = self.opposed_sides(a, b);
                if combinations.is_empty() {
                    continue;
                }
                let areas = [a, b].map(|sheet| self.list[sheet].polygon.area);
                let both = [pieces(i), pieces(j)];
                if overlap_area(both, areas, self.tolerance()).is_some() {
                    pairs.extend(combinations);
                }
            }
        }
    }

    /// The sides of two sheets in one plane that look opposite ways.
    fn opposed_sides(&self, a: usize, b: usize) -> Vec<[Side; 2]> {
        let [first, second] = [&self.list[a], &self.list[b]];
        if first.surface == second.surface {
            return Vec::new();
        }
        let along = |side: Side| self.list[side.sheet].along != side.is_back;
        let sides = |sheet, of: &Sheet| of.sides().map(move |is_back| Side { sheet, is_back });
        sides(a, first)
            .flat_map(|x| sides(b, second).map(move |y| [x, y]))
            .filter(|&[x, y]| along(x) != along(y))
            .collect()
    }

    /// The convex pieces of a sheet, counter-clockwise in the chart of its plane.
    fn flat_pieces(&self, chart: &Chart, sheet: usize) -> Vec<Vec<DVec2>> {
        let sheet = &self.list[sheet];
        let pieces = sheet.polygon.pieces.iter().map(|piece| {
            let mut corners = self.flat(chart, piece);
            if !sheet.along {
                corners.reverse();
            }
            corners
        });
        pieces.collect()
    }

    /// Sides of one plane that look the same way and are joined by edges, and which
    /// patch a side belongs to.
    fn patches(&self, planes: impl Iterator<Item = PlaneId>) -> Patches {
        let mut wanted: Vec<PlaneId> = planes.collect();
        wanted.sort_unstable();
        wanted.dedup();
        let mut sides: Vec<Side> = Vec::new();
        let mut at_edge: BTreeMap<(PlaneId, bool, [u32; 2]), Vec<usize>> = BTreeMap::new();
        for (i, sheet) in self.list.iter().enumerate() {
            if wanted.binary_search(&sheet.plane).is_err() {
                continue;
            }
            for is_back in sheet.sides() {
                let number = sides.len();
                sides.push(Side { sheet: i, is_back });
                for corners in sheet.loops() {
                    for (k, &a) in corners.iter().enumerate() {
                        let b = corners[(k + 1) % corners.len()];
                        let key = (sheet.plane, sheet.along != is_back, [a.min(b), a.max(b)]);
                        at_edge.entry(key).or_default().push(number);
                    }
                }
            }
        }
        let mut sets = Sets::new(sides.len());
        for joined in at_edge.values() {
            for pair in joined.windows(2) {
                sets.join(pair[0], pair[1]);
            }
        }
        let mut patches = Patches {
            sides: vec![Vec::new(); sides.len()],
            of: BTreeMap::new(),
        };
        for (number, &side) in sides.iter().enumerate() {
            let patch = sets.first_of(number);
            patches.sides[patch].push(side);
            patches.of.insert(side, patch);
        }
        patches
    }

    /// The parts of all sides that some pairs connect.
    fn divide(&mut self, pairs: &[[Side; 2]]) -> Option<BTreeMap<Side, Vec<(Polygon, bool)>>> {
        let mut partners: BTreeMap<Side, Vec<usize>> = BTreeMap::new();
        for &[a, b] in pairs {
            partners.entry(a).or_default().push(b.sheet);
            partners.entry(b).or_default().push(a.sheet);
        }
        let mut cluster: Vec<usize> = partners.keys().map(|side| side.sheet).collect();
        cluster.dedup();
        let chart = self.chart(self.list[*cluster.first()?].plane);
        let loops: Vec<Vec<Vec<u32>>> = cluster
            .iter()
            .map(|&sheet| self.list[sheet].loops().cloned().collect())
            .collect();
        let tolerance = self.tolerance();
        let division = Division::new(self.vertices, &chart, &loops, tolerance)?;
        let place = |sheet: &usize| cluster.binary_search(sheet).ok();
        let mut parts = BTreeMap::new();
        for (side, partners) in partners {
            let mut partners: Vec<usize> = partners.iter().filter_map(place).collect();
            partners.sort_unstable();
            let found = division.parts(place(&side.sheet)?, &partners)?;
            let whole = &self.list[side.sheet];
            let polygons = found.into_iter().map(|part| {
                let polygon = self.polygon(whole, part.loops, part.pieces, part.area);
                (polygon, part.is_covered)
            });
            let polygons: Vec<(Polygon, bool)> = polygons
                .filter(|(polygon, _)| polygon.width > smallest_width(self.extent))
                .collect();
            parts.insert(side, polygons);
        }
        Some(parts)
    }

    /// A part of a sheet as a polygon; its loops run the way of the plane's normal.
    fn polygon(
        &self,
        whole: &Sheet,
        mut loops: Vec<Vec<u32>>,
        mut pieces: Vec<Vec<u32>>,
        area: f64,
    ) -> Polygon {
        if !whole.along {
            for corners in loops.iter_mut().chain(&mut pieces) {
                corners.reverse();
            }
        }
        let outline = loops.remove(0);
        let positions: Vec<DVec3> = outline.iter().map(|&v| self.vertices[v as usize]).collect();
        Polygon {
            point: outline[0],
            width: width(&positions),
            outline,
            holes: loops,
            pieces,
            area,
            normal: whole.polygon.normal,
        }
    }

    /// The chart of a plane on the side of its normal.
    fn chart(&self, plane: PlaneId) -> Chart {
        let plane = &self.planes[plane.index()];
        Chart::new(plane.point, plane.normal)
    }

    fn flat(&self, chart: &Chart, corners: &[u32]) -> Vec<DVec2> {
        let flat = |&v: &u32| chart.to_chart(self.vertices[v as usize]);
        corners.iter().map(flat).collect()
    }

    fn normal(&self, side: Side) -> DVec3 {
        let sheet = &self.list[side.sheet];
        let normal = self.planes[sheet.plane.index()].normal;
        if sheet.along == side.is_back {
            DVec3::ZERO - normal
        } else {
            normal
        }
    }

    /// Corners this near to an edge lie on it.
    fn tolerance(&self) -> f64 {
        4.0 * self.extent * Scene::PLANE_TOLERANCE
    }
}

/// See [`Sheets::patches`].
struct Patches {
    /// By the number of the first side; empty for others.
    sides: Vec<Vec<Side>>,
    of: BTreeMap<Side, usize>,
}

/// The pairs by what they connect.
fn clusters(pairs: &[[Side; 2]]) -> Vec<Vec<[Side; 2]>> {
    let mut sheets: Vec<usize> = pairs.iter().flatten().map(|side| side.sheet).collect();
    sheets.sort_unstable();
    sheets.dedup();
    let place = |side: Side| sheets.binary_search(&side.sheet).unwrap_or(0);
    let mut sets = Sets::new(sheets.len());
    for &[a, b] in pairs {
        sets.join(place(a), place(b));
    }
    let mut clusters: BTreeMap<usize, Vec<[Side; 2]>> = BTreeMap::new();
    for &pair in pairs {
        let cluster = sets.first_of(place(pair[0]));
        clusters.entry(cluster).or_default().push(pair);
    }
    clusters.into_values().collect()
}
