use decoupler_core::{
    evaluation::{SimulatedSettings, Simulation},
    scene::{Indenter, Loading, Scene},
};

/// Settings with which the window opens for the first time: the paper's experiment, but with a ball pressed somewhere
/// onto the surface, which everybody recognises as touch, in place of nodes that are pressed each by itself.
pub fn opening_settings() -> SimulatedSettings {
    let paper = SimulatedSettings::default();
    SimulatedSettings {
        source: Simulation {
            scene: Scene {
                loading: Loading::Indenter(Indenter::default()),
                ..paper.source.scene
            },
            ..paper.source
        },
        ..paper
    }
}
