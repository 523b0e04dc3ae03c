//! The scene itself: faces, edges, plane classes and materials, by index.

use crate::bvh::BoxTree;
use crate::input::{LengthUnit, Quantity};
use antumbra_geom::Plane;
use glam::DVec3;
use std::ops::Range;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);

        impl $name {
            /// The index into the scene's array.
            #[must_use]
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    };
}

id!(/** A welded vertex. */ VertexId);
id!(/** An edge between two welded vertices. */ EdgeId);
id!(/** A plane one-sided polygon. */ FaceId);
id!(/** A class of coplanar faces. */ PlaneId);
id!(/** A surface as the user named it. */ SurfaceId);
id!(/** A material. */ MaterialId);

/// Where a point lies with respect to a plane class.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Side {
    /// On the side opposite to the plane's normal.
    Below,
    /// In the plane, by declaration: within [`Scene::plane_tolerance`].
    On,
    /// On the side of the plane's normal.
    Above,
}

/// From scene units to the file's units and back: a power of two and an offset
/// that is exact for all vertices of the scene.
///
/// All coordinates inside a [`Scene`] are `(file − offset) · scale`, so that the
/// longest extent of the scene lies in [1, 2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Subtracted from file coordinates, exactly.
    pub offset: DVec3,
    /// A power of two.
    pub scale: f64,
}

impl Frame {
    /// Scene coordinates of a point given in file units.
    #[must_use]
    pub fn to_scene(&self, file: DVec3) -> DVec3 {
        (file - self.offset) * self.scale
    }

    /// File coordinates of a point given in scene units.
    #[must_use]
    pub fn to_file(&self, scene: DVec3) -> DVec3 {
        scene / self.scale + self.offset
    }

    /// A length in file units of one in scene units.
    #[must_use]
    pub fn length_to_file(&self, length: f64) -> f64 {
        length / self.scale
    }

    /// An area in square file units of one in scene units.
    #[must_use]
    pub fn area_to_file(&self, area: f64) -> f64 {
        area / (self.scale * self.scale)
    }
}

/// A diffuse material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Unique name.
    pub name: String,
    /// Per band, in [0, 1).
    pub reflectance: Vec<f64>,
    /// Per band, not negative; W/m², lm/m² or no unit.
    pub exitance: Vec<f64>,
    /// Does the back emit and reflect too?
    pub two_sided: bool,
}

impl Material {
    /// Does it emit in any band?
    #[must_use]
    pub fn is_emitter(&self) -> bool {
        self.exitance.iter().any(|&m| m > 0.0)
    }
}

/// A surface of the user's: one face, or several where it had to be split.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Unique name.
    pub name: String,
    /// Its material.
    pub material: MaterialId,
    /// Its faces; fronts first, then the backs of a two-sided surface. Several fronts if it
    /// had to be split, or if something covers a part. Empty if the surface was dropped
    /// with a warning.
    pub faces: Range<u32>,
}

/// A plane polygon that emits and receives on its front and blocks light from
/// both sides. A two-sided surface has two, back to back.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// The surface it belongs to.
    pub surface: SurfaceId,
    /// Is it the back of a two-sided surface? Backs do not occlude again.
    pub is_back: bool,
    /// Is a body pressed on it, or it on one? It receives and sends nothing, and still
    /// hides what is behind it.
    pub is_covered: bool,
    /// Outline, counter-clockwise seen from the front.
    pub outline: Vec<VertexId>,
    /// Holes, clockwise seen from the front.
    pub holes: Vec<Vec<VertexId>>,
    /// Its class of coplanar faces.
    pub plane: PlaneId,
    /// Unit normal on the front: the plane's normal or its negative.
    pub normal: DVec3,
    /// Does `normal` equal the plane's normal?
    pub along_plane: bool,
    /// Convex pieces without new vertices: indices into [`Scene::pieces`].
    pub pieces: Range<u32>,
    /// In scene units.
    pub area: f64,
}

impl Face {
    /// The outline and then the holes.
    pub fn loops(&self) -> impl Iterator<Item = &[VertexId]> {
        std::iter::once(self.outline.as_slice()).chain(self.holes.iter().map(Vec::as_slice))
    }
}

/// A convex piece of a face; or of a front before it was divided into covered and
/// uncovered faces, which hides as the one it was.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Whose it is; the first of them, if the front was divided.
    pub face: FaceId,
    /// How many faces, from that one on, the front was divided into; else 1.
    pub n_faces: u32,
    /// Is it in the tree? Pieces of backs are not, nor those of parts of a divided front.
    pub hides: bool,
    /// Counter-clockwise seen from the face's front.
    pub vertices: Vec<VertexId>,
}

/// An edge and the faces that meet in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// Its ends, the smaller id first.
    pub ends: [VertexId; 2],
    /// The faces (fronts only, no backs) with this edge in an outline or hole,
    /// ascending.
    pub faces: Vec<FaceId>,
}

/// A valid scene.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Unit of the file's lengths.
    pub length_unit: LengthUnit,
    /// Unit of exitance and irradiance.
    pub quantity: Quantity,
    /// From file to scene coordinates.
    pub frame: Frame,
    /// Bands of every material.
    pub n_bands: usize,
    /// Materials.
    pub materials: Vec<Material>,
    /// Black, for covered faces.
    pub(crate) covered_material: Material,
    /// Surfaces, in the order of the file.
    pub surfaces: Vec<Surface>,
    /// Welded vertices, scene units.
    pub vertices: Vec<DVec3>,
    /// Faces, grouped by surface.
    pub faces: Vec<Face>,
    /// Convex pieces of all faces, grouped by face, and of fronts that were divided.
    pub pieces: Vec<Piece>,
    /// Edges, sorted by their ends.
    pub edges: Vec<Edge>,
    /// Plane classes; the point of each is a vertex.
    pub planes: Vec<Plane>,
    /// Boxes of the pieces that hide, of all fronts; its items are indices into `pieces`.
    pub tree: BoxTree,
    /// Longest extent of the scene, scene units: in [1, 2).
    pub extent: f64,
}

impl Scene {
    /// [`Scene::plane_tolerance`] relative to the extent.
    ///
    /// 2⁻⁴²: a thousand times the rounding of a rotated scene's coordinates
    /// (about 2⁻⁵² of the extent), and a thousandth of the gap of 2⁻³⁰ m between
    /// a table and a floor of 4 m that must stay two planes.
    pub(crate) const PLANE_TOLERANCE: f64 = 1.0 / (1u64 << 42) as f64;

    /// [`Scene::rounding`] relative to the extent: eight roundings of a coordinate.
    pub(crate) const ROUNDING: f64 = 1.0 / (1u64 << 49) as f64;

    /// How far corners of a plane surface lie off its plane at most, if nothing but their
    /// coordinates' rounding takes them there; scene units.
    #[must_use]
    pub fn rounding(&self) -> f64 {
        self.extent * Self::ROUNDING
    }

    /// Points closer than this to a plane class lie on it; scene units.
    #[must_use]
    pub fn plane_tolerance(&self) -> f64 {
        self.extent * Self::PLANE_TOLERANCE
    }

    /// Position of a vertex, scene units.
    #[must_use]
    pub fn position(&self, vertex: VertexId) -> DVec3 {
        self.vertices[vertex.index()]
    }

    /// A face.
    #[must_use]
    pub fn face(&self, face: FaceId) -> &Face {
        &self.faces[face.index()]
    }

    /// The material of a face; a black one if it is covered.
    #[must_use]
    pub fn material(&self, face: FaceId) -> &Material {
        if self.face(face).is_covered {
            return &self.covered_material;
        }
        let surface = &self.surfaces[self.face(face).surface.index()];
        &self.materials[surface.material.index()]
    }

    /// The surface of a face.
    #[must_use]
    pub fn surface_of(&self, face: FaceId) -> &Surface {
        &self.surfaces[self.face(face).surface.index()]
    }

    /// The faces that a piece is of: several if it is of a front that was divided.
    pub fn faces_of(&self, piece: u32) -> impl Iterator<Item = FaceId> + use<> {
        let piece = &self.pieces[piece as usize];
        (piece.face.0..piece.face.0 + piece.n_faces).map(FaceId)
    }

    /// Is a piece of this face, or of the front that it is a part of?
    #[must_use]
    pub fn is_of(&self, piece: u32, face: FaceId) -> bool {
        let piece = &self.pieces[piece as usize];
        (piece.face.0..piece.face.0 + piece.n_faces).contains(&face.0)
    }

    /// All faces by id.
    pub fn face_ids(&self) -> impl Iterator<Item = FaceId> + use<> {
        (0..self.faces.len() as u32).map(FaceId)
    }

    /// The faces that emit, ascending.
    pub fn emitters(&self) -> impl Iterator<Item = FaceId> + '_ {
        self.face_ids().filter(|&f| self.material(f).is_emitter())
    }

    /// Corner positions of a loop, scene units.
    #[must_use]
    pub fn positions(&self, corners: &[VertexId]) -> Vec<DVec3> {
        corners.iter().map(|&v| self.position(v)).collect()
    }

    /// On which side of a plane class a vertex lies. A vertex within
    /// [`Scene::plane_tolerance`] is on it; outside, rounding cannot change the
    /// answer.
    #[must_use]
    pub fn side(&self, vertex: VertexId, plane: PlaneId) -> Side {
        let distance = self.planes[plane.index()].distance(self.position(vertex));
        if distance.abs() <= self.plane_tolerance() {
            Side::On
        } else if distance > 0.0 {
            Side::Above
        } else {
            Side::Below
        }
    }

    /// The surface with this name.
    #[must_use]
    pub fn surface_named(&self, name: &str) -> Option<SurfaceId> {
        self.surfaces
            .iter()
            .position(|s| s.name == name)
            .map(|i| SurfaceId(i as u32))
    }

    /// The edge between two vertices, if a face has it.
    #[must_use]
    pub fn edge_between(&self, a: VertexId, b: VertexId) -> Option<EdgeId> {
        let ends = [a.min(b), a.max(b)];
        self.edges
            .binary_search_by(|e| e.ends.cmp(&ends))
            .ok()
            .map(|i| EdgeId(i as u32))
    }
}
