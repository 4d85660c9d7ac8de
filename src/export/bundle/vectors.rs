use super::{
    error::BundleError,
    exact::{Growth, decode_exactly},
    portable::Portable,
};
use crate::{evaluation::SimulatedSettings, export::NetworkFile};

/// Readings with the answers that the network gives to them.
#[derive(Clone, Debug)]
pub(super) struct Vectors {
    /// The golden vectors first: of each network the smallest, middle and largest readings of its training range, and a
    /// few of the scene.
    all: Vec<Vector>,
    golden: usize,
    /// Growth of rounding errors in the worst of them.
    pub(super) growth: Growth,
    /// Largest difference of `decode` of this program from the exact answers, in mm.
    pub(super) program_deviation_mm: f64,
}

/// Readings of a row-wire with the answer.
#[derive(Clone, Debug)]
pub(super) struct Vector {
    /// Index of the network, and so of the row-wire where that is an argument.
    pub(super) network: usize,
    pub(super) readings_ohm: Vec<f64>,
    pub(super) coordinates_mm: Vec<f64>,
}

/// Snapshots drawn for the verification.
const SNAPSHOTS: usize = 20;
/// Snapshots among them that are golden vectors.
const GOLDEN_SNAPSHOTS: usize = 1;

impl Vectors {
    /// Draws readings of the scene and answers them. `representable` gives the nearest reading that the bundle can take.
    ///
    /// # Errors
    /// The scene could not be drawn.
    pub(super) fn of(
        file: &NetworkFile,
        portable: &Portable,
        representable: impl Fn(f64) -> f64,
    ) -> Result<Self, BundleError> {
        let mut readings = Vec::new();
        for (index, network) in portable.networks.iter().enumerate() {
            let Some(range) = &network.range else { continue };
            for place in [0.0, 0.5, 1.0] {
                let between = |&(low, high): &(f64, f64)| if place == 1.0 { high } else { low + place * (high - low) };
                readings.push((index, range.extremes.iter().map(between).collect::<Vec<_>>()));
            }
        }
        let rows = file.settings.source.model_size().map_or(1, |size| size.rows);
        let mut settings = SimulatedSettings { ..file.settings };
        settings.source.test_samples = SNAPSHOTS * rows;
        let set = settings.draw_test().map_err(Box::new)?;
        let golden = readings.len() + GOLDEN_SNAPSHOTS * rows;
        for sample in 0..set.samples() {
            let network = if portable.takes_row() { set.row_index(sample) } else { 0 };
            readings.push((network, set.sample_readings(sample).to_vec()));
        }
        let mut growth = Growth::default();
        let mut program_deviation_mm = 0.0_f64;
        let mut all = Vec::new();
        for (network, readings_ohm) in readings {
            let readings_ohm: Vec<f64> = readings_ohm.into_iter().map(&representable).collect();
            let exact = decode_exactly(portable, &portable.networks[network], &readings_ohm);
            growth = growth.largest(exact.growth);
            let row = ndarray::ArrayView2::from_shape((1, readings_ohm.len()), &readings_ohm);
            let of_program = file.network.at(network).decouple(row.expect("one row of readings"));
            let differences = of_program
                .iter()
                .zip(&exact.coordinates_mm)
                .map(|(ours, exact)| (ours - exact).abs());
            program_deviation_mm = differences.fold(program_deviation_mm, f64::max);
            all.push(Vector {
                network,
                readings_ohm,
                coordinates_mm: exact.coordinates_mm,
            });
        }
        Ok(Self {
            all,
            golden,
            growth,
            program_deviation_mm,
        })
    }

    /// Leaves out the vectors with a reading that counts as outside the range of training.
    pub(super) fn inside(mut self, portable: &Portable) -> Self {
        let is_inside = |vector: &Vector| {
            portable.networks[vector.network].range.as_ref().is_none_or(|range| {
                let mut readings = vector.readings_ohm.iter().zip(&range.limits);
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

    /// Largest difference of `decode` from the answers, in mm. NaN if an answer is none.
    pub(super) fn deviation_mm(&self, mut decode: impl FnMut(&Vector) -> Vec<f64>) -> f64 {
        let mut largest = 0.0_f64;
        for vector in &self.all {
            let answers = decode(vector);
            assert_eq!(answers.len(), vector.coordinates_mm.len());
            for (answer, expected) in answers.iter().zip(&vector.coordinates_mm) {
                let difference = (answer - expected).abs();
                // Once it is NaN it stays so.
                if difference.is_nan() || difference > largest {
                    largest = difference;
                }
            }
        }
        largest
    }
}
