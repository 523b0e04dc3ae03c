//! Rigid motions, scalings and rewritings of a scene that change no light.

use antumbra::SceneInput;
use glam::{DMat3, DVec3};

/// `p ↦ scale · rotation · p + shift`.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Orthonormal; a determinant of −1 mirrors.
    pub rotation: DMat3,
    /// Positive.
    pub scale: f64,
    /// Added last.
    pub shift: DVec3,
}

impl Motion {
    /// Leaves everything where it is.
    pub const IDENTITY: Self = Self {
        rotation: DMat3::IDENTITY,
        scale: 1.0,
        shift: DVec3::ZERO,
    };

    /// 0.7 rad about (1, 2, 3): no coordinate plane stays one.
    #[must_use]
    pub fn skew() -> Self {
        Self::rotation(DVec3::new(1.0, 2.0, 3.0), 0.7)
    }

    /// A rotation about the origin; the axis need not be a unit vector.
    #[must_use]
    pub fn rotation(axis: DVec3, angle: f64) -> Self {
        let axis = axis.try_normalize().unwrap_or(DVec3::Z);
        Self {
            rotation: DMat3::from_axis_angle(axis, angle),
            ..Self::IDENTITY
        }
    }

    /// A scaling about the origin.
    #[must_use]
    pub fn scaling(scale: f64) -> Self {
        Self {
            scale,
            ..Self::IDENTITY
        }
    }

    /// A translation.
    #[must_use]
    pub fn translation(shift: DVec3) -> Self {
        Self {
            shift,
            ..Self::IDENTITY
        }
    }

    /// `x ↦ −x`.
    #[must_use]
    pub fn mirror() -> Self {
        Self {
            rotation: DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)),
            ..Self::IDENTITY
        }
    }

    /// The image of a point.
    #[must_use]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.rotation * p * self.scale + self.shift
    }

    /// The motion back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let (rotation, scale) = (self.rotation.transpose(), 1.0 / self.scale);
        Self {
            rotation,
            scale,
            shift: -(rotation * self.shift * scale),
        }
    }

    /// The image of a scene. A mirrored surface is wound the other way, so that
    /// its front stays its front.
    #[must_use]
    pub fn scene(&self, scene: &SceneInput) -> SceneInput {
        let is_mirror = self.rotation.determinant() < 0.0;
        let mut image = scene.clone();
        for surface in &mut image.surfaces {
            for corners in std::iter::once(&mut surface.vertices).chain(&mut surface.holes) {
                for p in corners.iter_mut() {
                    *p = self.point(*p);
                }
                if is_mirror {
                    corners.reverse();
                }
            }
        }
        image
    }
}
