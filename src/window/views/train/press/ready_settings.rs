use decoupler_core::{
    dataset::Simulation,
    evaluation::RunSettings,
    machine::node_pairs_per_row,
    network::{InputChoice, Quantity, ScalingChoice},
    scene::{Indenter, Loading, Noise, Rows, Scene},
};

/// Returns the settings of a small network that learns imprints of balls on the sensor of `source` in a fraction of a
/// second, with its rows, axes and stroke, and without noise; `None` for arrays for which training would take longer.
///
/// One network for each known row, with conductances scaled to [−1, 1], was the best choice for so few samples.
pub(super) fn ready_settings(source: &Simulation) -> Option<RunSettings> {
    /// Number of training samples per row.
    const SAMPLES: usize = 200;
    /// Maximum number of pairs of nodes in all samples: about a tenth of a second.
    const MAX_PAIRS: f64 = 5e7;
    /// Maximum number of unknowns and readings of all rows, with which the time of an epoch grows.
    const MAX_CHANNELS: usize = 2000;
    let (rows, scale) = (source.rows().ok()?, source.sensor.scale);
    let samples = SAMPLES * rows;
    let channels = rows * (source.scene.unknowns_per_row(scale) + scale.columns());
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
    let mut settings = RunSettings::from(Simulation {
        sensor: source.sensor,
        scene,
        samples,
        validation_samples: 0,
        test_samples: rows,
    });
    settings.inputs = InputChoice {
        quantity: Quantity::Conductance,
        scaling: ScalingChoice::MinMax,
    };
    settings.hidden = 6;
    settings.training.stopping.epochs = 30;
    Some(settings)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::{
        super::{
            pressed::Pressed,
            touch::{Print, Touch},
        },
        *,
    };
    use decoupler_core::{evaluation::Run, job::Job};

    /// Returns the mean errors of the ready-made network, and of always answering the rest positions, for a ball
    /// pressed on the middle of the array.
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
        let mut decoder = run.network().decoder();
        let answer = pressed.answer(&mut decoder, &Job::UNINTERRUPTED).unwrap();
        let depths = pressed.nodes_mm().map(|node| sensor.geometry.height_mm - node.z);
        let nodes = pressed.nodes_mm().count() as f64;
        [answer.mean_mm, depths.sum::<f64>() / nodes]
    }

    #[test]
    fn the_ready_made_network_decodes_imprints_on_every_array_of_the_paper() {
        for scale in ["10x6_3x18", "10x8_4x24", "10x10_5x30", "4x4_2x12"] {
            let [network, rest] = errors_mm(scale);
            assert!(network < 0.25 * rest, "{scale}: {network} of {rest} mm");
        }
    }

    #[test]
    fn large_arrays_have_no_ready_made_network() {
        let mut source = Simulation::default();
        source.sensor.scale = "96x96_96x288".parse().unwrap();
        assert_eq!(ready_settings(&source), None);
        source.sensor.scale = "10x10_5x30".parse().unwrap();
        source.scene.rows = Rows::One(99);
        assert_eq!(ready_settings(&source), None, "a row that does not exist");
    }
}
