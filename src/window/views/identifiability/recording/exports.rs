//! Exports of the analysis and of the cross-validation of a recording.

use super::{RecordingStudy, study::RecordingFindings, view::shown_curve_figure};
use crate::window::shared::{Export, FileWords, copy_exports, csv_export, picture_exports};
use decoupler_files::{
    export::{Cell, Table, TableColumn, error_table},
    figure::Figure,
};

const CHANNELS: FileWords = FileWords {
    kind: "channel table",
    description: "How much the error of each target grows without each channel, with every digit, as CSV.",
    extensions: &["csv"],
};

const HELD_OUT: FileWords = FileWords {
    kind: "cross-validation table",
    description: "Errors of each target over all samples, each tested by models fitted to the other folds, with every \
                  digit, as CSV.",
    extensions: &["csv"],
};

/// The learning curve, the channels, and the errors of the cross-validation.
pub fn study_exports(study: &RecordingStudy) -> Vec<Export<'_>> {
    let nothing = || "The readings are not analysed yet: press “Analyse readings” first.".to_owned();
    let of_source = |source: &str, what: &str| format!("{source}-{what}");
    let found = study.found.as_deref().ok_or_else(nothing);
    let stem = |what: &str| {
        let source = found.as_ref().map_or(String::new(), |found| found.setup.source_name());
        of_source(&source, what)
    };
    let curve = shown_curve_figure(study).ok_or_else(nothing);
    let curve = curve.map(|figure| move || Figure::from(figure.clone()));
    let mut exports: Vec<Export<'_>> = picture_exports("Learning curve", stem("learning-curve"), curve).collect();
    let channels = found.clone().map(|found| move || channel_table(found));
    exports.push(csv_export(
        "Channel table",
        CHANNELS,
        stem("channels"),
        channels.clone(),
    ));
    exports.extend(copy_exports("Channel table", channels));
    let validated = study.validated.as_deref();
    let name = validated.map_or(String::new(), |validated| validated.setup.source_name());
    let validated = validated.ok_or_else(|| "Nothing is cross-validated yet: press “Cross-validate” first.".to_owned());
    let errors = validated.map(|validated| move || error_table(&validated.table));
    exports.push(csv_export(
        "Cross-validation table",
        HELD_OUT,
        of_source(&name, "cross-validation"),
        errors.clone(),
    ));
    exports.extend(copy_exports("Cross-validation table", errors));
    exports
}

/// Growth of the error of each target without each channel.
fn channel_table(found: &RecordingFindings) -> Table {
    let mut rows = Vec::new();
    for channel in &found.findings.importance {
        for (target, growth) in found.targets.iter().zip(&channel.growth) {
            let names = [&found.inputs[channel.channel].name, &target.name];
            let figures = [
                growth.map(|growth| growth.value),
                growth.map(|growth| growth.low),
                growth.map(|growth| growth.high),
            ];
            let names = names.into_iter().map(|name| Cell::from(name.clone()));
            rows.push(names.chain(figures.map(Cell::Number)).collect());
        }
    }
    let columns = [
        ("channel", "Channel"),
        ("target", "Target"),
        ("rmse_ratio", "RMSE without it / with all"),
        ("low", "from"),
        ("high", "to"),
    ];
    Table {
        columns: columns
            .map(|(field, heading)| TableColumn::new(field, heading, ""))
            .into(),
        rows,
    }
}
