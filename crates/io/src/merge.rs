//! Triangles of single-precision files become polygons again.
//!
//! glTF and STL know triangles only, and coordinates of 24 bits. The engine wants
//! whole polygons: an edge between two halves of a wall is no edge. So triangles
//! of one part (one material, one mesh) that share edges, lie in one plane to the
//! precision of the file and face the same way become one outline with holes.
//!
//! One way through: weld ([`weld`]), drop what has no area, close T-vertices and
//! grow patches ([`patch`]), trace their borders ([`border`]), straighten chains
//! of corners that no other polygon needs ([`straight`]), and move corners onto
//! the planes they share, for rounding to 24 bits tilts every plane that is not
//! perpendicular to an axis ([`plane`]).
//! A patch whose border is not simple, or whose corners cannot be brought into one
//! plane without leaving others, stays triangles.

mod border;
mod nearby;
mod patch;
mod plane;
mod straight;
mod weld;

#[cfg(test)]
mod tests;

use crate::names::Namer;
use antumbra_geom::{Chart, DVec3, Plane, newell_normal};
use antumbra_scene::{Aabb, SurfaceInput};

/// The precision of a coordinate, relative to the largest of its part.
///
/// 2⁻²¹, eight units in the last place of a 32-bit float: what a few operations in
/// that precision leave of a plane or of a straight edge. Sixteen and more would
/// flatten real features: at 10 m this is 5 µm.
const PRECISION: f64 = 1.0 / (1u64 << 21) as f64;

/// Patches that are not plane leave their planes to others, which may then be; one
/// round does but for constructed cases, and the check of scenes splits the rest.
const MOST_ROUNDS: usize = 8;

/// Triangles of one material under one name.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    /// The name of its surfaces, before they are numbered.
    pub(crate) name: Option<String>,
    /// Name of its material.
    pub(crate) material: String,
    /// Finite corners, counter-clockwise seen from the front; file units.
    pub(crate) triangles: Vec<[DVec3; 3]>,
    /// The largest number that was rounded to 24 bits on the way to a corner, at
    /// least the largest coordinate.
    pub(crate) magnitude: f64,
}

impl Part {
    fn tolerance(&self) -> f64 {
        self.magnitude * PRECISION
    }
}

/// What became of the triangles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Merged {
    /// In the order of the parts, and in a part by the first triangle.
    pub(crate) surfaces: Vec<SurfaceInput>,
    /// What a user may want to know.
    pub(crate) notes: Vec<String>,
}

/// A polygon of a part, over welded vertices.
struct Patch {
    part: usize,
    /// Into the part's triangles, ascending.
    triangles: Vec<usize>,
    /// The outline counter-clockwise, then the holes clockwise.
    loops: Vec<Vec<u32>>,
    plane: Plane,
    area: f64,
    /// A triangle of a patch that is not plane: its corners hold to no plane.
    is_loose: bool,
}

impl Patch {
    fn corners(&self) -> impl Iterator<Item = u32> + '_ {
        self.loops.iter().flatten().copied()
    }

    /// Three corners are plane wherever they are.
    fn needs_a_plane(&self) -> bool {
        self.loops.len() > 1 || self.loops[0].len() > 3
    }

    /// Twice the area over the longest extent.
    fn width(&self, vertices: &[DVec3]) -> f64 {
        let bounds = Aabb::of(self.corners().map(|v| vertices[v as usize]));
        2.0 * self.area / (bounds.max - bounds.min).length()
    }
}

/// What was left out or done, for the notes.
#[derive(Default)]
struct Counts {
    triangles: usize,
    /// The number, and the part of the first.
    flat: Option<(usize, usize)>,
    duplicate: Option<(usize, usize)>,
    /// Patches that stay triangles, for their border or their plane.
    tangled: Option<(usize, usize)>,
    not_plane: Option<(usize, usize)>,
}

/// Merges the triangles of each part into polygons.
///
/// Every triangle is in one polygon, but for those without area and those that
/// are there twice, which are counted in a note. Corners move by a few
/// tolerances of their part at most.
pub(crate) fn surfaces(parts: &[Part], unit: &str) -> Merged {
    let mut counts = Counts::default();
    let welded = weld::weld(parts);
    let mut patches = Vec::new();
    for (p, part) in parts.iter().enumerate() {
        patches_of(p, part, &welded, &mut patches, &mut counts);
    }
    straight::straighten(&mut patches, &welded);
    patches.retain(|patch| {
        let has_width = patch.loops.first().is_some_and(|outline| outline.len() > 2);
        if !has_width {
            counted(&mut counts.flat, patch.part, patch.triangles.len());
        }
        has_width
    });
    let mut moved = plane::onto_planes(&patches, &welded);
    for _ in 0..MOST_ROUNDS {
        if moved.not_plane.is_empty() {
            break;
        }
        // Without them the others have what they need.
        for &i in &moved.not_plane {
            counted(&mut counts.not_plane, patches[i].part, 1);
        }
        let in_pieces = std::mem::take(&mut moved.not_plane);
        patches = with_pieces(patches, &in_pieces, &welded, &welded.vertices);
        moved = plane::onto_planes(&patches, &welded);
    }
    // What was simple before it moved may not be afterwards.
    let crooked: Vec<usize> = (0..patches.len())
        .filter(|&i| patches[i].needs_a_plane() && !is_simple(&patches[i], &moved.vertices))
        .collect();
    for &i in &crooked {
        counted(&mut counts.tangled, patches[i].part, 1);
    }
    let whole = with_pieces(patches, &crooked, &welded, &moved.vertices);
    let mut namer = Namer::new(whole.iter().map(|patch| parts[patch.part].name.as_deref()));
    let surfaces: Vec<SurfaceInput> = whole
        .iter()
        .map(|patch| {
            let part = &parts[patch.part];
            let mut loops = patch.loops.iter().map(|corners| {
                let corners = from_lowest(corners);
                corners.map(|v| moved.vertices[v as usize]).collect()
            });
            SurfaceInput {
                name: namer.next(part.name.as_deref()),
                material: part.material.clone(),
                vertices: loops.next().unwrap_or_default(),
                holes: loops.collect(),
            }
        })
        .collect();
    let notes = notes(parts, &counts, surfaces.len(), &moved, unit);
    Merged { surfaces, notes }
}

/// The patches, those at `in_pieces` (ascending) as loose triangles.
fn with_pieces(
    patches: Vec<Patch>,
    in_pieces: &[usize],
    welded: &weld::Welded,
    vertices: &[DVec3],
) -> Vec<Patch> {
    let mut all = Vec::with_capacity(patches.len());
    for (i, patch) in patches.into_iter().enumerate() {
        if in_pieces.binary_search(&i).is_err() {
            all.push(patch);
            continue;
        }
        all.extend(patch.triangles.iter().filter_map(|&t| {
            let corners = welded.corners[patch.part][t];
            let triangle = single(patch.part, t, corners, vertices)?;
            Some(Patch {
                is_loose: true,
                ..triangle
            })
        }));
    }
    all
}

fn patches_of(
    p: usize,
    part: &Part,
    welded: &weld::Welded,
    patches: &mut Vec<Patch>,
    counts: &mut Counts,
) {
    let tolerance = part.tolerance();
    let vertices = &welded.vertices;
    let corners = &welded.corners[p];
    counts.triangles += corners.len();
    let usable = patch::usable(corners, vertices, tolerance);
    counted(&mut counts.flat, p, usable.n_flat);
    counted(&mut counts.duplicate, p, usable.n_duplicate);
    let mesh = patch::Mesh::new(corners, usable.triangles, vertices, tolerance);
    let first = patches.len();
    for triangles in mesh.patches() {
        let merged = match triangles[..] {
            [_] => None,
            _ => merged(p, &mesh, &triangles, vertices),
        };
        match merged {
            Some(patch) => patches.push(patch),
            None => {
                if triangles.len() > 1 {
                    counted(&mut counts.tangled, p, 1);
                }
                patches.extend(
                    triangles
                        .iter()
                        .filter_map(|&t| single(p, t, corners[t], vertices)),
                );
            }
        }
    }
    patches[first..].sort_by_key(|patch| patch.triangles[0]);
}

/// The polygon of several triangles, if their border is simple.
fn merged(
    part: usize,
    mesh: &patch::Mesh<'_>,
    triangles: &[usize],
    vertices: &[DVec3],
) -> Option<Patch> {
    let plane = mesh.plane(triangles);
    let chart = Chart::new(plane.point, plane.normal);
    let mut loops = border::loops(triangles.iter().map(|&t| mesh.outline(t)), |v| {
        chart.to_chart(vertices[v as usize])
    })?;
    // A T-vertex of a neighbour is no corner of this polygon.
    let mut own: Vec<u32> = triangles.iter().flat_map(|&t| mesh.corners(t)).collect();
    own.sort_unstable();
    for corners in &mut loops {
        corners.retain(|v| own.binary_search(v).is_ok());
    }
    let patch = Patch {
        part,
        triangles: triangles.to_vec(),
        area: triangles.iter().map(|&t| mesh.area(t)).sum(),
        loops,
        plane,
        is_loose: false,
    };
    is_simple(&patch, vertices).then_some(patch)
}

/// A triangle by itself, unless it has no area.
fn single(part: usize, triangle: usize, corners: [u32; 3], vertices: &[DVec3]) -> Option<Patch> {
    let positions = corners.map(|v| vertices[v as usize]);
    let twice = newell_normal(&positions);
    let normal = twice.try_normalize()?;
    Some(Patch {
        part,
        triangles: vec![triangle],
        loops: vec![corners.to_vec()],
        plane: Plane {
            normal,
            point: positions[0],
        },
        area: twice.length() / 2.0,
        is_loose: false,
    })
}

fn is_simple(patch: &Patch, vertices: &[DVec3]) -> bool {
    let chart = Chart::new(patch.plane.point, patch.plane.normal);
    border::is_simple(&patch.loops, |v| chart.to_chart(vertices[v as usize]))
}

/// The loop, from its lowest vertex on.
fn from_lowest(corners: &[u32]) -> impl Iterator<Item = u32> + '_ {
    let start = (0..corners.len()).min_by_key(|&i| corners[i]).unwrap_or(0);
    (0..corners.len()).map(move |k| corners[(start + k) % corners.len()])
}

fn counted(count: &mut Option<(usize, usize)>, part: usize, n: usize) {
    if n > 0 {
        count.get_or_insert((0, part)).0 += n;
    }
}

fn notes(
    parts: &[Part],
    counts: &Counts,
    n_polygons: usize,
    moved: &plane::Moved,
    unit: &str,
) -> Vec<String> {
    let whose = |part: usize| match &parts[part].name {
        Some(name) => format!(", the first in '{name}'"),
        None => String::new(),
    };
    let plural = |n: usize| if n == 1 { "" } else { "s" };
    let dropped = |count: Option<(usize, usize)>| count.map_or(0, |(n, _)| n);
    let kept = counts.triangles - dropped(counts.flat) - dropped(counts.duplicate);
    let mut notes = Vec::new();
    if n_polygons < kept {
        notes.push(format!(
            "{kept} triangles merged into {n_polygons} polygon{}",
            plural(n_polygons)
        ));
    }
    if let Some((n, part)) = counts.flat {
        notes.push(format!(
            "{n} triangle{} without area dropped{}",
            plural(n),
            whose(part)
        ));
    }
    if let Some((n, part)) = counts.duplicate {
        notes.push(format!(
            "{n} triangle{} dropped that {} there twice{}",
            plural(n),
            if n == 1 { "is" } else { "are" },
            whose(part)
        ));
    }
    if let Some((n, part)) = counts.tangled {
        notes.push(format!(
            "{n} flat patch{} with an outline that meets itself kept as triangles{}",
            if n == 1 { "" } else { "es" },
            whose(part)
        ));
    }
    if let Some((n, part)) = counts.not_plane {
        notes.push(format!(
            "{n} flat patch{} kept as triangles, for more planes meet in a corner than it can be moved onto{}",
            if n == 1 { "" } else { "es" },
            whose(part)
        ));
    }
    if moved.n > 0 {
        notes.push(format!(
            "{} {} moved onto the planes of their polygons by up to {:.1e} {unit}: the file's coordinates are single precision",
            moved.n,
            if moved.n == 1 { "vertex" } else { "vertices" },
            moved.farthest
        ));
    }
    notes
}
