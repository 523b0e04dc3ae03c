//! Planes that polygons share, and corners moved onto them.
//!
//! A plane rounded to 24 bits is plane to 10⁻⁷ of its coordinates, and the check
//! of scenes asks for 10⁻⁹. Corners of polygons with more than three corners are
//! therefore moved onto their plane, corners of two or three polygons onto the
//! line or the point that those have in common: edges stay shared.

use super::Patch;
use super::nearby::Nearby;
use super::weld::Welded;
use antumbra_geom::{DVec3, Plane, settled};
use std::collections::BTreeMap;

/// No corner moves farther than so many tolerances. A fold of half a degree needs
/// as much; on finely tessellated surfaces more would move corners farther than
/// their rounding did.
const FARTHEST: f64 = 4.0;

/// Corners this near to their planes stay as they are, relative to the largest
/// coordinate: rounding of 64 bits.
const IN_PLACE: f64 = 1.0 / (1u64 << 50) as f64;

/// A polygon is plane if its corners lie in its plane to this part of its width,
/// or to rounding: a tenth of what the check of scenes asks for.
const PLANE: f64 = 1e-10;

/// Vertices after the move.
pub(super) struct Moved {
    pub(super) vertices: Vec<DVec3>,
    /// How many moved, and how far the farthest.
    pub(super) n: usize,
    pub(super) farthest: f64,
    /// Patches of more than a triangle with a corner that is held off their plane.
    pub(super) not_plane: Vec<usize>,
}

/// Moves the corners of patches onto the planes of their classes.
///
/// Where more than three planes meet in a corner, as on tessellated surfaces, not
/// all can be had: the largest patches come first.
pub(super) fn onto_planes(patches: &[Patch], welded: &Welded) -> Moved {
    let mut moved = Moved {
        vertices: welded.vertices.clone(),
        n: 0,
        farthest: 0.0,
        not_plane: Vec::new(),
    };
    // Classes come in the order of their area: the largest has the first word.
    let mut planes_at: BTreeMap<u32, Vec<Plane>> = BTreeMap::new();
    let mut plane_of: BTreeMap<usize, Plane> = BTreeMap::new();
    for class in classes(patches, welded) {
        let is_needed =
            class.members.len() > 1 || class.members.iter().any(|&i| patches[i].needs_a_plane());
        if !is_needed {
            continue;
        }
        let plane = class.plane(patches, welded);
        let mut corners: Vec<u32> = class
            .members
            .iter()
            .flat_map(|&i| patches[i].corners())
            .collect();
        corners.sort_unstable();
        corners.dedup();
        for v in corners {
            planes_at.entry(v).or_default().push(plane);
        }
        plane_of.extend(class.members.iter().map(|&i| (i, plane)));
    }
    let largest = welded
        .vertices
        .iter()
        .map(|p| p.abs().max_element())
        .fold(0.0, f64::max);
    for (v, planes) in planes_at {
        let from = welded.vertices[v as usize];
        if planes
            .iter()
            .all(|plane| plane.distance(from).abs() <= IN_PLACE * largest)
        {
            continue;
        }
        let to = settled(from, &planes, FARTHEST * welded.tolerances[v as usize]);
        moved.vertices[v as usize] = to;
        let distance = to.distance(from);
        // Mere rounding of 64 bits is not worth a word.
        if distance > 16.0 * IN_PLACE * largest {
            moved.n += 1;
            moved.farthest = moved.farthest.max(distance);
        }
    }
    for (i, plane) in plane_of {
        let patch = &patches[i];
        let allowed = (PLANE * patch.width(&moved.vertices)).max(4.0 * IN_PLACE * largest);
        let is_plane = patch
            .corners()
            .all(|v| plane.distance(moved.vertices[v as usize]).abs() <= allowed);
        if patch.needs_a_plane() && !is_plane {
            moved.not_plane.push(i);
        }
    }
    moved
}

/// Patches in one plane, the largest first; they may face either way.
struct Class {
    members: Vec<usize>,
}

impl Class {
    /// The plane of the largest, or the plane perpendicular to an axis that holds
    /// all corners as well.
    fn plane(&self, patches: &[Patch], welded: &Welded) -> Plane {
        let own = patches[self.members[0]].plane;
        let axis = own.normal.abs().max_position();
        // A coordinate of the file, not a mean that is none.
        let nearest = patches[self.members[0]].corners().min_by(|&u, &v| {
            let off = |v: u32| (welded.vertices[v as usize] - own.point)[axis].abs();
            off(u).total_cmp(&off(v)).then(u.cmp(&v))
        });
        let Some(nearest) = nearest else {
            return own;
        };
        let straight = Plane {
            normal: DVec3::AXES[axis] * own.normal[axis].signum(),
            point: welded.vertices[nearest as usize],
        };
        let holds = self
            .members
            .iter()
            .flat_map(|&i| patches[i].corners())
            .all(|v| {
                straight.distance(welded.vertices[v as usize]).abs()
                    <= welded.tolerances[v as usize]
            });
        if holds { straight } else { own }
    }
}

/// Sorts patches, but for loose ones, into classes: each joins the first, largest patch in whose plane
/// all its corners lie, to the tolerance of its corners.
fn classes(patches: &[Patch], welded: &Welded) -> Vec<Class> {
    let centre = patches
        .first()
        .map_or(DVec3::ZERO, |patch| patch.plane.point);
    let size = patches
        .iter()
        .map(|patch| patch.plane.point.distance(centre))
        .fold(f64::MIN_POSITIVE, f64::max);
    // A plane as a point: two parts of its normal and its height.
    let key = |plane: &Plane, sign: f64| {
        let n = plane.normal * sign;
        DVec3::new(n.x, n.y, n.dot(plane.point - centre) / size)
    };
    let keys: Vec<(u32, DVec3)> = (0u32..)
        .zip(patches)
        .map(|(i, patch)| (i, key(&patch.plane, 1.0)))
        .collect();
    let nearby = Nearby::new(&keys);
    let mut order: Vec<usize> = (0..patches.len())
        .filter(|&i| !patches[i].is_loose)
        .collect();
    order.sort_by(|&i, &j| patches[j].area.total_cmp(&patches[i].area).then(i.cmp(&j)));
    let mut is_taken: Vec<bool> = patches.iter().map(|patch| patch.is_loose).collect();
    let mut classes = Vec::new();
    for i in order {
        if is_taken[i] {
            continue;
        }
        is_taken[i] = true;
        let plane = patches[i].plane;
        let mut members = vec![i];
        let mut found: Vec<u32> = [1.0, -1.0]
            .into_iter()
            .flat_map(|sign| {
                let at = key(&plane, sign);
                nearby.around(at, SPREAD)
            })
            .collect();
        found.sort_unstable();
        found.dedup();
        for j in found.into_iter().map(|j| j as usize) {
            let fits = || {
                patches[j].plane.normal.dot(plane.normal).abs() > 0.5
                    && patches[j].corners().all(|v| {
                        plane.distance(welded.vertices[v as usize]).abs()
                            <= welded.tolerances[v as usize]
                    })
            };
            if !is_taken[j] && fits() {
                is_taken[j] = true;
                members.push(j);
            }
        }
        classes.push(Class { members });
    }
    classes
}

/// How far apart the normals of patches in one plane may be: that of a patch a
/// hundred tolerances wide. Narrower ones have no say in whose plane they lie.
const SPREAD: f64 = 1e-2;
