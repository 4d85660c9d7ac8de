use std::{path::Path, time::Duration};

use decoupler_core::{
    dataset::{Dataset, Simulation},
    evaluation::{
        Combination, DecoderReport, ErrorTable, Errors, Outlook, StartRecord, TestErrors, best_start, error_remarks,
        recorded::{Determination, HysteresisLoop},
    },
    sensor::Geometry,
    text::counted,
    training::StopReason,
};

use ndarray::Array2;

use super::{
    command::train_command,
    html::{Block, Tone, document, text},
    pictures::pictures,
    settings::{recording_facts, settings_facts},
};
use crate::{
    export::{
        Cell, NetworkFile, Table, TableColumn, WriteError, atomic_write, decoder_table, describe_determinacy,
        describe_search, describe_worse_than_ridge, document::PROGRAM, error_table, format_duration, format_percent,
        search_table, unfinished::folder_of,
    },
    import::{Plan, Setup},
};

/// A run to be reported: of a simulated array or a recording.
#[derive(Clone, Copy, Debug)]
pub struct RunReport<'a> {
    /// Name that the user gave it.
    pub name: Option<&'a str>,
    /// Its network, record and errors.
    pub file: &'a NetworkFile,
    /// Defect of its training, if there is one.
    pub defect: Option<&'a str>,
    /// Other decoders that were measured on its test set.
    pub decoders: &'a [DecoderReport],
    /// Its test set: [`Run::test`](decoupler_core::evaluation::Run::test), or [`NetworkFile::test_set`], which draws or reads it again.
    pub test: &'a Dataset,
}

impl RunReport<'_> {
    /// Writes the report atomically. It names recordings relative to its folder.
    ///
    /// # Errors
    /// The path cannot be written.
    ///
    /// # Panics
    /// If the test set does not belong to the run.
    pub fn save(&self, path: &Path) -> Result<(), WriteError> {
        let html = self.html(folder_of(path));
        atomic_write(path, |writer| writer.write_all(html.as_bytes()))
    }

    /// Returns the report as HTML for a file in `folder`.
    ///
    /// # Panics
    /// If the test set does not belong to the run.
    pub fn html(&self, folder: &Path) -> String {
        document(&self.title(), &self.blocks(folder))
    }

    /// Returns the report as text for a terminal: without its warnings, figures and command.
    ///
    /// # Panics
    /// If the test set does not belong to the run.
    pub fn text(&self) -> String {
        let setup = self.setup(Path::new(""));
        let (_, loops) = self.answers(&setup);
        let mut blocks = vec![Block::dim(self.summary())];
        blocks.extend(self.results(&setup, &loops));
        blocks.extend(self.training(&setup, Path::new("")));
        text(&blocks)
    }

    /// Answers to the test set, and the loops of loading and unloading in them.
    fn answers(&self, setup: &Setup) -> (Array2<f64>, Vec<Option<HysteresisLoop>>) {
        let answers = self.file.decoder().answers_to(self.test);
        let loops = setup.plan().map_or_else(Vec::new, |plan| {
            HysteresisLoop::of_test(self.test, answers.view(), plan.test_order())
        });
        (answers, loops)
    }

    fn blocks(&self, folder: &Path) -> Vec<Block> {
        let setup = self.setup(folder);
        let (answers, loops) = self.answers(&setup);
        let mut blocks = vec![Block::dim(self.summary())];
        let remarks = self.remarks_on(&setup, &answers).into_iter();
        blocks.extend(remarks.map(|remark| Block::Text(Tone::Warning, sentence(&remark))));
        blocks.extend(self.results(&setup, &loops));
        blocks.push(Block::Heading("Figures"));
        let pictures = pictures(self.file, self.test, &answers, &loops).into_iter();
        blocks.extend(pictures.map(|(caption, figure)| Block::Figure(caption, Box::new(figure))));
        blocks.extend(self.training(&setup, folder));
        blocks.push(Block::Heading("Repeating this run"));
        blocks.extend(self.repeat(&setup));
        blocks
    }

    /// Tables of errors.
    fn results(&self, setup: &Setup, loops: &[Option<HysteresisLoop>]) -> Vec<Block> {
        let Self { file, decoders, .. } = *self;
        let is_array = setup.plan().is_none();
        let mut tables = file.error_table();
        ErrorTable::add_loops(&mut tables, loops);
        let mut blocks = Vec::from([
            Block::Heading("Errors on the test set"),
            Block::Table(error_table(&tables), "network"),
            Block::dim(if is_array {
                "Means of |error|, in percent of the coordinate as in the paper, in mm, or in percent of the stroke. \
                 The model-based decoder knows the equations, the noise, and mean and covariance of the loading; \
                 training mean and linear map are what a network has to beat."
            } else {
                "RMSE, MAE and worst are in the unit of the target. R² is the share of the target's variance that the \
                 answers explain: 1 is exact, 0 is no better than the mean. Training mean and ridge regression are what \
                 a network has to beat."
            }),
        ]);
        let model_based = file.scores.baselines.model_based.as_ref().and_then(TestErrors::nodes);
        if model_based.is_some_and(Errors::is_rounding) {
            blocks.push(Block::dim(
                "The model-based error is nothing but rounding: the readings determine the deformation, and no ratio to it \
                 is given.",
            ));
        }
        if !decoders.is_empty() {
            let model_based = file.scores.baselines.model_based.as_ref();
            blocks.extend([
                Block::Heading("Decoders"),
                Block::Table(decoder_table(&file.problem, decoders, model_based), "Network"),
                Block::dim(if is_array {
                    "The residual is the rms relative difference between the readings and those of the decoded \
                     deformation; it needs no ground truth. Times are those of a frame on one thread."
                } else {
                    "Times are those of a frame on one thread. All decoders were fitted to the same samples."
                }),
            ]);
        }
        blocks
    }

    /// Starts, choice of settings, and settings.
    fn training(&self, setup: &Setup, folder: &Path) -> Vec<Block> {
        let (file, mut blocks) = (self.file, Vec::new());
        if file.training.starts.len() > 1 {
            blocks.extend([Block::Heading("Starts"), Block::Table(self.starts_table(), "")]);
            let best = best_start(&file.training.starts).map_or(0, |best| best + 1);
            blocks.push(Block::dim(match file.settings.combine {
                Combination::Best => format!("Number {best}, with the lowest error, is kept."),
                Combination::Mean => format!("The network is their mean; number {best} has the lowest error."),
            }));
        }
        if let Some(search) = file.recorded.as_ref().and_then(|recorded| recorded.search.as_ref()) {
            blocks.extend([
                Block::Heading("Choice of settings"),
                Block::dim(format!("{}.", describe_search(search))),
                Block::Table(search_table(search), ""),
            ]);
        }
        blocks.push(Block::Heading("Settings"));
        match (setup.settings().simulation(), &file.recorded) {
            (Some(simulation), _) => {
                blocks.push(Block::Facts(settings_facts(file, simulation)));
                blocks.extend(simulation.sensor.scale.note().map(Block::dim));
                blocks.push(Block::dim(Geometry::ASSUMPTION));
            }
            (None, Some(recorded)) => {
                let recorded = recorded.relative_to(folder);
                blocks.push(Block::Facts(recording_facts(file, &recorded, self.test)));
            }
            (None, None) => {}
        }
        blocks
    }

    /// Setup of the run, with paths for a file in `folder`.
    fn setup(&self, folder: &Path) -> Setup {
        let plan = self
            .file
            .recorded
            .as_ref()
            .map(|recorded| recorded.relative_to(folder).plan);
        Setup::of(self.file.settings, plan).expect("a file of a recording has its plan")
    }

    fn title(&self) -> String {
        let what = format!(
            "{}, {}, seed {}",
            self.file.source_name(),
            counted(self.file.settings.hidden, "hidden node"),
            self.file.settings.seed
        );
        match self.name {
            Some(name) => format!("{name}: {what}"),
            None => what,
        }
    }

    /// Summary of the training in two sentences.
    fn summary(&self) -> String {
        let Self { file, .. } = *self;
        let training = &file.training;
        let reason = training
            .stop_reason
            .map_or("not ended".to_owned(), |reason| reason.to_string());
        let time = Duration::try_from_secs_f64(training.seconds).unwrap_or_default();
        let error = format_percent(file.scores.network.percent());
        let error = match file.scores.network {
            TestErrors::Nodes(_) => format!("Z error {error} on the test set"),
            TestErrors::Targets(_) => format!(
                "Mean absolute error {error} of the range on the test set, averaged over {}",
                counted(file.problem.targets.len(), "target")
            ),
        };
        format!(
            "{error}. Trained for {}, {} on one thread ({reason}); weights kept from epoch {}.",
            counted(training.epochs(), "epoch"),
            format_duration(time),
            training.best_epoch
        )
    }

    /// Returns all warnings and remarks on the run, with cause and remedy.
    ///
    /// # Panics
    /// If the test set does not belong to the run.
    pub fn remarks(&self) -> Vec<String> {
        let setup = self.setup(Path::new(""));
        let answers = self.file.decoder().answers_to(self.test);
        self.remarks_on(&setup, &answers)
    }

    fn remarks_on(&self, setup: &Setup, answers: &Array2<f64>) -> Vec<String> {
        let mut remarks = Vec::from_iter(self.defect.map(str::to_owned));
        match (setup.settings().simulation(), setup.plan()) {
            (Some(simulation), _) => remarks.extend(self.array_remarks(simulation)),
            (None, Some(plan)) => remarks.extend(self.recording_remarks(plan, answers)),
            (None, None) => {}
        }
        for decoder in self.decoders {
            let name = decoder.kind.name(decoder.precision);
            remarks.extend(decoder.remarks.iter().map(|remark| format!("{name}: {remark}")));
        }
        remarks
    }

    fn array_remarks(&self, simulation: &Simulation) -> Vec<String> {
        let Self { file, .. } = *self;
        let outlook = Outlook::of(simulation).ok();
        let warnings = outlook.iter().flat_map(|outlook| &outlook.warnings);
        let mut remarks = Vec::from_iter(warnings.map(ToString::to_string));
        let reason = file.training.stop_reason;
        let of_rows = error_remarks(&file.settings, &file.scores, reason);
        remarks.extend(of_rows.iter().map(|(row, remark)| format!("{row}: {remark}")));
        let baselines = &file.scores.baselines;
        let (Some(network), Some(linear)) = (file.scores.network.nodes(), baselines.linear.nodes()) else {
            return remarks;
        };
        if network.z_mm > linear.z_mm
            && let Some(reason) = reason
        {
            let remedy = reason.remedy(&file.settings.training.method);
            remarks.push(format!(
                "a linear map of the resistances is better on z than this network: {remedy}"
            ));
        }
        remarks.extend(baselines.model_based_note().map(str::to_owned));
        remarks
    }

    fn recording_remarks(&self, plan: &Plan, answers: &Array2<f64>) -> Vec<String> {
        let measured = Determination::measure(self.test, answers.view(), plan.division.by);
        let mut remarks = describe_determinacy(&self.file.problem.targets, &measured, self.file.combined().is_some());
        let NetworkFile { problem, scores, .. } = self.file;
        remarks.extend(describe_worse_than_ridge(problem, scores));
        if plan.is_optimistic() {
            let text = "test samples are drawn at random, which is optimistic where neighbouring rows are similar; split \
                        by time or by group for an honest test";
            remarks.push(text.to_owned());
        }
        remarks
    }

    fn starts_table(&self) -> Table {
        let columns = [
            TableColumn::new("start", "Start", ""),
            TableColumn::new("train_mse", "training mse", ""),
            TableColumn::new("validation_mse", "validation mse", ""),
            TableColumn::new("z_percent", "Z", "%"),
            TableColumn::new("epochs", "epochs", ""),
            TableColumn::new("best_epoch", "best epoch", ""),
        ];
        let starts = self.file.training.starts.iter().enumerate();
        let row = |(number, start): (usize, &StartRecord)| -> Vec<Cell> {
            vec![
                (number + 1).into(),
                start.train_mse.into(),
                start.validation_mse.into(),
                start.percent().into(),
                start.epochs.into(),
                start.best_epoch.into(),
            ]
        };
        let mut table = Table {
            columns: columns.to_vec(),
            rows: starts.map(row).collect(),
        };
        if !self.file.problem.has_nodes() {
            table.remove_column("z_percent");
        }
        table
    }

    /// Returns the terminal command that repeats the run, and its limitations.
    fn repeat(&self, setup: &Setup) -> Vec<Block> {
        let training = &self.file.training;
        let mut settings = *setup.settings();
        if let Some(first) = training.stages.first() {
            settings.training.method = first.method;
        }
        let is_cut_short = matches!(training.stop_reason, None | Some(StopReason::Stopped));
        if is_cut_short {
            settings.training.stopping.epochs = training.epochs().max(1);
        }
        let plain = |text: String| Block::Text(Tone::Plain, text);
        let mut blocks = match train_command(&setup.with_settings(settings), None) {
            Ok(command) => {
                let place = match setup.plan() {
                    None => "In a terminal",
                    Some(_) => "In a terminal, in the folder of this report",
                };
                let text = format!("{place}, the same version of the program gives the same network with:");
                vec![plain(text), Block::Command(command)]
            }
            Err(gap) => vec![plain(format!(
                "No command repeats this run: {gap}. It can be repeated in the window with the settings above."
            ))],
        };
        if let Some(second) = training.stages.get(1) {
            let text = format!(
                "This trains with the first method only; the run changed its method at epoch {}. A checkpoint resumed with \
                 --method continues with another.",
                second.first_epoch
            );
            blocks.push(Block::Text(Tone::Warning, text));
        } else if is_cut_short {
            let text = "The run was stopped early; the command stops at the same epoch.";
            blocks.push(Block::dim(text));
        }
        let program = &self.file.program;
        let saved = if program == PROGRAM {
            String::new()
        } else {
            format!("; the network was saved by {program}")
        };
        blocks.push(Block::dim(format!("Report by {PROGRAM}{saved}.")));
        blocks
    }
}

/// Returns the text with an initial capital and one full stop.
fn sentence(text: &str) -> String {
    let mut letters = text.trim_end_matches('.').chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).chain(['.']).collect()
}
