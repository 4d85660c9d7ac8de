use std::{path::Path, time::Duration};

use thiserror::Error;

use super::{command::train_command, html::Html, pictures::pictures, settings::settings_facts};
use crate::{
    evaluation::{DecoderReport, Errors, Outlook, ReferenceNote, RunError, RunFlaw, SimulatedSettings, error_remarks},
    export::{
        Cell, NetworkFile, Table, TableColumn, WriteError, atomic_write, decoder_table, document::PROGRAM, error_table,
        figures::dark_style, format_duration, format_percent,
    },
    sensor::{Geometry, counted},
    training::StopReason,
};

/// A run to be reported.
#[derive(Clone, Copy, Debug)]
pub struct RunReport<'a> {
    /// Name that the user gave it.
    pub name: Option<&'a str>,
    /// Its network, record and errors.
    pub file: &'a NetworkFile,
    /// Defect of its training.
    pub flaw: Option<&'a RunFlaw>,
    /// Other decoders on its test set, as far as they were measured.
    pub decoders: &'a [DecoderReport],
}

/// Reasons for which a report cannot be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The test set cannot be drawn.
    #[error("the test set of the run cannot be drawn: {0}")]
    Run(#[from] RunError),
    /// The file.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl RunReport<'_> {
    /// Writes the report atomically.
    ///
    /// # Errors
    /// The test set cannot be drawn, or the path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ReportError> {
        let html = self.html()?;
        Ok(atomic_write(path, |writer| writer.write_all(html.as_bytes()))?)
    }

    /// Returns the report as HTML.
    ///
    /// # Errors
    /// The test set cannot be drawn.
    pub fn html(&self) -> Result<String, RunError> {
        let Self { file, decoders, .. } = *self;
        let settings = self.settings();
        let test = settings.draw_test()?;
        let decoupled_mm = file.network.decouple(&test);
        let title = self.title();
        let mut html = Html::default();
        html.element("h1", "", &title);
        html.element("p", "dim", &self.summary());
        for remark in self.remarks() {
            html.element("p", "warning", &remark);
        }
        let baselines = &file.scores.baselines;
        html.section("Errors on the test set", |html| {
            html.table(&error_table(&file.error_table()), "network");
            let text = "Means of |error|, in percent of the coordinate as in the paper, in mm, or in percent of the \
                        stroke. The reference is the error that remains given the noise and the loading of the scene; \
                        training mean and linear map are what a network has to beat.";
            html.element("p", "dim", text);
        });
        if !decoders.is_empty() {
            html.section("Decoders", |html| {
                let reference = baselines.reference.as_ref().and_then(|errors| errors.nodes());
                html.table(&decoder_table(decoders, reference), "Network");
                let text = "The residual is the rms relative difference between the readings and those of the decoded \
                            deformation; it needs no ground truth. Times are those of a frame on one thread.";
                html.element("p", "dim", text);
            });
        }
        html.section("Figures", |html| {
            for (number, (caption, figure)) in pictures(file, &settings, &test, &decoupled_mm).into_iter().enumerate() {
                html.figure(&caption, &figure.draw().inline_svg(number, &caption));
            }
        });
        if file.training.starts.len() > 1 {
            html.section("Starts", |html| html.table(&self.starts_table(), ""));
        }
        html.section("Settings", |html| {
            html.facts(&settings_facts(file, &settings));
            for note in settings.source.sensor.scale.note().iter().map(String::as_str) {
                html.element("p", "dim", note);
            }
            html.element("p", "dim", Geometry::ASSUMPTION);
        });
        html.section("How to repeat it", |html| self.repeat(html));
        Ok(html.finish(&title, &format!("{}{}", include_str!("style.css"), dark_style())))
    }

    /// Settings of the run.
    fn settings(&self) -> SimulatedSettings {
        self.file.settings.simulated().expect("the run is simulated")
    }

    fn title(&self) -> String {
        let settings = self.settings();
        let what = format!(
            "{}, {}, seed {}",
            settings.source.sensor.scale,
            counted(settings.hidden, "hidden node"),
            settings.seed
        );
        match self.name {
            Some(name) => format!("{name}: {what}"),
            None => what,
        }
    }

    /// The course of the training in two sentences.
    fn summary(&self) -> String {
        let training = &self.file.training;
        let reason = training
            .stop_reason
            .map_or("not ended".to_owned(), |reason| reason.to_string());
        let time = Duration::try_from_secs_f64(training.seconds).unwrap_or_default();
        format!(
            "Z error {} on the test set. Trained for {}, {} on one thread ({reason}); weights kept from epoch {}.",
            format_percent(self.file.scores.network.percent()),
            counted(self.last_epoch(), "epoch"),
            format_duration(time),
            training.best_epoch
        )
    }

    fn last_epoch(&self) -> usize {
        self.file.training.history.last().map_or(0, |record| record.epoch)
    }

    /// Everything that a reader has to weigh, with cause and cure.
    fn remarks(&self) -> Vec<String> {
        let Self { file, decoders, .. } = *self;
        let settings = self.settings();
        let mut remarks = Vec::from_iter(self.flaw.map(ToString::to_string));
        let outlook = Outlook::of(&settings.source).ok();
        remarks.extend(
            outlook
                .iter()
                .flat_map(|outlook| &outlook.warnings)
                .map(ToString::to_string),
        );
        let reason = file.training.stop_reason;
        let of_rows = error_remarks(&settings, &file.scores, reason);
        remarks.extend(of_rows.iter().map(|(row, remark)| format!("{row}: {remark}")));
        let baselines = &file.scores.baselines;
        let [ours, linear] =
            [&file.scores.network, &baselines.linear].map(|errors| errors.nodes().map(|errors| errors.z_mm));
        if ours > linear
            && let Some(reason) = reason
        {
            let remedy = reason.remedy(&file.settings.training.method);
            remarks.push(format!(
                "a linear map of the resistances is better on z than this network: {remedy}"
            ));
        }
        remarks.extend(ReferenceNote::of(baselines).map(|note| note.to_string()));
        if baselines
            .reference
            .as_ref()
            .and_then(|errors| errors.nodes())
            .is_some_and(Errors::is_rounding)
        {
            let text = "the reference is nothing but rounding: the readings determine the deformation, and no ratio to \
                        it is given";
            remarks.push(text.to_owned());
        }
        for decoder in decoders {
            let name = decoder.kind.name(decoder.precision);
            remarks.extend(decoder.remarks.iter().map(|remark| format!("{name}: {remark}")));
        }
        remarks.into_iter().map(|remark| sentence(&remark)).collect()
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
        let row = |(number, start): (usize, &crate::evaluation::StartRecord)| -> Vec<Cell> {
            vec![
                (number + 1).into(),
                start.train_mse.into(),
                start.validation_mse.into(),
                start.z_percent.into(),
                start.epochs.into(),
                start.best_epoch.into(),
            ]
        };
        Table {
            columns: columns.to_vec(),
            rows: starts.map(row).collect(),
        }
    }

    /// The command of the terminal, and what it does not repeat.
    fn repeat(&self, html: &mut Html) {
        let training = &self.file.training;
        let mut settings = self.settings();
        if let Some(first) = training.stages.first() {
            settings.training.method = first.method;
        }
        let is_cut_short = matches!(training.stop_reason, None | Some(StopReason::Stopped));
        if is_cut_short {
            settings.training.stopping.epochs = self.last_epoch().max(1);
        }
        match train_command(&settings) {
            Ok(command) => {
                html.element(
                    "p",
                    "",
                    "In a terminal, the same version of the program gives the same network with:",
                );
                html.element("pre", "", &command);
            }
            Err(gap) => {
                let text = format!("No command repeats this run: {gap}. The window does, with the settings above.");
                html.element("p", "", &text);
            }
        }
        if let Some(second) = training.stages.get(1) {
            let text = format!(
                "This trains with the first method only; the run changed its method at epoch {}. A checkpoint resumed with \
                 --method continues with another.",
                second.first_epoch
            );
            html.element("p", "warning", &text);
        } else if is_cut_short {
            html.element(
                "p",
                "dim",
                "The run was cut short: the command ends after as many epochs.",
            );
        }
        let program = &self.file.program;
        let mut text = format!("Report by {PROGRAM}");
        if program != PROGRAM {
            text += &format!("; the network was saved by {program}");
        }
        html.element("p", "dim", &format!("{text}."));
    }
}

/// The text with a capital and one full stop.
fn sentence(text: &str) -> String {
    let mut letters = text.trim_end_matches('.').chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).chain(['.']).collect()
}
