//! A point of the trade-off in words.

use std::time::Duration;

use decoupler_core::{
    evaluation::TradeOffPoint,
    text::{format_duration, format_number, format_percent},
};

/// `Network f32, best preset, 12 hidden`.
pub fn point_name(point: &TradeOffPoint) -> String {
    let mut name = point.report.kind.name(point.report.precision).to_owned();
    if let Some(preset) = point.preset {
        name += &format!(", {preset} preset");
    } else if let Some(method) = point.method() {
        name += &format!(", {}", method.short_name());
    }
    if let Some(hidden) = point.hidden() {
        name += &format!(", {hidden} hidden");
    }
    name
}

/// `Network f32, 12 hidden`, next to a point whose mark tells the preset.
pub fn point_label(point: &TradeOffPoint) -> String {
    let name = point.report.kind.name(point.report.precision).to_owned();
    match point.hidden() {
        Some(hidden) => format!("{name}, {hidden} hidden"),
        None => name,
    }
}

/// `3.59 µs`, `1.94 ms`.
pub fn frame_time(microseconds: f64) -> String {
    match microseconds {
        time if time < 1e3 => format!("{} µs", format_number(time)),
        time if time < 1e6 => format!("{} ms", format_number(1e-3 * time)),
        time => format!("{} s", format_number(1e-6 * time)),
    }
}

/// A time of training.
pub fn training_time(seconds: f64) -> String {
    Duration::try_from_secs_f64(seconds).map_or_else(|_| format_number(None), format_duration)
}

/// Returns the errors and times of a point, line by line.
pub fn point_facts(point: &TradeOffPoint) -> Vec<String> {
    let percent = format_percent(point.report.errors.percent());
    let mut facts = vec![match point.report.errors.nodes() {
        Some(errors) => format!("Z error {percent}, {} mm", format_number(errors.z_mm)),
        None => format!("mean absolute error {percent} of the range"),
    }];
    if let Some(ratio) = point.to_reference() {
        facts.push(format!("{} times the Bayesian reference", format_number(ratio)));
    }
    facts.push(format!("{} per frame", frame_time(point.report.cost.frame_us)));
    facts.push(format!("{} of training", training_time(point.training_seconds)));
    facts.extend(point.report.remarks.iter().map(ToString::to_string));
    facts
}
