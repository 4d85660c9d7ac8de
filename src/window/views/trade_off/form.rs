//! Form of a measurement, recommended decoders, and the marked point.

use std::{ops::RangeInclusive, str::FromStr};

use decoupler_core::{
    dataset::{LARGEST_SAMPLES, Seed, Simulation},
    decoupling::DecoderKind,
    evaluation::{Preset, RunSettings, TradeOffPoint},
    network::LARGEST_HIDDEN,
    scene::{Noise, Scene},
    text::counted,
    training::{Method, StoppingRules},
};
use decoupler_files::{
    export::format_percent,
    figure::{TradeOffLevel, frame_time, point_facts, point_name},
    import::{Plan, Setup},
};
use eframe::egui::{Label, RichText, Ui};
use thiserror::Error;

use super::{
    PointWish, TradeOffLook, TradeOffPlan,
    state::{PlannedLevel, PlannedRun},
};
use crate::window::{
    shared::{Exporting, NetworkSource},
    theme::{Theme, semibold, space, type_size},
    widgets::{dim_ui, fields::quantity_ui, ghost_button, section_heading_ui},
};

/// Form of a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOffForm {
    /// Noise levels, as typed.
    pub noises: String,
    /// Hidden nodes, as typed.
    pub hidden: String,
    /// Presets on which the settings of the networks of an array are based.
    pub presets: WhichPresets,
    /// Training methods of the networks of a recording, in the order of [`Method::all`].
    pub methods: Vec<bool>,
    /// Decoders, in the order of [`DecoderKind::ALL`].
    pub decoders: [bool; DecoderKind::ALL.len()],
    /// Length of the trainings.
    pub thoroughness: Thoroughness,
    /// Maximum number of training samples of a quick look.
    pub samples: usize,
    /// Maximum number of epochs of a quick look.
    pub epochs: usize,
    /// Number of samples on which the errors are measured.
    pub test_samples: usize,
}

/// Presets that are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhichPresets {
    /// Both.
    Both,
    /// One of them.
    Only(Preset),
}

/// Length of the trainings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Thoroughness {
    /// With few samples and epochs: a first look in less than a minute.
    Quick,
    /// As in the presets or, for a recording, as in the Train view.
    Full,
}

/// Error in a form.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TradeOffFormError {
    /// Something that is not a number.
    #[error("{what}: '{text}' is not a number; write a list such as {example}")]
    NotANumber {
        /// The list.
        what: &'static str,
        /// Text that was typed.
        text: String,
        /// Example of a valid list.
        example: &'static str,
    },
    /// A number out of its range.
    #[error("{what}: {value} is not possible, give from {min} to {max}")]
    Range {
        /// The list.
        what: &'static str,
        /// Text that was typed.
        value: String,
        /// The minimum.
        min: String,
        /// The maximum.
        max: String,
    },
    /// An empty list.
    #[error("{what}: there are no values; write a list such as {example}")]
    Empty {
        /// The list.
        what: &'static str,
        /// Example of a valid list.
        example: &'static str,
    },
    /// Too many points to display.
    #[error("{0} points are too many to display: give fewer values, at most {MAX_POINTS} points")]
    TooMany(usize),
    /// No decoder.
    #[error("no decoder is chosen: choose at least one")]
    NoDecoder,
    /// No training method of the networks of a recording.
    #[error("no training method is chosen: choose at least one, or leave out the networks")]
    NoMethod,
}

/// Maximum number of points of a measurement.
const MAX_POINTS: usize = 1000;

const NOISES: &str = "0, 1e-4, 1e-3, 1e-2";
const HIDDEN: &str = "6, 12";
/// Methods chosen by default for a recording.
const USUAL_METHODS: [&str; 2] = ["br", "lm"];

impl Default for TradeOffForm {
    fn default() -> Self {
        Self {
            noises: NOISES.to_owned(),
            hidden: HIDDEN.to_owned(),
            presets: WhichPresets::Both,
            methods: Method::all()
                .iter()
                .map(|method| USUAL_METHODS.contains(&method.short_name()))
                .collect(),
            decoders: [true; DecoderKind::ALL.len()],
            thoroughness: Thoroughness::Quick,
            samples: 2000,
            epochs: 60,
            test_samples: 100,
        }
    }
}

impl TradeOffForm {
    /// Returns the measurement on the source of `base`, validated as far as possible without running it.
    ///
    /// # Errors
    /// If the form is not a valid measurement.
    pub fn plan(&self, base: &Setup) -> Result<TradeOffPlan, TradeOffFormError> {
        let has_sensor = base.settings().simulation().is_some();
        let chosen = DecoderKind::ALL.into_iter().zip(self.decoders);
        let decoders: Vec<_> = chosen
            .filter(|(kind, is_chosen)| *is_chosen && (has_sensor || !kind.needs_sensor()))
            .map(|(kind, _)| kind)
            .collect();
        if decoders.is_empty() {
            return Err(TradeOffFormError::NoDecoder);
        }
        let levels = match (base.settings().simulation(), base.plan()) {
            (Some(simulation), _) => self.levels_of_array(simulation, base.settings().seed, &decoders)?,
            (None, Some(plan)) => vec![self.level_of_recording(base.settings(), plan, &decoders)?],
            (None, None) => Vec::new(),
        };
        let plan = TradeOffPlan {
            levels,
            hidden: list("Hidden nodes", &self.hidden, HIDDEN, 1..=LARGEST_HIDDEN)?,
        };
        match plan.points() {
            points if points > MAX_POINTS => Err(TradeOffFormError::TooMany(points)),
            _ => Ok(plan),
        }
    }

    /// Returns a level for each noise, with the sensor and the scene of `base`.
    fn levels_of_array(
        &self,
        base: &Simulation,
        seed: Seed,
        decoders: &[DecoderKind],
    ) -> Result<Vec<PlannedLevel>, TradeOffFormError> {
        let presets = match self.presets {
            WhichPresets::Both => Preset::ALL.to_vec(),
            WhichPresets::Only(preset) => vec![preset],
        };
        let noises = list("Noise levels", &self.noises, NOISES, 0.0..=1.0)?;
        let level = |noise: f64| {
            let run = |&preset: &Preset| PlannedRun {
                preset: Some(preset),
                setup: self.settings(base, seed, preset, noise).into(),
                decoders: decoders.to_vec(),
            };
            PlannedLevel {
                noise: Some(noise),
                runs: presets.iter().map(run).collect(),
            }
        };
        Ok(noises.into_iter().map(level).collect())
    }

    /// Returns the settings of a preset at a noise level, with the sensor and the scene of `base`. The preset
    /// determines the rows that are read and the inputs of the networks.
    fn settings(&self, base: &Simulation, seed: Seed, preset: Preset, noise: f64) -> RunSettings {
        let noise = Noise {
            relative: noise,
            ..base.scene.noise
        };
        let of_preset = preset.simulation_in(noise);
        let mut source = Simulation {
            sensor: base.sensor,
            scene: Scene {
                rows: of_preset.scene.rows,
                noise,
                ..base.scene
            },
            test_samples: self.test_samples.clamp(1, LARGEST_SAMPLES),
            ..of_preset
        };
        let mut training = preset.settings_in(noise).training;
        if self.thoroughness == Thoroughness::Quick {
            source.samples = source.samples.min(self.samples.clamp(1, LARGEST_SAMPLES));
            source.validation_samples = source.validation_samples.min(source.samples.div_ceil(5));
            training.stopping.epochs = training.stopping.epochs.min(self.max_epochs());
        }
        RunSettings {
            source: source.into(),
            training,
            seed,
            ..preset.settings_in(noise)
        }
    }

    /// Returns a run for each method, on the recording that `plan` reads. Decoders without a network do not depend on
    /// the method, so the first run measures them.
    fn level_of_recording(
        &self,
        base: &RunSettings,
        plan: &Plan,
        decoders: &[DecoderKind],
    ) -> Result<PlannedLevel, TradeOffFormError> {
        let chosen = Method::all().into_iter().zip(&self.methods);
        let mut methods = Vec::from_iter(chosen.filter(|(_, is_chosen)| **is_chosen).map(|(method, _)| method));
        if decoders.iter().all(|kind| !kind.needs_network()) {
            methods = vec![base.training.method];
        } else if methods.is_empty() {
            return Err(TradeOffFormError::NoMethod);
        }
        let run = |(place, method): (usize, &Method)| {
            let mut settings = *base;
            // The method of the Train view keeps its settings.
            if method.short_name() != base.training.method.short_name() {
                settings.choose_method(*method);
            }
            if self.thoroughness == Thoroughness::Quick {
                let stopping = &mut settings.training.stopping;
                stopping.epochs = stopping.epochs.min(self.max_epochs());
            }
            let mut plan = plan.clone();
            // A share set by the user is kept.
            if plan.division.validation_fraction == Some(base.validation_fraction()) {
                plan.division.validation_fraction = Some(settings.validation_fraction());
            }
            let of_run = decoders.iter().filter(|kind| place == 0 || kind.needs_network());
            PlannedRun {
                preset: None,
                setup: Setup::recording(settings, plan),
                decoders: of_run.copied().collect(),
            }
        };
        Ok(PlannedLevel {
            noise: None,
            runs: methods.iter().enumerate().map(run).collect(),
        })
    }

    fn max_epochs(&self) -> usize {
        self.epochs.clamp(1, StoppingRules::MAX_EPOCHS)
    }
}

/// Parses a list; returns each value once, in the order of the list.
fn list<N>(
    what: &'static str,
    text: &str,
    example: &'static str,
    possible: RangeInclusive<N>,
) -> Result<Vec<N>, TradeOffFormError>
where
    N: FromStr + PartialOrd + ToString,
{
    let mut values: Vec<N> = Vec::new();
    let words = text.split(|letter: char| letter == ',' || letter == ';' || letter.is_whitespace());
    for word in words.filter(|word| !word.is_empty()) {
        let value: N = word.parse().map_err(|_| TradeOffFormError::NotANumber {
            what,
            text: word.to_owned(),
            example,
        })?;
        if !possible.contains(&value) {
            return Err(TradeOffFormError::Range {
                what,
                value: word.to_owned(),
                min: possible.start().to_string(),
                max: possible.end().to_string(),
            });
        }
        if !values.contains(&value) {
            values.push(value);
        }
    }
    if values.is_empty() {
        return Err(TradeOffFormError::Empty { what, example });
    }
    Ok(values)
}

/// Shows the recommended decoders and the marked point. Returns the action that the user chose for it; `source` returns
/// what the decoder of a point is exported from.
pub fn choices_ui(
    ui: &mut Ui,
    level: &TradeOffLevel,
    look: &mut TradeOffLook,
    can_load: bool,
    source: impl Fn(usize) -> Option<NetworkSource>,
) -> Option<PointWish> {
    let [fastest, most_accurate] = level.answers(&look.limits);
    section_heading_ui(ui, "Recommended decoders");
    let hint = if level.noise.is_some() {
        "Finds the decoder with the shortest time for a frame among those whose Z error is at most this, in percent."
    } else {
        "Finds the decoder with the shortest time among those whose mean absolute error is at most this, in percent of the \
         range of the targets."
    };
    quantity_ui(ui, "Fastest under", hint, &mut look.limits.percent, 1e-15..=1e6, "%");
    let none = "No measured decoder is this accurate.";
    answer_ui(ui, &mut look.marked, level, "Fastest", fastest, none);
    ui.add_space(space(1));
    let hint = "Finds the decoder with the smallest error among those that decode a frame, or a sample of a recording, \
                within this time, in µs.";
    quantity_ui(
        ui,
        "Most accurate under",
        hint,
        &mut look.limits.microseconds,
        1e-6..=1e12,
        "µs",
    );
    let none = "No measured decoder is this fast.";
    answer_ui(ui, &mut look.marked, level, "Most accurate", most_accurate, none);
    section_heading_ui(ui, "Marked point");
    match look.marked.and_then(|marked| Some((marked, level.points.get(marked)?))) {
        Some((marked, point)) => marked_ui(ui, marked, point, can_load, source(marked).as_ref()),
        None => {
            dim_ui(
                ui,
                "Click a row of the table to mark its point, or a point of a chart to load it; right-click a point to export it.",
            );
            None
        }
    }
}

/// Shows a recommended decoder; a click marks it.
fn answer_ui(
    ui: &mut Ui,
    marked: &mut Option<usize>,
    level: &TradeOffLevel,
    question: &str,
    chosen: Option<usize>,
    none: &str,
) {
    let Some((number, point)) = chosen.and_then(|number| Some((number, level.points.get(number)?))) else {
        dim_ui(ui, none);
        return;
    };
    let text = format!(
        "{}: {}, {}",
        point_name(point),
        format_percent(point.report.errors.percent()),
        frame_time(point.report.frame_us)
    );
    let accent = Theme::of(ui).palette.accent;
    let response = ui.selectable_label(
        *marked == Some(number),
        RichText::new(&text).size(type_size().note).color(accent),
    );
    let response = response.on_hover_text("Click to mark it in the charts and the table.");
    response.widget_info(|| {
        let label = format!("{question}: {text}");
        eframe::egui::WidgetInfo::labeled(eframe::egui::accesskit::Role::Button, true, label)
    });
    if response.clicked() {
        *marked = Some(number);
    }
}

fn marked_ui(
    ui: &mut Ui,
    number: usize,
    point: &TradeOffPoint,
    can_load: bool,
    source: Option<&NetworkSource>,
) -> Option<PointWish> {
    let mut wish = None;
    let name = RichText::new(point_name(point)).font(semibold(type_size().note));
    ui.add(Label::new(name).truncate());
    ui.horizontal(|ui| {
        let load = ui.add_enabled(can_load, ghost_button("Load into Train view"));
        let is_loaded = load
            .on_hover_text("Uses its source and network settings for the next training.")
            .on_disabled_hover_text("A training is running in the Train view: its settings cannot be changed now")
            .clicked();
        wish = is_loaded.then_some(PointWish::Load(number));
        if let Some(source) = source {
            if ui.add(ghost_button("Export this decoder…")).clicked() {
                let exporting = Exporting::decoder(point.report.kind, source.clone());
                wish = Some(PointWish::Export(Box::new(exporting)));
            }
        }
    });
    dim_ui(ui, &format!("{}.", point_facts(point).join("; ")));
    let epochs = counted(point.settings.training.stopping.epochs, "epoch");
    match point.settings.simulation() {
        Some(array) => dim_ui(
            ui,
            &format!("{}, at most {epochs}.", counted(array.samples, "training sample")),
        ),
        None => dim_ui(ui, &format!("At most {epochs}.")),
    };
    wish
}

#[cfg(test)]
mod tests {
    use decoupler_core::scene::{RowModel, Rows};

    use super::*;

    fn array() -> Setup {
        RunSettings::default().into()
    }

    /// The settings of the run of a preset at the first level.
    fn settings(plan: &TradeOffPlan, level: usize, preset: Preset) -> RunSettings {
        let mut runs = plan.levels[level].runs.iter();
        let run = runs.find(|run| run.preset == Some(preset)).unwrap();
        *run.setup.settings()
    }

    #[test]
    fn the_default_form_is_a_quick_look_at_all_decoders() {
        let plan = TradeOffForm::default().plan(&array()).unwrap();
        // Five without a network, then two sizes with two precisions and polish.
        assert_eq!(plan.points(), 4 * 2 * (5 + 2 * 3));
        let best = settings(&plan, 2, Preset::Best);
        assert_eq!(
            (best.simulation().unwrap().samples, best.training.stopping.epochs),
            (2000, 60)
        );
        assert_eq!(
            (
                best.simulation().unwrap().scene.rows,
                best.simulation().unwrap().scene.noise.relative
            ),
            (Rows::Known, 1e-3)
        );
    }

    #[test]
    fn a_full_measurement_uses_the_presets_in_the_current_scene() {
        let mut base = RunSettings::default();
        base.simulation_mut().unwrap().scene.largest_compression = 0.1;
        base.simulation_mut().unwrap().sensor.geometry.height_mm = 4.0;
        let form = TradeOffForm {
            thoroughness: Thoroughness::Full,
            presets: WhichPresets::Only(Preset::Best),
            ..TradeOffForm::default()
        };
        let plan = form.plan(&base.into()).unwrap();
        let (settings, preset) = (settings(&plan, 0, Preset::Best), Preset::Best.settings());
        assert_eq!(
            (settings.simulation().unwrap().samples, settings.training),
            (preset.simulation().unwrap().samples, preset.training)
        );
        assert_eq!(settings.simulation().unwrap().sensor, base.simulation().unwrap().sensor);
        assert_eq!(settings.simulation().unwrap().scene.largest_compression, 0.1);
    }

    #[test]
    fn each_method_trains_its_networks_and_other_decoders_are_measured_once() {
        let base = RunSettings::measured(RowModel::Shared);
        let recording = |plan: &Plan| Setup::recording(base, plan.clone());
        let plan = TradeOffForm::default().plan(&recording(&Plan::default())).unwrap();
        let [level] = &plan.levels[..] else {
            panic!("{:?}", plan.levels);
        };
        assert_eq!(level.noise, None, "no noise is simulated");
        // Mean, ridge, radial basis and fuzzy rules once; two methods with two sizes in two precisions.
        assert_eq!(plan.points(), 4 + 2 * 2 * 2);
        let all = level.runs.iter().flat_map(|run| &run.decoders);
        assert!(all.clone().all(|kind| !kind.needs_sensor()), "{level:?}");
        let held_out = |plan: &TradeOffPlan| {
            let runs = plan.levels[0].runs.iter();
            let held_out = |run: &PlannedRun| {
                let settings = run.setup.settings();
                assert_eq!(settings.training.stopping.epochs, 60);
                (
                    settings.training.method.short_name(),
                    run.setup.plan().unwrap().division.validation_fraction.unwrap(),
                )
            };
            let mut held_out = Vec::from_iter(runs.map(held_out));
            held_out.sort_by_key(|(name, _)| *name);
            held_out
        };
        assert_eq!(held_out(&plan), [("br", 0.0), ("lm", 0.2)]);
        // A share set by the user applies to every method.
        let mut chosen = Plan::default();
        chosen.division.validation_fraction = Some(0.3);
        let plan = TradeOffForm::default().plan(&recording(&chosen)).unwrap();
        assert_eq!(held_out(&plan), [("br", 0.3), ("lm", 0.3)]);
        let mut form = TradeOffForm::default();
        form.methods.fill(false);
        let message = form.plan(&recording(&chosen)).unwrap_err().to_string();
        assert!(message.contains("training method"), "{message}");
    }

    #[test]
    fn invalid_forms_give_a_reason() {
        let base = array();
        let error = |form: TradeOffForm| form.plan(&base).unwrap_err().to_string();
        let with_noises = |text: &str| TradeOffForm {
            noises: text.to_owned(),
            ..TradeOffForm::default()
        };
        assert!(error(with_noises("0, much")).contains("'much' is not a number"));
        assert!(error(with_noises("2")).contains("give from 0 to 1"));
        assert!(error(with_noises("NaN")).contains("give from 0 to 1"));
        assert!(error(with_noises(" , ")).contains("there are no values"));
        let none = TradeOffForm {
            decoders: [false; DecoderKind::ALL.len()],
            ..TradeOffForm::default()
        };
        assert!(error(none).contains("choose at least one"));
        let many: Vec<String> = (1..=200).map(|hidden| hidden.to_string()).collect();
        let many = TradeOffForm {
            hidden: many.join(" "),
            ..TradeOffForm::default()
        };
        assert!(error(many).contains("give fewer values"));
    }
}
