//! Pressing: the user's finger on the actual surface, and the answers of all decoders.
//!
//! `pointer` turns mouse and keys into a [`Touch`] before anything of the frame is drawn. `solving` computes what is shown of
//! it in the background, the newest first; `demo` trains a small network that answers until there is another. `section` shows
//! the answers.

mod demo;
mod pointer;
mod section;
mod solving;

use std::sync::Arc;

use decoupler_core::{
    decoupling::DecoderKind,
    scene::{Indenter, IndenterShape, Radii},
};
use decoupler_files::figure::surface::{Sight, Surface};
use eframe::egui::{Id, Rect};
use glam::DVec2;

use self::{
    demo::Demo,
    solving::{Question, solve},
};
use super::decoders::{Decoders, Subject};
use crate::window::{
    job::{Background, JobError, Jobs},
    shared::{RunResult, Shared},
    surface_view::SurfaceViewResponse,
    test_view::Skin,
};

pub use section::{press_section_ui, readings_head_ui, readings_ui};
pub use solving::Shown;

/// The finger, what it presses, and everything known about that.
#[derive(Debug)]
pub struct PressState {
    /// The finger that presses.
    pub finger: Finger,
    /// Place that it presses; `None` while the test set is displayed.
    place_mm: Option<DVec2>,
    /// Height of the plane in which the pointer moves it, while the button is down: that of the first contact, so that it
    /// does not jump as the surface gives way.
    grip_mm: Option<f64>,
    /// The actual surface as last drawn.
    target: Option<Target>,
    /// The latest answer, or why there is none, with its question.
    answered: Option<Answered>,
    solving: Background<Result<Answered, JobError>>,
    decoders: Decoders,
    demo: Demo,
}

/// A question with its answer, or why there is none.
type Answered = (Question, Result<Shown, String>);

impl PressState {
    /// Nothing pressed.
    pub fn new(jobs: &Jobs) -> Self {
        Self {
            finger: Finger::default(),
            place_mm: None,
            grip_mm: None,
            target: None,
            answered: None,
            solving: Background::prompt("press", jobs),
            decoders: Decoders::new(jobs, &[DecoderKind::Mean]),
            demo: Demo::new(jobs),
        }
    }

    /// Returns true while something is pressed.
    pub fn is_pressing(&self) -> bool {
        self.place_mm.is_some()
    }

    /// Returns the pressed place.
    pub fn place_mm(&self) -> Option<DVec2> {
        self.place_mm
    }

    /// What is shown of the touch; `None` while the test set is displayed, or before the first answer.
    pub fn shown(&self) -> Option<&Shown> {
        self.answered.as_ref()?.1.as_ref().ok()
    }

    /// Goes back to the test set.
    pub fn let_go(&mut self) {
        (self.place_mm, self.grip_mm, self.answered) = (None, None, None);
        self.solving.abandon();
    }

    /// Presses the middle of the nodes.
    pub fn press_middle(&mut self, skin: &Skin) {
        let (geometry, scale) = (&skin.sensor.geometry, skin.sensor.scale);
        let [first, last] = [skin.rows.first(), skin.rows.last()].map(|row| row.copied().unwrap_or(0));
        let first = geometry.row_node_mm(scale, first, 0);
        let last = geometry.row_node_mm(scale, last, scale.nodes_per_row() - 1);
        self.place_mm = Some(0.5 * (first + last).truncate());
    }

    /// Takes the actual surface as it was drawn.
    pub fn take_target(&mut self, drawn: &SurfaceViewResponse, surface: &Surface) {
        self.target = drawn.sight.map(|sight| Target {
            id: drawn.response.id,
            rect: drawn.response.rect,
            sight,
            surface: surface.clone(),
        });
    }

    /// Has the touch answered, one question at a time; `result` is that of the displayed network.
    pub fn follow(&mut self, shared: &Shared, result: Option<&RunResult>) {
        let Some(skin) = shared.skin() else {
            // A recording has no sensor model to press.
            self.let_go();
            self.target = None;
            return;
        };
        if self
            .answered
            .as_ref()
            .is_some_and(|(question, _)| !question.is_of(skin))
        {
            // Another array, or another scene.
            self.let_go();
        }
        let Some(place_mm) = self.place_mm else { return };
        let own = shared.shown_run().zip(result).map(|(run, result)| Subject {
            networks: Arc::clone(&result.networks),
            setup: run.setup.clone(),
            problem: Arc::clone(&run.problem),
        });
        if own.is_none() {
            let scene = shared.draft.simulation().map(|simulation| simulation.scene);
            self.demo.follow(skin, scene.unwrap_or_default().noise);
        }
        let question = Question {
            finger: self.finger,
            place_mm,
            skin: Arc::clone(skin),
            is_demo: own.is_none(),
            is_idle: own.is_none() || result.is_some_and(|result| result.is_idle),
            subject: own.or_else(|| self.demo.subject.clone()?.ok()),
        };
        while let Some(answered) = self.solving.next_event() {
            let failed = |error: JobError| (question.clone(), Err(error.to_string()));
            self.answered = Some(answered.unwrap_or_else(failed));
        }
        let is_answered = self
            .answered
            .as_ref()
            .is_some_and(|(answered, _)| answered.is(&question));
        if !is_answered && !self.solving.is_under_way() {
            self.solving.start(move |_| solve(question), |answered| answered);
        }
        if let Some((
            Question {
                subject: Some(subject),
                is_idle,
                ..
            },
            Ok(shown),
        )) = &self.answered
        {
            match is_idle {
                true => self
                    .decoders
                    .follow(&subject.networks, &shown.pressed, || subject.clone()),
                false => self.decoders.forget(),
            }
        }
    }

    /// Text while something is pressed and no network has answered.
    pub fn waiting_text(&self, shared: &Shared) -> &str {
        match &self.demo.subject {
            Some(Err(reason)) => reason,
            _ if self.demo.is_awaited() => "The built-in demo network is being trained…",
            _ if shared.phase.is_busy() => "The network answers here once its training has begun.",
            _ => "This array is too large for the demo network: press Train, and your network answers here.",
        }
    }
}

/// A surface on the screen that can be touched.
#[derive(Clone, Debug)]
struct Target {
    id: Id,
    rect: Rect,
    sight: Sight,
    surface: Surface,
}

/// The ball that presses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finger {
    /// Its radius.
    pub radius_mm: f64,
    /// Its depth as a part of the stroke, from 0 to 1.
    pub depth_share: f64,
}

impl Default for Finger {
    fn default() -> Self {
        Self {
            radius_mm: 4.0,
            depth_share: 0.8,
        }
    }
}

impl Finger {
    fn indenter(&self) -> Indenter {
        let radius_mm = Radii {
            smallest: self.radius_mm,
            largest: self.radius_mm,
        };
        Indenter {
            shape: IndenterShape::Sphere { radius_mm },
            ..Indenter::default()
        }
    }

    /// Presses deeper by a part of the stroke.
    fn deepen(&mut self, share: f64) {
        self.depth_share = (self.depth_share + share).clamp(0.0, 1.0);
    }
}
