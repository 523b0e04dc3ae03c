//! Does an arrangement keep its promises? Does a mesh?
//!
//! Nothing here shares code with what it checks: pairs are found by a sweep, sides
//! are decided in `i128`, and curves are followed edge by edge. It is for tests and
//! for those who change an arrangement; nothing else calls it.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, dvec2};

use crate::arrange::{ArrangedEdge, Arrangement, Order, TaggedCurve};
use crate::sets::SetId;
use crate::trimesh::TriMesh;

/// Pixels are smaller than this, so that no product of two differences overflows.
const LARGEST_PIXEL: i64 = 1 << 48;

/// How far a vertex may be from the centre of its pixel in each axis, in pixels: half
/// of one, half of the largest fine unit, and what puts a point on the border
/// (`nodes.rs`).
const IN_PIXEL: f64 = 0.5 + 1.0 / 32.0 + 1.0 / 64.0;

/// So many edges of the border are looked at from both sides.
const MOST_SAMPLES: usize = 1000;

impl Arrangement {
    /// Checks everything an arrangement of these curves promises.
    ///
    /// 1. Vertices are distinct, each is in its pixel and is an end of an edge.
    /// 2. Edges are distinct, no two of them cross or overlap, and none passes through
    ///    a vertex. This is decided in integers.
    /// 3. Edges separate the inside from the outside where the curves of order
    ///    [`Boundary`](Order::Boundary) do, except within
    ///    [`tolerance`](Self::tolerance) of these.
    /// 4. Every curve is a connected chain of edges that carry its id, from its first
    ///    point to its last and past all others, and no edge carries its id elsewhere:
    ///    the chain is within the tolerance of the curve and the curve within the
    ///    tolerance of the chain. Left out are only curves without coordinates, with
    ///    some that are not finite, or not longer than twice the tolerance.
    /// 5. Curves that share a point share a vertex there.
    /// 6. The report counts what is there.
    ///
    /// `curves` are those the arrangement was made of, in the same order.
    ///
    /// # Errors
    ///
    /// The first broken promise, with the vertices, edges and curves that break it and
    /// where they are in the chart.
    pub fn check(&self, curves: &[TaggedCurve]) -> Result<(), String> {
        self.check_vertices()?;
        self.check_edges(curves)?;
        self.check_planar()?;
        self.check_border_degrees(curves)?;
        self.check_inside(curves)?;
        let n_without_edges = self.check_curves(curves)?;

        let report = &self.report;
        let counted = [
            ("curves", report.n_curves, curves.len()),
            ("skipped curves", report.n_skipped, n_without_edges),
            ("vertices", report.n_vertices, self.vertices.len()),
            ("edges", report.n_edges, self.edges.len()),
        ];
        for (what, reported, found) in counted {
            if reported != found {
                return Err(format!("the report has {reported} {what}, found {found}"));
            }
        }
        Ok(())
    }

    fn check_vertices(&self) -> Result<(), String> {
        if self.pixels.len() != self.vertices.len() {
            let (n, m) = (self.pixels.len(), self.vertices.len());
            return Err(format!("{n} pixels for {m} vertices"));
        }
        if let Some(v) = self.pixels.windows(2).position(|p| p[0] >= p[1]) {
            return Err(format!(
                "vertices {v} and {} at {} are not distinct and ascending",
                v + 1,
                self.vertices[v]
            ));
        }
        for (v, (&p, &pixel)) in self.vertices.iter().zip(&self.pixels).enumerate() {
            if pixel.iter().any(|x| x.abs() > LARGEST_PIXEL) {
                return Err(format!("vertex {v} at {p} has pixel {pixel:?}: too far"));
            }
            let off = (self.in_pixels(p) - to_f64(pixel)).abs().max_element();
            // Not a comparison the other way round, for coordinates that are no numbers.
            if !matches!(off.partial_cmp(&IN_PIXEL), Some(o) if o.is_le()) {
                return Err(format!("vertex {v} at {p} is {off} pixels off its pixel"));
            }
        }
        Ok(())
    }

    fn check_edges(&self, curves: &[TaggedCurve]) -> Result<(), String> {
        let mut is_used = vec![false; self.vertices.len()];
        for (e, edge) in self.edges.iter().enumerate() {
            let [a, b] = edge.ends;
            if a >= b || b as usize >= self.vertices.len() {
                return Err(format!("edge {e} has ends {a} and {b}"));
            }
            is_used[a as usize] = true;
            is_used[b as usize] = true;
            if edge.curves.0 as usize >= self.sets.len() {
                return Err(format!("edge {e} at {} has no set", self.place(edge)));
            }
            let set = self.sets.get(edge.curves);
            let is_known = set.last().is_some_and(|&c| (c as usize) < curves.len());
            if !is_known || set.windows(2).any(|c| c[0] >= c[1]) {
                let place = self.place(edge);
                return Err(format!("edge {e} at {place} has the curves {set:?}"));
            }
        }
        if let Some(e) = self.edges.windows(2).position(|e| e[0].ends >= e[1].ends) {
            return Err(format!(
                "edges {e} and {} at {} are not distinct and ascending",
                e + 1,
                self.place(&self.edges[e])
            ));
        }
        if let Some(v) = is_used.iter().position(|used| !used) {
            let p = self.vertices[v];
            return Err(format!("vertex {v} at {p} is no end of an edge"));
        }
        Ok(())
    }

    /// Compares all edges that overlap in x and lie in one of some strips of y.
    fn check_planar(&self) -> Result<(), String> {
        let low = self.pixels.iter().map(|p| p[1]).min().unwrap_or(0);
        let high = self.pixels.iter().map(|p| p[1]).max().unwrap_or(0);
        let n_strips = (self.edges.len() as f64).sqrt().ceil().max(1.0) as i64;
        let height = (high - low) / n_strips + 1;
        let mut strips: Vec<Vec<u32>> = vec![Vec::new(); n_strips as usize];
        for (e, edge) in self.edges.iter().enumerate() {
            let [from, to] = self.span(edge, 1).map(|y| (y - low) / height);
            for strip in &mut strips[from as usize..=to as usize] {
                strip.push(e as u32);
            }
        }
        for strip in &mut strips {
            let spans = |e: u32| self.span(&self.edges[e as usize], 0);
            strip.sort_by_key(|&e| (spans(e)[0], e));
            for (k, &e) in strip.iter().enumerate() {
                let reach = spans(e)[1];
                for &f in strip[k + 1..].iter().take_while(|&&f| spans(f)[0] <= reach) {
                    self.check_pair(e.min(f), e.max(f))?;
                }
            }
        }
        Ok(())
    }

    fn check_pair(&self, e: u32, f: u32) -> Result<(), String> {
        let (s, t) = (&self.edges[e as usize], &self.edges[f as usize]);
        let [a, b] = s.ends.map(|v| self.pixels[v as usize]);
        let [c, d] = t.ends.map(|v| self.pixels[v as usize]);
        let [at_c, at_d] = [c, d].map(|p| turn(a, b, p).signum());
        let [at_a, at_b] = [a, b].map(|p| turn(c, d, p).signum());
        if at_c * at_d < 0 && at_a * at_b < 0 {
            let (p, q) = (self.place(s), self.place(t));
            return Err(format!("edges {e} at {p} and {f} at {q} cross"));
        }
        // A vertex inside an edge; an edge on another has an end there too.
        for (edge, name, ends, v, side) in [
            (s, e, [a, b], t.ends[0], at_c),
            (s, e, [a, b], t.ends[1], at_d),
            (t, f, [c, d], s.ends[0], at_a),
            (t, f, [c, d], s.ends[1], at_b),
        ] {
            let p = self.pixels[v as usize];
            let is_between = (0..2).all(|k| {
                let [x, y] = [ends[0][k], ends[1][k]];
                x.min(y) <= p[k] && p[k] <= x.max(y)
            });
            if side == 0 && is_between && !edge.ends.contains(&v) {
                let (p, q) = (self.vertices[v as usize], self.place(edge));
                return Err(format!("vertex {v} at {p} lies on edge {name} at {q}"));
            }
        }
        Ok(())
    }

    /// Lines that separate end nowhere, except where a border does.
    fn check_border_degrees(&self, curves: &[TaggedCurve]) -> Result<(), String> {
        let mut is_odd = vec![false; self.vertices.len()];
        for (e, edge) in self.edges.iter().enumerate().filter(|e| e.1.separates) {
            let set = self.sets.get(edge.curves);
            if !set.iter().any(|&c| is_border(&curves[c as usize])) {
                let place = self.place(edge);
                return Err(format!("edge {e} at {place} separates without a border"));
            }
            for v in edge.ends {
                is_odd[v as usize] ^= true;
            }
        }
        let open_ends: Vec<DVec2> = borders(curves)
            .filter(|c| c.points.first() != c.points.last())
            .flat_map(|c| c.points.first().into_iter().chain(c.points.last()))
            .map(|&p| self.in_pixels(p))
            .collect();
        for v in (0..self.vertices.len()).filter(|&v| is_odd[v]) {
            let p = to_f64(self.pixels[v]);
            if !open_ends.iter().any(|q| q.distance(p) <= self.tolerance) {
                let p = self.vertices[v];
                return Err(format!("a line that separates ends in vertex {v} at {p}"));
            }
        }
        Ok(())
    }

    /// Is inside what the border bounds? Asked on both sides of its edges, and in a
    /// lattice over all of it.
    fn check_inside(&self, curves: &[TaggedCurve]) -> Result<(), String> {
        let mut ends: BTreeMap<[u64; 2], usize> = BTreeMap::new();
        for p in borders(curves).flat_map(|c| c.points.first().into_iter().chain(c.points.last())) {
            *ends.entry(bits_of(*p)).or_insert(0) += 1;
        }
        if ends.values().any(|n| n % 2 == 1) {
            // A border with a gap bounds nothing.
            return Ok(());
        }
        let outline: Vec<[DVec2; 2]> = borders(curves)
            .flat_map(|c| c.points.windows(2))
            .map(|pair| [pair[0], pair[1]].map(|p| self.in_pixels(p)))
            .collect();

        let mut samples: Vec<DVec2> = Vec::new();
        let on_border: Vec<[DVec2; 2]> = self
            .edges
            .iter()
            .filter(|e| {
                let set = self.sets.get(e.curves);
                set.iter().any(|&c| is_border(&curves[c as usize]))
            })
            .map(|e| e.ends.map(|v| to_f64(self.pixels[v as usize])))
            .collect();
        for [a, b] in on_border.iter().step_by(1 + on_border.len() / MOST_SAMPLES) {
            let aside = (b - a).normalize_or_zero().perp() * (self.tolerance + 2.0);
            samples.extend([(a + b) / 2.0 + aside, (a + b) / 2.0 - aside]);
        }
        let (min, max) = outline
            .iter()
            .flatten()
            .fold((DVec2::MAX, DVec2::MIN), |(min, max), &p| {
                (min.min(p), max.max(p))
            });
        if !outline.is_empty() {
            let at = |k: i32| f64::from(k) / 11.0;
            let lattice = (0..=11).flat_map(|i| (0..=11).map(move |j| dvec2(at(i), at(j))));
            samples.extend(lattice.map(|t| min + t * (max - min)));
        }

        for sample in samples {
            let pixel = sample.round().to_array().map(|x| x as i64);
            let p = to_f64(pixel);
            if outline.iter().any(|&s| distance(s, p) <= self.tolerance) {
                continue;
            }
            let expected = outline.iter().filter(|&&s| is_right_of(s, p)).count() % 2 == 1;
            if self.is_inside(pixel.map(|x| 2 * x)) != expected {
                let p = self.origin + p * self.pixel;
                let (is, should) = if expected {
                    ("outside", "inside")
                } else {
                    ("inside", "outside")
                };
                return Err(format!("{p} is {is}, but the border has it {should}"));
            }
        }
        Ok(())
    }

    /// Do edges that separate bound a place given in half pixels? Exact, for a place
    /// on none of them.
    fn is_inside(&self, p: [i64; 2]) -> bool {
        let is_crossed = |edge: &&ArrangedEdge| {
            let [a, b] = edge.ends.map(|v| self.pixels[v as usize].map(|x| 2 * x));
            let (low, high) = if a[1] <= b[1] { (a, b) } else { (b, a) };
            // To the right of the place, and closed below.
            low[1] <= p[1] && p[1] < high[1] && turn(low, high, p) > 0
        };
        self.edges
            .iter()
            .filter(|e| e.separates)
            .filter(is_crossed)
            .count()
            % 2
            == 1
    }

    /// Returns how many curves have no edges.
    fn check_curves(&self, curves: &[TaggedCurve]) -> Result<usize, String> {
        let mut edges_of: Vec<Vec<[u32; 2]>> = vec![Vec::new(); curves.len()];
        for edge in &self.edges {
            for &c in self.sets.get(edge.curves) {
                edges_of[c as usize].push(edge.ends);
            }
        }
        let position = |v: u32| to_f64(self.pixels[v as usize]);
        let mut n_without_edges = 0;
        // Where curves are at their points: by coordinates, the first of these curves
        // and the vertices that it has there in common with all others.
        let mut shared: BTreeMap<[u64; 2], (usize, Vec<u32>)> = BTreeMap::new();
        for (id, (curve, edges)) in curves.iter().zip(&edges_of).enumerate() {
            let points: Vec<DVec2> = curve.points.iter().map(|&p| self.in_pixels(p)).collect();
            if edges.is_empty() {
                n_without_edges += 1;
                let length = points.iter().map(|p| p.distance(points[0]));
                let length = length.fold(0.0, f64::max);
                if is_bounded(curve) && length > 2.0 * self.tolerance {
                    let (a, b) = (curve.points[0], length);
                    return Err(format!("curve {id} at {a}, {b} pixels long, has no edge"));
                }
                continue;
            }
            if !is_bounded(curve) {
                return Err(format!("curve {id} has edges, and no place"));
            }
            let walk = follow(&points, edges, position, self.tolerance)
                .map_err(|lost| lost.describe(&format!("curve {id}"), self))?;
            for (p, vertices) in curve.points.iter().zip(walk) {
                // Zero has two signs.
                let key = bits_of(*p + DVec2::ZERO);
                let (first, common) = shared.entry(key).or_insert_with(|| (id, vertices.clone()));
                common.retain(|v| vertices.contains(v));
                if common.is_empty() {
                    return Err(format!(
                        "curves {first} and {id} share the point {p} and no vertex there"
                    ));
                }
            }
        }
        Ok(n_without_edges)
    }

    /// Where an edge is in the chart: its middle.
    fn place(&self, edge: &ArrangedEdge) -> DVec2 {
        let [a, b] = edge.ends.map(|v| self.vertices[v as usize]);
        (a + b) / 2.0
    }

    /// From where to where an edge goes along an axis, in pixels.
    fn span(&self, edge: &ArrangedEdge, axis: usize) -> [i64; 2] {
        let [a, b] = edge.ends.map(|v| self.pixels[v as usize][axis]);
        [a.min(b), a.max(b)]
    }

    fn in_pixels(&self, p: DVec2) -> DVec2 {
        (p - self.origin) / self.pixel
    }
}

impl TriMesh {
    /// Checks that this is a mesh of `arrangement`, also after
    /// [`bisect`](Self::bisect) and [`cut`](Self::cut).
    ///
    /// 1. What [`check`](Self::check) says.
    /// 2. Every edge of the arrangement inside the border or on it is a chain of edges
    ///    here, within a pixel of it, which carry all its curves.
    /// 3. The triangles' areas sum up to what the edges that separate bound, up to a
    ///    pixel along these.
    ///
    /// # Errors
    ///
    /// The first broken promise, with where in the chart it is broken.
    pub fn check_against(&self, arrangement: &Arrangement) -> Result<(), String> {
        self.check()?;

        let mut vertices: BTreeMap<[u64; 2], u32> = BTreeMap::new();
        for (v, &p) in (0..).zip(&self.vertices) {
            vertices.entry(bits_of(p)).or_insert(v);
        }
        let mut tagged: Vec<([u32; 2], SetId)> =
            self.edges.iter().map(|(&ends, &set)| (ends, set)).collect();
        tagged.sort_unstable();
        let mut beside: Vec<Vec<usize>> = vec![Vec::new(); self.vertices.len()];
        for (k, (ends, _)) in tagged.iter().enumerate() {
            for v in ends {
                beside[*v as usize].push(k);
            }
        }

        let mut area = 0.0;
        let mut length = 0.0;
        for (e, edge) in arrangement.edges.iter().enumerate() {
            let [a, b] = edge.ends.map(|v| arrangement.pixels[v as usize]);
            let middle = [0, 1].map(|k| a[k] + b[k]);
            if edge.separates {
                length += to_f64(a).distance(to_f64(b));
                area += arrangement.area_left_of(edge);
            } else if !arrangement.is_inside(middle) {
                continue;
            }
            let ends = edge.ends.map(|v| arrangement.vertices[v as usize]);
            let is_there = ends
                .map(|p| vertices.get(&bits_of(p)).copied())
                .into_iter()
                .collect::<Option<Vec<u32>>>()
                .is_some_and(|v| {
                    let wanted = arrangement.sets.get(edge.curves);
                    self.has_chain([v[0], v[1]], wanted, &tagged, &beside)
                });
            if !is_there {
                let place = arrangement.place(edge);
                return Err(format!("edge {e} of the arrangement at {place} is gone"));
            }
        }

        let pixel_sq = self.pixel * self.pixel;
        let error = (self.total_area() - area * pixel_sq).abs();
        let allowed = length * pixel_sq + 1e-12 * area * pixel_sq;
        if error.is_nan() || error > allowed {
            let (found, expected) = (self.total_area(), area * pixel_sq);
            return Err(format!("the area is {found}, the border bounds {expected}"));
        }
        Ok(())
    }

    /// Do edges with the `wanted` curves lead straight from one vertex to the other?
    fn has_chain(
        &self,
        [from, to]: [u32; 2],
        wanted: &[u32],
        tagged: &[([u32; 2], SetId)],
        beside: &[Vec<usize>],
    ) -> bool {
        let line = [from, to].map(|v| self.vertices[v as usize]);
        let along = |v: u32| (line[1] - line[0]).dot(self.vertices[v as usize] - line[0]);
        // More than one edge may leave along the line, where another runs beside it.
        let mut work = vec![from];
        let mut seen = BTreeSet::new();
        while let Some(here) = work.pop() {
            if here == to {
                return true;
            }
            for &k in &beside[here as usize] {
                let ([a, b], set) = tagged[k];
                let there = if a == here { b } else { a };
                let is_near = distance(line, self.vertices[there as usize]) <= self.pixel;
                let curves = self.sets().get(set);
                if is_near
                    && along(there) > along(here)
                    && wanted.iter().all(|c| curves.contains(c))
                    && seen.insert(there)
                {
                    work.push(there);
                }
            }
        }
        false
    }
}

impl Arrangement {
    /// What an edge adds to the area inside, in square pixels: that of the triangle to
    /// the centre, positive if the inside is seen beyond a counter-clockwise edge.
    fn area_left_of(&self, edge: &ArrangedEdge) -> f64 {
        let [a, b] = edge.ends.map(|v| self.pixels[v as usize]);
        // A ray from the middle to the right (up, along a level edge) leaves from the
        // inside or from the outside; the edge itself does not count.
        let middle = [0, 1].map(|k| a[k] + b[k]);
        let is_level = a[1] == b[1];
        let n_beyond = self
            .edges
            .iter()
            .filter(|e| e.separates && e.ends != edge.ends);
        let flip = |p: [i64; 2]| if is_level { [p[1], p[0]] } else { p };
        let n_beyond = n_beyond
            .filter(|e| {
                let [c, d] = e.ends.map(|v| flip(self.pixels[v as usize].map(|x| 2 * x)));
                let p = flip(middle);
                let (low, high) = if c[1] <= d[1] { (c, d) } else { (d, c) };
                low[1] <= p[1] && p[1] < high[1] && turn(low, high, p) > 0
            })
            .count();
        let is_inside_beyond = n_beyond % 2 == 1;
        // Beyond is to the right of an upward edge, and left of a rightward one.
        let goes_forward = if is_level { a[0] < b[0] } else { a[1] > b[1] };
        let doubled = turn([0, 0], a, b) as f64;
        if is_inside_beyond == goes_forward {
            doubled / 2.0
        } else {
            -doubled / 2.0
        }
    }
}

/// Where a curve is lost among its edges, or an edge from its curve.
#[derive(Debug, PartialEq)]
enum Lost {
    /// No vertex with the curve is near this point that can be reached from those
    /// before it.
    AtPoint(usize, DVec2),
    /// This edge is not near the curve.
    Edge([u32; 2], DVec2),
}

impl Lost {
    fn describe(&self, name: &str, arrangement: &Arrangement) -> String {
        let to_chart = |p: DVec2| arrangement.origin + p * arrangement.pixel;
        match *self {
            Self::AtPoint(k, p) => {
                format!("{name} is not there up to its point {k} at {}", to_chart(p))
            }
            Self::Edge([a, b], p) => {
                format!("edge {a}-{b} at {} is not on {name}", to_chart(p))
            }
        }
    }
}

/// Follows a polyline along its edges: at each of its points the vertices where it can
/// be, all within the tolerance.
///
/// A stretch of edges counts for a segment if it is within the tolerance of it. Then
/// the segment is within the tolerance of the stretch too, for the stretch passes all
/// of it, from near its one end to near the other.
fn follow(
    points: &[DVec2],
    edges: &[[u32; 2]],
    position: impl Fn(u32) -> DVec2,
    tolerance: f64,
) -> Result<Vec<Vec<u32>>, Lost> {
    let mut vertices: Vec<u32> = edges.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let places: Vec<DVec2> = vertices.iter().map(|&v| position(v)).collect();
    let edges: Vec<[usize; 2]> = edges
        .iter()
        .map(|e| e.map(|v| vertices.partition_point(|&u| u < v)))
        .collect();

    let near = |p: DVec2| -> Vec<usize> {
        let is_near = |&v: &usize| places[v].distance(p) <= tolerance;
        (0..places.len()).filter(is_near).collect()
    };
    let mut is_near = vec![false; edges.len()];
    let mut reached: Vec<usize> = near(points[0]);
    let mut walk = Vec::with_capacity(points.len());
    for (k, &p) in points.iter().enumerate() {
        if k > 0 {
            let segment = [points[k - 1], p];
            let on_segment: Vec<bool> = places
                .iter()
                .map(|&q| distance(segment, q) <= tolerance)
                .collect();
            let mut stretches = Stretches((0..places.len()).collect());
            for (&[a, b], is_near) in edges.iter().zip(&mut is_near) {
                if on_segment[a] && on_segment[b] {
                    *is_near = true;
                    stretches.join(a, b);
                }
            }
            let mut from: Vec<usize> = reached.iter().map(|&v| stretches.of(v)).collect();
            from.sort_unstable();
            reached = near(p);
            reached.retain(|&v| from.binary_search(&stretches.of(v)).is_ok());
        }
        if reached.is_empty() {
            return Err(Lost::AtPoint(k, p));
        }
        walk.push(reached.iter().map(|&v| vertices[v]).collect());
    }
    match is_near.iter().position(|near| !near) {
        Some(e) => {
            let [a, b] = edges[e];
            let middle = (places[a] + places[b]) / 2.0;
            Err(Lost::Edge([vertices[a], vertices[b]], middle))
        }
        None => Ok(walk),
    }
}

/// Which vertices edges connect: each points to another of its stretch, one to itself.
struct Stretches(Vec<usize>);

impl Stretches {
    fn of(&self, mut v: usize) -> usize {
        while self.0[v] != v {
            v = self.0[v];
        }
        v
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.of(a), self.of(b));
        self.0[a.max(b)] = a.min(b);
    }
}

fn is_border(curve: &TaggedCurve) -> bool {
    curve.order == Order::Boundary
}

/// The curves that bound the receiver and have a place.
fn borders(curves: &[TaggedCurve]) -> impl Iterator<Item = &TaggedCurve> {
    curves.iter().filter(|c| is_border(c) && is_bounded(c))
}

/// Has the curve points, and all of them a place?
fn is_bounded(curve: &TaggedCurve) -> bool {
    let is_place = |p: &DVec2| p.abs().max_element() < 1e100 && !p.is_nan();
    !curve.points.is_empty() && curve.points.iter().all(is_place)
}

/// Does a ray from the point to the right cross the segment? For points that are not
/// near it.
fn is_right_of([a, b]: [DVec2; 2], p: DVec2) -> bool {
    let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
    low.y <= p.y && p.y < high.y && (high - low).perp_dot(p - low) > 0.0
}

/// The distance of a point from a segment.
fn distance([a, b]: [DVec2; 2], p: DVec2) -> f64 {
    let d = b - a;
    let t = (p - a).dot(d) / d.length_squared();
    // No number if the ends are the same.
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
    p.distance(a + t * d)
}

/// Positive if `a`, `b`, `p` turn left, zero if they are on a line. Exact up to
/// [`LARGEST_PIXEL`].
fn turn(a: [i64; 2], b: [i64; 2], p: [i64; 2]) -> i128 {
    let [x, y] = [0, 1].map(|k| i128::from(b[k] - a[k]));
    let [u, v] = [0, 1].map(|k| i128::from(p[k] - a[k]));
    x * v - y * u
}

fn bits_of(p: DVec2) -> [u64; 2] {
    p.to_array().map(f64::to_bits)
}

fn to_f64(pixel: [i64; 2]) -> DVec2 {
    dvec2(pixel[0] as f64, pixel[1] as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ArrangementOptions, Cut, arrange};
    use antumbra_geom::Control;

    fn curve(points: &[(f64, f64)], order: Order) -> TaggedCurve {
        TaggedCurve {
            points: points.iter().map(|&(x, y)| dvec2(x, y)).collect(),
            order,
        }
    }

    /// A square with a hole, two crossing lines, one along the border, a polyline that
    /// shares its first point with a line, and one too short for an edge.
    fn curves() -> Vec<TaggedCurve> {
        vec![
            curve(
                &[(0., 0.), (4., 0.), (4., 4.), (0., 4.), (0., 0.)],
                Order::Boundary,
            ),
            curve(
                &[(1., 1.), (1., 2.), (2., 2.), (2., 1.), (1., 1.)],
                Order::Boundary,
            ),
            curve(&[(0.5, 0.5), (3.5, 3.5)], Order::D1),
            curve(&[(0.5, 3.5), (3.5, 0.5)], Order::D2),
            curve(&[(1., 0.), (3., 0.)], Order::D0),
            curve(&[(0.5, 3.5), (2.5, 3.8), (3.8, 2.5)], Order::D2),
            curve(&[(3.2, 1.5), (3.2, 1.5 + 1e-8)], Order::D2),
        ]
    }

    fn arranged() -> Arrangement {
        let arrangement =
            arrange(&curves(), &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default();
        assert_eq!(arrangement.check(&curves()), Ok(()));
        arrangement
    }

    /// The vertex at a point.
    fn at(a: &Arrangement, x: f64, y: f64) -> u32 {
        let found = |p: &DVec2| p.distance(dvec2(x, y)) < 1e-6;
        a.vertices.iter().position(found).unwrap() as u32
    }

    fn edge(a: &Arrangement, [u, v]: [u32; 2]) -> usize {
        let ends = [u.min(v), u.max(v)];
        a.edges.iter().position(|e| e.ends == ends).unwrap()
    }

    fn edge_between(a: &Arrangement, p: (f64, f64), q: (f64, f64)) -> usize {
        edge(a, [at(a, p.0, p.1), at(a, q.0, q.1)])
    }

    /// The edge of a line from the corner of the hole to the polyline.
    fn inner_edge(a: &Arrangement) -> usize {
        edge_between(a, (2., 2.), (3.15, 3.15))
    }

    /// Adds an edge in its place, and counts it.
    fn insert(a: &mut Arrangement, [u, v]: [u32; 2], curves: &[u32]) {
        let new = ArrangedEdge {
            ends: [u.min(v), u.max(v)],
            curves: a.sets.intern(curves),
            separates: false,
        };
        let k = a.edges.partition_point(|e| e.ends < new.ends);
        a.edges.insert(k, new);
        a.report.n_edges += 1;
    }

    fn remove(a: &mut Arrangement, e: usize) {
        a.edges.remove(e);
        a.report.n_edges -= 1;
    }

    fn retag(a: &mut Arrangement, e: usize, curves: &[u32]) {
        a.edges[e].curves = a.sets.intern(curves);
    }

    /// What the check says of a sound arrangement that was changed.
    fn found(change: impl FnOnce(&mut Arrangement)) -> String {
        let mut a = arranged();
        change(&mut a);
        a.check(&curves()).unwrap_err()
    }

    #[track_caller]
    fn assert_finds(what: &str, change: impl FnOnce(&mut Arrangement)) {
        let message = found(change);
        assert!(message.contains(what), "{message}");
    }

    #[test]
    fn equal_or_unordered_vertices_are_found() {
        assert_finds("are not distinct and ascending", |a| {
            a.pixels[3] = a.pixels[2];
        });
        assert_finds("are not distinct and ascending", |a| a.pixels.swap(4, 5));
        assert_finds("pixels for", |a| a.vertices.truncate(5));
    }

    #[test]
    fn a_vertex_off_its_pixel_is_found() {
        assert_finds("off its pixel", |a| {
            let v = at(a, 3.5, 3.5) as usize;
            a.vertices[v].x += 0.75 * a.pixel;
        });
        assert_finds("off its pixel", |a| a.vertices[2].y = f64::NAN);
        assert_finds("too far", |a| {
            let last = a.pixels.len() - 1;
            a.pixels[last][0] = i64::MAX;
        });
    }

    #[test]
    fn a_vertex_without_edges_is_found() {
        assert_finds("is no end of an edge", |a| {
            let ends = edge_between(a, (3.15, 3.15), (3.5, 3.5));
            remove(a, ends);
        });
    }

    #[test]
    fn equal_unordered_and_broken_edges_are_found() {
        assert_finds("are not distinct and ascending", |a| {
            let e = inner_edge(a);
            a.edges.insert(e, a.edges[e]);
        });
        assert_finds("are not distinct and ascending", |a| a.edges.swap(0, 1));
        assert_finds("has ends", |a| a.edges[0].ends.reverse());
        assert_finds("has ends", |a| a.edges[0].ends[1] = a.edges[0].ends[0]);
        assert_finds("has ends", |a| a.edges[0].ends[1] = 1000);
    }

    #[test]
    fn edges_without_known_curves_are_found() {
        assert_finds("has no set", |a| a.edges[0].curves = SetId(999));
        assert_finds("has the curves [99]", |a| retag(a, 0, &[99]));
        assert_finds("has the curves []", |a| retag(a, 0, &[]));
    }

    #[test]
    fn crossing_edges_are_found() {
        // Across the line from (2, 2) to (3.5, 3.5).
        assert_finds("cross", |a| {
            let ends = [at(a, 2.5, 3.8), at(a, 4., 0.)];
            insert(a, ends, &[5]);
        });
    }

    #[test]
    fn a_vertex_on_an_edge_is_found() {
        // Past (3, 0), on the border.
        assert_finds("lies on edge", |a| {
            let ends = [at(a, 1., 0.), at(a, 4., 0.)];
            insert(a, ends, &[0]);
        });
        // Without an edge of its own: the two that met in (3, 0) are one.
        assert_finds("lies on edge", |a| {
            let (p, q) = (at(a, 1., 0.), at(a, 4., 0.));
            let e = edge_between(a, (1., 0.), (3., 0.));
            let f = edge_between(a, (3., 0.), (4., 0.));
            remove(a, e.max(f));
            remove(a, e.min(f));
            insert(a, [p, q], &[0, 4]);
            let lonely = [at(a, 3., 0.), at(a, 3.5, 0.5)];
            insert(a, lonely, &[3]);
        });
    }

    #[test]
    fn crossings_anywhere_are_found_as_by_comparing_all_pairs() {
        // Lines that cross at one pixel of the coarsest kind: swap ends of pairs of
        // edges and see whether the sweep finds what comparing all finds.
        let a = arranged();
        let n = a.edges.len();
        for (i, j) in (0..n).flat_map(|i| (0..i).map(move |j| (i, j))) {
            let mut changed = a.clone();
            let ([_, b], [_, d]) = (a.edges[i].ends, a.edges[j].ends);
            if a.edges[i].ends[0] >= d || a.edges[j].ends[0] >= b || b == d {
                continue;
            }
            changed.edges[i].ends[1] = d;
            changed.edges[j].ends[1] = b;
            let all_pairs = (0..n as u32)
                .flat_map(|e| (0..e).map(move |f| (f, e)))
                .any(|(f, e)| changed.check_pair(f, e).is_err());
            assert_eq!(changed.check_planar().is_err(), all_pairs);
        }
    }

    #[test]
    fn a_border_that_does_not_separate_is_found() {
        assert_finds("a line that separates ends", |a| {
            let e = edge_between(a, (1., 0.), (3., 0.));
            a.edges[e].separates = false;
        });
        assert_finds("separates without a border", |a| {
            let e = inner_edge(a);
            a.edges[e].separates = true;
        });
        // All of the hole.
        assert_finds("is inside, but the border has it outside", |a| {
            for edge in &mut a.edges {
                edge.separates &= !a.sets.get(edge.curves).contains(&1);
            }
        });
    }

    #[test]
    fn a_curve_with_a_gap_is_found() {
        // Its edge loses its tag, or is not there at all.
        assert_finds("curve 2 is not there up to its point 1", |a| {
            let e = edge_between(a, (1., 1.), (2., 2.));
            retag(a, e, &[3]);
        });
        assert_finds("curve 3 is not there", |a| {
            let e = (0..a.edges.len())
                .find(|&e| a.sets.get(a.edges[e].curves) == [3])
                .unwrap();
            remove(a, e);
        });
        assert_finds("curve 4 at [1, 0]", |a| {
            let e = edge_between(a, (1., 0.), (3., 0.));
            retag(a, e, &[0]);
        });
    }

    #[test]
    fn a_curve_where_it_is_not_is_found() {
        assert_finds("is not on curve 4", |a| {
            let e = inner_edge(a);
            retag(a, e, &[2, 4]);
        });
        assert_finds("curve 6 is not there", |a| {
            let e = inner_edge(a);
            retag(a, e, &[2, 6]);
        });
    }

    #[test]
    fn a_chain_that_leaves_its_curve_is_found() {
        // The end of a line, with its vertex, moved by more than the tolerance.
        assert_finds("curve 2 is not there up to its point 1", |a| {
            let v = at(a, 3.5, 3.5) as usize;
            a.pixels[v][1] += 10;
            a.vertices[v].y += 10.0 * a.pixel;
        });
        let mut a = arranged();
        let v = at(&a, 3.5, 3.5) as usize;
        a.pixels[v][1] += 8;
        a.vertices[v].y += 8.0 * a.pixel;
        assert_eq!(a.check(&curves()), Ok(()));
    }

    #[test]
    fn curves_that_lose_their_common_point_are_found() {
        // The second of two lines through (0.5, 3.5) ends in a vertex beside it.
        assert_finds("share the point [0.5, 3.5] and no vertex there", |a| {
            let old = at(a, 0.5, 3.5);
            let e = (0..a.edges.len())
                .find(|&e| a.sets.get(a.edges[e].curves) == [5] && a.edges[e].ends.contains(&old))
                .unwrap();
            let [u, v] = a.edges[e].ends;
            let other = u ^ v ^ old;
            remove(a, e);
            // After the vertices before it, so that all keep their order.
            let pixel = [a.pixels[old as usize][0], a.pixels[old as usize][1] + 3];
            let k = a.pixels.partition_point(|&p| p < pixel);
            a.pixels.insert(k, pixel);
            a.vertices.insert(k, a.origin + to_f64(pixel) * a.pixel);
            for edge in &mut a.edges {
                edge.ends = edge.ends.map(|v| v + u32::from(v as usize >= k));
            }
            a.report.n_vertices += 1;
            let other = other + u32::from(other as usize >= k);
            insert(a, [k as u32, other], &[5]);
        });
    }

    #[test]
    fn a_report_that_counts_wrongly_is_found() {
        assert_finds("edges, found", |a| a.report.n_edges += 1);
        assert_finds("skipped curves, found 1", |a| a.report.n_skipped = 0);
        assert_finds("curves, found 7", |a| a.report.n_curves = 8);
        assert_finds("vertices, found", |a| a.report.n_vertices = 0);
    }

    #[test]
    fn an_arrangement_of_other_curves_is_found() {
        let mut others = curves();
        others[3].points[0].x += 1e-6;
        assert!(arranged().check(&others).is_err());
    }

    fn meshed() -> (Arrangement, TriMesh) {
        let a = arranged();
        let mut mesh = TriMesh::new(&a, &curves()).unwrap();
        assert_eq!(mesh.check_against(&a), Ok(()));
        let all: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        mesh.bisect(&all);
        mesh.cut(&[(
            Cut {
                ends: [dvec2(0.1, 0.2), dvec2(3.0, 3.9)],
                curve: 7,
                order: Order::D2,
            },
            (0..mesh.triangles.len() as u32).collect(),
        )]);
        assert_eq!(mesh.check_against(&a), Ok(()));
        (a, mesh)
    }

    #[track_caller]
    fn assert_mesh_finds(what: &str, change: impl FnOnce(&mut TriMesh)) {
        let (a, mut mesh) = meshed();
        change(&mut mesh);
        let message = mesh.check_against(&a).unwrap_err();
        assert!(message.contains(what), "{message}");
    }

    #[test]
    fn triangles_that_are_wrong_are_found() {
        assert_mesh_finds("has an area of -", |mesh| mesh.triangles[0].swap(0, 1));
        assert_mesh_finds("has a corner twice", |mesh| {
            mesh.triangles[0][0] = mesh.triangles[0][1];
        });
        assert_mesh_finds("neighbours are not", |mesh| {
            mesh.neighbours[0].rotate_left(1);
        });
        assert_mesh_finds("has one triangle but is no border", |mesh| {
            mesh.triangles.pop();
            mesh.neighbours.pop();
        });
    }

    #[test]
    fn a_constraint_that_is_gone_is_found() {
        assert_mesh_finds("of the arrangement at", |mesh| {
            let mut keys: Vec<[u32; 2]> = mesh.edges.keys().copied().collect();
            keys.sort_unstable();
            // The first edge of the line from (0.5, 3.5), which no border covers.
            let is_inner = |&[a, b]: &[u32; 2]| {
                let set = mesh.edge_curves(a, b).unwrap();
                mesh.sets().get(set) == [3]
            };
            let key = *keys.iter().find(|k| is_inner(k)).unwrap();
            mesh.edges.remove(&key);
        });
    }

    #[test]
    fn a_vertex_that_moved_is_found() {
        assert_mesh_finds("of the arrangement at", |mesh| {
            let p = dvec2(3.5, 3.5);
            let v = mesh.vertices.iter().position(|&q| q == p).unwrap();
            mesh.vertices[v].x += 1e-3;
        });
    }

    #[test]
    fn a_mesh_of_too_much_is_found() {
        // The mesh has the hole filled: all its constraints are there.
        let mut open = curves();
        let a = arranged();
        open[1].order = Order::D0;
        let filled =
            arrange(&open, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default();
        let mesh = TriMesh::new(&filled, &open).unwrap();
        let message = mesh.check_against(&a).unwrap_err();
        assert!(message.contains("the border bounds 15"), "{message}");
    }
}
