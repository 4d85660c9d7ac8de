//! The folded parts of the configuration, in a few words each.

use crate::window::widgets::fields::input_text;
use decoupler_core::{
    evaluation::{RunSettings, SimulatedSettings},
    network::{InputChoice, Quantity, ScalingChoice},
    scene::{Loading, Movement, Rows},
    sensor::Geometry,
    text::counted,
    training::TrainingSettings,
};

/// Loading, rows, axes and noise.
pub(super) fn of_scene(draft: &SimulatedSettings) -> String {
    let scene = &draft.source.scene;
    let loading = match scene.loading {
        Loading::RandomNodes => "random nodes".to_owned(),
        Loading::SmoothField { .. } => "smooth field".to_owned(),
        Loading::Indenter(indenter) => indenter.name().to_owned(),
    };
    let rows = match scene.rows {
        Rows::All => "all rows".to_owned(),
        Rows::Known => "known rows".to_owned(),
        Rows::One(row) => format!("row {}", row + 1),
    };
    let axes = match scene.movement {
        Movement::Z => "",
        Movement::Xyz { .. } => ", x y z",
    };
    let noise = if scene.noise.is_none() { "" } else { ", noise" };
    format!("{loading}, {rows}{axes}{noise}")
}

/// Numbers of training, validation and test samples, and the seed.
pub(super) fn of_samples(draft: &SimulatedSettings) -> String {
    let source = &draft.source;
    format!(
        "{} + {} + {}, seed {}",
        source.samples, source.validation_samples, source.test_samples, draft.seed.0
    )
}

/// Height, and whether anything else differs from what is assumed.
pub(super) fn of_geometry(geometry: &Geometry) -> String {
    let height = input_text(geometry.height_mm);
    if *geometry == Geometry::default() {
        format!("assumed, {height} mm high")
    } else {
        format!("yours, {height} mm high")
    }
}

/// Quantity and scaling of the inputs.
pub(super) fn of_inputs(inputs: &InputChoice) -> String {
    let quantity = match inputs.quantity {
        Quantity::Raw => "readings",
        Quantity::Resistance => "resistance",
        Quantity::Conductance => "conductance",
        Quantity::LogResistance => "log-resistance",
    };
    let scaling = match inputs.scaling {
        ScalingChoice::MinMax => "min-max",
        ScalingChoice::Whitening => "whitening",
    };
    format!("{quantity}, {scaling}")
}

/// The rule that ends every training.
pub(super) fn of_stopping(training: &TrainingSettings) -> String {
    counted(training.stopping.epochs, "epoch")
}

/// The first of the method's own settings, and the number of starts.
pub(super) fn of_method<S>(settings: &RunSettings<S>) -> String {
    let mut method = settings.training.method;
    let first = method.settings().into_iter().next();
    let first = first.map(|setting| format!("{} {}, ", setting.name, input_text(*setting.value)));
    let starts = counted(settings.starts, "start");
    format!("{}{starts}", first.unwrap_or_default())
}
