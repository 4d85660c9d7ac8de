//! Networks for decoding benchmarks.

use decoupler_core::{
    dataset::{Dataset, PerRow, Seed, Stream},
    network::{DecouplingNetwork, InputChoice, Inputs, MinMax, NetworkError, Networks, Shape, nguyen_widrow},
    scene::{NoiseSource, RowModel},
};

/// Untrained networks of known rows: the speed does not depend on the weights.
pub(crate) fn untrained_networks(training: &Dataset, choice: InputChoice, hidden: usize) -> Networks {
    let mut rng = Seed(0).rng(Stream::Start);
    let network = |set: &Dataset| {
        let inputs = Inputs::fit(choice, set.readings(), NoiseSource::default())?;
        let outputs = MinMax::fit(set.targets())?;
        let shape = Shape {
            inputs: inputs.count(),
            hidden,
            outputs: outputs.varying().len(),
        };
        let mlp = nguyen_widrow(shape, &mut rng);
        Ok::<_, NetworkError>(DecouplingNetwork::new(inputs, mlp, outputs))
    };
    PerRow::fit(training, RowModel::Each, network).unwrap()
}
