use decoupler_core::text::inert;

use super::{
    choice::{ReadingRounding, Taking},
    exact::{ErrorGrowth, decode_exactly},
    exported_decoder::ExportedDecoder,
    meaning::Meaning,
    portable::Portable,
    report::{BundleError, VectorCounts},
    weights::{Arithmetic, Digits, names},
};

/// Readings with the answers that the decoder gives to them.
#[derive(Clone, Debug)]
pub(super) struct Vectors {
    /// Golden vectors first: for each row the smallest, middle and largest readings of its training range, and a few of
    /// the drawn readings.
    all: Vec<Vector>,
    golden: usize,
    /// Largest growth of rounding errors over all vectors.
    pub(super) growth: ErrorGrowth,
    /// Changes of the answers caused by rounding the readings to the numbers that the bundle takes.
    pub(super) rounding: ReadingRounding,
    /// The bound of [`Self::rounding`] if a constant in the middle of each channel had been subtracted from the readings.
    centred_bound: f64,
    /// Largest deviation of `decode` of this program from the exact answers.
    pub(super) program_deviation: f64,
    /// [`Portable::scales`].
    scales: Vec<f64>,
}

/// Readings of a row with the answer.
#[derive(Clone, Debug)]
pub(super) struct Vector {
    /// Index of the row-wire if it is an argument, otherwise 0.
    pub(super) row: usize,
    /// Readings of the caller, in double precision.
    pub(super) readings: Vec<f64>,
    /// Readings rounded to the numbers that the bundle takes.
    pub(super) taken: Vec<f64>,
    /// Exact answers to the readings.
    pub(super) answers: Vec<f64>,
    /// Exact answers to the rounded readings.
    pub(super) answers_to_taken: Vec<f64>,
}

/// Largest differences of an evaluation, relative to the scales of the outputs. NaN if an answer is NaN.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Deviation {
    /// Deviation from the answers of the decoder to the readings of the caller.
    pub(super) total: f64,
    /// Deviation from the answers of the decoder to the rounded readings, which is caused by the arithmetic alone.
    pub(super) of_arithmetic: f64,
}

impl Vectors {
    /// Draws readings and answers them.
    ///
    /// # Errors
    /// No readings could be drawn, or the bundle cannot take one of them.
    pub(super) fn of(
        exported: &mut ExportedDecoder<'_>,
        portable: &Portable,
        taking: Taking<'_>,
    ) -> Result<Self, BundleError> {
        let mut readings = Vec::new();
        for (index, range) in portable.ranges.iter().enumerate() {
            let Some(range) = range else { continue };
            for place in [0.0, 0.5, 1.0] {
                let between = |&(low, high): &(f64, f64)| if place == 1.0 { high } else { low + place * (high - low) };
                readings.push((index, range.extremes.iter().map(between).collect::<Vec<_>>()));
            }
        }
        let (golden, drawn) = exported.draw(portable)?;
        let mut vectors = Self {
            all: Vec::new(),
            golden: readings.len() + golden,
            growth: ErrorGrowth::default(),
            rounding: ReadingRounding::default(),
            centred_bound: 0.0,
            program_deviation: 0.0,
            scales: portable.scales.clone(),
        };
        readings.extend(drawn);
        for (index, readings) in readings {
            let channels = readings.iter().enumerate();
            let taken: Vec<f64> = (channels.clone())
                .map(|(channel, &reading)| taking.rounded(channel, reading))
                .collect();
            let refused = taken.iter().position(|&reading| !portable.quantity.accepts(reading));
            if let Some(channel) = refused {
                let (channel, reading) = (portable.meaning.inputs()[channel].name.clone(), readings[channel]);
                return Err(BundleError::ReadingBeyond { channel, reading });
            }
            let errors: Vec<f64> = channels
                .map(|(channel, &reading)| taking.error(channel, reading))
                .collect();
            let of_program = exported.decode(index, &readings)?;
            let map = &portable.maps[index];
            let exact = decode_exactly(portable, map, &readings);
            let of_taken = if taken == readings {
                exact.clone()
            } else {
                decode_exactly(portable, map, &taken)
            };
            vectors.growth = vectors.growth.largest(&of_taken.growth);
            let bound = exact.change_by(portable, map, &readings, &errors);
            if let Some(range) = &portable.ranges[index] {
                let errors: Vec<f64> = (range.limits.iter().enumerate())
                    .map(|(channel, &(low, high))| taking.error(channel, 0.5 * (high - low)))
                    .collect();
                let bound = exact.change_by(portable, map, &readings, &errors);
                vectors.centred_bound = larger(vectors.centred_bound, bound);
            } else {
                vectors.centred_bound = f64::INFINITY;
            }
            vectors.rounding = ReadingRounding {
                largest: larger(
                    vectors.rounding.largest,
                    relative(&of_taken.answers, &exact.answers, &vectors.scales),
                ),
                bound: larger(vectors.rounding.bound, bound),
            };
            vectors.program_deviation = larger(
                vectors.program_deviation,
                relative(&of_program, &exact.answers, &vectors.scales),
            );
            vectors.all.push(Vector {
                row: index,
                readings,
                taken,
                answers: exact.answers,
                answers_to_taken: of_taken.answers,
            });
        }
        Ok(vectors)
    }

    /// Leaves out the vectors with a reading that counts as outside the range of training.
    pub(super) fn inside(mut self, portable: &Portable) -> Self {
        let is_inside = |vector: &Vector| {
            portable.ranges[vector.row].as_ref().is_none_or(|range| {
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

    /// Advice for a bundle in single precision that changes too much by rounding readings to it.
    pub(super) fn cure(&self, portable: &Portable) -> String {
        /// Fraction of the change that may remain.
        const WORTHWHILE: f64 = 0.1;
        let subtracted = match portable.meaning {
            Meaning::Own { .. } => self.centred_bound < WORTHWHILE * self.rounding.bound,
            Meaning::Array(_) => false,
        };
        if subtracted {
            "give --precision f64, or subtract a constant from each input before training, because the readings vary little \
             in proportion to their size"
                .to_owned()
        } else {
            format!(
                "give --precision f64, or {} for one that amplifies less",
                portable.smaller_weights()
            )
        }
    }

    /// Numbers of vectors.
    pub(super) fn counts(&self) -> VectorCounts {
        VectorCounts {
            verified: self.all.len(),
            golden: self.golden,
        }
    }

    pub(super) fn all(&self) -> &[Vector] {
        &self.all
    }

    /// The vectors that the bundle contains.
    pub(super) fn golden(&self) -> &[Vector] {
        &self.all[..self.golden]
    }

    /// Returns the largest differences of `decode`, which is called with the rounded readings.
    pub(super) fn deviation(&self, mut decode: impl FnMut(&Vector) -> Vec<f64>) -> Deviation {
        self.all.iter().fold(Deviation::default(), |largest, vector| {
            let answers = decode(vector);
            Deviation {
                total: larger(largest.total, relative(&answers, &vector.answers, &self.scales)),
                of_arithmetic: larger(
                    largest.of_arithmetic,
                    relative(&answers, &vector.answers_to_taken, &self.scales),
                ),
            }
        })
    }
}

/// Largest difference of `answers` from those `expected`, each relative to its scale. NaN if an answer is NaN.
fn relative(answers: &[f64], expected: &[f64], scales: &[f64]) -> f64 {
    assert_eq!(answers.len(), expected.len());
    let pairs = answers.iter().zip(expected).zip(scales);
    pairs.fold(0.0, |largest, ((answer, expected), scale)| {
        larger(largest, (answer - expected).abs() / scale)
    })
}

/// Returns the larger of two deviations, or NaN if either is NaN.
fn larger(one: f64, other: f64) -> f64 {
    if one.is_nan() || one >= other { one } else { other }
}

/// Writes the golden vectors as CSV: the row from 1 if it is an argument, readings, outputs.
pub(super) fn golden_csv(portable: &Portable, vectors: &[Vector]) -> String {
    let meaning = &portable.meaning;
    let row = portable.takes_row().then(|| "row".to_owned());
    let names = row.into_iter().chain(
        meaning
            .inputs()
            .into_iter()
            .chain(meaning.targets())
            .map(|channel| inert(&channel.name)),
    );
    // User-defined names may contain commas.
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut write = |fields: Vec<String>| writer.write_record(fields).expect("writing to memory does not fail");
    write(names.collect());
    for vector in vectors {
        let row = portable.takes_row().then(|| (vector.row + 1).to_string());
        let numbers = vector.readings.iter().chain(&vector.answers).map(f64::to_string);
        write(row.into_iter().chain(numbers).collect());
    }
    let bytes = writer.into_inner().expect("writing to memory does not fail");
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Largest deviation of a bundle of floating-point numbers from its decoder, relative to the widest range of an output.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    pub(super) limit: f64,
    /// Limit of the precision, regardless of the decoder.
    usual: f64,
    /// Change of an output, as a fraction of its range, per relative error of the terms of the sums in a layer.
    amplification: f64,
}

impl Tolerance {
    /// Usual limit of double precision.
    pub(super) const DOUBLE: f64 = 1e-12;
    /// Largest limit for any decoder.
    pub(super) const LARGEST: f64 = 0.01;
    /// Usual limit of single precision.
    pub(super) const SINGLE: f64 = 1e-5;

    /// Returns the usual limit, or, if the `deviation` of an evaluation comes near it because the decoder's own sums
    /// amplify rounding errors, the bound on them: each of n terms of a sum has a relative error of at most about n
    /// units (N. J. Higham, Accuracy and Stability of Numerical Algorithms, section 3.1).
    pub(super) fn of(portable: &Portable, arithmetic: Arithmetic, growth: &ErrorGrowth, deviation: f64) -> Self {
        /// Other programs sum in a different order and may deviate more or less by this factor.
        const NEAR: f64 = 0.5;
        // In addition to the sums: difference, division, logarithm, weight and the function of a layer.
        let operations = (portable.channels + portable.widest() + 10) as f64;
        let of_layer = |(index, growth): (usize, &f64)| growth * arithmetic.of_layer(index).unit_roundoff();
        let errors: f64 = growth.0.iter().enumerate().map(of_layer).sum();
        let usual = match arithmetic.rest {
            Digits::Double => Self::DOUBLE,
            Digits::Single => Self::SINGLE,
        };
        let bound = operations * errors;
        Self {
            limit: if deviation <= NEAR * usual {
                usual
            } else {
                usual.max(bound.min(Self::LARGEST))
            },
            usual,
            amplification: growth.most(),
        }
    }

    /// Remarks on the arithmetic that the decoder needs.
    pub(super) fn remarks(self, arithmetic: Arithmetic, portable: &Portable) -> Vec<String> {
        let mut remarks = Vec::new();
        if arithmetic.wide_layers > 0 {
            let names = names(portable.layers());
            let wide: Vec<_> = names[..arithmetic.wide_layers]
                .iter()
                .map(|layer| layer.result.replace('_', " "))
                .collect();
            remarks.push(format!(
                "the {} are computed in double precision, because their large products nearly cancel; the rest is in single \
                 precision",
                wide.join(" and ")
            ));
        }
        if self.limit > self.usual {
            remarks.push(format!(
                "this {} amplifies rounding errors up to {:.1e} times (relative to the range of its outputs), so two \
                 programs that evaluate it may differ by up to {:.1e}, more than the usual {:.0e}; {} for one that amplifies less",
                portable.decoder,
                self.amplification,
                self.limit,
                self.usual,
                portable.smaller_weights()
            ));
        }
        remarks
    }
}
