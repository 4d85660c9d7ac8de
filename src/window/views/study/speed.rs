//! Speed against accuracy of every decoder, measured on this machine. While another view computes, the measurement waits,
//! because the times would be distorted.

use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use decoupler_core::{
    dataset::{LARGEST_SAMPLES, Seed, Simulation},
    decoupling::{DecoderKind, Precision},
    evaluation::{
        Preset, Run, RunSettings, TradeOffPoint, Workload, decoded_unit, experiments::AxisKind, measure_trade_off,
    },
    job::Job,
    scene::{Noise, Scene},
    sensor::SensorModel,
    text::counted,
    training::{Method, StoppingRules},
};
use decoupler_files::{
    export::{NetworkFile, format_percent, trade_off_points, trade_off_summary},
    figure::{Ink, TradeOffCost, TradeOffLevel, TradeOffLimits, frame_time, point_facts, point_name, trade_off_figure},
    import::{Recorded, Setup},
    machine::memory_budget,
};
use eframe::egui::Ui;

use super::{NamedTable, Note, Outcome, Page, Report, Reporter, Row, StudyEvent, Task, Tone, ValueList};
use crate::window::{
    shared::{Effect, Exporting, NetworkSource, sentence},
    widgets::{
        fields::{count_ui, quantity_ui},
        section_heading_ui, segmented_ui,
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
    /// Preset on which the settings of the networks of an array are based; `None` for both.
    preset: Option<Preset>,
    /// Decoders, in the order of [`DecoderKind::ALL`].
    decoders: [bool; DecoderKind::ALL.len()],
    /// True for trainings as in the presets or, for a recording, as in the Train view.
    is_full: bool,
    /// Maximum number of training samples of a quick look.
    samples: usize,
    /// Maximum number of epochs of a quick look.
    epochs: usize,
    /// Number of samples on which the errors are measured.
    test_samples: usize,
}

impl Default for SpeedForm {
    fn default() -> Self {
        let list = |kind, values: &str| ValueList {
            kind,
            values: values.to_owned(),
        };
        Self {
            noises: list(AxisKind::Noise, "0, 1e-4, 1e-3, 1e-2"),
            hidden: list(AxisKind::Hidden, "6, 12"),
            methods: list(AxisKind::Method, "lm, br"),
            preset: None,
            decoders: [true; DecoderKind::ALL.len()],
            is_full: false,
            samples: 2000,
            epochs: 60,
            test_samples: 100,
        }
    }
}

impl SpeedForm {
    /// Returns the task on the source of `base`, which measures only while it `is_quiet`.
    ///
    /// # Errors
    /// If the form is not a valid measurement.
    pub fn task(&self, base: &Setup, is_quiet: &Arc<AtomicBool>) -> Result<Task, String> {
        let plan = self.plan(base)?;
        let outcome = SpeedOutcome {
            plan: plan.clone(),
            ..SpeedOutcome::default()
        };
        let is_quiet = Arc::clone(is_quiet);
        let size = counted(plan.points(), "point");
        Ok(Task::new(size, outcome, move |reporter| {
            measure(&plan, &is_quiet, reporter)
        }))
    }

    fn plan(&self, base: &Setup) -> Result<SpeedPlan, String> {
        let has_sensor = base.settings().simulation().is_some();
        let chosen = DecoderKind::ALL.into_iter().zip(self.decoders);
        let chosen = chosen.filter(|(kind, is_chosen)| *is_chosen && (has_sensor || !kind.needs_sensor()));
        let decoders = Vec::from_iter(chosen.map(|(kind, _)| kind));
        if decoders.is_empty() {
            return Err("no decoder is chosen: choose at least one".to_owned());
        }
        let hidden = self.hidden.numbers()?.into_iter();
        let plan = SpeedPlan {
            runs: match base.settings().simulation() {
                Some(array) => self.runs_of_array(array, base.settings().seed, &decoders)?,
                None => self.runs_of_recording(base, &decoders)?,
            },
            hidden: hidden.map(|hidden| hidden as usize).collect(),
        };
        match plan.points() {
            points if points > MAX_POINTS => Err(format!(
                "{points} points are too many to display: give fewer values, at most {MAX_POINTS} points"
            )),
            _ => Ok(plan),
        }
    }

    /// Returns a run for each noise and preset, with the sensor and the scene of `base`.
    fn runs_of_array(
        &self,
        base: &Simulation,
        seed: Seed,
        decoders: &[DecoderKind],
    ) -> Result<Vec<PlannedRun>, String> {
        let mut runs = Vec::new();
        for noise in self.noises.numbers()? {
            let presets = Preset::ALL.into_iter();
            let presets = presets.filter(|preset| self.preset.is_none_or(|only| only == *preset));
            let scene = Scene {
                noise: Noise {
                    relative: noise,
                    ..base.scene.noise
                },
                ..base.scene
            };
            scene.check().map_err(|error| error.to_string())?;
            runs.extend(presets.map(|preset| PlannedRun {
                noise: Some(noise),
                preset: Some(preset),
                setup: self.settings(base.sensor, scene, seed, preset).into(),
                decoders: decoders.to_vec(),
            }));
        }
        Ok(runs)
    }

    /// Returns the settings of a preset with this sensor and scene. The preset determines the rows that are read and the
    /// inputs of the networks.
    fn settings(&self, sensor: SensorModel, scene: Scene, seed: Seed, preset: Preset) -> RunSettings {
        let of_preset = preset.simulation_in(scene.noise);
        let rows = of_preset.scene.rows;
        let source = Simulation {
            sensor,
            scene: Scene { rows, ..scene },
            test_samples: self.test_samples,
            ..of_preset
        };
        self.shortened(RunSettings {
            source: source.into(),
            seed,
            ..preset.settings_in(scene.noise)
        })
    }

    /// Returns the settings of a quick look, unless the form asks for full trainings.
    fn shortened(&self, mut settings: RunSettings) -> RunSettings {
        if self.is_full {
            return settings;
        }
        let epochs = &mut settings.training.stopping.epochs;
        *epochs = (*epochs).min(self.epochs);
        if let Some(array) = settings.simulation_mut() {
            array.samples = array.samples.min(self.samples);
            array.validation_samples = array.validation_samples.min(array.samples.div_ceil(5));
        }
        settings
    }

    /// Returns a run for each method, on the recording of `base`. Decoders without a network do not depend on the method, so
    /// the first run measures them.
    fn runs_of_recording(&self, base: &Setup, decoders: &[DecoderKind]) -> Result<Vec<PlannedRun>, String> {
        let present = base.settings().training.method;
        let mut methods = vec![present];
        if decoders.iter().any(|kind| kind.needs_network()) {
            let named = self.methods.parse()?.values.into_iter();
            methods = named.flat_map(|name| Method::named(&name.to_string())).collect();
        }
        if methods.is_empty() {
            return Err("no training method is given: give at least one, or leave out the networks".to_owned());
        }
        let mut runs: Vec<PlannedRun> = Vec::new();
        for method in methods {
            let mut settings = *base.settings();
            // The method of the Train view keeps its settings.
            if method.short_name() != present.short_name() {
                settings.choose_method(method);
            }
            let settings = self.shortened(settings);
            let mut plan = base.plan().cloned().ok_or("This is not a recording.")?;
            // A share set by the user is kept.
            if plan.division.validation_fraction == Some(base.settings().validation_fraction()) {
                plan.division.validation_fraction = Some(settings.validation_fraction());
            }
            let of_run = decoders.iter().filter(|kind| runs.is_empty() || kind.needs_network());
            let of_run = of_run.copied().collect();
            runs.push(PlannedRun {
                noise: None,
                preset: None,
                setup: Setup::recording(settings, plan),
                decoders: of_run,
            });
        }
        Ok(runs)
    }

    /// Shows the fields; `is_array` for a simulated array.
    pub fn fields_ui(&mut self, ui: &mut Ui, is_array: bool) {
        if is_array {
            let hint = "Noise of each reading (standard deviation), relative to the reading, separated by commas.";
            self.noises.ui(ui, None, hint);
        }
        let hint = "Numbers of hidden nodes of the networks, separated by commas.";
        self.hidden.ui(ui, None, hint);
        if is_array {
            section_heading_ui(ui, "Presets");
            let presets = [
                (None, "Both"),
                (Some(Preset::Paper), "Paper"),
                (Some(Preset::Best), "Best"),
            ];
            self.preset = segmented_ui(ui, "Presets", &presets, self.preset, true).unwrap_or(self.preset);
        } else {
            let hint = "Training methods of the networks, separated by commas.";
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
        self.training_ui(ui, is_array);
    }

    fn training_ui(&mut self, ui: &mut Ui, is_array: bool) {
        let full = if is_array { "Full presets" } else { "As in Train view" };
        let lengths = [(false, "Quick look"), (true, full)];
        self.is_full = segmented_ui(ui, "Training length", &lengths, self.is_full, true).unwrap_or(self.is_full);
        if !self.is_full {
            if is_array {
                let hint = "Largest number of training samples per network; a preset with fewer keeps its own number.";
                count_ui(ui, "Maximum samples", hint, &mut self.samples, 1..=LARGEST_SAMPLES);
            }
            let epochs = 1..=StoppingRules::MAX_EPOCHS;
            let hint = "Largest number of epochs per training.";
            count_ui(ui, "Maximum epochs", hint, &mut self.epochs, epochs);
        }
        if is_array {
            let hint = "Number of samples on which the errors are measured.";
            count_ui(ui, "Test samples", hint, &mut self.test_samples, 1..=LARGEST_SAMPLES);
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
#[derive(Clone, Debug, Default)]
struct SpeedPlan {
    /// Runs that fit the decoders, level by level.
    runs: Vec<PlannedRun>,
    /// Numbers of hidden nodes of the networks.
    hidden: Vec<usize>,
}

/// A run that fits decoders.
#[derive(Clone, Debug)]
struct PlannedRun {
    /// Relative noise of a reading, if it is simulated.
    noise: Option<f64>,
    /// Preset from which its settings were derived, if any.
    preset: Option<Preset>,
    /// Setup, except for the hidden nodes.
    setup: Setup,
    /// Decoders to be measured.
    decoders: Vec<DecoderKind>,
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

/// Measures run by run, and reports each point as it is measured; waits unless it `is_quiet`.
fn measure(plan: &SpeedPlan, is_quiet: &AtomicBool, reporter: &Reporter) -> Result<(), String> {
    // Asked before every epoch and every decoder, outside the times that are measured.
    let is_cancelled = || {
        while !is_quiet.load(Ordering::Relaxed) && !reporter.is_cancelled() {
            thread::sleep(WAIT);
        }
        reporter.is_cancelled()
    };
    let job = Job::new(&is_cancelled);
    for (number, run) in plan.runs.iter().enumerate() {
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
        reporter.send(StudyEvent::Samples(number, unit, recorded.cloned().map(Box::new)));
        let on_point = |kind, point: Result<TradeOffPoint, _>, trained: Option<&Run>| {
            let file = trained.and_then(|trained| NetworkFile::from_run(trained, recorded).ok());
            reporter.send(match point {
                Ok(point) => StudyEvent::Point(number, Box::new(point), file.map(Arc::new)),
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
    plan: SpeedPlan,
    /// One for each noise level, or a single one for a recording.
    levels: Vec<TradeOffLevel>,
    /// The number of the run of each point of each level, and the file of its network if it has one.
    origins: Vec<Vec<(usize, Option<Arc<NetworkFile>>)>>,
    /// Decoders that cannot be used, each with its level and the reason.
    refused: Vec<(usize, String)>,
    /// Unit that is decoded at a time, such as "a sample", once it is known.
    unit: String,
    /// Origin of the samples of a recording.
    recorded: Option<Box<Recorded>>,
}

impl SpeedOutcome {
    /// Returns the setup with which a point was measured.
    fn setup_of(&self, level: usize, point: usize) -> Box<Setup> {
        let (run, _) = &self.origins[level][point];
        let settings = self.levels[level].points[point].settings;
        Box::new(self.plan.runs[*run].setup.with_settings(settings))
    }

    fn page(&self, number: usize, limits: &TradeOffLimits) -> Page {
        let level = &self.levels[number];
        let table = trade_off_summary(level);
        Page {
            name: level.noise.map_or_else(String::new, |noise| noise.to_string()),
            what: "Point",
            rows: rows(level, table.columns.len()),
            table,
            figure: Some(trade_off_figure(level, limits).into()),
            notes: self.notes(number, limits),
        }
    }

    fn notes(&self, number: usize, limits: &TradeOffLimits) -> Vec<Note> {
        let level = &self.levels[number];
        let refused = self.refused.iter().filter(|(of, _)| *of == number);
        let mut notes = Vec::from_iter(refused.map(|(_, reason)| Note::Line(Tone::Warning, sentence(reason))));
        notes.push(Note::Heading("Recommended decoders"));
        let questions = [
            ("Fastest", "No measured decoder is this accurate."),
            ("Most accurate", "No measured decoder is this fast."),
        ];
        for ((question, none), answer) in questions.into_iter().zip(level.answers(limits)) {
            let Some(answer) = answer else {
                notes.push(Note::Line(Tone::Dim, none.to_owned()));
                continue;
            };
            let point = &level.points[answer];
            let (percent, time) = (point.report.errors.percent(), frame_time(point.report.frame_us));
            let (name, percent) = (point_name(point), format_percent(percent));
            notes.push(Note::Pick(answer, format!("{question}: {name}, {percent}, {time}")));
        }
        let hint = "Click a row of the table to mark its point, or a point of a chart to open it in the Train view.";
        notes.push(Note::Line(Tone::Dim, hint.to_owned()));
        notes
    }
}

impl Outcome for SpeedOutcome {
    fn take(&mut self, event: StudyEvent) {
        match event {
            StudyEvent::Samples(run, unit, recorded) => {
                let noise = self.plan.runs[run].noise;
                if self.levels.last().is_none_or(|level| level.noise != noise) {
                    let points = Vec::new();
                    self.levels.push(TradeOffLevel { noise, points });
                    self.origins.push(Vec::new());
                }
                (self.unit, self.recorded) = (unit, recorded);
            }
            StudyEvent::Point(run, point, file) => {
                if let (Some(level), Some(origins)) = (self.levels.last_mut(), self.origins.last_mut()) {
                    let preset = self.plan.runs[run].preset;
                    level.points.push(TradeOffPoint { preset, ..*point });
                    origins.push((run, file));
                }
            }
            StudyEvent::Refused(reason) => self.refused.push((self.levels.len() - 1, reason)),
            _ => {}
        }
    }

    fn parts(&self) -> (usize, usize, &'static str) {
        let measured: usize = self.levels.iter().map(|level| level.points.len()).sum();
        (measured + self.refused.len(), self.plan.points(), "point")
    }

    fn report(&self, limits: &TradeOffLimits) -> Report {
        let source = self.plan.runs.first().map(|run| run.setup.source_name());
        let (source, unit) = (source.unwrap_or_default(), &self.unit);
        Report {
            headline: "Speed against accuracy".to_owned(),
            conditions: format!("{source}, one thread, median of many times of {unit}"),
            pages: (0..self.levels.len()).map(|level| self.page(level, limits)).collect(),
        }
    }

    fn open(&self, level: usize, point: usize) -> Vec<Effect> {
        vec![Effect::TakeSetup(self.setup_of(level, point))]
    }

    fn decoder(&self, level: usize, point: usize) -> Option<Exporting> {
        let (_, file) = self.origins.get(level)?.get(point)?;
        let of_point = &self.levels[level].points[point];
        let source = match file {
            Some(file) => NetworkSource::Kept(point_name(of_point), Arc::clone(file)),
            None => NetworkSource::Samples(self.setup_of(level, point), self.recorded.clone()),
        };
        Some(Exporting::decoder(of_point.report.kind, source))
    }

    fn tables(&self) -> Vec<NamedTable<'_>> {
        vec![("All points", Box::new(|| trade_off_points(&self.levels)))]
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
        let cost = |cost: TradeOffCost| cost.of(point).into();
        let mut facts = point_facts(point);
        facts.push(format!(
            "at most {}",
            counted(point.settings.training.stopping.epochs, "epoch")
        ));
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
            facts,
            places: vec![
                ("Decoding", cost(TradeOffCost::Decoding)),
                ("Training", cost(TradeOffCost::Training)),
            ],
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
        let run = runs.find(|run| (run.noise, run.preset) == (Some(noise), Some(preset)));
        *run.unwrap().setup.settings()
    }

    #[test]
    fn the_default_form_is_a_quick_look_at_all_decoders() {
        let plan = plan(&SpeedForm::default(), RunSettings::default());
        // Five without a network, then two sizes with two precisions and polish.
        assert_eq!(plan.points(), 4 * 2 * (5 + 2 * 3));
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
            is_full: true,
            preset: Some(Preset::Best),
            ..SpeedForm::default()
        };
        let (settings, preset) = (settings(&plan(&form, base), 0.0, Preset::Best), Preset::Best.settings());
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
        // Mean, ridge, radial basis and fuzzy rules once; two methods with two sizes in two precisions.
        assert_eq!(of.points(), 4 + 2 * 2 * 2);
        assert!(of.runs.iter().all(|run| run.noise.is_none()), "no noise is simulated");
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
        assert!(error(|form| form.noises.values = "2".to_owned()).contains("relative noise"));
        assert!(error(|form| form.noises.values = " , ".to_owned()).contains("there are no values"));
        assert!(error(|form| form.decoders.fill(false)).contains("choose at least one"));
        let many = error(|form| {
            let many = (1..=200).map(|hidden| hidden.to_string());
            form.hidden.values = Vec::from_iter(many).join(" ");
        });
        assert!(many.contains("give fewer values"));
    }
}
