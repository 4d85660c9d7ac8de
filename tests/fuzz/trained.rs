//! Small trainings whose files are mutated.

use decoupler_core::{
    evaluation::{Preset, Run, SimulatedSettings},
    network::InputChoice,
};

fn small(mut settings: SimulatedSettings) -> Run {
    settings.source.sensor.scale = "2x2_2x6".parse().unwrap();
    (settings.source.samples, settings.source.validation_samples) = (40, 10);
    settings.source.test_samples = 10;
    settings.hidden = 3;
    settings.training.stopping.epochs = 5;
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    run
}

/// Returns a training with the paper's settings, and one with a network for each row and whitened inputs.
pub(crate) fn trained() -> [Run; 2] {
    let mut starts = Preset::Best.settings();
    starts.inputs = InputChoice::BEST;
    starts.starts = 2;
    [small(SimulatedSettings::default()), small(starts)]
}
