//! Exports of a measurement.

use super::TradeOffView;
use crate::window::shared::{Export, FileWords, copy_exports, csv_export, picture_exports};
use decoupler_files::{
    export::{trade_off_points, trade_off_summary},
    figure::{Figure, trade_off_figure},
};

const POINTS: FileWords = FileWords {
    kind: "points",
    description: "Every point, of an array at every noise level, with every digit, as CSV.",
    extensions: &["csv"],
};

/// The charts and the table at the displayed noise level, and every point.
pub(super) fn trade_off_exports(view: &TradeOffView) -> Vec<Export<'_>> {
    let stem = || "trade_off".to_owned();
    let outcome = view.outcome.as_ref().filter(|outcome| outcome.points().0 > 0);
    let outcome = outcome.ok_or_else(|| "No point is measured yet: press Measure first.".to_owned());
    let level = outcome.clone().and_then(|outcome| {
        let level = outcome
            .levels
            .get(view.look.level)
            .filter(|level| !level.points.is_empty());
        level.ok_or_else(|| "No point is measured here yet.".to_owned())
    });
    let charts = level
        .clone()
        .map(|level| move || Figure::from(trade_off_figure(level, &view.look.limits)));
    let mut exports: Vec<Export<'_>> = picture_exports("Charts", stem(), charts).collect();
    let points = outcome.map(|outcome| || trade_off_points(&outcome.levels));
    exports.push(csv_export("All points", POINTS, stem(), points));
    exports.extend(copy_exports(
        "Trade-off table",
        level.map(|level| move || trade_off_summary(level)),
    ));
    exports
}
