//! Options of the settings of a run, from the table of settings.

use std::{collections::HashSet, marker::PhantomData};

use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches, error::ErrorKind};
use decoupler_core::{
    dataset::Simulation,
    decoupling::DecoderKind,
    evaluation::{Part, Preset, RUN_OPTIONS, RunOption, RunSettings, auto::AutoFixed},
    network::LARGEST_HIDDEN,
    scene::{Noise, RowModel, SceneError},
    settings::{Method, SettingError, Value},
    text::Named,
    training::TrainingSettings,
};
use decoupler_files::{export::RecipeFile, import::Setup};

use super::{count, failure::Failure, interruption::check_same};

/// Rows of the table of settings that a command offers.
pub(super) trait Offer: Send + Sync {
    /// `true` if the command trains networks by a method that is given.
    const OF_METHOD: bool = false;

    /// Returns `true` if the command offers this row.
    fn has(option: &RunOption) -> bool;
}

/// All settings; hidden nodes may be chosen, and inputs may be columns.
pub(super) struct OfTrain;

/// Scene, array, and a range of noise.
pub(super) struct OfTrade;

/// Scene and array.
pub(super) struct OfSimulate;

impl Offer for OfTrain {
    const OF_METHOD: bool = true;

    fn has(option: &RunOption) -> bool {
        option.setting.name != "hidden"
    }
}

impl Offer for OfTrade {
    fn has(option: &RunOption) -> bool {
        option.part == Part::Scene && option.setting.name != "noise"
            || ["array", "samples", "test samples", "epochs", "seed"].contains(&option.setting.name)
    }
}

impl Offer for OfSimulate {
    fn has(option: &RunOption) -> bool {
        option.part == Part::Scene || ["array", "seed"].contains(&option.setting.name)
    }
}

/// Settings that were given, in the order of the table.
pub(super) struct Given<O> {
    values: Vec<(&'static RunOption, Value)>,
    /// Settings of the method.
    of_method: Vec<(String, f64)>,
    of: PhantomData<O>,
}

fn offered<O: Offer>() -> impl Iterator<Item = &'static RunOption> {
    RUN_OPTIONS.iter().filter(|option| O::has(option))
}

/// Returns the option of a setting as it is typed, without the first two dashes.
fn typed(option: &RunOption) -> String {
    let word = option.setting.word("-");
    if option.is_rare() { format!("set {word}") } else { word }
}

/// Reads a value and checks it against its row.
fn parsed(option: &'static RunOption, text: &str) -> Result<Value, SettingError> {
    let (setting, mut run) = (&option.setting, RunSettings::default());
    let value = setting.parse(text)?;
    setting.set(&mut run, &value)?;
    setting.check(&run)?;
    // As the program writes it.
    Ok(setting.get(&run).unwrap_or(value))
}

/// Returns the explanation of a setting; options have no full stop at the end.
fn help(option: &RunOption) -> String {
    let help = option.setting.help.trim_end_matches('.');
    match option.default {
        "" => help.to_owned(),
        default => format!("{help} [default: {default}]"),
    }
}

fn argument(option: &'static RunOption) -> Arg {
    /// Settings that `-h` shows.
    const USUAL: [&str; 4] = ["array", "inputs", "epochs", "seed"];
    let (setting, word) = (&option.setting, option.setting.word("-"));
    let heading = match option.part {
        Part::Array | Part::Scene => "Simulated array",
        Part::Network | Part::Training | Part::Random => "Network and training",
    };
    let argument = Arg::new(word.clone())
        .long(word)
        .value_name(option.form)
        .help(help(option))
        .help_heading(heading)
        .hide_short_help(!USUAL.contains(&setting.name));
    match setting.name {
        "inputs" => argument.value_delimiter(',').action(ArgAction::Append),
        _ => argument.value_parser(move |text: &str| parsed(option, text)),
    }
}

/// The option for the settings that are rarely changed, and for those of the method.
fn set<O: Offer>() -> Arg {
    let rare = offered::<O>().filter(|option| option.is_rare());
    let rare = rare.map(|option| format!("{}: {}", option.setting.word("-"), help(option)));
    let mut texts = vec!["Change a setting that is rarely changed; may be repeated".to_owned()];
    texts.extend(rare);
    texts.extend(O::OF_METHOD.then(|| format!("Settings of the methods: {}", method_settings())));
    Arg::new("set")
        .long("set")
        .value_name("NAME=VALUE")
        .action(ArgAction::Append)
        .help(texts.join("; "))
        .help_heading(RARELY)
        .hide_short_help(true)
}

/// Heading of the last options.
pub(super) const RARELY: &str = "Rarely needed";

impl<O: Offer> Args for Given<O> {
    fn augment_args(command: Command) -> Command {
        let usual = offered::<O>().filter(|option| !option.is_rare());
        usual
            .fold(command, |command, option| command.arg(argument(option)))
            .arg(set::<O>())
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<O: Offer> FromArgMatches for Given<O> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let refused = |message: String| clap::Error::raw(ErrorKind::ValueValidation, message);
        let mut set = Vec::new();
        for text in matches.get_many::<String>("set").into_iter().flatten() {
            let assignment = text.split_once('=').map(|(name, value)| (name.trim(), value.trim()));
            set.push(assignment.ok_or_else(|| refused("--set: write NAME=VALUE, for example mu=0.01".to_owned()))?);
        }
        let mut values = Vec::new();
        for option in offered::<O>() {
            let word = option.setting.word("-");
            let value = match option.setting.name {
                _ if option.is_rare() => {
                    let texts = set.extract_if(.., |(name, _)| *name == word).map(|(_, text)| text);
                    let parsed = texts.last().map(|text| parsed(option, text)).transpose();
                    parsed.map_err(|error| refused(format!("--set {error}")))?
                }
                "inputs" => matches.get_many::<String>(&word).map(|names| {
                    let names = Vec::from_iter(names.map(String::as_str));
                    Value::Text(names.join(","))
                }),
                _ => matches.get_one::<Value>(&word).cloned(),
            };
            values.extend(value.map(|value| (option, value)));
        }
        let of_method = set.into_iter().map(|(name, value)| {
            let is_known = O::OF_METHOD && Method::all().iter().any(|method| has(method, name));
            match value.parse() {
                _ if !is_known => Err(format!(
                    "--set {name}: there is no such setting; there are {}",
                    names::<O>()
                )),
                Ok(value) => Ok((name.to_owned(), value)),
                Err(_) => Err(format!("--set {name}: '{value}' is not a number")),
            }
        });
        Ok(Self {
            values,
            of_method: of_method.collect::<Result<_, _>>().map_err(refused)?,
            of: PhantomData,
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

fn has(method: &Method, name: &str) -> bool {
    method.settings().any(|setting| setting.word("-") == name)
}

/// Names that `--set` takes.
fn names<O: Offer>() -> String {
    let rare = offered::<O>()
        .filter(|option| option.is_rare())
        .map(|option| option.setting.word("-"));
    let mut names = Vec::from_iter(rare);
    if O::OF_METHOD {
        let of_methods = Method::all().into_iter().flat_map(|method| method.settings());
        names.extend(of_methods.map(|setting| setting.word("-")));
        let mut seen = HashSet::new();
        names.retain(|name| seen.insert(name.clone()));
    }
    names.join(", ")
}

// Scene and array, and the decoders that are used.
#[derive(Args)]
pub(super) struct SettingsArguments<O: Offer> {
    /// Settings that other arguments start from: those of the paper, or the best ones measured [default: paper]
    #[arg(long, value_name = "paper|best", value_parser = Preset::parse, help_heading = "Simulated array")]
    pub(super) preset: Option<Preset>,
    #[command(flatten)]
    given: Given<O>,
    /// Decoders to use, separated by commas: mean, ridge, network, rbf, fuzzy, newton, polish
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = DecoderKind::parse, hide_short_help = true)]
    pub(super) decoder: Vec<DecoderKind>,
}

impl<O: Offer> SettingsArguments<O> {
    /// Returns the value of this name, if it is given.
    pub(super) fn value(&self, name: &str) -> Option<&Value> {
        let mut given = self.given.values.iter();
        given
            .find(|(option, _)| option.setting.name == name)
            .map(|(_, value)| value)
    }

    /// Settings of the preset on this simulated array, by default its own, with what is given.
    pub(super) fn settings(&self, on: Option<Simulation>) -> Result<RunSettings, Failure> {
        let noise = match self.value("noise") {
            Some(Value::Number(relative)) => Noise::relative(*relative),
            _ => Noise::default(),
        };
        let preset = self.preset.unwrap_or_default();
        self.applied(match on {
            Some(simulation) => RunSettings {
                source: simulation.into(),
                ..preset.settings()
            },
            // As many samples as the noise requires.
            None => preset.settings_in(self.noise(noise)),
        })
    }

    /// The given parts of the noise.
    fn noise(&self, noise: Noise) -> Noise {
        let mut settings = RunSettings::default();
        if let Some(simulation) = settings.simulation_mut() {
            simulation.scene.noise = noise;
        }
        let parts = self
            .given
            .values
            .iter()
            .filter(|(option, _)| option.part == Part::Scene);
        for (option, value) in parts {
            // Errors are reported when the settings are made.
            let _ = option.setting.set(&mut settings, value);
        }
        settings.simulation().map_or(noise, |simulation| simulation.scene.noise)
    }

    /// Settings of this preset at this relative noise, with what is given.
    pub(super) fn settings_at(&self, preset: Preset, relative_noise: f64) -> Result<RunSettings, Failure> {
        self.applied(preset.settings_in(self.noise(Noise::relative(relative_noise))))
    }

    /// Default settings for a recording, with what is given.
    ///
    /// # Errors
    /// Names the first given argument that is only for a simulated array.
    pub(super) fn recorded(&self, has_row_wires: bool) -> Result<RunSettings, Failure> {
        let refuse = |argument: &str, reason: &str| Err(Failure::Arguments(format!("{argument}: {reason}")));
        if self.preset.is_some() {
            return refuse("--preset", "a recording (--data) has no scene; leave it out");
        }
        if let Some(kind) = self.decoder.iter().find(|kind| kind.needs_sensor()) {
            let reason =
                "it solves the equations of a simulated array, which a recording (--data) does not have; leave it out";
            return refuse(&format!("--decoder {kind}"), reason);
        }
        let settings = self.applied(RunSettings::measured(RowModel::Shared))?;
        if settings.source.row_model() == RowModel::Each && !has_row_wires {
            return refuse("--rows known", "name the column of row-wires with --row-wire");
        }
        Ok(settings)
    }

    /// `settings` with what is given.
    fn applied(&self, mut settings: RunSettings) -> Result<RunSettings, Failure> {
        for (option, value) in &self.given.values {
            let setting = &option.setting;
            let is_columns = setting.name == "inputs" && settings.simulation().is_none();
            if !is_columns && !setting.applies(&settings) {
                return Err(Failure::Arguments(format!("--{}: {}", typed(option), instead(option))));
            }
            if let ("inputs", Value::Text(names), true) = (setting.name, value, settings.simulation().is_some())
                && names.contains(',')
            {
                let message =
                    "--inputs: columns need --data; give resistance, conductance or log for a simulated sensor";
                return Err(Failure::Arguments(message.to_owned()));
            }
            let set = setting.set(&mut settings, value);
            set.map_err(|error| Failure::Arguments(format!("--{error}")))?;
        }
        if let Some(simulation) = settings.simulation() {
            let checked: Result<(), SceneError> = simulation.scene.check();
            checked.map_err(|impossible| Failure::Arguments(impossible.to_string()))?;
        }
        Ok(settings)
    }

    /// Columns read by the network of a recording.
    pub(super) fn columns(&self) -> Vec<String> {
        match self.value("inputs") {
            Some(Value::Text(names)) => names.split(',').map(str::to_owned).collect(),
            _ => Vec::new(),
        }
    }

    /// The given decoders, or all.
    pub(super) fn decoders(&self) -> Vec<DecoderKind> {
        if self.decoder.is_empty() {
            DecoderKind::ALL.to_vec()
        } else {
            self.decoder.clone()
        }
    }
}

/// Says what to do with a recording instead of giving this setting of a simulated array.
fn instead(option: &RunOption) -> &'static str {
    match option.setting.name {
        "array" => "a recording (--data) has no array; leave it out",
        "samples" => "all rows of a recording (--data) are used; choose some with --where",
        "test samples" => {
            "a share of a recording (--data) is held out for testing; give --test-data, or --test-fraction in a recipe (decoupler inspect --recipe-out)"
        }
        "validation samples" => {
            "a share of a recording (--data) is held out for validation; give --validation-fraction in a recipe (decoupler inspect --recipe-out)"
        }
        "axes" | "loading" => "a recording (--data) has no scene; leave it out",
        _ => "a recording (--data) has its own noise; leave it out",
    }
}

// Settings of a training. Arguments that are not given have their default or the value in the checkpoint.
#[derive(Args)]
pub(super) struct TrainingArguments {
    #[command(flatten)]
    pub(super) scene: SettingsArguments<OfTrain>,
    /// Hidden nodes, or auto: the program chooses the settings [default: 12; auto for a recording]
    ///
    /// For a recording, auto chooses settings by cross-validation on the training samples, within --budget
    /// (60 seconds of one core by default): the readings, their logarithms or reciprocals; with --time, no memory, or averages
    /// with time constants from a few samples to a tenth of the recording if they are clearly better; 2 to 64 hidden nodes;
    /// min-max scaling or whitening; lm or br, or scg with weight decay where inputs are too many for the samples; the number of
    /// epochs, up to 400 (3000 of scg); and weights that begin random or at ridge regression. The answer is the best convex
    /// combination of the training mean, ridge, kernel ridge and up to four networks. What else is given here is kept. It is
    /// the default for a recording if no setting of network or training is given.
    #[arg(long, value_name = "N|auto", value_parser = hidden_nodes, help_heading = "Network and training")]
    hidden: Option<HiddenNodes>,
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
        let given = self.scene.given.values.iter();
        let mut of_training = given.filter(|(option, _)| matches!(option.part, Part::Network | Part::Training));
        let is_any_given =
            self.hidden.is_some() || !self.scene.given.of_method.is_empty() || of_training.next().is_some();
        self.asks_for_auto() || !is_any_given
    }

    /// Returns `true` if `--hidden auto` is given.
    pub(super) fn asks_for_auto(&self) -> bool {
        self.hidden == Some(HiddenNodes::Auto)
    }

    /// Given settings, which a choice keeps; `settings` are those of the run.
    ///
    /// # Errors
    /// If something is given that the choice decides.
    pub(super) fn fixed(&self, settings: &RunSettings) -> Result<AutoFixed, Failure> {
        let is_given = |name: &str| self.scene.value(name).is_some();
        for name in ["begin", "combine"] {
            if is_given(name) {
                let message =
                    format!("--{name}: --hidden auto chooses it; leave it out, or give a number of hidden nodes");
                return Err(Failure::Arguments(message));
            }
        }
        let is_method_given = is_given("method") || !self.scene.given.of_method.is_empty();
        Ok(AutoFixed {
            hidden: self.hidden(),
            method: is_method_given.then_some(settings.training.method),
            epochs: is_given("epochs").then_some(settings.training.stopping.epochs),
            starts: is_given("starts").then_some(settings.starts),
            scaling: is_given("scaling").then_some(settings.inputs.scaling),
            memory: None,
            tries_memory: false,
        })
    }

    /// Refuses `--hidden auto` where settings cannot be chosen.
    pub(super) fn refuse_auto(&self, reason: &str) -> Result<(), Failure> {
        if self.asks_for_auto() {
            return Err(Failure::Arguments(format!("--hidden auto: {reason}; give a number")));
        }
        Ok(())
    }

    /// Settings of a new run on this simulated array, by default that of the preset.
    pub(super) fn settings(&self, on: Option<Simulation>) -> Result<RunSettings, Failure> {
        self.refuse_auto("settings are chosen for a recording (--data)")?;
        self.completed(self.scene.settings(on)?)
    }

    /// Settings of a new run on a recording.
    fn recorded(&self, has_row_wires: bool) -> Result<RunSettings, Failure> {
        self.completed(self.scene.recorded(has_row_wires)?)
    }

    /// `settings` with the given hidden nodes and settings of the method.
    fn completed(&self, mut settings: RunSettings) -> Result<RunSettings, Failure> {
        settings.hidden = self.hidden().unwrap_or(settings.hidden);
        self.set_method(&mut settings.training)?;
        Ok(settings)
    }

    /// Setup of a new run on samples of `source`, or of the array described by the arguments.
    pub(super) fn setup(&self, source: Option<RecipeFile>) -> Result<Setup, Failure> {
        let plan = match source {
            None => return Ok(self.settings(None)?.into()),
            Some(RecipeFile::Simulated(simulation)) => return Ok(self.settings(Some(simulation))?.into()),
            Some(RecipeFile::Recording(plan)) => plan,
        };
        let settings = self.recorded(plan.import.row_wire.is_some())?;
        Ok(Setup::recording(settings, plan))
    }

    /// Training settings with which the run of the setup `saved` is resumed.
    ///
    /// # Errors
    /// Names the first given setting that differs.
    pub(super) fn resumed(&self, saved: &Setup) -> Result<TrainingSettings, Failure> {
        let before = saved.settings();
        let mut asked = *before;
        if let (Some(preset), Some(simulation)) = (self.scene.preset, asked.simulation_mut()) {
            simulation.scene.rows = preset.simulation_in(Noise::default()).scene.rows;
            asked.inputs = preset.settings().inputs;
        }
        let asked = self.completed(self.scene.applied(asked)?)?;
        for option in RUN_OPTIONS.iter().filter(|option| option.part != Part::Training) {
            let [now, then] = [&asked, before].map(|run| option.setting.get(run).map(|value| value.to_string()));
            check_same(&typed(option), now, then.unwrap_or_default())?;
        }
        if let Some(plan) = saved.plan() {
            let columns = self.scene.columns();
            let given = (!columns.is_empty()).then(|| columns.join(","));
            check_same("inputs", given, plan.import.inputs.join(","))?;
            self.scene.recorded(plan.import.row_wire.is_some())?;
        }
        Ok(asked.training)
    }

    /// Sets the given settings of the method.
    fn set_method(&self, training: &mut TrainingSettings) -> Result<(), Failure> {
        let method = &mut training.method;
        for (name, value) in &self.scene.given.of_method {
            let short_name = method.short_name();
            match method.settings().find(|setting| setting.word("-") == *name) {
                Some(setting) => setting.set(method, &Value::Number(*value))?,
                None => {
                    let names = Vec::from_iter(method.settings().map(|setting| setting.word("-"))).join(", ");
                    let message = format!("--set {name}: {short_name} has no such setting; it has {names}");
                    return Err(Failure::Arguments(message));
                }
            }
        }
        Ok(training.check()?)
    }
}

/// Names and defaults of the settings of each method.
fn method_settings() -> String {
    let of = |method: Method| {
        let recorded = match method {
            Method::BayesianRegularization(_) => Method::recorded_regularization(),
            method => method,
        };
        let list = method.settings().filter_map(|setting| {
            let (name, default, recorded) = (setting.word("-"), setting.number(&method)?, setting.number(&recorded)?);
            let recorded = if recorded == default {
                String::new()
            } else {
                format!("; {recorded} for a recording")
            };
            Some(format!("{name} (default {default}{recorded})"))
        });
        format!("{} has {}", method.short_name(), Vec::from_iter(list).join(", "))
    };
    Method::all().map(of).join("; ")
}

#[cfg(test)]
mod tests {
    use clap::{Command, FromArgMatches};

    use super::*;
    use decoupler_core::{dataset::Seed, scene::RowModel};
    use decoupler_files::export::report::train_command;

    fn parsed(line: &str) -> TrainingArguments {
        let command = TrainingArguments::augment_args(Command::new("train"));
        let matches = command.get_matches_from(line.split(' '));
        TrainingArguments::from_arg_matches(&matches).unwrap()
    }

    #[test]
    fn the_defaults_in_the_help_match_the_library() {
        assert_eq!(parsed("train").settings(None).unwrap(), RunSettings::default());
        let line = "train --preset paper --rows all --axes z --loading random --inputs resistance --scaling minmax \
                    --noise 0 --set noise-in=both --array 10x10_5x30 --hidden 12 --starts 1 --method lm --epochs 1000 \
                    --set goal=0 --set max-fail=6 --set min-gradient=1e-7 --samples 1000 --set test-samples=100 \
                    --set validation-samples=200 --seed 0";
        assert_eq!(parsed(line).settings(None).unwrap(), RunSettings::default());
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
        assert_eq!(rules("train --method rp --epochs 300 --set max-fail=6"), (300, 6));
    }

    /// Another value than the default of each setting, so that a new one cannot be forgotten here.
    #[test]
    fn every_setting_survives_from_option_to_printed_command() {
        let values = [
            ("array", "10x6_3x18"),
            ("rows", "3"),
            ("axes", "xyz"),
            ("loading", "smooth:2.5"),
            ("inputs", "log"),
            ("scaling", "whiten"),
            ("noise", "0.001"),
            ("noise ohm", "1e-3"),
            ("adc bits", "12"),
            ("drift", "0.01"),
            ("noise in", "training"),
            ("samples", "321"),
            ("test samples", "11"),
            ("validation samples", "0"),
            ("hidden", "7"),
            ("starts", "3"),
            ("combine", "mean"),
            ("begin", "ridge"),
            ("method", "gdm"),
            ("epochs", "17"),
            ("goal", "1e-7"),
            ("min gradient", "0"),
            ("max fail", "9"),
            ("seed", "18446744073709551615"),
        ];
        for (option, (name, value)) in RUN_OPTIONS.iter().zip(values) {
            assert_eq!(option.setting.name, name);
            let given = |value: &str| match option.is_rare() {
                true => format!("--set={}={value}", option.setting.word("-")),
                false => format!("--{}={value}", option.setting.word("-")),
            };
            let settings = parsed(&format!("train {}", given(value))).settings(None).unwrap();
            assert_ne!(settings, RunSettings::default(), "{name}");
            let command = train_command(&settings.into(), None).unwrap();
            let command = command.strip_prefix("decoupler ").unwrap();
            assert_eq!(parsed(command).settings(None).unwrap(), settings, "{command}");
            for wrong in ["", "-1", "nan", "1e999", "no such name"] {
                let line = ["train".to_owned(), given(wrong)];
                let arguments = TrainingArguments::augment_args(Command::new("train")).try_get_matches_from(line);
                let arguments = arguments.and_then(|found| TrainingArguments::from_arg_matches(&found));
                let settings = arguments.map(|arguments| arguments.settings(None));
                assert!(matches!(settings, Err(_) | Ok(Err(_))), "{name} {wrong}");
            }
        }
    }

    #[test]
    fn the_command_in_a_report_gives_the_settings_of_the_run() {
        let lines = [
            "train",
            "train --preset best --array 10x6_3x18 --hidden 7 --seed 18446744073709551615",
            "train --rows 3 --axes xyz --loading smooth:2.5 --noise 1e-3 --set noise-ohm=0.1 --set adc-bits=12 --set \
             drift=0.0123 --set noise-in=training --inputs log --scaling whiten --starts 4",
            "train --loading indenter:flat-punch --method gdm --set learning-rate=0.3 --epochs 77 --set goal=1e-5 --set \
             max-fail=9 --set min-gradient=0 --samples 123 --set test-samples=17 --set validation-samples=0",
        ];
        for line in lines {
            let settings = parsed(&line.split_whitespace().collect::<Vec<_>>().join(" "))
                .settings(None)
                .unwrap();
            let command = train_command(&settings.into(), None).unwrap();
            let command = command.strip_prefix("decoupler ").unwrap();
            assert_eq!(parsed(command).settings(None).unwrap(), settings, "{command}");
        }
    }
}
