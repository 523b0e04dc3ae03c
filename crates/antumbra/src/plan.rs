//! The plan: which effects a scene calls for at a tolerance, and why.

use crate::options::{Events, Options};
use crate::scout::Scout;
use antumbra_scene::Scene;
use antumbra_visibility::{CountByKind, EventKind};

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Direct light alone.
    Direct,
    /// Direct light and interreflection.
    Total,
}

/// What is done about an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// It is simulated.
    Simulated,
    /// The scene has it, and it is left out.
    LeftOut,
    /// The scene does not have it.
    Absent,
}

impl Decision {
    /// In words, as in reports.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Simulated => "simulated",
            Self::LeftOut => "left out",
            Self::Absent => "absent",
        }
    }
}

/// One effect with its decision.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// Its key in reports.
    pub name: &'static str,
    /// What is done.
    pub decision: Decision,
    /// What the decision can change any value by, relative to the scene's peak direct
    /// irradiance; 0 for what is simulated exactly.
    pub bound: f64,
    /// Why, for people.
    pub reason: String,
}

/// What a run is expected to take; within a factor of about two.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Expected {
    /// Elements of all meshes.
    pub elements: f64,
    /// Exact evaluations, check points included.
    pub exact_evaluations: f64,
    /// Memory of the result and its making.
    pub memory_bytes: f64,
}

/// Which effects are simulated, which are not, what leaving them out costs at most,
/// and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// In the order of reports.
    pub effects: Vec<Effect>,
    /// Degree of the elements.
    pub degree: u8,
    /// The tolerance relative to the peak.
    pub relative_tolerance: f64,
    /// Bounces of light that carry all but a hundredth of the tolerance; 0 without
    /// interreflection.
    pub bounces: u32,
    /// Critical curves of all receivers.
    pub curves: CountByKind,
    /// Those that are put into the meshes before anything is evaluated.
    pub lines: CountByKind,
    /// Generators that were looked at.
    pub candidates: CountByKind,
    /// What the run is expected to take; `None` where nothing is known beforehand
    /// (`Events::Kinds` without all kinds).
    pub expected: Option<Expected>,
}

/// Interreflection that can change no value by more than this share of the tolerance
/// is left out.
const NEGLIGIBLE: f64 = 0.1;

/// Exact evaluations per element: nodes shared with neighbours, and check points
/// (measured: `docs/accuracy.md`).
const EVALUATIONS_PER_ELEMENT: [f64; 4] = [4.2, 8.0, 8.5, 13.0];

/// Bytes per element: mesh, nodes, values, and what refinement keeps.
const BYTES_PER_ELEMENT: f64 = 1600.0;

impl Plan {
    /// The effect with this key.
    #[must_use]
    pub fn effect(&self, name: &str) -> Option<&Effect> {
        self.effects.iter().find(|e| e.name == name)
    }

    /// Is this effect simulated?
    #[must_use]
    pub fn simulates(&self, name: &str) -> bool {
        self.effect(name)
            .is_some_and(|e| e.decision == Decision::Simulated)
    }

    pub(crate) fn new(
        scene: &Scene,
        options: &Options,
        quantity: Quantity,
        scout: &Scout<'_>,
    ) -> Self {
        let events = options.curves().events;
        let tolerance = if scout.peak > 0.0 {
            scout.allowed / scout.peak
        } else {
            0.0
        };
        let mut plan = Self {
            effects: Vec::new(),
            degree: options.chosen_degree(),
            relative_tolerance: tolerance,
            bounces: 0,
            curves: scout.count(|_| true),
            lines: scout.count(|is_line| is_line),
            candidates: scout.candidates(),
            expected: None,
        };
        plan.occlusion(scene, scout);
        for kind in EventKind::ALL {
            plan.events(kind, events, tolerance);
        }
        plan.not_looked_at(scout.n_stopped());
        plan.degree(options);
        plan.faces(scene, scout);
        plan.interreflection(scene, quantity, tolerance);
        plan.bands(scene);
        plan.expect(scout, events);
        plan
    }

    fn push(&mut self, name: &'static str, decision: Decision, bound: f64, reason: String) {
        self.effects.push(Effect {
            name,
            decision,
            bound,
            reason,
        });
    }

    fn occlusion(&mut self, scene: &Scene, scout: &Scout<'_>) {
        let lit = scene
            .face_ids()
            .filter(|&f| scout.light.view(f).sees_any_emitter());
        let (n_lit, n_shadowed) = lit.fold((0, 0), |(lit, shadowed), f| {
            let is_shadowed = scout.light.view(f).may_be_occluded();
            (lit + 1, shadowed + usize::from(is_shadowed))
        });
        let (decision, reason) = if n_shadowed > 0 {
            (
                Decision::Simulated,
                format!(
                    "something stands between an emitter and {n_shadowed} of {n_lit} lit faces"
                ),
            )
        } else {
            (
                Decision::Absent,
                format!(
                    "nothing stands between any emitter and the {n_lit} lit faces: closed form"
                ),
            )
        };
        self.push("occlusion", decision, 0.0, reason);
    }

    fn events(&mut self, kind: EventKind, events: Events, tolerance: f64) {
        let (n, lines) = (self.curves[kind as usize], self.lines[kind as usize]);
        let name = kind.key();
        // Refinement holds every mesh to the tolerance, so two of them differ by no
        // more than twice that.
        let refined = 2.0 * tolerance;
        if !events.kinds().contains(kind) {
            let reason = "left out by --events: elements are refined instead".to_owned();
            self.push(name, Decision::LeftOut, refined, reason);
        } else if n == 0 {
            let reason = format!(
                "the scene has none ({} candidates)",
                self.candidates[kind as usize]
            );
            self.push(name, Decision::Absent, 0.0, reason);
        } else if kind == EventKind::Contact {
            let reason = format!("{n} curves: without them light leaks");
            self.push(name, Decision::Simulated, 0.0, reason);
        } else if lines == 0 {
            let reason = format!(
                "{n} curves, none worth a line at this tolerance: elements are refined instead"
            );
            self.push(name, Decision::LeftOut, refined, reason);
        } else {
            let reason = format!(
                "{lines} of {n} curves are worth a line; {} wait for an element that needs them",
                n - lines
            );
            let bound = if lines < n { refined } else { 0.0 };
            self.push(name, Decision::Simulated, bound, reason);
        }
    }

    /// Of events, some receivers were not looked at, because the work was stopped.
    fn not_looked_at(&mut self, (n, n_stopped): (usize, usize)) {
        if n_stopped == 0 {
            return;
        }
        for effect in self.effects.iter_mut().filter(|e| is_event(e)) {
            // An absence on some receivers is none on all.
            if effect.decision == Decision::Absent {
                effect.decision = Decision::LeftOut;
            }
            effect.bound = 1.0;
            effect.reason.push_str(&format!(
                "; stopped before {n_stopped} of {n} receivers were looked at"
            ));
        }
    }

    fn degree(&mut self, options: &Options) {
        let reason = match options.degree {
            Some(p) => format!("degree {p}, as asked for"),
            None => format!(
                "degree {}: fewest exact evaluations at this tolerance",
                self.degree
            ),
        };
        self.push("degree", Decision::Simulated, 0.0, reason);
    }

    fn faces(&mut self, scene: &Scene, scout: &Scout<'_>) {
        let n_dark = scene
            .face_ids()
            .filter(|&f| !scout.light.view(f).sees_any_emitter())
            .count();
        let (decision, reason) = if n_dark > 0 {
            (
                Decision::LeftOut,
                format!("{n_dark} faces see no emitter: their direct light is 0, not evaluated"),
            )
        } else {
            (Decision::Absent, "every face may see an emitter".to_owned())
        };
        self.push("dark-faces", decision, 0.0, reason);
        let n_two_sided = scene.faces.iter().filter(|f| f.is_back).count();
        let (decision, reason) = if n_two_sided > 0 {
            (
                Decision::Simulated,
                format!("{n_two_sided} backs of two-sided surfaces receive, emit and reflect"),
            )
        } else {
            (
                Decision::Absent,
                "no surface is two-sided: backs only block light".to_owned(),
            )
        };
        self.push("two-sidedness", decision, 0.0, reason);
    }

    fn interreflection(&mut self, scene: &Scene, quantity: Quantity, tolerance: f64) {
        let reflectance = scene
            .faces
            .iter()
            .flat_map(|f| {
                let surface = &scene.surfaces[f.surface.index()];
                &scene.materials[surface.material.index()].reflectance
            })
            .copied()
            .fold(0.0, f64::max);
        // A point sees reflected light of at most ρ times the peak, twice reflected
        // light of at most ρ² times, and so on.
        let all = reflectance / (1.0 - reflectance);
        let series = format!(
            "reflectance is at most {reflectance}: all bounces together bring at most {all:.3} of the peak"
        );
        let (decision, bound, reason) = if reflectance == 0.0 {
            (Decision::Absent, 0.0, "no surface reflects".to_owned())
        } else if quantity == Quantity::Direct {
            (
                Decision::LeftOut,
                all,
                format!("mesh is about direct light, solve adds it; {series}"),
            )
        } else if all <= NEGLIGIBLE * tolerance {
            (
                Decision::LeftOut,
                all,
                format!("below a tenth of the tolerance: {series}"),
            )
        } else {
            // The smallest n with ρⁿ⁺¹/(1−ρ) below a hundredth of the tolerance.
            let rest = (0.01 * tolerance * (1.0 - reflectance)).ln() / reflectance.ln() - 1.0;
            self.bounces = rest.clamp(1.0, 1e6).ceil() as u32;
            (
                Decision::Simulated,
                0.0,
                format!(
                    "{series}; solved for all bounces, of which {} carry all but a hundredth of the tolerance",
                    self.bounces
                ),
            )
        };
        let is_simulated = decision == Decision::Simulated;
        self.push("interreflection", decision, bound, reason);
        let (decision, bound, reason) = if is_simulated {
            (
                Decision::LeftOut,
                all,
                "shadows of reflected light get lines where surfaces touch or nearly do; \
                 elsewhere refinement follows them"
                    .to_owned(),
            )
        } else {
            (
                Decision::Absent,
                0.0,
                "no reflected light is simulated".to_owned(),
            )
        };
        self.push("secondary-shadows", decision, bound, reason);
    }

    fn bands(&mut self, scene: &Scene) {
        let columns = |band: usize| -> Vec<(u64, u64)> {
            scene
                .materials
                .iter()
                .map(|m| (m.reflectance[band].to_bits(), m.exitance[band].to_bits()))
                .collect()
        };
        let mut distinct: Vec<_> = (0..scene.n_bands).map(columns).collect();
        distinct.sort_unstable();
        distinct.dedup();
        let reason = format!(
            "{} bands, {} of them different: visibility is computed once for all",
            scene.n_bands,
            distinct.len()
        );
        let decision = if scene.n_bands > 1 {
            Decision::Simulated
        } else {
            Decision::Absent
        };
        self.push("bands", decision, 0.0, reason);
    }

    fn expect(&mut self, scout: &Scout<'_>, events: Events) {
        if events.kinds() != antumbra_visibility::EventKinds::ALL {
            return;
        }
        let p = usize::from(self.degree) - 1;
        let elements = scout.expected_elements();
        self.expected = Some(Expected {
            elements,
            exact_evaluations: elements * EVALUATIONS_PER_ELEMENT[p],
            memory_bytes: elements * BYTES_PER_ELEMENT,
        });
    }

    /// The plan as it was carried out: kinds of which elements called for a line
    /// after all are simulated; and if refinement was stopped, it bounds nothing.
    #[must_use]
    pub(crate) fn carried_out(mut self, inserted: &CountByKind, is_stopped: bool) -> Self {
        for kind in EventKind::ALL {
            let n = inserted[kind as usize];
            if let Some(effect) = self.effects.iter_mut().find(|e| e.name == kind.key())
                && effect.decision == Decision::LeftOut
                && n > 0
            {
                effect.decision = Decision::Simulated;
                effect.reason = format!("elements called for {n} of its curves");
            }
        }
        if is_stopped {
            for effect in self.effects.iter_mut().filter(|e| is_event(e)) {
                if effect.decision != Decision::Absent && effect.bound < 1.0 {
                    effect.bound = 1.0;
                    effect
                        .reason
                        .push_str("; stopped before elements were refined to the tolerance");
                }
            }
        }
        self
    }

    /// The plan of a run that was stopped before interreflection was solved.
    #[must_use]
    pub(crate) fn without_interreflection(mut self) -> Self {
        let reflects =
            |e: &&mut Effect| e.name == "interreflection" && e.decision == Decision::Simulated;
        // What leaving out the shadows of reflected light costs is all of it, too.
        let all = self.effect("secondary-shadows").map_or(1.0, |e| e.bound);
        if let Some(effect) = self.effects.iter_mut().find(reflects) {
            effect.decision = Decision::LeftOut;
            effect.bound = all;
            effect.reason.push_str("; stopped before it was solved");
        }
        self
    }
}

/// Is an effect a kind of events?
fn is_event(effect: &Effect) -> bool {
    EventKind::ALL.iter().any(|kind| kind.key() == effect.name)
}
