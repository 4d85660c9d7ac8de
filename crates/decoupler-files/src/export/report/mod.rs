//! The report of a run: one self-contained HTML file, for any browser and for print.

mod command;
mod html;
mod pictures;

#[cfg(test)]
mod tests;

pub use command::{CommandGap, changed_options, quoted, train_command};

use std::{fmt::Display, path::Path, time::Duration};

use self::{
    command::{division_options, file_options},
    html::{Block, document, text},
    pictures::pictures,
};
use super::{
    NetworkFile, Table, WriteError, atomic_write, decoder_table, describe_determinacy, describe_search,
    describe_worse_than_ridge, document::PROGRAM, error_table, format_duration, format_percent, search_table,
    sweep::flatten, table::cell, unfinished::folder_of,
};
use crate::import::{Setup, stored};
use decoupler_core::{
    dataset::{Dataset, Simulation, SplitBy},
    evaluation::{
        Combination, DecoderReport, ErrorTable, Errors, Outlook, RUN_OPTIONS, RunOption, StartRecord, TestErrors,
        best_start, error_remarks,
        recorded::{Determination, HysteresisLoop},
    },
    problem::Channel,
    scene::RowModel,
    sensor::Geometry,
    text::{capitalised, counted},
    training::StopReason,
};
use ndarray::Array2;
use serde_json::json;

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
        let mut blocks = vec![Block::Note(self.summary())];
        blocks.extend(self.results(&loops));
        blocks.extend(self.training(&setup));
        text(&blocks)
    }

    fn setup(&self, folder: &Path) -> Setup {
        let plan = self.file.recorded.as_ref().map(|recorded| &recorded.plan);
        let plan = plan.map(|plan| plan.with_paths(|file| stored(file, folder)));
        let setup = Setup::of(self.file.settings, plan);
        setup.expect("a file of a recording has its plan")
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
        let Self { file, test, .. } = *self;
        let setup = self.setup(folder);
        let (answers, loops) = self.answers(&setup);
        let sentence = |remark: String| Block::Warning(capitalised(remark.trim_end_matches('.')) + ".");
        let mut blocks = vec![Block::Note(self.summary())];
        blocks.extend(self.remarks_on(&setup, &answers).into_iter().map(sentence));
        blocks.extend(self.results(&loops));
        blocks.push(Block::Heading("Figures"));
        let pictures = pictures(file, test, &answers, &loops).into_iter();
        blocks.extend(pictures.map(|(caption, figure)| Block::Figure(caption, Box::new(figure))));
        blocks.extend(self.training(&setup));
        blocks.push(Block::Heading("Repeating this run"));
        blocks.extend(self.repeat(&setup));
        blocks
    }

    /// Tables of errors.
    fn results(&self, loops: &[Option<HysteresisLoop>]) -> Vec<Block> {
        let Self { file, decoders, .. } = *self;
        let is_array = file.problem.has_nodes();
        let note =
            |of_array: &str, of_recording: &str| Block::Note(if is_array { of_array } else { of_recording }.to_owned());
        let mut tables = file.error_table();
        ErrorTable::add_loops(&mut tables, loops);
        let mut blocks = vec![
            Block::Heading("Errors on the test set"),
            Block::Table(error_table(&tables), "network"),
            note(
                "Means of |error|, in percent of the coordinate as in the paper, in mm, or in percent of the stroke. \
                 The model-based decoder knows the equations, the noise, and mean and covariance of the loading; \
                 training mean and linear map are what a network has to beat.",
                "RMSE, MAE and worst are in the unit of the target. R² is the share of the target's variance that the \
                 answers explain: 1 is exact, 0 is no better than the mean. Training mean and ridge regression are what \
                 a network has to beat.",
            ),
        ];
        let model_based = file.scores.baselines.model_based.as_ref();
        if model_based.and_then(TestErrors::nodes).is_some_and(Errors::is_rounding) {
            let text = "The model-based error is nothing but rounding: the readings determine the deformation, and no ratio \
                        to it is given.";
            blocks.push(Block::Note(text.to_owned()));
        }
        if !decoders.is_empty() {
            blocks.extend([
                Block::Heading("Decoders"),
                Block::Table(decoder_table(&file.problem, decoders, model_based), "Network"),
                note(
                    "The residual is the rms relative difference between the readings and those of the decoded \
                     deformation; it needs no ground truth. Times are those of a frame on one thread.",
                    "Times are those of a frame on one thread. All decoders were fitted to the same samples.",
                ),
            ]);
        }
        blocks
    }

    /// Starts, choice of settings, and settings.
    fn training(&self, setup: &Setup) -> Vec<Block> {
        let Self { file, .. } = *self;
        let mut blocks = Vec::new();
        if file.training.starts.len() > 1 {
            let best = best_start(&file.training.starts).map_or(0, |best| best + 1);
            let note = match file.settings.combine {
                Combination::Best => format!("Number {best}, with the lowest error, is kept."),
                Combination::Mean => format!("The network is their mean; number {best} has the lowest error."),
            };
            blocks.extend([
                Block::Heading("Starts"),
                Block::Table(self.starts_table(), ""),
                Block::Note(note),
            ]);
        }
        if let Some(search) = file.recorded.as_ref().and_then(|recorded| recorded.search.as_ref()) {
            blocks.extend([
                Block::Heading("Choice of settings"),
                Block::Note(format!("{}.", describe_search(search))),
                Block::Table(search_table(search), ""),
            ]);
        }
        let settings = self.settings(setup).into_iter();
        let settings = settings.map(|(name, value)| vec![capitalised(&name).into(), value.into()]);
        blocks.extend([
            Block::Heading("Settings"),
            Block::Table(Table::of_headings(["Setting", "Value"], settings), ""),
        ]);
        if let Some(simulation) = file.settings.simulation() {
            blocks.extend(simulation.sensor.scale.note().map(Block::Note));
            blocks.push(Block::Note(Geometry::ASSUMPTION.to_owned()));
        }
        blocks
    }

    fn title(&self) -> String {
        let Self { name, file, .. } = *self;
        let (source, seed) = (file.source_name(), file.settings.seed);
        let name = name.map_or(String::new(), |name| format!("{name}: "));
        let hidden = counted(file.settings.hidden, "hidden node");
        format!("{name}{source}, {hidden}, seed {seed}")
    }

    /// Summary of the training in two sentences.
    fn summary(&self) -> String {
        let Self { file, .. } = *self;
        let training = &file.training;
        let reason = training.stop_reason;
        let reason = reason.map_or("not ended".to_owned(), |reason| reason.to_string());
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
            "{error}. Trained for {} in {} ({reason}); weights kept from epoch {}.",
            counted(training.epochs, "epoch"),
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
        self.remarks_on(&setup, &self.file.decoder().answers_to(self.test))
    }

    fn remarks_on(&self, setup: &Setup, answers: &Array2<f64>) -> Vec<String> {
        let Self { file, .. } = *self;
        let NetworkFile { problem, scores, .. } = file;
        let mut remarks = Vec::from_iter(self.defect.map(str::to_owned));
        if let Some(simulation) = setup.settings().simulation() {
            let outlook = Outlook::of(simulation).ok();
            let warnings = outlook.iter().flat_map(|outlook| &outlook.warnings);
            remarks.extend(warnings.map(ToString::to_string));
            let reason = file.training.stop_reason;
            let of_rows = error_remarks(&file.settings, scores, reason);
            remarks.extend(of_rows.iter().map(|(row, remark)| format!("{row}: {remark}")));
            let z_mm = |errors: &TestErrors| errors.nodes().map(|errors| errors.z_mm);
            let linear_is_better = z_mm(&scores.network) > z_mm(&scores.baselines.linear);
            if let Some(reason) = reason.filter(|_| linear_is_better) {
                let remedy = reason.remedy(&file.settings.training.method);
                remarks.push(format!(
                    "a linear map of the resistances is better on z than this network: {remedy}"
                ));
            }
            remarks.extend(scores.baselines.model_based_note().map(str::to_owned));
        }
        if let Some(plan) = setup.plan() {
            let measured = Determination::measure(self.test, answers.view(), plan.division.by);
            let is_combined = file.combined().is_some();
            remarks.extend(describe_determinacy(&problem.targets, &measured, is_combined));
            remarks.extend(describe_worse_than_ridge(problem, scores));
            let is_optimistic = (plan.test_order() == SplitBy::Random).then_some(
                "test samples are drawn at random, which is optimistic where neighbouring samples are similar; split by time \
                 or by group for an honest test",
            );
            remarks.extend(is_optimistic.map(str::to_owned));
        }
        for decoder in self.decoders {
            let name = decoder.kind.name(decoder.precision);
            remarks.extend(decoder.remarks.iter().map(|remark| format!("{name}: {remark}")));
        }
        remarks
    }

    fn starts_table(&self) -> Table {
        let row = |(number, start): (usize, &StartRecord)| {
            let mut cells = vec![
                cell(("start", "Start", ""), number + 1),
                cell(("train_mse", "training mse", ""), start.train_mse),
                cell(("validation_mse", "validation mse", ""), start.validation_mse),
                cell(("z_percent", "Z", "%"), start.percent()),
                cell("epochs", start.epochs),
                cell(("best_epoch", "best epoch", ""), start.best_epoch),
            ];
            cells.retain(|(column, _)| self.file.problem.has_nodes() || column.field != "z_percent");
            cells
        };
        Table::of_rows(self.file.training.starts.iter().enumerate().map(row))
    }

    /// Names and values of all settings.
    fn settings(&self, setup: &Setup) -> Vec<(String, String)> {
        let Self { file, test, .. } = *self;
        let settings = setup.settings();
        let mut rows = Vec::new();
        let mut add = |name: &str, value: &dyn Display| rows.push((name.to_owned(), value.to_string()));
        if let Some(plan) = setup.plan() {
            let options = file_options(plan, None).into_iter().chain(division_options(plan, None));
            options.for_each(|(option, value)| add(&option.replace('-', " "), &value));
            let titles = |channels: &[Channel]| Vec::from_iter(channels.iter().map(Channel::title)).join(", ");
            add("readings", &titles(&file.problem.inputs));
            add("answers", &titles(&file.problem.targets));
            add("test samples", &test.samples());
            add("quantity of the inputs", &settings.inputs.quantity);
            let networks = match settings.source.row_model() {
                RowModel::Each => "a network for each",
                RowModel::Shared => "one network for all",
            };
            let rows = file.row_wires.as_ref();
            let rows = rows.map(|rows| format!("{}, {networks}", rows.len()));
            add("row-wires", &rows.as_deref().unwrap_or("not known"));
        }
        for RunOption { setting, .. } in &RUN_OPTIONS {
            let value = setting.get(settings).map(|value| value.to_string()).unwrap_or_default();
            // The methods follow.
            if !value.is_empty() && setting.name != "method" {
                add(setting.name, &value);
            }
        }
        for (number, stage) in file.training.stages.iter().enumerate() {
            let name = match number {
                0 => "method".to_owned(),
                _ => format!("method from epoch {}", stage.first_epoch),
            };
            add(&name, &stage.method);
            for setting in stage.method.settings() {
                let value = setting.get(&stage.method).map(|value| value.to_string());
                add(setting.name, &value.unwrap_or_default());
            }
        }
        add("weights", &file.network.weights());
        if let Some(Simulation { sensor, scene, .. }) = settings.simulation() {
            // What the table does not contain, by its names in recipes.
            let source = json!({
                "geometry": sensor.geometry,
                "resistivity_ohm_per_mm": sensor.resistivity_ohm_per_mm,
                "largest_compression": scene.largest_compression,
                "movement": scene.movement,
                "loading": scene.loading,
            });
            flatten(&source, "", &mut |place, value| {
                // Names are in the table.
                if value.is_number() {
                    add(&place.replace(['.', '_'], " "), value);
                }
            });
        }
        rows
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
            settings.training.stopping.epochs = training.epochs.max(1);
        }
        let mut blocks = match train_command(&setup.with_settings(settings), None) {
            Ok(command) => {
                let place = match setup.plan() {
                    None => "In a terminal",
                    Some(_) => "In a terminal, in the folder of this report",
                };
                let text = format!("{place}, the same version of the program gives the same network with:");
                vec![Block::Text(text), Block::Command(command)]
            }
            Err(gap) => vec![Block::Text(format!(
                "No command repeats this run: {gap}. It can be repeated in the window with the settings above."
            ))],
        };
        if let Some(second) = training.stages.get(1) {
            blocks.push(Block::Warning(format!(
                "This trains with the first method only; the run changed its method at epoch {}. A checkpoint resumed with \
                 --method continues with another.",
                second.first_epoch
            )));
        } else if is_cut_short {
            let text = "The run was stopped early; the command stops at the same epoch.";
            blocks.push(Block::Note(text.to_owned()));
        }
        let saved = match &self.file.program {
            program if program == PROGRAM => String::new(),
            program => format!("; the network was saved by {program}"),
        };
        blocks.push(Block::Note(format!("Report by {PROGRAM}{saved}.")));
        blocks
    }
}
