//! The other decoders: fitted to the training set and measured in the background, on the test set while a training is paused
//! or has ended, and on each touch of the pressed surface; the newest set wins. Results are shown as they arrive.

use std::{
    cell::Cell,
    collections::HashMap,
    path::Path,
    sync::{Arc, Mutex, PoisonError},
    time::Instant,
};

use decoupler_core::{
    dataset::Dataset,
    decoupling::{Decoder, DecoderKind, Precision},
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
    job::{Background, JobError, Jobs, Report},
    shared::{Exporting, NetworkSource, Phase, Shared, target_choice_ui},
    theme::{Palette, Theme, space},
    widgets::{ColumnWidth, TableColumn, TableRow, TableView, dim_ui, focus_ring_ui, note_ui},
};

/// Message of the thread to the window.
enum MeasuringEvent {
    /// Report of the decoder at this place in the list.
    Measured(usize, Result<DecoderReport, String>),
    /// The thread has ended.
    Ended(Result<(), JobError>),
}

/// A network, and what it was trained on.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The network, or one for each row.
    pub networks: Arc<Networks>,
    /// Setup of its training.
    pub setup: Setup,
    /// Its channels.
    pub problem: Arc<Problem>,
}

/// The decoders of a network's training set, and the window's end of the thread that measures them.
pub struct Decoders {
    /// True while their table is unfolded.
    pub is_open: bool,
    /// Results of all decoders, once they are asked for; none while the network changes.
    pub measured: Option<Vec<DecoderResult>>,
    /// Those that are measured while the table is folded, too.
    always: &'static [DecoderKind],
    /// The network.
    of: Option<Arc<Networks>>,
    /// The set on which they are measured, and whether all are.
    asked: Option<(Arc<Dataset>, bool)>,
    fitted: Arc<Mutex<Fitted>>,
    job: Background<MeasuringEvent>,
}

/// The training set, and the decoders fitted to it so far.
#[derive(Default)]
struct Fitted {
    set: Option<Result<DecoderSet, String>>,
    decoders: HashMap<(DecoderKind, Precision), FittedDecoder>,
}

/// A decoder with the seconds that its fit took, or why it cannot be used.
type FittedDecoder = Result<(Box<dyn Decoder>, f64), String>;

/// Result of a decoder.
#[derive(Clone, Debug, PartialEq)]
pub struct DecoderResult {
    /// Kind of decoder.
    pub kind: DecoderKind,
    /// Precision of its network.
    pub precision: Precision,
    /// Report of the decoder, or why it cannot be used; none until it has been measured.
    pub report: Option<Result<DecoderReport, String>>,
    /// True for a report on an earlier set.
    pub is_past: bool,
}

impl DecoderResult {
    /// All decoders for this problem, none measured yet.
    pub fn pending(problem: &Problem) -> Vec<Self> {
        let pending = |(kind, precision)| Self {
            kind,
            precision,
            report: None,
            is_past: false,
        };
        DecoderSet::kinds(problem).map(pending).collect()
    }
}

impl std::fmt::Debug for Decoders {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Decoders").finish_non_exhaustive()
    }
}

impl Decoders {
    /// Nothing measured yet. Those of the kinds `always` are measured while the table is folded, too.
    pub fn new(jobs: &Jobs, always: &'static [DecoderKind]) -> Self {
        Self {
            is_open: false,
            measured: None,
            always,
            of: None,
            asked: None,
            fitted: Arc::default(),
            job: match always {
                [] => Background::new("comparison of decoders", jobs),
                _ => Background::prompt("decoders of a press", jobs),
            },
        }
    }

    /// Returns true while a result is missing.
    pub fn is_measuring(&self) -> bool {
        let mut results = self.measured.iter().flatten();
        self.is_open && results.any(|result| result.report.is_none())
    }

    /// Follows the training: its network is measured on the test set while it is paused or has ended.
    pub fn follow_training(&mut self, shared: &Shared) {
        self.take_events();
        let is_idle = matches!(shared.phase, Phase::Paused | Phase::Ended(_));
        let run = shared.run.as_ref().filter(|_| is_idle);
        let standing = run.and_then(|run| Some((run, run.result.as_ref().filter(|result| result.is_idle)?)));
        match standing {
            Some((run, result)) => self.follow(&result.networks, &run.test.set, || Subject {
                networks: Arc::clone(&result.networks),
                setup: run.setup.clone(),
                problem: Arc::clone(&run.problem),
            }),
            None if shared.phase == Phase::Training => self.forget(),
            None => {}
        }
    }

    /// Takes results, discards those of another network, and measures the decoders on `set` if they are wanted; `subject` is
    /// that of `networks`. What failed is tried again once the table is closed and opened.
    pub fn follow(&mut self, networks: &Arc<Networks>, set: &Arc<Dataset>, subject: impl FnOnce() -> Subject) {
        self.take_events();
        let is_other = self.of.as_ref().is_some_and(|of| !Arc::ptr_eq(of, networks));
        let mut results = self.measured.iter().flatten();
        let has_failed = results.any(|result| matches!(result.report, Some(Err(_))));
        if is_other || (has_failed && !self.is_open && self.always.is_empty()) {
            self.forget();
        }
        let is_wanted = self.is_open || !self.always.is_empty();
        let is_asked = |(asked, are_all): &(Arc<Dataset>, bool)| Arc::ptr_eq(asked, set) && *are_all >= self.is_open;
        if !is_wanted || self.asked.as_ref().is_some_and(is_asked) {
            return;
        }
        if self.job.is_under_way() {
            // Its decoder is fitted or measured, and then they are measured on this set.
            return self.job.cancel();
        }
        (self.of, self.asked) = (Some(Arc::clone(networks)), Some((Arc::clone(set), self.is_open)));
        let (subject, set, fitted) = (subject(), Arc::clone(set), Arc::clone(&self.fitted));
        let results = self
            .measured
            .get_or_insert_with(|| DecoderResult::pending(&subject.problem));
        results
            .iter_mut()
            .for_each(|result| result.is_past = result.report.is_some());
        let wanted = results.iter().enumerate();
        let wanted = wanted.filter(|(_, result)| self.is_open || self.always.contains(&result.kind));
        let wanted = Vec::from_iter(wanted.map(|(place, result)| (place, (result.kind, result.precision))));
        self.job.start(
            move |report| measure(&subject, &wanted, &set, &fitted, report),
            MeasuringEvent::Ended,
        );
    }

    /// Discards the results.
    pub fn forget(&mut self) {
        self.job.abandon();
        (self.of, self.asked, self.measured, self.fitted) = (None, None, None, Arc::default());
    }

    fn take_events(&mut self) {
        while let Some(event) = self.job.next_event() {
            let mut results = self.measured.iter_mut().flatten();
            match event {
                MeasuringEvent::Measured(place, report) => {
                    if let Some(result) = results.nth(place) {
                        (result.report, result.is_past) = (Some(report), false);
                    }
                }
                // The decoders of a training are measured once.
                MeasuringEvent::Ended(Ok(())) if self.always.is_empty() => self.fitted = Arc::default(),
                MeasuringEvent::Ended(Ok(())) => {}
                MeasuringEvent::Ended(Err(error)) => {
                    let again = match self.always {
                        [] => "close the table and open it again",
                        _ => "press again",
                    };
                    // An answer to an earlier press must not stay as if it were the latest.
                    for result in results.filter(|result| result.report.is_none() || result.is_past) {
                        (result.report, result.is_past) = (Some(Err(format!("{error}; {again}"))), false);
                    }
                }
            }
        }
    }
}

/// Measures one decoder after the other, each fitted when it is first asked for.
fn measure(
    subject: &Subject,
    wanted: &[(usize, (DecoderKind, Precision))],
    test: &Dataset,
    fitted: &Mutex<Fitted>,
    report: &Report<MeasuringEvent>,
) {
    let is_cancelled = || report.is_cancelled();
    // Only one job runs at a time, and a panic leaves whole decoders.
    let Fitted { set, decoders } = &mut *fitted.lock().unwrap_or_else(PoisonError::into_inner);
    if set.is_none() {
        let sets = subject.setup.sets(Path::new(""), &Job::new(&is_cancelled), &mut |_| ());
        let drawn = sets.map_err(|error| error.to_string()).map(|sets| {
            let training = sets.sets.split.training;
            DecoderSet::new(
                *subject.setup.settings(),
                training,
                Some(Networks::clone(&subject.networks)),
            )
        });
        *set = Some(drawn).filter(|_| !is_cancelled());
    }
    let Some(set) = set else { return };
    for &(place, wanted) in wanted {
        if is_cancelled() {
            return;
        }
        let measured = set.as_ref().map_err(String::clone).and_then(|set| {
            let decoder = decoders.entry(wanted).or_insert_with(|| {
                let begun = Instant::now();
                let fitted = set.decoder(wanted.0, wanted.1).map_err(|error| error.to_string())?;
                let fitted = fitted.ok_or_else(|| "it needs a trained network".to_owned())?;
                Ok((fitted, begun.elapsed().as_secs_f64()))
            });
            let (decoder, fit_seconds) = decoder.as_mut().map_err(|reason| reason.clone())?;
            let measured = set.report(wanted, &mut **decoder, *fit_seconds, test);
            measured.map_err(|error| error.to_string())
        });
        report.send(MeasuringEvent::Measured(place, measured));
    }
}

/// A column of the table: its heading and meaning, and the figure of a decoder next to the model-based errors and for the
/// displayed target.
#[derive(Clone, Copy)]
pub struct Figure {
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

const MEAN_MM: Figure = Figure {
    heading: "mean mm",
    meaning: || "Mean |error| of z over the nodes of the pressed surface, in millimetres",
    value: |report, _, _| Some(report.errors.nodes()?.z_mm),
};

const WORST_MM: Figure = Figure {
    heading: "worst mm",
    meaning: || "Largest |error| of z, in millimetres",
    value: |report, _, _| Some(report.errors.nodes()?.worst_mm),
};

const FRAME_TIME: Figure = Figure {
    heading: "µs",
    meaning: || "Time to decode a frame (all row-wires, or one sample of a recording) on one thread, in µs: the median of many.",
    value: |report, _, _| Some(report.frame_us),
};

/// Figures of a touch.
pub const OF_TOUCH: [Figure; 3] = [MEAN_MM, WORST_MM, FRAME_TIME];

/// Returns the headings of a table of decoders.
pub fn columns(figures: &[Figure]) -> Vec<TableColumn<'static>> {
    let headings = figures
        .iter()
        .map(|figure| TableColumn::figure(figure.heading).meaning((figure.meaning)()));
    [TableColumn::text("")].into_iter().chain(headings).collect()
}

/// Returns the row of a decoder; figures of an earlier set are pale.
pub fn row<'a>(
    result: &DecoderResult,
    figures: &[Figure],
    (model_based, target): (Option<&Errors>, usize),
    palette: &Palette,
) -> TableRow<'a> {
    let cells = figures.iter().map(|figure| match &result.report {
        None => "…".to_owned(),
        Some(Err(_)) => format_number(None),
        Some(Ok(report)) => match (figure.value)(report, model_based, target) {
            value if figure.heading == R2.heading => format_r2(value),
            value => format_number(value),
        },
    });
    let colour = match result.kind {
        _ if result.is_past => palette.dim,
        DecoderKind::Network => palette.accent,
        _ => palette.text,
    };
    TableRow::figures(result.kind.name(result.precision), cells)
        .meaning(result.kind.meaning())
        .colour(colour)
}

/// A table of decoders, folded away until the user asks for it; `contents_ui` shows what is measured.
pub fn decoders_fold_ui(
    ui: &mut Ui,
    (name, hint): (&str, &str),
    decoders: &mut Decoders,
    contents_ui: impl FnOnce(&mut Ui, &[DecoderResult]),
) {
    ui.add_space(space(1));
    let header = CollapsingHeader::new(name)
        .open(Some(decoders.is_open))
        .show(ui, |ui| match &decoders.measured {
            Some(measured) => contents_ui(ui, measured),
            None => {
                dim_ui(ui, "They are measured when the training is paused or has ended.");
            }
        });
    focus_ring_ui(ui, &header.header_response);
    if header.header_response.on_hover_text(hint).clicked() {
        decoders.is_open = !decoders.is_open;
    }
}

/// The other decoders on the same test set, next to the `model_based` errors. `target` is the target whose errors are shown
/// for a recording. Each decoder can be exported with `source`; returns the requested export.
pub fn decoders_ui(
    ui: &mut Ui,
    decoders: &mut Decoders,
    (problem, model_based): (&Problem, Option<&Errors>),
    target: &mut usize,
    source: Option<&NetworkSource>,
) -> Option<Exporting> {
    let mut asked = None;
    let hint = if problem.has_nodes() {
        "Ridge regression, radial-basis network, Newton on Eq. (2) and others on the same test set: errors, times, and \
         ratio to the model-based error."
    } else {
        "Ridge regression, radial-basis network and others on the same test set: errors and times."
    };
    decoders_fold_ui(ui, ("More decoders", hint), decoders, |ui, measured| {
        asked = measured_ui(ui, measured, (problem, model_based), target, source);
    });
    asked
}

fn measured_ui(
    ui: &mut Ui,
    measured: &[DecoderResult],
    (problem, model_based): (&Problem, Option<&Errors>),
    target: &mut usize,
    source: Option<&NetworkSource>,
) -> Option<Exporting> {
    let palette = &Theme::of(ui).palette;
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
    let mut columns = columns(&figures);
    columns.push(TableColumn::text("").width(ColumnWidth::Points(space(7))));
    let asked = Cell::new(None);
    let rows = measured.iter().map(|result| {
        let row = row(result, &figures, (model_based, target), palette);
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
    notes_ui(ui, measured, true);
    asked.into_inner()
}

/// Shows why decoders cannot be used and, if wanted, the remarks on their errors.
pub fn notes_ui(ui: &mut Ui, measured: &[DecoderResult], has_remarks: bool) {
    for result in measured {
        let (reason, remarks) = match &result.report {
            Some(Err(reason)) => (Some(reason), &[][..]),
            Some(Ok(report)) if has_remarks => (None, &report.remarks[..]),
            _ => (None, &[][..]),
        };
        for remark in reason.into_iter().chain(remarks) {
            note_ui(ui, &format!("{}: {remark}", result.kind.name(result.precision)));
        }
    }
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
        let mut decoders = Decoders::new(&Jobs::new(Arc::new(wake)), &[]);
        let mut impossible = settings;
        impossible.simulation_mut().unwrap().samples = 0;
        decoders.is_open = true;
        let networks = Arc::new(run.network());
        decoders.follow(&networks, run.test(), || Subject {
            networks: Arc::clone(&networks),
            setup: impossible.into(),
            problem: Arc::clone(run.problem()),
        });
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
        let mut decoders = Decoders::new(&Jobs::new(Arc::new(|| ())), &[]);
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
