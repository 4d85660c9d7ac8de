//! Results of other decoders on the test set: measured on a separate thread once a training is paused and the user has
//! unfolded their table, and shown as they arrive.
//!
//! The thread ends after the last decoder, or after the current one if it is cancelled.

use std::{cell::Cell, path::Path, sync::Arc};

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

/// The table of decoders, and the window's end of the thread.
#[derive(Debug)]
pub struct Decoders {
    /// True while the table is unfolded.
    pub is_open: bool,
    /// Results for the current training; none while it is running.
    pub measured: Option<Vec<DecoderResult>>,
    /// The training whose networks are measured, and its number of epochs at that time.
    of: Option<(RunId, usize)>,
    job: Background<MeasuringEvent>,
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

impl Decoders {
    /// Nothing measured yet. `wake` is called after each decoder and at the end.
    pub fn new(wake: Wake) -> Self {
        Self {
            is_open: false,
            measured: None,
            of: None,
            job: Background::new("decoders", wake),
        }
    }

    /// Returns true while a result is missing.
    pub fn is_measuring(&self) -> bool {
        let mut results = self.measured.iter().flatten();
        results.any(|result| result.report.is_none())
    }

    /// Takes events, discards results of networks that have changed since, and measures the displayed networks once the
    /// training is paused and the table is unfolded. What failed is tried again once the table is closed and opened.
    pub fn follow(&mut self, shared: &Shared) {
        self.take_events();
        let run = shared.run.as_ref();
        let standing = run.and_then(|run| Some((run, run.result.as_ref().filter(|result| result.is_idle)?)));
        let of = standing.map(|(run, result)| (run.id, result.epochs_run));
        let is_other = of.is_some() && self.of.is_some() && of != self.of;
        let mut results = self.measured.iter().flatten();
        let has_failed = results.any(|result| matches!(result.report, Some(Err(_))));
        if is_other || (has_failed && !self.is_open) || shared.phase == Phase::Training {
            self.forget();
        }
        let is_wanted = self.is_open && self.measured.is_none();
        if let (true, Phase::Paused | Phase::Ended(_), Some((run, result))) = (is_wanted, shared.phase, standing) {
            self.of = of;
            let (problem, test) = (Arc::clone(&run.problem), Arc::clone(&run.test.set));
            self.begin(run.setup.clone(), problem, (*result.networks).clone(), test);
        }
    }

    fn forget(&mut self) {
        self.job.abandon();
        (self.of, self.measured) = (None, None);
    }

    /// Measures all decoders of `setup` with their trained `networks` on `test`, which `problem` describes.
    fn begin(&mut self, setup: Setup, problem: Arc<Problem>, networks: Networks, test: Arc<Dataset>) {
        self.measured = Some(DecoderResult::pending(&problem));
        self.job.start(
            move |report| measure_all(&setup, &problem, networks, &test, report),
            MeasuringEvent::Ended,
        );
    }

    fn take_events(&mut self) {
        while let Some(event) = self.job.next_event() {
            let mut results = self.measured.iter_mut().flatten();
            match event {
                MeasuringEvent::Measured(place, report) => {
                    if let Some(result) = results.nth(place) {
                        result.report = Some(report);
                    }
                }
                MeasuringEvent::Ended(Ok(())) => {}
                MeasuringEvent::Ended(Err(error)) => {
                    let reason = format!("{error}; close the table and open it again");
                    for result in results.filter(|result| result.report.is_none()) {
                        result.report = Some(Err(reason.clone()));
                    }
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
        let measured = set.as_ref().map_err(String::clone).and_then(measure);
        report.send(MeasuringEvent::Measured(place, measured));
    }
}

/// A column of the table: its heading and meaning, and the figure of a decoder next to the model-based errors and for the
/// displayed target.
#[derive(Clone, Copy)]
struct Figure {
    heading: &'static str,
    meaning: fn() -> &'static str,
    value: fn(&DecoderReport, Option<&Errors>, usize) -> Option<f64>,
}

const PERCENT: Figure = Figure {
    heading: "Z %",
    meaning: || glossary::Z_PERCENT.hint,
    value: |report, _, _| report.errors.percent(),
};

const TIMES: Figure = Figure {
    heading: "× model-based",
    meaning: || "Mean |error| of z divided by that of the model-based decoder in this scene.",
    value: |report, model_based, _| report.errors.nodes()?.times(model_based?),
};

const RESIDUAL: Figure = Figure {
    heading: "residual",
    meaning: || glossary::RESIDUAL.hint,
    value: |report, _, _| report.residual,
};

const RANGE_PERCENT: Figure = Figure {
    heading: "% of range",
    meaning: || "Mean absolute error in percent of the range, averaged over all targets that vary.",
    ..PERCENT
};

const RMSE: Figure = Figure {
    heading: "RMSE",
    meaning: || ErrorMeasure::Rmse.definition(),
    value: |report, _, target| Some(report.errors.targets().get(target)?.rmse),
};

const R2: Figure = Figure {
    heading: "R²",
    meaning: || ErrorMeasure::R2.definition(),
    value: |report, _, target| report.errors.targets().get(target)?.r2,
};

const FRAME_TIME: Figure = Figure {
    heading: "µs",
    meaning: || "Time to decode a frame (all rows, or one sample of a recording) on one thread, in µs: the median of many.",
    value: |report, _, _| Some(report.frame_us),
};

/// The other decoders on the same test set, folded away until the user asks for them, next to the `model_based`
/// errors. `target` is the target whose errors are shown for a recording. Each decoder can be exported with
/// `source`; returns the requested export.
pub fn decoders_ui(
    ui: &mut Ui,
    decoders: &mut Decoders,
    (problem, model_based): (&Problem, Option<&Errors>),
    target: &mut usize,
    source: Option<&NetworkSource>,
) -> Option<Exporting> {
    let mut asked = None;
    ui.add_space(space(1));
    let header = CollapsingHeader::new("More decoders")
        .open(Some(decoders.is_open))
        .show(ui, |ui| match &decoders.measured {
            Some(measured) => asked = measured_ui(ui, measured, (problem, model_based), target, source),
            None => {
                dim_ui(ui, "They are measured when the training is paused or has ended.");
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
    let figures = match (problem.has_nodes(), model_based) {
        (true, Some(_)) => vec![PERCENT, TIMES, RESIDUAL, FRAME_TIME],
        (true, None) => vec![PERCENT, RESIDUAL, FRAME_TIME],
        // In a narrow window the buttons at the end come first.
        (false, _) if ui.available_width() < space(80) => vec![RANGE_PERCENT, RMSE, FRAME_TIME],
        (false, _) => vec![RANGE_PERCENT, RMSE, R2, FRAME_TIME],
    };
    let headings = figures
        .iter()
        .map(|figure| TableColumn::figure(figure.heading).meaning((figure.meaning)()));
    let mut columns = vec![TableColumn::text("")];
    columns.extend(headings);
    columns.push(TableColumn::text("").width(ColumnWidth::Points(space(7))));
    let asked = Cell::new(None);
    let rows = measured.iter().map(|result| {
        let cells = figures.iter().map(|figure| match &result.report {
            None => "…".to_owned(),
            Some(Err(_)) => format_number(None),
            Some(Ok(report)) => match (figure.value)(report, model_based, target) {
                value if figure.heading == R2.heading => format_r2(value),
                value => format_number(value),
            },
        });
        let is_network = result.kind == DecoderKind::Network;
        let row = TableRow::figures(result.kind.name(result.precision), cells)
            .meaning(result.kind.meaning())
            .colour(if is_network { palette.accent } else { palette.text });
        // The dialog has both precisions.
        let source = source.filter(|_| result.precision == Precision::Double && matches!(result.report, Some(Ok(_))));
        let Some(source) = source else { return row };
        row.controls(|ui| {
            let button = ui.add(Button::new("…").min_size(Vec2::splat(space(5))));
            let name = format!("Export {}…", result.kind.name(Precision::Double));
            button.widget_info(|| WidgetInfo::labeled(Role::Button, true, &name));
            if button.on_hover_text(name).clicked() {
                asked.set(Some(Exporting::decoder(result.kind, source.clone())));
            }
        })
    });
    let of_model_based = model_based.map(|errors| {
        let cells = figures.iter().map(|figure| match figure.heading {
            heading if heading == PERCENT.heading => format_number(errors.z_percent),
            heading if heading == TIMES.heading => format_number(1.0),
            _ => format_number(None),
        });
        TableRow::figures("model-based", cells)
            .meaning(glossary::MODEL_BASED.hint)
            .colour(palette.dim)
    });
    let rows = rows.chain(of_model_based).collect();
    TableView::new("decoders", &columns).show_all(ui, rows);
    for result in measured {
        let name = result.kind.name(result.precision);
        match &result.report {
            None => {}
            Some(Err(reason)) => {
                note_ui(ui, &format!("{name}: {reason}"));
            }
            Some(Ok(report)) => {
                for remark in &report.remarks {
                    note_ui(ui, &format!("{name}: {remark}"));
                }
            }
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
        let mut decoders = Decoders::new(Arc::new(wake));
        let mut impossible = settings;
        impossible.simulation_mut().unwrap().samples = 0;
        decoders.begin(
            impossible.into(),
            Arc::clone(run.problem()),
            run.network(),
            Arc::clone(run.test()),
        );
        assert!(decoders.is_measuring());
        while decoders.is_measuring() {
            woken.recv().unwrap();
            decoders.take_events();
        }
        for result in decoders.measured.iter().flatten() {
            let reason = result.report.clone().unwrap().unwrap_err();
            assert!(reason.contains("training samples"), "{reason}");
        }
        decoders.forget();
        assert!(decoders.measured.is_none());
    }

    /// The unfolded table with the report of one decoder.
    fn shown(kind: DecoderKind, report: Result<DecoderReport, String>) -> Harness<'static> {
        let problem = Simulation::default().problem();
        let mut measured = DecoderResult::pending(&problem);
        let place = measured.iter().position(|result| result.kind == kind).unwrap();
        measured[place].report = Some(report);
        let mut decoders = Decoders::new(Arc::new(|| ()));
        (decoders.is_open, decoders.measured) = (true, Some(measured));
        Harness::new_ui(move |ui| {
            decoders_ui(ui, &mut decoders, (&problem, None), &mut 0, None);
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
        let harness = shown(DecoderKind::Ridge, Ok(report));
        harness.get_by_label(&format!("Ridge: {remark}"));
    }

    #[test]
    fn a_decoder_that_fails_says_why_and_the_others_are_kept() {
        let harness = shown(DecoderKind::Mean, Err("no resistance at rest".to_owned()));
        harness.get_by_label("Training mean: no resistance at rest");
        harness.get_by_label("Training mean, Z %: –");
        harness.get_by_label("Newton, Z %: …");
    }

    #[test]
    fn rows_that_were_not_solved_are_counted_below_the_table() {
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
        let harness = shown(DecoderKind::Newton, Ok(report));
        harness.get_by_label_contains("Newton: 10 of 10 rows are not determined by their readings");
    }
}
