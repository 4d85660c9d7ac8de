//! Exports of two runs side by side, and of each of them alone.

use std::sync::Arc;

use super::{CompareView, figures_table::compared_table, view::losses};
use crate::window::shared::{Export, NetworkSource, PLACES, Shared, copy_exports, network_exports, picture_exports};
use decoupler_files::figure::Figure;

/// The networks of both runs, the pictures, and the table.
pub(super) fn compare_exports<'a>(view: &'a CompareView, shared: &'a Shared) -> Vec<Export<'a>> {
    let runs = &shared.runs;
    let mut exports = Vec::new();
    for (place, letter) in PLACES.into_iter().enumerate() {
        let run = runs.pinned(place);
        let source = run.map(|run| NetworkSource::Kept(run.name.clone(), Arc::clone(&run.file)));
        let source = source.ok_or_else(|| format!("No run is chosen as {letter}: choose one in the list."));
        exports.extend(network_exports(&format!("{letter}: "), &source, Vec::new));
    }
    // One part of the menu for the networks of both.
    exports.sort_by_key(|export| export.group);
    let nothing = || "No run is chosen: choose one in the list.".to_owned();
    let figure = view.figure(shared);
    let surfaces = if figure.surfaces.is_empty() {
        Err(nothing())
    } else {
        Ok(move || Figure::from(figure.clone()))
    };
    exports.extend(picture_exports("Surfaces", "compared-surfaces".to_owned(), surfaces));
    for (place, letter) in PLACES.into_iter().enumerate() {
        if let Some(regression) = view.regression(place) {
            let stem = format!("regression-{}", letter.to_lowercase());
            let regression = Ok(move || Figure::from(regression.clone()));
            exports.extend(picture_exports(&format!("Regression of {letter}"), stem, regression));
        }
    }
    let losses = losses(runs).ok_or_else(nothing);
    let losses = losses.map(|losses| move || Figure::from(losses.clone()));
    exports.extend(picture_exports("Loss chart", "compared-loss".to_owned(), losses));
    let is_any = (0..PLACES.len()).any(|place| runs.pinned(place).is_some());
    let table = if is_any {
        Ok(|| compared_table(runs))
    } else {
        Err(nothing())
    };
    exports.extend(copy_exports("Table of both runs", table));
    exports
}
