use std::collections::BTreeMap;

use serde_json::Value;

use decoupler_files::export::{MergedSweep, SweepRow, format_number};

/// The trials of a folder as they are shown.
#[derive(Debug)]
pub(in crate::window::views::experiments) struct SweepTable {
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

/// Results of a trial: heading, place in its report and, for a list of targets, the field whose mean over the targets counts.
type Result = (&'static str, &'static str, Option<&'static str>);

/// Results on an array.
const ON_NODES: [Result; 4] = [
    ("Z %", "/errors/z_percent", None),
    ("X %", "/errors/x_percent", None),
    ("linear map Z %", "/baselines/linear/z_percent", None),
    ("epochs", "/epochs", None),
];

/// Results on a recording; the error is the mean absolute one in percent of the range.
const ON_TARGETS: [Result; 4] = [
    ("error %", "/targets", Some("percent_of_range")),
    ("R²", "/targets", Some("r2")),
    ("ridge %", "/baselines/ridge", Some("percent_of_range")),
    ("epochs", "/epochs", None),
];

fn results_of(merged: &MergedSweep) -> Vec<Result> {
    let is_recorded = |row: &SweepRow| row.result.get("targets").is_some();
    let (recorded, simulated): (Vec<_>, Vec<_>) = merged.trials.iter().partition(|row| is_recorded(row));
    match (recorded.is_empty(), simulated.is_empty()) {
        (true, _) => ON_NODES.to_vec(),
        (false, true) => ON_TARGETS.to_vec(),
        (false, false) => ON_NODES[..3].iter().chain(&ON_TARGETS).copied().collect(),
    }
}

impl SweepTable {
    pub(super) fn of(merged: &MergedSweep) -> Self {
        let options = varying(merged);
        let results = results_of(merged);
        let of_results = results.iter().map(|(heading, ..)| (*heading).to_owned());
        let headings = options.iter().cloned().chain(of_results).chain(["seconds".to_owned()]);
        let mut problems = merged.damaged.clone();
        let conflicts = merged.conflicting.iter();
        problems
            .extend(conflicts.map(|files| format!("same options, different results: {files}; delete the wrong one")));
        Self {
            headings: headings.collect(),
            options: options.len(),
            rows: merged.trials.iter().map(|row| cells(row, &options, &results)).collect(),
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

fn cells(row: &SweepRow, options: &[String], results: &[Result]) -> Vec<SweepCell> {
    let of_options = options.iter().map(|option| SweepCell::of(row.options.get(option)));
    let of_results = results
        .iter()
        .map(|(_, place, field)| match (row.result.pointer(place), field) {
            (Some(Value::Array(targets)), Some(field)) => SweepCell::of(mean(targets, field).as_ref()),
            (value, _) => SweepCell::of(value),
        });
    let seconds = SweepCell::of(row.time.get("seconds"));
    of_options.chain(of_results).chain([seconds]).collect()
}

/// Mean of a field over the targets that have it.
fn mean(targets: &[Value], field: &str) -> Option<Value> {
    let values = Vec::from_iter(targets.iter().filter_map(|target| target[field].as_f64()));
    (!values.is_empty()).then(|| Value::from(values.iter().sum::<f64>() / values.len() as f64))
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
