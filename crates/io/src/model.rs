//! What the writers write: meshes with values, and matrices of form factors, in file
//! units, free of the engine.

use antumbra_geom::{DVec2, DVec3};

/// A meshed scene with its values, ready to be written.
#[derive(Clone, Debug, Default)]
pub struct MeshedScene {
    /// `m`, `mm`, …: the unit of all coordinates.
    pub length_unit: String,
    /// `W/m²`, `lx` or empty: the unit of all node fields.
    pub unit: String,
    /// Values per node of every field.
    pub n_bands: usize,
    /// One per face that was meshed, in the order of the scene.
    pub surfaces: Vec<SurfaceMesh>,
    /// The command or call that made it, for headers.
    pub provenance: String,
}

/// A mesh of one face.
#[derive(Clone, Debug, Default)]
pub struct SurfaceMesh {
    /// The surface's name.
    pub name: String,
    /// Which of the surface's faces (0 unless it was split).
    pub part: usize,
    /// Is it the back of a two-sided surface?
    pub is_back: bool,
    /// Unit normal of the front.
    pub normal: DVec3,
    /// Outline and holes, as corners in space.
    pub loops: Vec<Vec<DVec3>>,
    /// Degree of the elements, 1 to 4.
    pub degree: u8,
    /// Node positions; one position occurs once per side of a contact.
    pub nodes: Vec<DVec3>,
    /// The nodes in the face's own 2-D frame (right-handed seen from the front),
    /// file length units.
    pub nodes_2d: Vec<DVec2>,
    /// Nodes of every element, (degree+1)(degree+2)/2 each, in VTK's Lagrange
    /// order: corners counter-clockwise from the front, then edges 0–1, 1–2, 2–0,
    /// then inside.
    pub elements: Vec<u32>,
    /// Nodes of quadrilateral elements, (degree+1)² each, in VTK's Lagrange order: corners
    /// counter-clockwise from the front, then edges 0–1, 1–2, 3–2, 0–3, then inside row by
    /// row. They are numbered after the triangles of `elements`.
    pub quads: Vec<u32>,
    /// Fields on the nodes: `direct`, and after a solve `irradiance` and `radiosity`.
    pub fields: Vec<Field>,
    /// Measured error of every element, triangles first, relative to the peak.
    pub element_errors: Vec<f64>,
    /// Mesh edges that lie on curves.
    pub curve_edges: Vec<CurveEdge>,
    /// The curves those edges belong to.
    pub curves: Vec<Curve>,
}

/// A field on the nodes, `n_bands` values per node.
#[derive(Clone, Debug, Default)]
pub struct Field {
    /// `direct`, `irradiance` or `radiosity`.
    pub name: String,
    /// Node after node, bands together.
    pub values: Vec<f64>,
}

/// A mesh edge on one or several curves.
#[derive(Clone, Debug, Default)]
pub struct CurveEdge {
    /// Corner nodes of its ends.
    pub ends: [u32; 2],
    /// Indices into [`SurfaceMesh::curves`].
    pub curves: Vec<u32>,
}

/// A curve across which something changes.
#[derive(Clone, Debug, Default)]
pub struct Curve {
    /// `border`, `ve`, `ee`, `eee`, `facet`, `horizon` or `contact`.
    pub kind: String,
    /// `border`, `d0`, `d1` or `d2`.
    pub order: String,
    /// The emitter's name, where the curve belongs to one.
    pub emitter: Option<String>,
    /// The features that generate it, in words: names of surfaces.
    pub generators: String,
    /// The curve itself, file units.
    pub points: Vec<DVec3>,
}

impl SurfaceMesh {
    /// Nodes per triangle.
    #[must_use]
    pub fn nodes_per_element(&self) -> usize {
        let p = usize::from(self.degree);
        (p + 1) * (p + 2) / 2
    }

    /// Nodes per quadrilateral.
    #[must_use]
    pub fn nodes_per_quad(&self) -> usize {
        let p = usize::from(self.degree);
        (p + 1) * (p + 1)
    }

    /// How many elements there are: triangles, then quadrilaterals.
    #[must_use]
    pub fn n_elements(&self) -> usize {
        self.elements.len() / self.nodes_per_element() + self.quads.len() / self.nodes_per_quad()
    }

    /// The nodes of every element, triangles first, and whether it is a quadrilateral.
    pub fn each_element(&self) -> impl Iterator<Item = (&[u32], bool)> {
        let triangles = self.elements.chunks_exact(self.nodes_per_element());
        let quads = self.quads.chunks_exact(self.nodes_per_quad());
        triangles
            .map(|nodes| (nodes, false))
            .chain(quads.map(|nodes| (nodes, true)))
    }

    /// The field with this name.
    #[must_use]
    pub fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|f| f.name == name)
    }
}

/// Form factors between surfaces, ready to be written.
#[derive(Clone, Debug, Default)]
pub struct FactorTable {
    /// `m`, `mm`, …: areas are in its square.
    pub length_unit: String,
    /// Names of the surfaces.
    pub names: Vec<String>,
    /// Their areas; those of both sides for two-sided surfaces.
    pub areas: Vec<f64>,
    /// 1 less the mean of the reflectance over the bands.
    pub emissivities: Vec<f64>,
    /// Row by row: the factor from surface `i` to `j` is at `i * n + j`.
    pub values: Vec<f64>,
    /// Estimated errors of the factors, in the same order.
    pub errors: Vec<f64>,
    /// In the same order: was this factor not computed? Empty if all were.
    pub missing: Vec<bool>,
    /// Were the rows scaled to sum up to 1?
    pub is_repaired: bool,
    /// Do the surfaces enclose a volume?
    pub is_closed: bool,
    /// The command or call that made it, for headers.
    pub provenance: String,
}

impl FactorTable {
    /// The factors from one surface to all, row by row.
    pub fn rows(&self) -> impl Iterator<Item = &[f64]> {
        // A table without surfaces has no rows; chunks cannot be empty.
        self.values.chunks(self.names.len().max(1))
    }

    /// The factors from one surface to all, row by row; nothing where one is missing.
    pub fn known_rows(&self) -> impl Iterator<Item = Vec<Option<f64>>> {
        self.known(&self.values)
    }

    /// Their errors, in the same way.
    pub fn known_errors(&self) -> impl Iterator<Item = Vec<Option<f64>>> {
        self.known(&self.errors)
    }

    fn known<'a>(&'a self, values: &'a [f64]) -> impl Iterator<Item = Vec<Option<f64>>> + 'a {
        let n = self.names.len().max(1);
        let is_missing = |k: usize| self.missing.get(k).is_some_and(|&missing| missing);
        values.chunks(n).enumerate().map(move |(i, row)| {
            let known = row.iter().enumerate();
            known
                .map(|(j, &value)| (!is_missing(i * n + j)).then_some(value))
                .collect()
        })
    }

    /// How many factors are missing.
    #[must_use]
    pub fn n_missing(&self) -> usize {
        self.missing.iter().filter(|&&missing| missing).count()
    }

    /// The sums of the rows; nothing where a factor of the row is missing.
    #[must_use]
    pub fn row_sums(&self) -> Vec<Option<f64>> {
        self.known_rows()
            .map(|row| row.into_iter().sum::<Option<f64>>())
            .collect()
    }
}
