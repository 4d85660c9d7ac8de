use std::collections::BTreeMap;

use serde_json::Value;

use crate::export::{MergedSweep, SweepRow, format_number};

/// The trials of a folder as they are shown.
#[derive(Debug)]
pub(in crate::app::views::experiments) struct SweepTable {
    pub(super) headings: Vec<String>,
    /// Number of headings that name options.
    pub(super) options: usize,
    pub(super) rows: Vec<Vec<SweepCell>>,
    /// Trials that are planned or there.
    pub(super) trials: usize,
    /// Everything that is wrong with files of the folder.
    pub(super) problems: Vec<String>,
}

#[derive(Clone, Debug)]
pub(super) struct SweepCell {
    pub(super) text: String,
    pub(super) value: Option<f64>,
}

/// Results of a trial: heading, and place in its report.
const RESULTS: [(&str, &str); 4] = [
    ("Z %", "/errors/z_percent"),
    ("X %", "/errors/x_percent"),
    ("linear map Z %", "/baselines/linear/z_percent"),
    ("epochs", "/epochs"),
];

impl SweepTable {
    pub(super) fn of(merged: &MergedSweep) -> Self {
        let options = varying(merged);
        let results = RESULTS.map(|(heading, _)| heading.to_owned());
        let headings = options.iter().cloned().chain(results).chain(["seconds".to_owned()]);
        let mut problems = merged.damaged.clone();
        let conflicts = merged.conflicting.iter();
        problems
            .extend(conflicts.map(|files| format!("same options, different results: {files}; delete the wrong one")));
        Self {
            headings: headings.collect(),
            options: options.len(),
            rows: merged.trials.iter().map(|row| cells(row, &options)).collect(),
            trials: merged.trials.len() + merged.missing.len() + merged.conflicting.len(),
            problems,
        }
    }

    /// Number of trials that are finished.
    pub(super) fn finished(&self) -> usize {
        self.rows.len()
    }
}

/// Options that a plan varies, or that differ between trials where there is no plan, in the order of the plan.
fn varying(merged: &MergedSweep) -> Vec<String> {
    let mut options = merged.axes.clone();
    let mut first: BTreeMap<&String, &Value> = BTreeMap::new();
    for (option, value) in merged.trials.iter().flat_map(|row| &row.options) {
        if *first.entry(option).or_insert(value) != value && !options.contains(option) {
            options.push(option.clone());
        }
    }
    options
}

fn cells(row: &SweepRow, options: &[String]) -> Vec<SweepCell> {
    let of_options = options.iter().map(|option| SweepCell::of(row.options.get(option)));
    let of_results = RESULTS
        .iter()
        .map(|(_, place)| SweepCell::of(row.result.pointer(place)));
    let seconds = SweepCell::of(row.time.get("seconds"));
    of_options.chain(of_results).chain([seconds]).collect()
}

impl SweepCell {
    fn of(value: Option<&Value>) -> Self {
        let text = match value {
            None | Some(Value::Null) => "–".to_owned(),
            Some(Value::String(text)) => text.clone(),
            Some(Value::Array(values)) => {
                let texts: Vec<_> = values.iter().map(|value| Self::of(Some(value)).text).collect();
                texts.join(" ")
            }
            Some(value) if value.is_f64() => format_number(value.as_f64()),
            Some(value) => value.to_string(),
        };
        Self {
            text,
            value: value.and_then(Value::as_f64),
        }
    }
}
