use super::{SimulatedSettings, Simulation, machine::node_pairs_per_row};
use crate::{
    network::{InputChoice, Quantity, ScalingChoice},
    scene::{Indenter, Loading, Noise, Rows, Scene},
    training::{StoppingRules, TrainingSettings},
};

/// Settings of a small network that learns the prints of balls on the sensor of `source` in a fraction of a second, with
/// its rows, axes and stroke, and without noise; `None` for arrays on which it would take longer.
///
/// One network for each known row on conductances between −1 and 1 is the best measured for so few samples.
pub fn ready_settings(source: &Simulation) -> Option<SimulatedSettings> {
    /// Training samples of each row.
    const SAMPLES: usize = 200;
    /// Pairs of nodes in all samples: about a tenth of a second.
    const MAX_PAIRS: f64 = 5e7;
    /// Unknowns and readings of all rows: with them grows the time of an epoch.
    const MAX_CHANNELS: usize = 2000;
    let rows = source.model_size().ok()?;
    let samples = SAMPLES * rows.rows;
    let channels = rows.unknowns + rows.equations;
    if samples as f64 * node_pairs_per_row(&source.sensor) > MAX_PAIRS || channels > MAX_CHANNELS {
        return None;
    }
    let scene = Scene {
        rows: match source.scene.rows {
            Rows::All | Rows::Known => Rows::Known,
            one @ Rows::One(_) => one,
        },
        loading: Loading::Indenter(Indenter::default()),
        noise: Noise::default(),
        ..source.scene
    };
    Some(SimulatedSettings {
        source: Simulation {
            sensor: source.sensor,
            scene,
            samples,
            validation_samples: 0,
            test_samples: rows.rows,
        },
        inputs: InputChoice {
            quantity: Quantity::Conductance,
            scaling: ScalingChoice::MinMax,
        },
        hidden: 6,
        training: TrainingSettings {
            stopping: StoppingRules {
                epochs: 30,
                ..StoppingRules::default()
            },
            ..TrainingSettings::default()
        },
        ..SimulatedSettings::default()
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::{
        decoupling::CompiledNetworks,
        evaluation::{Pressed, Run},
        scene::{Print, Touch},
    };

    /// Mean error under a ball in the middle of the array, by the ready-made network and by answering the rest.
    fn errors_mm(scale: &str) -> [f64; 2] {
        let mut source = Simulation::default();
        source.sensor.scale = scale.parse().unwrap();
        let settings = ready_settings(&source).unwrap();
        let mut run = Run::prepare(settings).unwrap();
        while run.step().is_none() {}
        let (sensor, rows) = (source.sensor, Vec::from_iter(0..source.sensor.scale.rows()));
        let corners = [(0, 0), (rows.len() - 1, sensor.scale.nodes_per_row() - 1)];
        let [first, last] = corners.map(|(row, node)| sensor.geometry.row_node_mm(sensor.scale, row, node));
        let print = Print {
            indenter: Indenter::default(),
            place_mm: DVec2::new(0.5 * (first.x + last.x), 0.5 * (first.y + last.y)),
            depth_mm: 0.8,
        };
        let touch = Touch {
            print: Some(print),
            ..Touch::default()
        };
        let pressed = Pressed::new(&sensor, &rows, &touch, 1.0).unwrap();
        let mut decoder = CompiledNetworks::<f64>::new(&run.network(), rows.len());
        let answer = pressed.answer(&mut decoder, &|| false).unwrap().unwrap();
        let depths = pressed.nodes_mm().map(|node| sensor.geometry.height_mm - node.z);
        let nodes = pressed.nodes_mm().count() as f64;
        [answer.mean_mm, depths.sum::<f64>() / nodes]
    }

    #[test]
    fn the_ready_made_network_feels_a_print_on_every_array_of_the_paper() {
        for scale in ["10x6_3x18", "10x8_4x24", "10x10_5x30", "4x4_2x12"] {
            let [network, rest] = errors_mm(scale);
            assert!(network < 0.25 * rest, "{scale}: {network} of {rest} mm");
        }
    }

    #[test]
    fn large_arrays_have_none() {
        let mut source = Simulation::default();
        source.sensor.scale = "96x96_96x288".parse().unwrap();
        assert_eq!(ready_settings(&source), None);
        source.sensor.scale = "10x10_5x30".parse().unwrap();
        source.scene.rows = Rows::One(99);
        assert_eq!(ready_settings(&source), None, "a row that does not exist");
    }
}
