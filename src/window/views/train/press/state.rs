use std::sync::Arc;

use decoupler_core::{
    evaluation::RunSettings,
    network::Networks,
    scene::{Indenter, IndenterShape, Radii, TiltedBody},
};
use decoupler_files::figure::surface::{Sight, Surface};
use eframe::egui::{Id, Rect};
use glam::DVec2;

use super::{
    comparing::{Compared, Comparing},
    pointer::ReadyNetwork,
    section::{Question, Shown},
    touch::{Print, Touch},
};
use crate::window::{
    job::{Background, JobError, Wake},
    shared::{RunResult, Shared, SourceKind},
    surface_view::SurfaceViewResponse,
    test_view::TestView,
    views::train::drawn::Frames,
};

/// The touch, and everything known about it.
#[derive(Debug)]
pub struct PressState {
    /// Work of the pointer on the actual surface.
    pub hand: Hand,
    /// The finger that presses.
    pub finger: Finger,
    /// The touch; `None` while the test set is displayed.
    pub(super) touch: Option<Touch>,
    /// Hold of the pointer, while its button is down.
    pub(super) grip: Option<Grip>,
    /// The actual surface as last drawn.
    pub(super) target: Option<Target>,
    pub(super) ready: ReadyNetwork,
    /// True once the user was about to press.
    pub(super) is_wanted: bool,
    shown: Option<Shown>,
    comparing: Comparing,
    /// Answers that take longer than a frame.
    answering: Background<Result<Result<Shown, String>, JobError>>,
    /// The question that could not be answered, and why.
    failed: Option<(Question, String)>,
}

impl PressState {
    /// Nothing pressed. `wake` is called when something was computed in the background.
    pub fn new(wake: &Wake) -> Self {
        Self {
            hand: Hand::default(),
            finger: Finger::default(),
            touch: None,
            grip: None,
            target: None,
            ready: ReadyNetwork::new(Arc::clone(wake)),
            is_wanted: false,
            shown: None,
            comparing: Comparing::new(wake),
            answering: Background::prompt("press", Arc::clone(wake)),
            failed: None,
        }
    }

    /// Returns true while something is pressed.
    pub fn is_pressing(&self) -> bool {
        self.touch.is_some()
    }

    /// The touch; `None` while the test set is displayed.
    pub fn touch(&self) -> Option<&Touch> {
        self.touch.as_ref()
    }

    /// The part of the touch that is shown; `None` while the test set is displayed, or before the first answer.
    pub fn shown(&self) -> Option<&Shown> {
        self.shown.as_ref().filter(|_| self.is_pressing())
    }

    /// Surfaces of the touch.
    pub fn frames(&self) -> Option<&Frames> {
        self.shown().map(|shown| &shown.frames)
    }

    /// The other decoders under the finger.
    pub(super) fn compared(&self) -> &[Compared] {
        self.comparing.rows()
    }

    /// Returns the reason why nothing is shown of the touch.
    pub(super) fn failure(&self) -> Option<&str> {
        let failed = self.failed.as_ref().filter(|_| self.is_pressing())?;
        Some(&failed.1)
    }

    /// Goes back to the test set.
    pub fn let_go(&mut self) {
        (self.touch, self.grip, self.shown, self.failed) = (None, None, None, None);
    }

    /// Presses the finger onto the middle of the nodes.
    pub fn press_middle(&mut self, test: &TestView) {
        if self.finger.tool == Tool::OneNode {
            self.finger.tool = Tool::default();
        }
        let last = test.sensor.scale.nodes_per_row() - 1;
        let corner = |row: Option<&usize>, node| {
            let row = row.copied().unwrap_or(0);
            test.sensor.geometry.row_node_mm(test.sensor.scale, row, node)
        };
        let (first, last) = (corner(test.rows.first(), 0), corner(test.rows.last(), last));
        self.print_at(0.5 * (first + last).truncate(), test.stroke_mm);
    }

    /// Presses the finger onto a place.
    pub(super) fn print_at(&mut self, place_mm: DVec2, stroke_mm: f64) {
        self.touch = Some(Touch {
            print: self.finger.print(place_mm, stroke_mm),
            ..Touch::default()
        });
    }

    /// Updates the touch after a change of the finger.
    pub(super) fn follow_finger(&mut self, stroke_mm: f64) {
        if let Some(print) = self.touch.as_mut().and_then(|touch| touch.print.as_mut())
            && let Some(changed) = self.finger.print(print.place_mm, stroke_mm)
        {
            *print = changed;
        }
    }

    /// Takes the actual surface as it was drawn.
    pub fn take_target(&mut self, drawn: &SurfaceViewResponse, surface: &Surface) {
        self.target = drawn.sight.map(|sight| Target {
            id: drawn.response.id,
            rect: drawn.response.rect,
            sight,
            surface: surface.clone(),
        });
        self.is_wanted |= self.hand == Hand::Press && drawn.response.hovered();
    }

    /// Answers the touch; `result` is that of the displayed network.
    pub fn follow(&mut self, shared: &Shared, result: Option<&RunResult>) {
        self.ready.take_events();
        if shared.source == SourceKind::Recording {
            // There is no sensor model to press.
            self.let_go();
            (self.target, self.is_wanted) = (None, false);
            return;
        }
        let has_network = shared.shown_run().is_some() && result.is_some();
        if (self.is_wanted || self.is_pressing()) && !has_network {
            self.ready.ask(shared);
        }
        let Some((touch, test)) = self.touch.as_ref().zip(shared.test()) else {
            return;
        };
        if self.shown.as_ref().is_some_and(|shown| !shown.question.is_of(test)) {
            // Another array, or another scene.
            self.let_go();
            return;
        }
        let question = Question {
            touch: touch.clone(),
            test: test.clone(),
            subject: self.subject(shared, result),
        };
        self.ask(question);
        self.comparing.follow(self.shown.as_ref());
    }

    /// The displayed network, whose result is `result`; before there is one, the ready-made one.
    fn subject(&self, shared: &Shared, result: Option<&RunResult>) -> Option<Subject> {
        match shared.shown_run().zip(result) {
            Some((run, result)) => Some(Subject {
                networks: Arc::clone(&result.networks),
                settings: *run.settings(),
                is_ready_made: false,
                is_idle: result.is_idle,
            }),
            None => self.ready.subject(shared),
        }
    }

    /// Answers a question in this frame if that is quick, otherwise in the background, one at a time.
    fn ask(&mut self, question: Question) {
        while let Some(answered) = self.answering.next_event() {
            let answered = answered.unwrap_or_else(|error| Err(error.to_string()));
            self.take_answer(&question, answered);
        }
        let is_answered = self.shown.as_ref().is_some_and(|shown| shown.question.is(&question))
            || self.failed.as_ref().is_some_and(|(failed, _)| failed.is(&question));
        if is_answered {
            return;
        }
        if question.is_light() {
            let answered = question.clone().answer();
            self.take_answer(&question, answered);
        } else if !self.answering.is_under_way() {
            self.answering.start(move |_| question.answer(), |answered| answered);
        }
    }

    fn take_answer(&mut self, question: &Question, answered: Result<Shown, String>) {
        match answered {
            Ok(shown) => (self.shown, self.failed) = (Some(shown), None),
            Err(reason) => self.failed = Some((question.clone(), reason)),
        }
    }
}

/// The network that answers the finger.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The network, or one for each row.
    pub networks: Arc<Networks>,
    /// Settings that it was trained with.
    pub settings: RunSettings,
    /// True for the small one that was trained automatically.
    pub is_ready_made: bool,
    /// True once it no longer changes.
    pub is_idle: bool,
}

impl Subject {
    pub(super) fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.networks, &other.networks)
    }
}

/// A surface on the screen that can be touched.
#[derive(Clone, Debug)]
pub(super) struct Target {
    pub(super) id: Id,
    pub(super) rect: Rect,
    pub(super) sight: Sight,
    pub(super) surface: Surface,
}

/// Hold of the pointer on the surface while its button is down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Grip {
    /// An indenter moves in the horizontal plane of the first contact, so that it does not jump as the surface gives way.
    Level(f64),
    /// A node moves up and down.
    Node {
        /// Its place among those drawn.
        node: usize,
        /// Height of the node above the pointer's.
        above_mm: f64,
        /// Height of the node, and of the pointer on the screen, when it was taken.
        begin: (f64, f32),
    },
    /// The button went down next to the surface.
    Missed,
}

/// Work of the pointer on the actual surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Hand {
    /// It presses.
    #[default]
    Press,
    /// It turns the surface.
    Turn,
}

/// Body that presses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tool {
    /// A ball.
    #[default]
    Sphere,
    /// The flat end of a round bar.
    FlatPunch,
    /// A bar along a row of nodes.
    Cylinder,
    /// The edge of a block.
    Edge,
    /// Two fingertips that move one node up and down.
    OneNode,
}

/// Tool of the user with its size and depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finger {
    /// The body.
    pub tool: Tool,
    /// Its radius, where it has one.
    pub radius_mm: f64,
    /// Depth as a part of the stroke, from 0 to 1.
    pub depth_share: f64,
}

impl Default for Finger {
    fn default() -> Self {
        Self {
            tool: Tool::default(),
            radius_mm: 4.0,
            depth_share: 0.8,
        }
    }
}

impl Finger {
    /// Radii offered.
    pub const RADIUS_MM: std::ops::RangeInclusive<f64> = 0.5..=20.0;

    /// The finger pressed onto a place; `None` for a tool that moves one node.
    pub(super) fn print(&self, place_mm: DVec2, stroke_mm: f64) -> Option<Print> {
        let radius_mm = Radii {
            smallest: self.radius_mm,
            largest: self.radius_mm,
        };
        let largest_tilt_degrees = 0.0;
        let body = TiltedBody {
            radius_mm,
            largest_tilt_degrees,
        };
        let shape = match self.tool {
            Tool::Sphere => IndenterShape::Sphere { radius_mm },
            Tool::FlatPunch => IndenterShape::FlatPunch(body),
            Tool::Cylinder => IndenterShape::Cylinder(body),
            Tool::Edge => IndenterShape::Edge { largest_tilt_degrees },
            Tool::OneNode => return None,
        };
        Some(Print {
            indenter: Indenter {
                shape,
                ..Indenter::default()
            },
            place_mm,
            depth_mm: self.depth_share * stroke_mm,
        })
    }

    /// Returns true if the tool has a radius.
    pub(super) fn has_radius(&self) -> bool {
        matches!(self.tool, Tool::Sphere | Tool::FlatPunch | Tool::Cylinder)
    }

    /// Presses deeper by a part of the stroke.
    pub(super) fn deepen(&mut self, share: f64) {
        self.depth_share = (self.depth_share + share).clamp(0.0, 1.0);
    }
}
