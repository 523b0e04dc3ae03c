//! Receivers prepared for many evaluations.

use crate::evaluator::Evaluator;
use crate::evaluator::occluders::Candidates;
use crate::place::{Approach, Place};
use antumbra_scene::{FaceId, PlaneId};
use glam::DVec3;

/// A receiver prepared for many evaluations: which emitters it can see at all,
/// and which occluders may stand between.
#[derive(Clone, Debug)]
pub struct View {
    normal: DVec3,
    plane: Option<PlaneId>,
    /// Per emitter of the evaluator.
    pub(super) candidates: Vec<Option<Candidates>>,
}

impl View {
    /// The unit normal of the receiver.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// A place on the receiver.
    pub(super) fn place(&self, point: DVec3, approach: Option<&Approach>) -> Place {
        Place {
            point,
            normal: self.normal,
            plane: self.plane,
            approach: approach.copied(),
        }
    }

    /// Can any emitter light this receiver at all?
    #[must_use]
    pub fn sees_any_emitter(&self) -> bool {
        self.candidates.iter().any(Option::is_some)
    }

    /// May anything stand between this receiver and an emitter?
    #[must_use]
    pub fn may_be_occluded(&self) -> bool {
        let mut lists = self.candidates.iter().flatten().map(Candidates::list);
        lists.any(|list| list.is_none_or(|list| !list.is_empty()))
    }

    /// The emitters this receiver may see, as positions in [`Evaluator::emitters`].
    pub fn visible_emitters(&self) -> impl Iterator<Item = usize> + '_ {
        self.candidates
            .iter()
            .enumerate()
            .filter(|(_, c)| c.is_some())
            .map(|(i, _)| i)
    }
}

impl Evaluator<'_> {
    /// Prepares evaluations on a face.
    #[must_use]
    pub fn view(&self, receiver: FaceId) -> View {
        let face = self.scene.face(receiver);
        let outline = self.scene.positions(&face.outline);
        let candidates = self
            .emitters
            .iter()
            .map(|(emitter, source)| {
                if source.plane == face.plane || face.is_covered {
                    return None;
                }
                let lamp = self.scene.positions(&self.scene.face(*emitter).outline);
                let own = (face.normal, face.plane);
                let between = self.between(&outline, own, &lamp, (source.normal, source.plane));
                between.map(Candidates::of)
            })
            .collect();
        View {
            normal: face.normal,
            plane: Some(face.plane),
            candidates,
        }
    }

    /// A view of a face for which nothing is prepared: every evaluation asks the box tree
    /// for all that may stand between. Values are the same.
    #[must_use]
    pub fn unprepared_view(&self, receiver: FaceId) -> View {
        let face = self.scene.face(receiver);
        let mut view = View {
            plane: Some(face.plane),
            ..self.free_view(face.normal)
        };
        if face.is_covered {
            view.candidates.fill(None);
        }
        view
    }

    /// Prepares evaluations at free sensors with this unit normal.
    #[must_use]
    pub fn free_view(&self, normal: DVec3) -> View {
        let candidates = vec![Some(Candidates::Tree); self.emitters.len()];
        View {
            normal,
            plane: None,
            candidates,
        }
    }
}
