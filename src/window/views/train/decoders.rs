//! Results of other decoders on the test set: measured on a separate thread once a training is paused and the user has
//! unfolded their table, and shown as they arrive.
//!
//! The thread ends after the last decoder, or after the current one if it is cancelled.

use std::{cell::RefCell, path::Path, sync::Arc};

use decoupler_core::{
    dataset::Dataset,
    decoupling::{DecoderKind, Precision},
    evaluation::{DecoderReport, DecoderSet, ErrorMeasure, Errors},
    job::Job,
    network::Networks,
    problem::Problem,
};
use decoupler_files::{
    export::{format_number, format_r2},
    import::Setup,
};
use eframe::egui::{Button, CollapsingHeader, Ui, Vec2, WidgetInfo, accesskit::Role};

use crate::window::{
    glossary,
    job::{Background, JobError, Report, Wake},
    shared::{Exporting, NetworkSource, Phase, Shared, target_choice_ui},
    theme::{Theme, space},
    training_worker::RunId,
    widgets::{ColumnWidth, TableColumn, TableRow, TableView, dim_ui, focus_ring_ui, note_ui},
};

/// Message of the thread to the window.
enum MeasuringEvent {
    /// Report of the decoder at this place in the list.
    Measured(usize, Result<DecoderReport, String>),
    /// The thread has ended.
    Ended(Result<(), JobError>),
}

/// The window's end of the thread.
#[derive(Debug)]
pub struct DecoderMeasuring {
    job: Background<MeasuringEvent>,
    /// The training whose networks are measured, and its number of epochs at that time.
    of: Option<(RunId, usize)>,
    /// True after an internal error: the decoders are measured again once the table is closed and opened.
    has_failed: bool,
}

impl DecoderMeasuring {
    /// Nothing measured yet. `wake` is called after each decoder and at the end.
    pub fn new(wake: Wake) -> Self {
        Self {
            job: Background::new("decoders", wake),
            of: None,
            has_failed: false,
        }
    }

    /// Takes events, discards results of networks that have changed since, and measures the displayed networks once the
    /// training is paused and the table is unfolded.
    pub fn follow(&mut self, shared: &Shared, state: &mut DecodersState) {
        self.take_events(state);
        let standing = shared.run.as_ref().and_then(|run| {
            let result = run.result.as_ref()?;
            result
                .is_idle
                .then_some((run, (run.id, result.epochs_run), &result.networks))
        });
        let is_other = standing.is_some_and(|(_, of, _)| self.of.is_some_and(|measured| measured != of));
        let is_closed = self.has_failed && !state.is_open;
        if is_other || is_closed || shared.phase == Phase::Training {
            self.forget(state);
        }
        let is_wanted = state.is_open && state.measured.is_none();
        if let (true, Phase::Paused | Phase::Ended(_), Some((run, of, networks))) = (is_wanted, shared.phase, standing)
        {
            self.of = Some(of);
            state.measured = Some(DecoderResult::pending(&run.problem));
            let (problem, test) = (Arc::clone(&run.problem), Arc::clone(run.test.set()));
            self.begin(run.setup.clone(), problem, (**networks).clone(), test);
        }
    }

    fn forget(&mut self, state: &mut DecodersState) {
        self.job.abandon();
        (self.of, state.measured, self.has_failed) = (None, None, false);
    }

    /// Measures all decoders of `setup` with their trained `networks` on `test`, which `problem` describes.
    fn begin(&mut self, setup: Setup, problem: Arc<Problem>, networks: Networks, test: Arc<Dataset>) {
        self.job.start(
            move |report| measure_all(&setup, &problem, networks, &test, report),
            MeasuringEvent::Ended,
        );
    }

    /// Takes the events of the thread.
    fn take_events(&mut self, state: &mut DecodersState) {
        while let Some(event) = self.job.next_event() {
            match event {
                MeasuringEvent::Measured(place, report) => state.take(place, report),
                MeasuringEvent::Ended(Ok(())) => {}
                MeasuringEvent::Ended(Err(error)) => {
                    self.has_failed = true;
                    state.end(&format!("{error}; close the table and open it again"));
                }
            }
        }
    }
}

fn measure_all(setup: &Setup, problem: &Problem, networks: Networks, test: &Dataset, report: &Report<MeasuringEvent>) {
    let is_cancelled = || report.is_cancelled();
    let sets = setup.sets(Path::new(""), &Job::new(&is_cancelled), &mut |_| ());
    let set = sets.map_err(|error| error.to_string()).map(|sets| {
        let training = sets.sets.split.training;
        DecoderSet::new(*setup.settings(), training, Some(networks))
    });
    for (place, wanted) in DecoderResult::pending(problem).into_iter().enumerate() {
        if is_cancelled() {
            return;
        }
        let measure = |set: &DecoderSet| match set.measure(wanted.kind, wanted.precision, test) {
            Ok(report) => report.ok_or_else(|| "it needs a trained network".to_owned()),
            Err(error) => Err(error.to_string()),
        };
        report.send(MeasuringEvent::Measured(
            place,
            set.as_ref().map_err(String::clone).and_then(measure),
        ));
    }
}

/// The table of decoders.
#[derive(Debug, Default)]
pub struct DecodersState {
    /// True while the table is unfolded.
    pub is_open: bool,
    /// Results for the current training; none while it is running.
    pub measured: Option<Vec<DecoderResult>>,
}

/// Result of a decoder.
#[derive(Clone, Debug, PartialEq)]
pub struct DecoderResult {
    /// Kind of decoder.
    pub kind: DecoderKind,
    /// Precision of its network.
    pub precision: Precision,
    /// Report of the decoder, or why it cannot be used; none until it has been measured.
    pub report: Option<Result<DecoderReport, String>>,
}

impl DecoderResult {
    /// All decoders for this problem, none measured yet.
    pub fn pending(problem: &Problem) -> Vec<Self> {
        let pending = |(kind, precision)| Self {
            kind,
            precision,
            report: None,
        };
        DecoderSet::kinds(problem).map(pending).collect()
    }
}

impl DecodersState {
    /// Returns true while a result is missing.
    pub fn is_measuring(&self) -> bool {
        let results = self.measured.iter().flatten();
        results.into_iter().any(|result| result.report.is_none())
    }

    /// Takes events about one decoder.
    pub fn take(&mut self, place: usize, report: Result<DecoderReport, String>) {
        if let Some(result) = self.measured.as_mut().and_then(|measured| measured.get_mut(place)) {
            result.report = Some(report);
        }
    }

    /// Marks the missing results as failed for this reason.
    pub fn end(&mut self, reason: &str) {
        let results = self.measured.iter_mut().flatten();
        for result in results.filter(|result| result.report.is_none()) {
            result.report = Some(Err(reason.to_owned()));
        }
    }
}

/// Figure measured for a decoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Figure {
    ZPercent,
    TimesModelBased,
    Residual,
    RangePercent,
    Rmse,
    R2,
    FrameTime,
}

impl Figure {
    /// Returns the figures for this problem, from left to right.
    fn of(problem: &Problem, has_model_based: bool) -> Vec<Self> {
        if !problem.has_nodes() {
            return vec![Self::RangePercent, Self::Rmse, Self::R2, Self::FrameTime];
        }
        let figures = [Self::ZPercent, Self::TimesModelBased, Self::Residual, Self::FrameTime].into_iter();
        figures
            .filter(|figure| has_model_based || *figure != Self::TimesModelBased)
            .collect()
    }

    fn column(self) -> TableColumn<'static> {
        let (heading, meaning) = match self {
            Self::ZPercent => ("Z %", glossary::Z_PERCENT.hint),
            Self::TimesModelBased => (
                "× model-based",
                "Mean |error| of z divided by that of the model-based decoder in this scene.",
            ),
            Self::Residual => ("residual", glossary::RESIDUAL.hint),
            Self::RangePercent => (
                "% of range",
                "Mean absolute error in percent of the range, averaged over all targets that vary.",
            ),
            Self::Rmse => ("RMSE", ErrorMeasure::Rmse.definition()),
            Self::R2 => ("R²", ErrorMeasure::R2.definition()),
            Self::FrameTime => (
                "µs",
                "Time to decode a frame (all rows, or one sample of a recording) on one thread, in µs: the median of many.",
            ),
        };
        TableColumn::figure(heading).meaning(meaning)
    }

    fn value(self, report: &DecoderReport, model_based: Option<&Errors>, target: usize) -> Option<f64> {
        let of_target = report.errors.targets().get(target);
        match self {
            Self::ZPercent | Self::RangePercent => report.errors.percent(),
            Self::TimesModelBased => report.errors.nodes()?.times(model_based?),
            Self::Residual => report.residual,
            Self::Rmse => Some(of_target?.rmse),
            Self::R2 => of_target?.r2,
            Self::FrameTime => Some(report.frame_us),
        }
    }

    /// Returns the same figure of the model-based errors.
    fn of_model_based(self, errors: &Errors) -> Option<f64> {
        match self {
            Self::ZPercent => errors.z_percent,
            Self::TimesModelBased => Some(1.0),
            _ => None,
        }
    }
}

/// The other decoders on the same test set, folded away until the user asks for them, next to the `model_based`
/// errors. `target` is the target whose errors are shown for a recording. Each decoder can be exported with
/// `source`; returns the requested file.
pub fn decoders_ui(
    ui: &mut Ui,
    decoders: &mut DecodersState,
    phase: Phase,
    (problem, model_based): (&Problem, Option<&Errors>),
    target: &mut usize,
    source: Option<&NetworkSource>,
) -> Option<Exporting> {
    let mut asked = None;
    ui.add_space(space(1));
    let header = CollapsingHeader::new("More decoders")
        .open(Some(decoders.is_open))
        .show(ui, |ui| {
            if let Some(measured) = &decoders.measured {
                asked = measured_ui(ui, measured, (problem, model_based), target, source);
            } else {
                let text = match phase {
                    Phase::Died => "The network was lost with the training thread: train again.",
                    _ => "They are measured when the training is paused or has ended.",
                };
                dim_ui(ui, text);
            }
        });
    focus_ring_ui(ui, &header.header_response);
    let hint = if problem.has_nodes() {
        "Ridge regression, radial-basis network, Newton on Eq. (2) and others on the same test set: errors, times, and \
         ratio to the model-based error."
    } else {
        "Ridge regression, radial-basis network and others on the same test set: errors and times."
    };
    if header.header_response.on_hover_text(hint).clicked() {
        decoders.is_open = !decoders.is_open;
    }
    asked
}

fn measured_ui(
    ui: &mut Ui,
    measured: &[DecoderResult],
    (problem, model_based): (&Problem, Option<&Errors>),
    target: &mut usize,
    source: Option<&NetworkSource>,
) -> Option<Exporting> {
    let palette = Theme::of(ui).palette;
    // Ratios to rounding are meaningless.
    let model_based = model_based.filter(|errors| !errors.is_rounding());
    if !problem.has_nodes() {
        target_choice_ui(ui, "RMSE and R² of", "target of the decoders", &problem.targets, target);
    }
    let target = (*target).min(problem.targets.len().saturating_sub(1));
    let mut figures = Figure::of(problem, model_based.is_some());
    // In a narrow window the buttons at the end come first.
    if ui.available_width() < space(80) {
        figures.retain(|figure| *figure != Figure::R2);
    }
    let columns: Vec<TableColumn<'_>> = std::iter::once(TableColumn::text(""))
        .chain(figures.iter().map(|figure| figure.column()))
        .chain([TableColumn::text("").width(ColumnWidth::Points(space(7)))])
        .collect();
    let asked = RefCell::new(None);
    let rows = measured.iter().map(|result| {
        let cells = figures.iter().map(|figure| match &result.report {
            None => "…".to_owned(),
            Some(Err(_)) => format_number(None),
            Some(Ok(report)) if *figure == Figure::R2 => format_r2(figure.value(report, model_based, target)),
            Some(Ok(report)) => format_number(figure.value(report, model_based, target)),
        });
        let colour = if result.kind == DecoderKind::Network {
            palette.accent
        } else {
            palette.text
        };
        let row = TableRow::figures(result.kind.name(result.precision), cells)
            .meaning(result.kind.meaning())
            .colour(colour);
        // The dialog has both precisions.
        let source = source.filter(|_| result.precision == Precision::Double && matches!(result.report, Some(Ok(_))));
        match source {
            None => row,
            Some(source) => row.controls(|ui| {
                let button = Button::new("…").min_size(Vec2::splat(space(5)));
                let button = ui.add(button);
                let name = format!("Export {}…", result.kind.name(Precision::Double));
                button.widget_info(|| WidgetInfo::labeled(Role::Button, true, &name));
                if button.on_hover_text(name).clicked() {
                    asked.replace(Some(Exporting::decoder(result.kind, source.clone())));
                }
            }),
        }
    });
    let of_model_based = model_based.map(|errors| {
        let cells = figures
            .iter()
            .map(|figure| format_number(figure.of_model_based(errors)));
        TableRow::figures("model-based", cells)
            .meaning(glossary::MODEL_BASED.hint)
            .colour(palette.dim)
    });
    let rows = rows.chain(of_model_based).collect();
    TableView::new("decoders", &columns).show_all(ui, rows);
    for result in measured {
        let name = result.kind.name(result.precision);
        match &result.report {
            Some(Err(reason)) => {
                note_ui(ui, &format!("{name}: {reason}"));
            }
            Some(Ok(report)) => {
                for remark in &report.remarks {
                    note_ui(ui, &format!("{name}: {remark}"));
                }
            }
            None => {}
        }
    }
    asked.into_inner()
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use decoupler_core::{
        dataset::Simulation,
        evaluation::{DecoderSet, Preset, Run, RunSets, RunSettings},
        scene::{Noise, NoisySets},
    };
    use egui_kittest::{Harness, kittest::Queryable as _};

    use super::*;
    use decoupler_core::machine::MemoryBudget;

    /// Returns decoders fitted to the training set of `settings`.
    fn decoders_of(settings: RunSettings) -> DecoderSet {
        let sets = RunSets::draw(&settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
        DecoderSet::new(settings, sets.split.training, None)
    }

    #[test]
    fn decoders_that_cannot_be_measured_say_why_and_none_stays_pending() {
        let mut settings = RunSettings {
            hidden: 2,
            ..RunSettings::default()
        };
        settings.source = Simulation {
            samples: 20,
            validation_samples: 0,
            test_samples: 4,
            ..Simulation::default()
        }
        .into();
        settings.simulation_mut().unwrap().sensor.scale = "2x3_2x9".parse().unwrap();
        let run = Run::prepare(settings).unwrap();
        let (waking, woken) = channel();
        let wake = move || waking.send(()).unwrap_or(());
        let (mut measuring, mut state) = (DecoderMeasuring::new(Arc::new(wake)), DecodersState::default());
        state.measured = Some(DecoderResult::pending(run.problem()));
        assert!(state.is_measuring());
        let mut impossible = settings;
        impossible.simulation_mut().unwrap().samples = 0;
        measuring.begin(
            impossible.into(),
            Arc::clone(run.problem()),
            run.network(),
            Arc::clone(run.test()),
        );
        while state.is_measuring() {
            woken.recv().unwrap();
            measuring.take_events(&mut state);
        }
        assert!(!state.is_measuring());
        for result in state.measured.iter().flatten() {
            let reason = result.report.clone().unwrap().unwrap_err();
            assert!(reason.contains("training samples"), "{reason}");
        }
        measuring.forget(&mut state);
        assert!(state.measured.is_none());
    }

    fn unfolded() -> DecodersState {
        DecodersState {
            is_open: true,
            measured: Some(DecoderResult::pending(&Simulation::default().problem())),
        }
    }

    fn shown(mut decoders: DecodersState) -> Harness<'static> {
        let problem = Simulation::default().problem();
        Harness::new_ui(move |ui| {
            decoders_ui(ui, &mut decoders, Phase::Idle, (&problem, None), &mut 0, None);
        })
    }

    #[test]
    fn a_decoder_worse_than_the_mean_says_so_with_cause_and_remedy() {
        let mut settings = decoupler_core::evaluation::RunSettings::default();
        settings.simulation_mut().unwrap().sensor.scale = "2x3_2x9".parse().unwrap();
        settings.simulation_mut().unwrap().samples = 40;
        settings.simulation_mut().unwrap().scene.noise = Noise {
            sets: NoisySets::Test,
            ..Noise::relative(0.5)
        };
        let test = settings.simulation().unwrap().draw_test(settings.seed).unwrap();
        let mut without_noise = settings;
        without_noise.simulation_mut().unwrap().scene.noise = Noise::default();
        // Fitted without the noise that the readings have.
        let set = decoders_of(without_noise);
        let report = set
            .measure(DecoderKind::Ridge, Precision::Double, &test)
            .unwrap()
            .unwrap();
        let remark = report.remarks[0].to_string();
        assert!(remark.contains("times that of always answering the mean"), "{remark}");
        let mut decoders = unfolded();
        let place = DecoderResult::pending(&Simulation::default().problem())
            .iter()
            .position(|result| result.kind == DecoderKind::Ridge);
        decoders.take(place.unwrap(), Ok(report));
        let harness = shown(decoders);
        harness.get_by_label(&format!("Ridge: {remark}"));
    }

    #[test]
    fn a_decoder_that_fails_says_why_and_the_others_are_kept() {
        let mut decoders = unfolded();
        decoders.take(0, Err("no resistance at rest".to_owned()));
        let harness = shown(decoders);
        harness.get_by_label("Training mean: no resistance at rest");
        harness.get_by_label("Training mean, Z %: –");
        harness.get_by_label("Newton, Z %: …");
    }

    #[test]
    fn rows_that_were_not_solved_are_counted_below_the_table() {
        let mut decoders = unfolded();
        // Four electrodes are too few for six nodes.
        let mut settings = Preset::Best.settings();
        settings.simulation_mut().unwrap().sensor.scale = "10x6_3x4".parse().unwrap();
        settings.simulation_mut().unwrap().samples = 100;
        settings.simulation_mut().unwrap().test_samples = 10;
        let set = decoders_of(settings);
        let test = settings.simulation().unwrap().draw_test(settings.seed).unwrap();
        let report = set
            .measure(DecoderKind::Newton, Precision::Double, &test)
            .unwrap()
            .unwrap();
        let place = DecoderResult::pending(&Simulation::default().problem())
            .iter()
            .position(|result| result.kind == DecoderKind::Newton)
            .unwrap();
        decoders.take(place, Ok(report));
        let harness = shown(decoders);
        harness.get_by_label_contains("Newton: 10 of 10 rows are not determined by their readings");
    }
}
