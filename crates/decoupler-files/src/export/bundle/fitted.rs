use super::{BundleDecoder, BundleError};
use decoupler_core::{
    dataset::{Dataset, PerRow},
    decoupling::{CompiledNetworks, Decoder, DecoderKind, Description, Precision, decode_set},
    evaluation::{DecoderSet, RunError, RunSets, RunSettings, TestErrors},
    network::{Networks, ReadingRange},
};

/// A decoder fitted to training samples, with what a bundle says of these.
pub(super) struct FittedDecoder {
    pub(super) kind: BundleDecoder,
    pub(super) decoder: Box<dyn Decoder>,
    pub(super) description: Description,
    /// Readings in training of all row-wires, or of each where the row is an argument.
    pub(super) reading_ranges: Vec<Option<ReadingRange>>,
    /// Smallest and largest target in training, likewise.
    pub(super) target_extremes: Vec<Vec<(f64, f64)>>,
    /// Errors on the test samples.
    pub(super) errors: TestErrors,
}

impl FittedDecoder {
    /// Takes trained networks, which know the range of their readings themselves, and their errors on the test samples.
    pub(super) fn of_networks(networks: &Networks, errors: TestErrors) -> Self {
        let all = networks.values().iter();
        let extremes = all.clone().map(|network| {
            let outputs = network.outputs();
            (0..outputs.channels()).map(|output| outputs.extremes(output)).collect()
        });
        let decoder = CompiledNetworks::<f64>::new(networks, networks.values().len());
        Self {
            kind: BundleDecoder::Kind(DecoderKind::Network),
            description: decoder.description().expect("networks consist of layers"),
            decoder: Box::new(decoder),
            reading_ranges: all.map(|network| network.inputs().range().cloned()).collect(),
            target_extremes: extremes.collect(),
            errors,
        }
    }

    /// Fits a decoder to the training samples of `sets` by these settings and measures it on the test samples; `networks` are
    /// those trained with these settings, for the decoders that need them.
    ///
    /// # Errors
    /// The samples cannot be scaled or decoded, or no program outside this one can compute what the decoder does.
    pub(super) fn fit(
        settings: RunSettings,
        sets: RunSets,
        networks: Option<Networks>,
        kind: BundleDecoder,
    ) -> Result<Self, BundleError> {
        if kind.needs_network() && networks.is_none() {
            return Err(BundleError::NoNetwork(kind));
        }
        let (training, test) = (sets.split.training, sets.test);
        let of_row = |set: &Dataset| {
            let targets = set.targets();
            let extremes = targets.columns().into_iter().map(|column| {
                let both = |(low, high): (f64, f64), &value: &f64| (low.min(value), high.max(value));
                column.iter().fold((f64::INFINITY, f64::NEG_INFINITY), both)
            });
            Ok::<_, BundleError>((ReadingRange::of(set.readings()), extremes.collect::<Vec<_>>()))
        };
        let in_training = PerRow::fit(&training, settings.source.row_model(), of_row)?;
        let (reading_ranges, target_extremes) = in_training.values().iter().cloned().unzip();
        let set = DecoderSet::on_set(settings, training, networks);
        let decoder = match kind {
            BundleDecoder::Linear => Some(set.linear().map_err(Box::new)?),
            BundleDecoder::Kind(kind) => set.decoder(kind, Precision::Double).map_err(Box::new)?,
        };
        let mut decoder = decoder.ok_or(BundleError::NoSensor(kind))?;
        let description = decoder
            .description()
            .map_err(|reason| BundleError::NotDescribed { decoder: kind, reason })?;
        let answers = decode_set(&mut *decoder, &test).map_err(|error| Box::new(RunError::from(error)))?;
        decoder.take_solved_rows();
        Ok(Self {
            kind,
            decoder,
            description,
            reading_ranges,
            target_extremes,
            errors: TestErrors::measure(&settings.source, &test, &answers),
        })
    }
}
