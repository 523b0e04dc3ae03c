//! What a reader hands over: surfaces as they stand in a file, unchecked.

use glam::DVec3;

/// The unit of a file's lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LengthUnit {
    /// Metre.
    #[default]
    Metre,
    /// Millimetre.
    Millimetre,
    /// Centimetre.
    Centimetre,
    /// Inch, 0.0254 m.
    Inch,
    /// Foot, 0.3048 m.
    Foot,
}

impl LengthUnit {
    /// The symbol used in scene files and on the command line.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Millimetre => "mm",
            Self::Centimetre => "cm",
            Self::Inch => "in",
            Self::Foot => "ft",
        }
    }

    /// The unit with this symbol.
    #[must_use]
    pub fn from_symbol(symbol: &str) -> Option<Self> {
        [
            Self::Metre,
            Self::Millimetre,
            Self::Centimetre,
            Self::Inch,
            Self::Foot,
        ]
        .into_iter()
        .find(|unit| unit.symbol() == symbol)
    }

    /// Metres in one unit.
    #[must_use]
    pub fn in_metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Millimetre => 1e-3,
            Self::Centimetre => 1e-2,
            Self::Inch => 0.0254,
            Self::Foot => 0.3048,
        }
    }
}

/// What exitance and irradiance are measured in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quantity {
    /// W/m².
    #[default]
    Radiometric,
    /// lm/m²; irradiance is illuminance, in lux.
    Photometric,
    /// No unit.
    None,
}

impl Quantity {
    /// The name used in scene files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Radiometric => "radiometric",
            Self::Photometric => "photometric",
            Self::None => "none",
        }
    }

    /// The unit of irradiance: `W/m²`, `lx` or nothing.
    #[must_use]
    pub fn irradiance_unit(self) -> &'static str {
        match self {
            Self::Radiometric => "W/m²",
            Self::Photometric => "lx",
            Self::None => "",
        }
    }
}

/// A material as a file states it. Bands are broadcast and checked by
/// [`Scene::build`](crate::Scene::build).
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialInput {
    /// Unique name.
    pub name: String,
    /// Diffuse reflectance, one value or one per band, each in [0, 1).
    pub reflectance: Vec<f64>,
    /// Exitance, one value or one per band, not negative.
    pub exitance: Vec<f64>,
    /// Does the back emit and reflect too?
    pub two_sided: bool,
}

/// A polygon as a file states it.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceInput {
    /// Unique name, the key of every output.
    pub name: String,
    /// Name of its material.
    pub material: String,
    /// Outline, counter-clockwise as seen from the front; file units.
    pub vertices: Vec<DVec3>,
    /// Holes, each a closed loop in either direction.
    pub holes: Vec<Vec<DVec3>>,
}

/// A scene as a file states it, unchecked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneInput {
    /// Unit of all coordinates.
    pub length_unit: LengthUnit,
    /// Unit of exitance.
    pub quantity: Quantity,
    /// Materials.
    pub materials: Vec<MaterialInput>,
    /// Surfaces.
    pub surfaces: Vec<SurfaceInput>,
    /// Are surfaces split into triangles however far they are from plane? Else they are
    /// refused where that is more than measuring explains.
    pub triangulate: bool,
    /// What the reader already has to say (an unknown `Ka` emission, a missing
    /// material library): shown with the report of the check.
    pub notes: Vec<String>,
}
