use clap::{
    Args,
    builder::{PossibleValuesParser, TypedValueParser},
};

use super::{count, failure::Failure, interruption::check_same, number, scene_arguments::SceneArguments, seed};
use decoupler_core::{
    dataset::{LARGEST_SAMPLES, Seed, Simulation},
    evaluation::{Combination, Initialization, MAX_STARTS, RunSettings, auto::AutoFixed},
    network::LARGEST_HIDDEN,
    sensor::{ArrayScale, SensorModel},
    settings::Value,
    text::Named,
    training::{Method, StoppingRules, TrainingSettings},
};
use decoupler_files::{export::RecipeSource, import::Setup};

// Settings of the run. Arguments that are not given have their default or the value in the checkpoint.
#[derive(Args)]
pub(super) struct TrainingArguments {
    #[command(flatten)]
    pub(super) scene: SceneArguments,
    /// Array scale M1xM2_M3xM4: rows x nodes on each, nodes on each column x columns [default: 10x10_5x30]
    #[arg(long, value_name = "SCALE")]
    array: Option<ArrayScale>,
    /// Hidden nodes. For a recording, auto chooses settings by cross-validation on the training samples, within --budget
    /// (60 seconds of one core by default): the readings, their logarithms or reciprocals; with --time, no memory, or averages
    /// with time constants from a few samples to a tenth of the recording if they are clearly better; 2 to 64 hidden nodes;
    /// min-max scaling or whitening; lm or br, or scg with weight decay where inputs are too many for the samples; the number of
    /// epochs, up to 400 (3000 of scg); and weights that begin random or at ridge regression. The answer is the best convex
    /// combination of the training mean, ridge, kernel ridge and up to four networks. What else is given here is kept. It is the
    /// default for a recording if none of --hidden, --starts, --combine, --begin, --method, --set, --epochs, --goal, --max-fail
    /// and --min-gradient is given
    /// [default: 12; auto for a recording]
    #[arg(long, value_name = "N|auto", value_parser = hidden_nodes)]
    hidden: Option<HiddenNodes>,
    /// Number of trainings from different random weights, which --combine makes one network [default: 1]
    #[arg(long, value_name = "N", value_parser = count(1..=MAX_STARTS))]
    starts: Option<usize>,
    /// How several starts become one network: best keeps the one with the lowest validation error, mean averages their
    /// answers [default: best]
    #[arg(long, value_name = "best|mean", value_parser = Combination::parse)]
    combine: Option<Combination>,
    /// Weights with which a training begins: random, or ridge regression with random weights added [default: random]
    #[arg(long, value_name = "random|ridge", value_parser = Initialization::parse)]
    begin: Option<Initialization>,
    /// Training method [default: lm; br for a recording]
    #[arg(long, value_parser = method())]
    method: Option<Method>,
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment, help = settings_help())]
    set: Vec<(String, f64)>,
    /// Maximum number of epochs [default: 1000; for a recording 300, or 2000 with a method that follows gradients (scg,
    /// rp, gd…)]
    #[arg(long, value_name = "N", value_parser = count(1..=StoppingRules::MAX_EPOCHS))]
    epochs: Option<usize>,
    /// Training error (mse, scaled) at which training ends [default: 0]
    #[arg(long, value_name = "MSE", value_parser = number)]
    goal: Option<f64>,
    /// Validation failures, epochs without a new best validation error, that end training [default: 6; 100
    /// for a recording with a method that follows gradients]
    #[arg(long, value_name = "N", value_parser = count(1..=StoppingRules::MAX_EPOCHS))]
    max_fail: Option<usize>,
    /// Norm of the gradient below which training ends [default: 1e-7]
    #[arg(long, value_name = "LENGTH", value_parser = number)]
    min_gradient: Option<f64>,
    /// Training samples; this and the next two are rounded up to whole snapshots of all rows [default: 1000]
    #[arg(long, value_name = "N", value_parser = count(1..=LARGEST_SAMPLES))]
    samples: Option<usize>,
    /// Test samples, on which the printed errors are measured [default: 100]
    #[arg(long, value_name = "N", value_parser = count(1..=LARGEST_SAMPLES))]
    test_samples: Option<usize>,
    /// Validation samples, which select the best weights and end the training; 0 for none [default: 200]
    #[arg(long, value_name = "N", value_parser = count(0..=LARGEST_SAMPLES))]
    validation_samples: Option<usize>,
    /// Seed of all random numbers [default: 0]
    #[arg(long, value_parser = seed)]
    seed: Option<u64>,
}

/// Number of hidden nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HiddenNodes {
    /// Chosen by cross-validation, together with other settings.
    Auto,
    /// Given.
    Count(usize),
}

fn hidden_nodes(text: &str) -> Result<HiddenNodes, String> {
    match text {
        "auto" => Ok(HiddenNodes::Auto),
        _ => count(1..=LARGEST_HIDDEN)(text).map(HiddenNodes::Count),
    }
}

impl TrainingArguments {
    /// Number of hidden nodes, if it is given.
    fn hidden(&self) -> Option<usize> {
        match self.hidden? {
            HiddenNodes::Auto => None,
            HiddenNodes::Count(count) => Some(count),
        }
    }

    /// Returns `true` if the settings of a training on a recording are to be chosen: on request, or if none is given.
    pub(super) fn is_auto(&self) -> bool {
        let is_any_given = self.hidden.is_some()
            || self.starts.is_some()
            || self.combine.is_some()
            || self.begin.is_some()
            || self.method.is_some()
            || !self.set.is_empty()
            || self.epochs.is_some()
            || self.goal.is_some()
            || self.max_fail.is_some()
            || self.min_gradient.is_some();
        self.asks_for_auto() || !is_any_given
    }

    /// Returns `true` if `--hidden auto` is given.
    pub(super) fn asks_for_auto(&self) -> bool {
        self.hidden == Some(HiddenNodes::Auto)
    }

    /// Given settings, which a choice keeps; `settings` are those of the run.
    pub(super) fn fixed(&self, settings: &RunSettings) -> AutoFixed {
        let is_method_given = self.method.is_some() || !self.set.is_empty();
        AutoFixed {
            hidden: self.hidden(),
            method: is_method_given.then_some(settings.training.method),
            epochs: self.epochs,
            starts: self.starts,
            scaling: self.scene.scaling,
            memory: None,
            tries_memory: false,
        }
    }

    /// Refuses `--hidden auto` where settings cannot be chosen.
    pub(super) fn refuse_auto(&self, reason: &str) -> Result<(), Failure> {
        if self.asks_for_auto() {
            return Err(Failure::Arguments(format!("--hidden auto: {reason}; give a number")));
        }
        Ok(())
    }

    /// Settings of a new run on a simulated array.
    pub(super) fn settings(&self) -> Result<RunSettings, Failure> {
        self.settings_on(None)
    }

    /// Settings of a new run with the given arguments on this simulated array, by default that of the preset.
    fn settings_on(&self, simulation: Option<Simulation>) -> Result<RunSettings, Failure> {
        self.scene.check_one_noise()?;
        self.refuse_auto("settings are chosen for a recording (--data)")?;
        let mut default = match simulation {
            Some(simulation) => self.scene.settings_on(simulation)?,
            None => self.scene.settings()?,
        };
        if let Some(source) = default.simulation_mut() {
            *source = Simulation {
                sensor: self.sensor().unwrap_or(source.sensor),
                samples: self.samples.unwrap_or(source.samples),
                validation_samples: self.validation_samples.unwrap_or(source.validation_samples),
                test_samples: self.test_samples.unwrap_or(source.test_samples),
                ..*source
            };
        }
        Ok(RunSettings {
            hidden: self.hidden().unwrap_or(default.hidden),
            starts: self.starts.unwrap_or(default.starts),
            combine: self.combine.unwrap_or(default.combine),
            initialization: self.begin.unwrap_or(default.initialization),
            training: self.training(default.training)?,
            seed: self.seed.map_or(default.seed, Seed),
            ..default
        })
    }

    /// Setup of a new run on samples of `source`, or of the array described by the arguments. `holds_out` is true if the
    /// validation share of a recording is given; otherwise the method determines it.
    pub(super) fn setup(&self, source: Option<RecipeSource>, holds_out: bool) -> Result<Setup, Failure> {
        let mut plan = match source {
            None => return Ok(self.settings()?.into()),
            Some(RecipeSource::Simulated(simulation)) => return Ok(self.settings_on(Some(simulation))?.into()),
            Some(RecipeSource::Recording(plan)) => plan,
        };
        let settings = self.recorded(plan.import.row_wire.is_some())?;
        if !holds_out {
            plan.division.validation_fraction = settings.validation_fraction();
        }
        Ok(Setup::recording(settings, plan))
    }

    /// Settings of a new run on a recording.
    fn recorded(&self, has_row_wires: bool) -> Result<RunSettings, Failure> {
        let mut default = self.recorded_source(has_row_wires)?;
        if let Some(method) = self.method {
            default.choose_method(method);
        }
        Ok(RunSettings {
            hidden: self.hidden().unwrap_or(default.hidden),
            starts: self.starts.unwrap_or(default.starts),
            combine: self.combine.unwrap_or(default.combine),
            initialization: self.begin.unwrap_or(default.initialization),
            training: self.training(default.training)?,
            seed: self.seed.map_or(default.seed, Seed),
            ..default
        })
    }

    /// Default settings with the given row model and scaling.
    ///
    /// # Errors
    /// Names the first given argument that is only for a simulated array.
    fn recorded_source(&self, has_row_wires: bool) -> Result<RunSettings, Failure> {
        let settings = self.scene.recorded(has_row_wires)?;
        refuse_with_recordings([
            self.array.is_some(),
            self.samples.is_some(),
            self.test_samples.is_some(),
            self.validation_samples.is_some(),
        ])?;
        Ok(settings)
    }

    /// Sensor, if an array scale is given.
    pub(super) fn sensor(&self) -> Option<SensorModel> {
        self.array.map(SensorModel::new)
    }

    /// Training settings with which the run of the setup `saved` is resumed.
    ///
    /// # Errors
    /// Names the first given argument that differs.
    pub(super) fn resumed(&self, saved: &Setup) -> Result<TrainingSettings, Failure> {
        let settings = saved.settings();
        match (settings.simulation(), saved.plan()) {
            (Some(source), _) => {
                if let Some(what) = self.scene.difference(&source.scene, settings.inputs)? {
                    return Err(Failure::Arguments(format!(
                        "the checkpoint has a different value of {what}: leave it out to resume, or start a new training \
                         with another --checkpoint"
                    )));
                }
                check_same("array", self.array, source.sensor.scale)?;
                check_same("samples", self.samples, source.samples)?;
                check_same("test-samples", self.test_samples, source.test_samples)?;
                check_same("validation-samples", self.validation_samples, source.validation_samples)?;
            }
            (None, plan) => {
                let import = plan.map(|plan| &plan.import);
                self.recorded_source(import.is_some_and(|import| import.row_wire.is_some()))?;
                self.scene.check_resumed(settings)?;
                let columns = self.scene.columns();
                let given = (!columns.is_empty()).then(|| columns.join(","));
                check_same(
                    "inputs",
                    given,
                    import.map_or(String::new(), |import| import.inputs.join(",")),
                )?;
            }
        }
        check_same("hidden", self.hidden(), settings.hidden)?;
        check_same("starts", self.starts, settings.starts)?;
        check_same("begin", self.begin, settings.initialization)?;
        check_same("combine", self.combine, settings.combine)?;
        check_same("seed", self.seed, settings.seed)?;
        self.training(settings.training)
    }

    /// The given method and stopping rules; those not given are as in `current`.
    pub(super) fn training(&self, current: TrainingSettings) -> Result<TrainingSettings, Failure> {
        // The current settings of the method are those that suit the samples.
        let same = |method: &Method| method.short_name() == current.method.short_name();
        let mut method = self.method.filter(|method| !same(method)).unwrap_or(current.method);
        for (name, value) in &self.set {
            let short_name = method.short_name();
            match method.settings().find(|setting| setting.word("-") == *name) {
                Some(setting) => setting.set(&mut method, &Value::Number(*value))?,
                None => {
                    let names = method.settings().map(|setting| setting.word("-"));
                    let names = names.collect::<Vec<_>>().join(", ");
                    let message = format!("--set {name}: {short_name} has no such setting; it has {names}");
                    return Err(Failure::Arguments(message));
                }
            }
        }
        let rules = current.stopping;
        let training = TrainingSettings {
            method,
            stopping: StoppingRules {
                epochs: self.epochs.unwrap_or(rules.epochs),
                goal_mse: self.goal.unwrap_or(rules.goal_mse),
                min_gradient: self.min_gradient.unwrap_or(rules.min_gradient),
                max_fail: self.max_fail.unwrap_or(rules.max_fail),
            },
        };
        training.check()?;
        Ok(training)
    }
}

/// Refuses arguments for a simulated array together with a recording, in this order: array, training, test and
/// validation samples.
pub(super) fn refuse_with_recordings(are_given: [bool; 4]) -> Result<(), Failure> {
    let arguments = [
        ("--array", "a recording (--data) has no array; leave it out"),
        (
            "--samples",
            "all rows of a recording (--data) are used; choose some with --where",
        ),
        (
            "--test-samples",
            "a share of a recording (--data) is held out for testing; give --test-fraction or --test-data",
        ),
        (
            "--validation-samples",
            "a share of a recording (--data) is held out for validation; give --validation-fraction",
        ),
    ];
    match arguments.iter().zip(are_given).find(|(_, is_given)| *is_given) {
        Some(((argument, reason), _)) => Err(Failure::Arguments(format!("{argument}: {reason}"))),
        None => Ok(()),
    }
}

pub(super) fn method() -> impl TypedValueParser<Value = Method> {
    let names = Method::all().map(|method| method.short_name());
    PossibleValuesParser::new(names).map(|name| Method::named(&name).unwrap_or_default())
}

fn assignment(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("write NAME=VALUE, for example mu=0.01")?;
    let value = value.trim().parse().map_err(|_| format!("'{value}' is not a number"))?;
    Ok((name.trim().to_owned(), value))
}

fn settings_help() -> String {
    let of = |method: Method| {
        let recorded = if method == Method::bayesian_regularization() {
            Method::recorded_regularization()
        } else {
            method
        };
        let list = method.settings().filter_map(|setting| {
            let (name, default) = (setting.word("-"), setting.number(&method)?);
            let recorded = setting.number(&recorded)?;
            Some(if recorded == default {
                format!("{name} (default {default})")
            } else {
                format!("{name} (default {default}; {recorded} for a recording)")
            })
        });
        let list = list.collect::<Vec<_>>().join(", ");
        format!("{} has {list}", method.short_name())
    };
    let methods = Method::all().map(of).join("; ");
    format!("Change a setting of the method; may be repeated: {methods}")
}

#[cfg(test)]
mod tests {
    use clap::{Command, FromArgMatches};

    use super::*;
    use decoupler_core::scene::RowModel;
    use decoupler_files::export::report::train_command;

    fn parsed(line: &str) -> TrainingArguments {
        let command = TrainingArguments::augment_args(Command::new("train"));
        let matches = command.get_matches_from(line.split(' '));
        TrainingArguments::from_arg_matches(&matches).unwrap()
    }

    #[test]
    fn the_defaults_in_the_help_match_the_library() {
        assert_eq!(parsed("train").settings().unwrap(), RunSettings::default());
        let line = "train --preset paper --rows all --axes z --loading random --inputs resistance --scaling minmax \
                    --noise 0 --noise-in both --array 10x10_5x30 --hidden 12 --starts 1 --method lm --epochs 1000 \
                    --goal 0 --max-fail 6 --min-gradient 1e-7 --samples 1000 --test-samples 100 --validation-samples \
                    200 --seed 0";
        assert_eq!(parsed(line).settings().unwrap(), RunSettings::default());
    }

    #[test]
    fn recordings_have_the_defaults_of_the_library() {
        let recorded = |line: &str| parsed(line).recorded(false).unwrap();
        let default = RunSettings::measured(RowModel::Shared);
        assert_eq!(recorded("train"), default);
        // Naming the default method keeps its settings for recordings.
        assert_eq!(recorded("train --method br"), default);
        let given = recorded(
            "train --method br --set own-noise=0 --set groups-of-weights=1 --epochs 7 --starts 2 --hidden 3 --seed 4",
        );
        assert_eq!(
            (given.training.stopping.epochs, given.starts, given.hidden, given.seed),
            (7, 2, 3, Seed(4))
        );
        assert_eq!(given.training.method, Method::bayesian_regularization());
        let rules = |line: &str| {
            let rules = recorded(line).training.stopping;
            (rules.epochs, rules.max_fail)
        };
        assert_eq!(rules("train --method lm"), (300, 6));
        assert_eq!(rules("train --method scg"), (2000, 100));
        assert_eq!(rules("train --method rp --epochs 300 --max-fail 6"), (300, 6));
    }

    #[test]
    fn the_command_in_a_report_gives_the_settings_of_the_run() {
        let lines = [
            "train",
            "train --preset best --array 10x6_3x18 --hidden 7 --seed 18446744073709551615",
            "train --rows 3 --axes xyz --loading smooth:2.5 --noise 1e-3 --noise-ohm 0.1 --adc-bits 12 --drift 0.0123 \
             --noise-in training --inputs log --scaling whiten --starts 4",
            "train --loading indenter:flat-punch --method gdm --set learning-rate=0.3 --epochs 77 --goal 1e-5 \
             --max-fail 9 --min-gradient 0 --samples 123 --test-samples 17 --validation-samples 0",
        ];
        for line in lines {
            let settings = parsed(&line.split_whitespace().collect::<Vec<_>>().join(" "))
                .settings()
                .unwrap();
            let command = train_command(&settings.into(), None).unwrap();
            let command = command.strip_prefix("decoupler ").unwrap();
            assert_eq!(parsed(command).settings().unwrap(), settings, "{command}");
        }
    }
}
