//! Speed against accuracy of every decoder, measured on this machine. While another job computes, the measurement waits,
//! because the times would be distorted.

use std::{path::Path, sync::Arc, thread, time::Duration};

use decoupler_core::{
    dataset::{LARGEST_SAMPLES, Seed, Simulation},
    decoupling::{DecoderKind, Precision},
    evaluation::{
        Preset, Run, RunSettings, TradeOffPoint, Workload, decoded_unit,
        experiments::{AxisKind, Experiment},
        measure_trade_off,
    },
    job::Job,
    scene::Scene,
    text::counted,
    training::StoppingRules,
};
use decoupler_files::{
    export::{NetworkFile, format_percent, trade_off_points, trade_off_summary},
    figure::{Ink, TradeOffCost, TradeOffLevel, TradeOffLimits, frame_time, point_name, trade_off_figure},
    import::{Recorded, Setup},
    machine::memory_budget,
};
use eframe::egui::Ui;

use super::{
    NamedTable, Note, Outcome, Page, Report, Reporter, Row, StudyEvent, Task, Tone, ValueList, experiment::setup_of,
    value_list::noise_text,
};
use crate::window::{
    shared::{Effect, Exporting, NetworkSource, sentence},
    widgets::{
        fields::{count_ui, quantity_ui},
        section_heading_ui,
    },
};

/// Maximum number of points of a measurement.
const MAX_POINTS: usize = 1000;

/// Form of a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedForm {
    noises: ValueList,
    hidden: ValueList,
    /// Training methods of the networks of a recording.
    methods: ValueList,
    /// Decoders, in the order of [`DecoderKind::ALL`].
    decoders: [bool; DecoderKind::ALL.len()],
    /// Maximum number of training samples of an array.
    samples: usize,
    /// Maximum number of epochs.
    epochs: usize,
}

impl Default for SpeedForm {
    fn default() -> Self {
        let list = |kind, values: &str| ValueList {
            kind,
            values: values.to_owned(),
        };
        Self {
            noises: list(AxisKind::Noise, "0.1"),
            hidden: list(AxisKind::Hidden, "6, 12"),
            methods: list(AxisKind::Method, "lm, br"),
            decoders: [true; DecoderKind::ALL.len()],
            samples: 2000,
            epochs: 60,
        }
    }
}

impl SpeedForm {
    /// Returns the task on the source of `base`.
    ///
    /// # Errors
    /// If the form is not a valid measurement.
    pub fn task(&self, base: &Setup) -> Result<Task, String> {
        let plan = self.plan(base)?;
        let (points, source) = (plan.points(), base.source_name());
        let outcome = SpeedOutcome {
            points,
            source,
            ..SpeedOutcome::default()
        };
        let size = counted(points, "point");
        Ok(Task::new(size, outcome, move |reporter| measure(&plan, reporter)))
    }

    /// Returns the runs on the source of `base`: one for each noise and preset, or for each method. Decoders of a recording
    /// that have no network do not depend on the method, so the first run measures them.
    fn plan(&self, base: &Setup) -> Result<SpeedPlan, String> {
        let is_array = base.plan().is_none();
        let chosen = DecoderKind::ALL.into_iter().zip(self.decoders);
        let chosen = chosen.filter(|(kind, is_chosen)| *is_chosen && (is_array || !kind.needs_sensor()));
        let decoders = Vec::from_iter(chosen.map(|(kind, _)| kind));
        if decoders.is_empty() {
            return Err("no decoder is chosen: choose at least one".to_owned());
        }
        let rows = if is_array { &self.noises } else { &self.methods };
        let grid = Experiment {
            base: *base.settings(),
            recording: base.experiment_recording(),
            axis: self.hidden.parse()?,
            second_axis: Some(rows.parse()?),
            seeds: 1,
            cross_validation: None,
        };
        grid.check().map_err(|error| error.to_string())?;
        let cells = grid.cells();
        let sizes = cells.iter().filter(|cell| cell.row == 0);
        let mut plan = SpeedPlan {
            runs: Vec::new(),
            hidden: sizes.map(|cell| cell.settings.hidden).collect(),
        };
        for cell in cells.iter().filter(|cell| cell.column == 0) {
            if let Some(array) = cell.settings.simulation() {
                plan.runs.extend(Preset::ALL.map(|preset| PlannedRun {
                    preset: Some(preset),
                    setup: self.of_preset(preset, array, cell.settings.seed).into(),
                    decoders: decoders.clone(),
                }));
            } else {
                let settings = self.shortened(cell.settings);
                let of_run = decoders.iter().copied();
                let of_run = of_run.filter(|kind| cell.row == 0 || kind.needs_network());
                plan.runs.push(PlannedRun {
                    preset: None,
                    setup: setup_of(settings, cell.division, base.plan()),
                    decoders: of_run.collect(),
                });
            }
        }
        match plan.points() {
            points if points > MAX_POINTS => Err(format!(
                "{points} points are too many to display: give fewer values, at most {MAX_POINTS} points"
            )),
            _ => Ok(plan),
        }
    }

    /// Returns the settings of a preset with the sensor and the scene of `array`. The preset determines the rows that are
    /// read and the inputs of the networks.
    fn of_preset(&self, preset: Preset, array: &Simulation, seed: Seed) -> RunSettings {
        let of_preset = preset.simulation_in(array.scene.noise);
        let rows = of_preset.scene.rows;
        let source = Simulation {
            sensor: array.sensor,
            scene: Scene { rows, ..array.scene },
            test_samples: array.test_samples,
            ..of_preset
        };
        self.shortened(RunSettings {
            source: source.into(),
            seed,
            ..preset.settings_in(array.scene.noise)
        })
    }

    /// Limits the training.
    fn shortened(&self, mut settings: RunSettings) -> RunSettings {
        let epochs = &mut settings.training.stopping.epochs;
        *epochs = (*epochs).min(self.epochs);
        if let Some(array) = settings.simulation_mut() {
            array.samples = array.samples.min(self.samples);
            array.validation_samples = array.validation_samples.min(array.samples.div_ceil(5));
        }
        settings
    }

    /// Shows the fields; `is_array` for a simulated array.
    pub fn fields_ui(&mut self, ui: &mut Ui, is_array: bool) {
        if is_array {
            let hint = "Noise of each reading (standard deviation), in percent of the reading, separated by commas.";
            self.noises.ui(ui, None, hint);
        }
        let hint = "Numbers of hidden nodes of the networks, separated by commas.";
        self.hidden.ui(ui, None, hint);
        if !is_array {
            let hint = "Training methods of the networks.";
            self.methods.ui(ui, None, hint);
        }
        section_heading_ui(ui, "Decoders");
        for (kind, is_chosen) in DecoderKind::ALL.into_iter().zip(&mut self.decoders) {
            if is_array || !kind.needs_sensor() {
                ui.checkbox(is_chosen, kind.name(Precision::Double))
                    .on_hover_text(kind.meaning());
            }
        }
        section_heading_ui(ui, "Training");
        let hint =
            "Largest number of epochs per training; a preset, or the Train view, with fewer keeps its own number.";
        count_ui(
            ui,
            "Maximum epochs",
            hint,
            &mut self.epochs,
            1..=StoppingRules::MAX_EPOCHS,
        );
        if is_array {
            let hint = "Largest number of training samples per network; a preset with fewer keeps its own number.";
            count_ui(ui, "Maximum samples", hint, &mut self.samples, 1..=LARGEST_SAMPLES);
        }
    }
}

/// Shows the limits for the recommended decoders, which apply to the results that are shown.
pub fn limits_ui(ui: &mut Ui, limits: &mut TradeOffLimits) {
    section_heading_ui(ui, "Recommended decoders");
    let hint = "Finds the fastest decoder whose error (of Z, or in percent of the range of a target) is at most this.";
    quantity_ui(ui, "Fastest under", hint, &mut limits.percent, 1e-15..=1e6, "%");
    let hint = "Finds the most accurate decoder of a frame, or of a sample of a recording, within this time.";
    let time = &mut limits.microseconds;
    quantity_ui(ui, "Most accurate under", hint, time, 1e-6..=1e12, "µs");
}

/// Plan of a measurement.
#[derive(Debug)]
struct SpeedPlan {
    /// Runs that fit the decoders, level by level.
    runs: Vec<PlannedRun>,
    /// Numbers of hidden nodes of the networks.
    hidden: Vec<usize>,
}

/// A run that fits decoders.
#[derive(Debug)]
struct PlannedRun {
    /// Preset from which its settings were derived, if any.
    preset: Option<Preset>,
    /// Setup, except for the hidden nodes.
    setup: Setup,
    /// Decoders to be measured.
    decoders: Vec<DecoderKind>,
}

impl PlannedRun {
    /// Returns the relative noise of a reading, if it is simulated.
    fn noise(&self) -> Option<f64> {
        let simulation = self.setup.settings().simulation()?;
        Some(simulation.scene.noise.relative)
    }
}

impl SpeedPlan {
    /// Returns the number of points.
    fn points(&self) -> usize {
        let of_decoder = |kind: &DecoderKind| {
            let networks = if kind.needs_network() { self.hidden.len() } else { 1 };
            networks * kind.precisions().len()
        };
        self.runs.iter().flat_map(|run| &run.decoders).map(of_decoder).sum()
    }
}

/// Interval at which a waiting measurement looks whether it can go on.
const WAIT: Duration = Duration::from_millis(50);

/// Measures run by run, and reports each point as it is measured; waits while another job computes.
fn measure(plan: &SpeedPlan, reporter: &Reporter) -> Result<(), String> {
    // Asked before every epoch and every decoder, outside the times that are measured.
    let is_cancelled = || {
        while reporter.is_distorted() && !reporter.is_cancelled() {
            thread::sleep(WAIT);
        }
        reporter.is_cancelled()
    };
    let job = Job::new(&is_cancelled);
    for run in &plan.runs {
        if run.setup.plan().is_none() {
            let workload = Workload::of_trade_off(run.setup.settings(), &plan.hidden, &run.decoders);
            let checked = workload.and_then(|workload| workload.check_memory(memory_budget()));
            checked.map_err(|error| error.to_string())?;
        }
        let on_progress = &mut |progress| reporter.progress(StudyEvent::Reading(progress), |_, _| ());
        let sets = run.setup.sets(Path::new(""), &job, on_progress);
        let sets = sets.map_err(|error| error.to_string())?;
        let recorded = sets.recorded();
        let unit = decoded_unit(&sets.sets.test);
        reporter.send(StudyEvent::Samples(run.noise(), unit, recorded.cloned().map(Box::new)));
        let on_point = |kind, point: Result<TradeOffPoint, _>, trained: Option<&Run>| {
            let file = trained.and_then(|trained| NetworkFile::from_run(trained, recorded).ok());
            reporter.send(match point {
                Ok(mut point) => {
                    point.preset = run.preset;
                    let setup = run.setup.with_settings(point.settings);
                    StudyEvent::Point(Box::new(point), Box::new(setup), file.map(Arc::new))
                }
                Err(error) => StudyEvent::Refused(format!("{kind}: {error}")),
            });
        };
        let settings = run.setup.settings();
        let measured = measure_trade_off(settings, &sets.sets, &plan.hidden, &run.decoders, &job, on_point);
        measured.map_err(|error| error.to_string())?;
    }
    Ok(())
}

/// Points measured so far.
#[derive(Debug, Default)]
struct SpeedOutcome {
    /// Name of the source.
    source: String,
    /// Number of planned points.
    points: usize,
    /// One for each noise level, or a single one for a recording.
    levels: Vec<Level>,
    /// Unit that is decoded at a time, such as "a sample", once it is known.
    unit: String,
    /// Origin of the samples of a recording.
    recorded: Option<Box<Recorded>>,
}

/// Points of a level of noise.
#[derive(Debug)]
struct Level {
    measured: TradeOffLevel,
    /// Setup of each point, and the file of its network if it has one.
    origins: Vec<(Box<Setup>, Option<Arc<NetworkFile>>)>,
    /// Reasons why decoders cannot be used.
    refused: Vec<String>,
}

impl Level {
    fn page(&self, limits: &TradeOffLimits) -> Page {
        let table = trade_off_summary(&self.measured);
        Page {
            name: self.measured.noise.map_or_else(String::new, noise_text),
            what: "Point",
            rows: rows(&self.measured, table.columns.len()),
            table,
            figure: Some(trade_off_figure(&self.measured, limits).into()),
            notes: self.notes(limits),
        }
    }

    fn notes(&self, limits: &TradeOffLimits) -> Vec<Note> {
        let mut notes = vec![Note::Heading("Recommended decoders")];
        let questions = [
            ("Fastest", "No measured decoder is this accurate."),
            ("Most accurate", "No measured decoder is this fast."),
        ];
        for ((question, none), answer) in questions.into_iter().zip(self.measured.answers(limits)) {
            let Some(answer) = answer else {
                notes.push(Note::Line(Tone::Dim, none.to_owned()));
                continue;
            };
            let point = &self.measured.points[answer];
            let (percent, time) = (point.report.errors.percent(), frame_time(point.report.frame_us));
            let (name, percent) = (point_name(point), format_percent(percent));
            notes.push(Note::Line(Tone::Own, format!("{question}: {name}, {percent}, {time}")));
        }
        // A remark is the same in both precisions.
        let double = self
            .measured
            .points
            .iter()
            .filter(|point| point.report.precision == Precision::Double);
        let remarks = double.flat_map(|point| {
            let remarks = point.report.remarks.iter();
            remarks.map(move |remark| format!("{}: {remark}", point_name(point)))
        });
        let remarks = remarks.chain(self.refused.iter().cloned());
        notes.extend(remarks.map(|remark| Note::Line(Tone::Warning, sentence(&remark))));
        notes
    }
}

impl Outcome for SpeedOutcome {
    fn take(&mut self, event: StudyEvent) {
        if let StudyEvent::Samples(noise, unit, recorded) = event {
            if self.levels.last().is_none_or(|level| level.measured.noise != noise) {
                let points = Vec::new();
                self.levels.push(Level {
                    measured: TradeOffLevel { noise, points },
                    origins: Vec::new(),
                    refused: Vec::new(),
                });
            }
            (self.unit, self.recorded) = (unit, recorded);
            return;
        }
        let Some(level) = self.levels.last_mut() else { return };
        match event {
            StudyEvent::Point(point, setup, file) => {
                level.measured.points.push(*point);
                level.origins.push((setup, file));
            }
            StudyEvent::Refused(reason) => level.refused.push(reason),
            _ => {}
        }
    }

    fn parts(&self) -> (usize, usize, &'static str) {
        let levels = self.levels.iter();
        let done = levels.map(|level| level.origins.len() + level.refused.len()).sum();
        (done, self.points, "point")
    }

    fn report(&self, limits: &TradeOffLimits) -> Report {
        let (source, unit) = (&self.source, &self.unit);
        Report {
            headline: "Speed against accuracy".to_owned(),
            conditions: format!("{source}, one thread, median of many times of {unit}"),
            pages: self.levels.iter().map(|level| level.page(limits)).collect(),
        }
    }

    fn open(&self, level: usize, point: usize) -> Vec<Effect> {
        vec![Effect::TakeSetup(self.levels[level].origins[point].0.clone())]
    }

    fn decoder(&self, level: usize, point: usize) -> Option<Exporting> {
        let Level { measured, origins, .. } = self.levels.get(level)?;
        let (point, (setup, file)) = (measured.points.get(point)?, &origins[point]);
        let source = match file {
            Some(file) => NetworkSource::Kept(point_name(point), Arc::clone(file)),
            None => NetworkSource::Samples(setup.clone(), self.recorded.clone()),
        };
        Some(Exporting::decoder(point.report.kind, source))
    }

    fn tables(&self) -> Vec<NamedTable<'_>> {
        let points = || {
            let levels = self.levels.iter().map(|level| level.measured.clone());
            trade_off_points(&Vec::from_iter(levels))
        };
        vec![("All points", Box::new(points))]
    }
}

/// Returns the rows of the table of a level, fastest first.
fn rows(level: &TradeOffLevel, columns: usize) -> Vec<Row> {
    let [decoding, training] = TradeOffCost::ALL.map(|cost| level.front(cost));
    let time = |item: usize| level.points[item].report.frame_us;
    let mut order = Vec::from_iter(0..level.points.len());
    order.sort_by(|&a, &b| time(a).total_cmp(&time(b)));
    let row = |item: usize| {
        let point = &level.points[item];
        let of_cost = |is_on_front| if is_on_front { Tone::Own } else { Tone::Usual };
        let mut tones = vec![Tone::Usual; columns];
        // The last columns are the costs.
        tones[columns - 2..].copy_from_slice(&[decoding[item], training[item]].map(of_cost));
        Row {
            item,
            name: point_name(point),
            meaning: "A blue time is on the Pareto front: no other point has as small an error in as little time.",
            dot: Some(Ink::of_decoder(point.report.kind)),
            tones,
        }
    };
    order.into_iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use decoupler_core::scene::{RowModel, Rows};
    use decoupler_files::import::Plan;

    use super::*;

    fn plan(form: &SpeedForm, base: impl Into<Setup>) -> SpeedPlan {
        form.plan(&base.into()).unwrap()
    }

    /// The settings of the run of a preset at a noise.
    fn settings(plan: &SpeedPlan, noise: f64, preset: Preset) -> RunSettings {
        let mut runs = plan.runs.iter();
        let run = runs.find(|run| (run.noise(), run.preset) == (Some(noise), Some(preset)));
        *run.unwrap().setup.settings()
    }

    #[test]
    fn the_default_form_is_a_quick_look_at_all_decoders() {
        let plan = plan(&SpeedForm::default(), RunSettings::default());
        let alone = DecoderKind::ALL.iter().filter(|kind| !kind.needs_network()).count();
        // All without a network, then two sizes with two precisions and polish.
        assert_eq!(plan.points(), 2 * (alone + 2 * 3));
        let best = settings(&plan, 1e-3, Preset::Best);
        let simulation = best.simulation().unwrap();
        assert_eq!((simulation.samples, best.training.stopping.epochs), (2000, 60));
        let scene = simulation.scene;
        assert_eq!((scene.rows, scene.noise.relative), (Rows::Known, 1e-3));
    }

    #[test]
    fn a_full_measurement_uses_the_presets_in_the_current_scene() {
        let mut base = RunSettings::default();
        base.simulation_mut().unwrap().scene.largest_compression = 0.1;
        base.simulation_mut().unwrap().sensor.geometry.height_mm = 4.0;
        let form = SpeedForm {
            samples: usize::MAX,
            epochs: usize::MAX,
            ..SpeedForm::default()
        };
        let settings = settings(&plan(&form, base), 1e-3, Preset::Best);
        let preset = Preset::Best.settings_in(settings.simulation().unwrap().scene.noise);
        let (simulation, of_preset) = (settings.simulation().unwrap(), preset.simulation().unwrap());
        assert_eq!(
            (simulation.samples, settings.training),
            (of_preset.samples, preset.training)
        );
        assert_eq!(simulation.sensor, base.simulation().unwrap().sensor);
        assert_eq!(simulation.scene.largest_compression, 0.1);
    }

    #[test]
    fn each_method_trains_its_networks_and_other_decoders_are_measured_once() {
        let base = RunSettings::measured(RowModel::Shared);
        let recording = |plan: &Plan| Setup::recording(base, plan.clone());
        let of = plan(&SpeedForm::default(), recording(&Plan::default()));
        let is_alone = |kind: &&DecoderKind| !kind.needs_network() && !kind.needs_sensor();
        let alone = DecoderKind::ALL.iter().filter(is_alone).count();
        // All with neither network nor sensor once; two methods with two sizes in two precisions.
        assert_eq!(of.points(), alone + 2 * 2 * 2);
        assert!(of.runs.iter().all(|run| run.noise().is_none()), "no noise is simulated");
        let mut all = of.runs.iter().flat_map(|run| &run.decoders);
        assert!(all.all(|kind| !kind.needs_sensor()));
        let held_out = |plan: &SpeedPlan| {
            let held_out = plan.runs.iter().map(|run| {
                let settings = run.setup.settings();
                assert_eq!(settings.training.stopping.epochs, 60);
                let held_out = run.setup.plan().unwrap().division.validation_fraction;
                (settings.training.method.short_name(), held_out.unwrap())
            });
            Vec::from_iter(held_out)
        };
        assert_eq!(held_out(&of), [("lm", 0.2), ("br", 0.0)]);
        // A share set by the user applies to every method.
        let mut chosen = Plan::default();
        chosen.division.validation_fraction = Some(0.3);
        let of = plan(&SpeedForm::default(), recording(&chosen));
        assert_eq!(held_out(&of), [("lm", 0.3), ("br", 0.3)]);
    }

    #[test]
    fn invalid_forms_give_a_reason() {
        let error = |change: fn(&mut SpeedForm)| {
            let mut form = SpeedForm::default();
            change(&mut form);
            form.plan(&RunSettings::default().into()).unwrap_err()
        };
        assert!(error(|form| form.noises.values = "0, much".to_owned()).contains("'much' is not a number"));
        assert!(error(|form| form.noises.values = "200".to_owned()).contains("relative noise"));
        assert!(error(|form| form.noises.values = " , ".to_owned()).contains("there are no values"));
        assert!(error(|form| form.decoders.fill(false)).contains("choose at least one"));
        let many = error(|form| {
            let many = (1..=200).map(|hidden| hidden.to_string());
            form.hidden.values = Vec::from_iter(many).join(" ");
        });
        assert!(many.contains("give fewer values"));
    }
}
