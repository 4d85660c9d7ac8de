use super::{
    error::BundleError,
    exact::{Growth, decode_exactly},
    exported_network::ExportedNetwork,
    portable::Portable,
};

/// Readings with the answers that the network gives to them.
#[derive(Clone, Debug)]
pub(super) struct Vectors {
    /// The golden vectors first: of each network the smallest, middle and largest readings of its training range, and a
    /// few of those drawn.
    all: Vec<Vector>,
    golden: usize,
    /// Growth of rounding errors in the worst of them.
    pub(super) growth: Growth,
    /// Largest deviation of `decode` of this program from the exact answers.
    pub(super) program_deviation: f64,
    /// [`Portable::scales`].
    scales: Vec<f64>,
}

/// Readings of a row with the answer.
#[derive(Clone, Debug)]
pub(super) struct Vector {
    /// Index of the network, and so of the row-wire where that is an argument.
    pub(super) network: usize,
    pub(super) readings: Vec<f64>,
    pub(super) answers: Vec<f64>,
}

impl Vectors {
    /// Draws readings and answers them. `representable` gives the nearest reading of a channel that the bundle can take.
    ///
    /// # Errors
    /// No readings could be drawn.
    pub(super) fn of(
        exported: ExportedNetwork<'_>,
        portable: &Portable,
        representable: impl Fn(usize, f64) -> f64,
    ) -> Result<Self, BundleError> {
        let mut readings = Vec::new();
        for (index, network) in portable.networks.iter().enumerate() {
            let Some(range) = &network.range else { continue };
            for place in [0.0, 0.5, 1.0] {
                let between = |&(low, high): &(f64, f64)| if place == 1.0 { high } else { low + place * (high - low) };
                readings.push((index, range.extremes.iter().map(between).collect::<Vec<_>>()));
            }
        }
        let (golden, drawn) = exported.draw(portable)?;
        let golden = readings.len() + golden;
        readings.extend(drawn);
        let mut growth = Growth::default();
        let mut program_deviation = 0.0_f64;
        let mut all = Vec::new();
        for (network, readings) in readings {
            let readings = readings.into_iter().enumerate();
            let readings: Vec<f64> = readings
                .map(|(channel, reading)| representable(channel, reading))
                .collect();
            let exact = decode_exactly(portable, &portable.networks[network], &readings);
            growth = growth.largest(exact.growth);
            let row = ndarray::ArrayView2::from_shape((1, readings.len()), &readings);
            let of_program = exported
                .networks()
                .at(network)
                .decouple(row.expect("one row of readings"));
            let of_program = relative(
                &of_program.into_raw_vec_and_offset().0,
                &exact.answers,
                &portable.scales,
            );
            program_deviation = program_deviation.max(of_program);
            all.push(Vector {
                network,
                readings,
                answers: exact.answers,
            });
        }
        Ok(Self {
            all,
            golden,
            growth,
            program_deviation,
            scales: portable.scales.clone(),
        })
    }

    /// Leaves out the vectors with a reading that counts as outside the range of training.
    pub(super) fn inside(mut self, portable: &Portable) -> Self {
        let is_inside = |vector: &Vector| {
            portable.networks[vector.network].range.as_ref().is_none_or(|range| {
                let mut readings = vector.readings.iter().zip(&range.limits);
                readings.all(|(ohm, (low, high))| (low..=high).contains(&ohm))
            })
        };
        self.golden = self.all[..self.golden]
            .iter()
            .filter(|vector| is_inside(vector))
            .count();
        self.all.retain(is_inside);
        self
    }

    pub(super) fn all(&self) -> &[Vector] {
        &self.all
    }

    /// The vectors that the bundle contains.
    pub(super) fn golden(&self) -> &[Vector] {
        &self.all[..self.golden]
    }

    /// Largest difference of `decode` from the answers, relative to the scale of the output. NaN if an answer is none.
    pub(super) fn deviation(&self, mut decode: impl FnMut(&Vector) -> Vec<f64>) -> f64 {
        let deviations = self
            .all
            .iter()
            .map(|vector| relative(&decode(vector), &vector.answers, &self.scales));
        deviations.fold(0.0, larger)
    }
}

/// Largest difference of `answers` from those `expected`, each relative to its scale. NaN if an answer is none.
fn relative(answers: &[f64], expected: &[f64], scales: &[f64]) -> f64 {
    assert_eq!(answers.len(), expected.len());
    let pairs = answers.iter().zip(expected).zip(scales);
    pairs.fold(0.0, |largest, ((answer, expected), scale)| {
        larger(largest, (answer - expected).abs() / scale)
    })
}

/// The larger of two deviations; once it is NaN it stays so.
fn larger(one: f64, other: f64) -> f64 {
    if one.is_nan() || one >= other { one } else { other }
}
