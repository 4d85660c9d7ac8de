use decoupler_core::{dataset::Simulation, scene::Scene, sensor::SensorModel, text::counted};
use eframe::egui::Ui;

use super::{Analysis, figures};
use crate::window::{
    forms::{self, Fields},
    job::{Background, Jobs},
    shared::{Effect, Shared, Shown, SourceKind, Status, Tone, View},
    theme::space,
    widgets::{card_ui, note_ui, placeholder_ui, scrolled_ui, section_heading_ui},
};

/// The Sensor view.
#[derive(Debug)]
pub struct SensorView {
    /// The newest analysis, displayed until the next one is computed.
    pub(super) analysis: Option<Box<Analysis>>,
    /// Reason why the array cannot be analysed.
    pub(super) problem: Option<String>,
    /// Axis along which pattern and sensitivity are drawn: 0 for x, 1 for y, 2 for z.
    pub(super) axis: usize,
    /// The node under the pointer, marked on both pictures.
    pub(super) node: Option<usize>,
    /// The array of the last analysis.
    asked: Option<(SensorModel, Scene)>,
    job: Background<Analysed>,
}

/// Result of an analysis; `None` if it was abandoned.
type Analysed = Result<Option<Box<Analysis>>, String>;

/// What the view says while a recording is the source.
pub(super) const RECORDED: &str =
    "This view computes what the readings of a simulated array determine. For a recording, Study measures it.";

impl SensorView {
    /// Creates the view without an analysis.
    pub fn new(jobs: &Jobs) -> Self {
        Self {
            analysis: None,
            problem: None,
            axis: 2,
            node: None,
            asked: None,
            job: Background::new("identifiability analysis", jobs),
        }
    }

    /// Analyses the array unless that is done. One that is being analysed is abandoned; its end wakes the window.
    fn follow(&mut self, Simulation { sensor, scene, .. }: &Simulation) {
        let asked = (*sensor, *scene);
        if self.asked == Some(asked) {
            return;
        }
        if self.job.is_under_way() {
            return self.job.cancel();
        }
        self.asked = Some(asked);
        self.job.start(
            move |report| {
                let analysis = Analysis::new(&asked.0, &asked.1, || report.is_cancelled());
                Ok(analysis.map_err(|error| error.to_string())?.map(Box::new))
            },
            |ended| ended.unwrap_or_else(|error| Err(format!("{error}; change a value to try again"))),
        );
    }
}

impl View for SensorView {
    fn take_events(&mut self, _shared: &Shared, _effects: &mut Vec<Effect>) {
        while let Some(analysed) = self.job.next_event() {
            match analysed {
                Ok(analysis) => {
                    self.problem = None;
                    // An abandoned one is repeated if the array has become what it was.
                    self.asked = self.asked.filter(|_| analysis.is_some());
                    self.analysis = analysis.or(self.analysis.take());
                }
                Err(reason) => self.problem = Some(reason),
            }
        }
    }

    fn shown<'a>(&'a self, shared: &'a Shared) -> Vec<Shown<'a>> {
        figures::shown(self, shared)
    }

    /// Shows the array and the scene of the Train view.
    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        let mut settings = shared.draft;
        scrolled_ui(ui, "sensor form", |ui| {
            if shared.source == SourceKind::Recording {
                return;
            }
            ui.add_enabled_ui(!shared.phase.is_busy(), |ui| {
                section_heading_ui(ui, "Array");
                if let Some(simulation) = settings.simulation_mut() {
                    forms::array_ui(ui, simulation);
                    forms::geometry_ui(ui, &mut simulation.sensor);
                }
                section_heading_ui(ui, "Scene");
                forms::scene_ui(ui, &mut Fields::new(&mut settings));
            });
            ui.add_space(space(4));
        });
        forms::follow_preset(&shared.draft, &mut settings);
        if settings != shared.draft {
            effects.push(Effect::Configure(Box::new(settings)));
        }
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status> {
        let whole = ui.available_rect_before_wrap();
        if shared.source == SourceKind::Recording {
            card_ui(ui, whole, |ui| placeholder_ui(ui, RECORDED));
            return Some(Status::new(Tone::Calm, "No simulated array".to_owned()));
        }
        if let Some(simulation) = shared.draft.simulation() {
            self.follow(simulation);
        }
        let status = match (&self.problem, &self.analysis) {
            (Some(problem), _) => {
                card_ui(ui, whole, |ui| {
                    note_ui(ui, problem);
                });
                let text = "This sensor or scene is not possible: the note says why";
                Status::new(Tone::Bad, text.to_owned())
            }
            (None, Some(analysis)) => {
                (self.axis, self.node) = figures::analysis_ui(ui, self, analysis, shared.look, effects);
                let (tone, text) = match analysis.warnings.len() {
                    0 => (Tone::Good, "No warnings: nothing prevents decoupling".to_owned()),
                    warnings => (Tone::Warning, counted(warnings, "warning")),
                };
                let rows = counted(analysis.rows.len(), "row");
                Status::new(tone, text).with_note(format!("{}, {rows} read", analysis.sensor.scale))
            }
            (None, None) => {
                card_ui(ui, whole, |ui| {
                    placeholder_ui(ui, "The singular values are being computed.");
                });
                Status::new(Tone::Busy, "Computing".to_owned())
            }
        };
        let computing = || Status::new(Tone::Busy, "Computing".to_owned());
        Some(if self.job.is_under_way() { computing() } else { status })
    }
}
