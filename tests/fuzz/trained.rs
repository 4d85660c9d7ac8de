//! Small trainings whose files are mutated.

use decoupler_core::{
    evaluation::{Preset, Run, RunSettings},
    network::InputChoice,
};

fn small(mut settings: RunSettings) -> Run {
    settings.simulation_mut().unwrap().sensor.scale = "2x2_2x6".parse().unwrap();
    (
        settings.simulation_mut().unwrap().samples,
        settings.simulation_mut().unwrap().validation_samples,
    ) = (40, 10);
    settings.simulation_mut().unwrap().test_samples = 10;
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
    [small(RunSettings::default()), small(starts)]
}
