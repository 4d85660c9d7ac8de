//! Fitted decoders with samples to decode.

use decoupler_core::{
    dataset::{Dataset, PerRow, Seed, Simulation, Stream},
    decoupling::{Decoder, DecoderKind},
    evaluation::{DecoderSet, RunSettings},
    network::{
        DecouplingNetwork, InputChoice, Inputs, MinMax, NetworkError, Networks, Quantity, ScalingChoice, Shape,
        nguyen_widrow,
    },
    scene::{Noise, NoiseSource, RowModel, Rows, Scene},
    sensor::SensorModel,
};
use ndarray::Array2;
use rand::RngExt;

/// A fitted decoder with samples of all its row-wires.
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) kind: DecoderKind,
    /// Quantity that the decoder reads, which decides which readings are valid.
    pub(crate) quantity: Quantity,
    pub(crate) decoder: Box<dyn Decoder>,
    pub(crate) test: Dataset,
}

/// Samples, with the sensor and scene if they were simulated.
struct Source {
    name: &'static str,
    sensor: Option<Simulation>,
    training: Dataset,
    test: Dataset,
    inputs: Vec<InputChoice>,
}

impl Source {
    fn is_noisy(&self) -> bool {
        self.sensor.is_some_and(|simulation| !simulation.scene.noise.is_none())
    }
}

pub(crate) fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

pub(crate) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for row_model in [RowModel::Shared, RowModel::Each] {
        for source in [simulated(row_model, 0.0), simulated(row_model, 1e-3), recorded()] {
            for kind in DecoderKind::ALL {
                // Noise matters to those that solve the equations.
                if source.is_noisy() && !kind.needs_sensor() {
                    continue;
                }
                for &precision in kind.precisions() {
                    // Decoders that solve the equations read resistances.
                    let inputs = if kind.needs_network() || !kind.needs_sensor() {
                        &source.inputs[..]
                    } else {
                        &source.inputs[..1]
                    };
                    for &choice in inputs {
                        let networks = untrained(&source.training, row_model, choice);
                        let settings = RunSettings {
                            inputs: choice,
                            seed: Seed(1),
                            ..source
                                .sensor
                                .map_or_else(|| RunSettings::measured(row_model), RunSettings::from)
                        };
                        let set = DecoderSet::new(settings, source.training.clone(), Some(networks));
                        let Some(decoder) = set.decoder(kind, precision).unwrap() else {
                            assert!(kind.needs_sensor() && source.sensor.is_none());
                            continue;
                        };
                        let InputChoice { quantity, scaling } = choice;
                        cases.push(Case {
                            name: format!(
                                "{kind} {precision:?}, {row_model:?}, {}, {quantity}, {scaling}",
                                source.name
                            ),
                            kind,
                            quantity,
                            decoder,
                            test: source.test.clone(),
                        });
                    }
                }
            }
        }
    }
    cases
}

/// Networks with random weights, and a number of hidden nodes that is not a multiple of any vector register.
fn untrained(training: &Dataset, row_model: RowModel, choice: InputChoice) -> Networks {
    let mut rng = Seed(2).rng(Stream::Start);
    let network = |set: &Dataset| {
        let inputs = Inputs::fit(choice, set.readings(), NoiseSource::default())?;
        let outputs = MinMax::fit(set.targets())?;
        let shape = Shape {
            inputs: inputs.count(),
            hidden: 5,
            outputs: outputs.varying().len(),
        };
        let mlp = nguyen_widrow(shape, &mut rng);
        Ok::<_, NetworkError>(DecouplingNetwork::new(inputs, mlp, outputs))
    };
    PerRow::fit(training, row_model, network).unwrap()
}

/// A small array with more readings than unknowns.
fn simulated(row_model: RowModel, noise: f64) -> Source {
    let model = SensorModel::new("3x2_2x6".parse().unwrap());
    let scene = Scene {
        rows: match row_model {
            RowModel::Shared => Rows::All,
            RowModel::Each => Rows::Known,
        },
        noise: Noise::relative(noise),
        ..Scene::default()
    };
    let draw = |snapshots: usize, stream, noise_stream| {
        let mut set = Dataset::simulate(&model, &scene, 3 * snapshots, &mut Seed(0).rng(stream)).unwrap();
        set.disturb(&model, &scene.noise, &mut Seed(0).rng(noise_stream))
            .unwrap();
        set
    };
    let mut inputs = vec![InputChoice::PAPER, InputChoice::BEST];
    inputs.push(InputChoice {
        quantity: Quantity::LogResistance,
        scaling: ScalingChoice::MinMax,
    });
    Source {
        name: if noise > 0.0 { "noisy" } else { "exact" },
        training: draw(40, Stream::Training, Stream::TrainingNoise),
        test: draw(11, Stream::Test, Stream::TestNoise),
        sensor: Some(Simulation {
            sensor: model,
            scene,
            ..Simulation::default()
        }),
        inputs,
    }
}

/// Readings of any sign, a channel and a target that are constant.
fn recorded() -> Source {
    let mut rng = Seed(3).rng(Stream::Training);
    let mut draw = |snapshots: usize| {
        let samples = 3 * snapshots;
        let mut readings = Array2::from_elem((samples, 4), 7.5);
        let mut targets = Array2::from_elem((samples, 3), -2.0);
        for sample in 0..samples {
            let [a, b]: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            readings[[sample, 0]] = 100.0 * a + b;
            readings[[sample, 2]] = a - b;
            readings[[sample, 3]] = a * b + 0.1 * (sample % 3) as f64;
            targets[[sample, 0]] = a + 0.3 * b * b;
            targets[[sample, 2]] = 50.0 * b;
        }
        let row_wires = Vec::from_iter((0..samples).map(|sample| sample % 3));
        let groups = Vec::from_iter((0..samples).map(|sample| sample / 3));
        Dataset::new(readings, targets, Some(&row_wires), groups).unwrap()
    };
    Source {
        name: "recorded",
        training: draw(50),
        test: draw(11),
        sensor: None,
        inputs: vec![
            InputChoice::MEASURED,
            InputChoice {
                quantity: Quantity::Raw,
                scaling: ScalingChoice::Whitening,
            },
        ],
    }
}
