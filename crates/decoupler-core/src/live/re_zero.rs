use std::collections::VecDeque;

use ndarray::{Array1, Array2, ArrayViewMut1, Axis};
use serde::{Deserialize, Serialize};

use super::LiveError;
use crate::{numerics::median, scene::NoiseSource};

/// Gain of every channel in the unloaded state: the reading divided by the resistance at rest.
///
/// [`Self::estimate`] finds it from recent frames, without erasing a sustained contact. Each channel's gain is the ratio of
/// its median reading over the frames to its resistance at rest. Amplifiers and temperature affect whole columns and the
/// whole array; a contact lowers the readings of a few rows. The logarithms of the ratios are therefore decomposed by
/// median polish (Tukey, "Exploratory Data Analysis", 1977) into a common part, column parts, row parts and residuals. A
/// contact on fewer than half of the rows does not affect the common and column parts.
///
/// A row is in contact if its part plus its mean residual is below zero by more than [`Self::DEVIATIONS`] standard
/// deviations, estimated from the other rows or from the noise. It is also in contact if its readings, corrected for the
/// gain error that a snapshot has in common, changed during the frames by more than noise and converter steps explain.
/// Channels of rows in contact use the common and column parts only; all others use their full ratio. If the noise is
/// unknown, it is estimated from the differences of successive frames, to which slow movement contributes little.
///
/// A contact on more than half of the rows cannot be distinguished from drift; it is refused if the readings move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ZeroGains {
    /// Number of column-wires.
    pub columns: usize,
    /// Reading divided by resistance at rest: rows read × columns, row by row.
    pub gains: Vec<f64>,
    /// True for rows in contact, whose gains are those of their columns.
    pub in_contact: Vec<bool>,
}

/// Median absolute deviation of a normal distribution in units of its standard deviation.
const NORMAL_MAD: f64 = 0.674_489_750_196_081_7;
/// Largest gain that is attributed to drift; the smallest is its reciprocal.
const LARGEST_GAIN: f64 = 2.0;

impl ZeroGains {
    /// Number of standard deviations beyond which a row is in contact.
    pub const DEVIATIONS: f64 = 4.0;
    /// Number of frames needed.
    pub const FRAMES: usize = 25;

    /// Returns the gains of the unloaded state from the last frames, of which there are [`Self::FRAMES`], with readings that
    /// are finite and above 0; `rest_ohm` are the resistances at rest (rows × columns each). If `noise` is none, it is
    /// estimated from the frames.
    ///
    /// # Errors
    /// If there are too few frames, too many rows are in contact, or a gain is far from 1.
    ///
    /// # Panics
    /// If the resistances do not form whole rows, or a frame has another length.
    pub fn estimate(
        frames_ohm: &VecDeque<Vec<f64>>,
        rest_ohm: &[f64],
        columns: usize,
        noise: &NoiseSource,
    ) -> Result<Self, LiveError> {
        assert!(columns > 0 && rest_ohm.len().is_multiple_of(columns) && !rest_ohm.is_empty());
        assert!(frames_ohm.iter().all(|ohm| ohm.len() == rest_ohm.len()));
        let (found, needed, rows) = (frames_ohm.len(), Self::FRAMES, rest_ohm.len() / columns);
        if found < needed {
            return Err(LiveError::Frames { found, needed });
        }
        // Logarithms of the readings of each channel relative to its resistance at rest, without the common gain error.
        let latest = frames_ohm.range(found - needed..);
        let of_channel = |(channel, rest_ohm): (usize, &f64)| -> Vec<f64> {
            let ohm = latest.clone().map(|ohm| ohm[channel]);
            ohm.map(|ohm| (ohm / rest_ohm).ln()).collect()
        };
        let mut channels: Vec<Vec<f64>> = rest_ohm.iter().enumerate().map(of_channel).collect();
        let common = common_of_frames(&channels, noise);
        for logs in &mut channels {
            logs.iter_mut().zip(&common).for_each(|(log, common)| *log -= common);
        }
        let deviations = deviations(&channels, rest_ohm, noise);
        let mut moves = vec![false; rows];
        for (index, (logs, deviation)) in channels.iter().zip(&deviations).enumerate() {
            let (from, to) = noise.rounded_from_ohm(rest_ohm[index]).unwrap_or_default();
            moves[index / columns] |= change(logs) > largest_change(*deviation) + (to - from) / rest_ohm[index];
        }
        let common = median(common);
        let squares = deviations.iter().map(|deviation| deviation * deviation);
        let noise = (squares.sum::<f64>() / channels.len() as f64).sqrt();
        let ratios = channels.into_iter().map(|logs| median(logs) + common).collect();
        let ratios = Array2::from_shape_vec((rows, columns), ratios).expect("a ratio for each resistance");
        let mut rest = ratios.clone();
        let (common, of_rows, of_columns) = polish(&mut rest);
        // Mean and spread of the residuals of each row, including the row part.
        let spread = median(rest.iter().map(|e| e.abs()).collect()) / NORMAL_MAD;
        let of_mean = spread.max(noise / (Self::FRAMES as f64).sqrt()) / (columns as f64).sqrt();
        let means = of_rows + rest.sum_axis(Axis(1)) / columns as f64;
        let apart = median(means.iter().map(|mean| mean.abs()).collect()) / NORMAL_MAD;
        let limit = -Self::DEVIATIONS * of_mean.max(apart);
        let in_contact = means.iter().zip(moves).map(|(mean, moves)| *mean < limit || moves);
        let in_contact: Vec<bool> = in_contact.collect();
        let touched = in_contact.iter().filter(|touched| **touched).count();
        if 2 * touched >= rows && touched > 0 {
            return Err(LiveError::Contact { touched, rows });
        }
        let log_gain = |((row, column), ratio): ((usize, usize), &f64)| match in_contact[row] {
            true => common + of_columns[column],
            false => *ratio,
        };
        let gains = Vec::from_iter(ratios.indexed_iter().map(|at| log_gain(at).exp()));
        let is_far = |gain: &f64| !(1.0 / LARGEST_GAIN..=LARGEST_GAIN).contains(gain);
        if let Some(index) = gains.iter().position(is_far) {
            return Err(LiveError::Gain {
                row: index / columns,
                column: index % columns,
                gain: gains[index],
            });
        }
        Ok(Self {
            columns,
            gains,
            in_contact,
        })
    }

    /// Divides the readings of a frame, rows × columns in ohm, by the gains.
    ///
    /// # Panics
    /// If the frame has the wrong length.
    pub fn apply(&self, frame_ohm: &mut [f64]) {
        assert_eq!(frame_ohm.len(), self.gains.len());
        let readings = frame_ohm.iter_mut().zip(&self.gains);
        readings.for_each(|(ohm, gain)| *ohm /= gain);
    }

    /// Returns `true` if there are gains for this many rows and columns, all finite and above 0: they may come from a
    /// file.
    pub fn is_sound(&self, rows: usize, columns: usize) -> bool {
        let is_gain = |gain: &f64| *gain > 0.0 && gain.is_finite();
        let sizes = (self.in_contact.len(), self.columns, self.gains.len());
        sizes == (rows, columns, rows * columns) && self.gains.iter().all(is_gain)
    }
}

/// Logarithm of the common gain error of each frame; 0 if all rows have moved, which is not noise.
fn common_of_frames(channels: &[Vec<f64>], noise: &NoiseSource) -> Vec<f64> {
    let middles: Vec<f64> = channels.iter().map(|logs| median(logs.clone())).collect();
    let of_frame = |frame: usize| median(channels.iter().zip(&middles).map(|(logs, m)| logs[frame] - m).collect());
    let mut common: Vec<f64> = (0..ZeroGains::FRAMES).map(of_frame).collect();
    let drift = match noise.is_none() {
        true => jitter(&common),
        false => noise.noise.drift,
    };
    if change(&common) > largest_change(drift) {
        common.fill(0.0);
    }
    common
}

/// Noise of each channel relative to its reading, without the common gain error (standard deviation).
fn deviations(channels: &[Vec<f64>], rest_ohm: &[f64], noise: &NoiseSource) -> Vec<f64> {
    if !noise.is_none() {
        return rest_ohm.iter().map(|&ohm| noise.relative_to(ohm).own).collect();
    }
    let found: Vec<f64> = channels.iter().map(|logs| jitter(logs)).collect();
    let middle = median(found.clone());
    // The estimate from a few frames is rough, and a trembling contact must not be mistaken for noise.
    let limited = |deviation: f64| deviation.clamp(middle, 3.0 * middle);
    found.into_iter().map(limited).collect()
}

/// Number of frames at the beginning and at the end whose medians are compared.
const HALF: usize = ZeroGains::FRAMES / 2;

/// Difference between the medians of the last and the first values.
fn change(values: &[f64]) -> f64 {
    (median(values[..HALF].to_vec()) - median(values[values.len() - HALF..].to_vec())).abs()
}

/// Largest [`change`] expected by chance for values with this standard deviation. The standard deviation of a median of n
/// normal values is 1.2533/√n times theirs; the limit allows for the many channels of an array.
fn largest_change(deviation: f64) -> f64 {
    1.5 * ZeroGains::DEVIATIONS * 1.2533 * (2.0 / HALF as f64).sqrt() * deviation
}

/// Standard deviation of values around a slow movement, estimated from successive differences.
fn jitter(values: &[f64]) -> f64 {
    let differences = values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    median(differences.collect()) / (NORMAL_MAD * 2.0_f64.sqrt())
}

/// Iterations of median polish: two or three are enough.
const ROUNDS: usize = 6;

/// Decomposes values (rows × columns), which become residuals, by median polish; returns the common part, the parts of the
/// rows and those of the columns.
fn polish(rest: &mut Array2<f64>) -> (f64, Array1<f64>, Array1<f64>) {
    let centre = |mut values: ArrayViewMut1<'_, f64>| {
        let shift = median(values.to_vec());
        values.iter_mut().for_each(|value| *value -= shift);
        shift
    };
    let (mut common, mut of_rows, mut of_columns) = (0.0, Array1::zeros(rest.nrows()), Array1::zeros(rest.ncols()));
    for _ in 0..ROUNDS {
        let columns = of_columns.iter_mut().zip(rest.columns_mut());
        columns.for_each(|(part, column)| *part += centre(column));
        let rows = of_rows.iter_mut().zip(rest.rows_mut());
        rows.for_each(|(part, row)| *part += centre(row));
        common += centre(of_columns.view_mut());
        common += centre(of_rows.view_mut());
    }
    (common, of_rows, of_columns)
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};
    use rand::Rng;

    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::{Deformation, Indenter, Noise, standard_normal},
        sensor::SensorModel,
    };

    const NOISE: f64 = 1e-3;

    fn model() -> SensorModel {
        SensorModel::new("10x10_5x30".parse().unwrap())
    }

    fn readings(model: &SensorModel, deformation: &Deformation) -> Vec<f64> {
        let rows = (0..10).flat_map(|row| model.row_resistances(row, deformation.row_mm(row)).unwrap());
        rows.collect()
    }

    fn at_rest(model: &SensorModel) -> Vec<f64> {
        readings(model, &Deformation::from_fn(model.scale, |_, _| DVec3::ZERO))
    }

    /// Column gains with a spread of 1 %, on top of 2 % for all.
    fn drift(rng: &mut impl Rng) -> Vec<f64> {
        (0..30).map(|_| 1.02 * (1.0 + 0.01 * standard_normal(rng))).collect()
    }

    fn re_zero(
        deformation: impl Fn(usize) -> Deformation,
        gains: &[f64],
        rng: &mut impl Rng,
    ) -> Result<ZeroGains, LiveError> {
        let noise = Noise::relative(NOISE);
        re_zero_in(noise, noise, deformation, gains, rng)
    }

    /// Frames with `noise`, decoded under the assumption of `assumed`.
    fn re_zero_in(
        noise: Noise,
        assumed: Noise,
        deformation: impl Fn(usize) -> Deformation,
        gains: &[f64],
        rng: &mut impl Rng,
    ) -> Result<ZeroGains, LiveError> {
        let model = model();
        let source = noise.source(&model).unwrap();
        let mut frames_ohm = VecDeque::new();
        for frame in 0..ZeroGains::FRAMES {
            let mut ohm = readings(&model, &deformation(frame));
            ohm.iter_mut()
                .enumerate()
                .for_each(|(index, ohm)| *ohm *= gains[index % 30]);
            source.disturb(&mut ohm, rng);
            frames_ohm.push_back(ohm);
        }
        ZeroGains::estimate(&frames_ohm, &at_rest(&model), 30, &assumed.source(&model).unwrap())
    }

    #[test]
    fn the_drift_of_an_unloaded_array_is_found() {
        let mut rng = Seed(1).rng(Stream::Live);
        let gains = drift(&mut rng);
        let model = model();
        let found = re_zero(
            |_| Deformation::from_fn(model.scale, |_, _| DVec3::ZERO),
            &gains,
            &mut rng,
        );
        let found = found.unwrap();
        assert_eq!(found.in_contact, [false; 10]);
        for (index, gain) in found.gains.iter().enumerate() {
            assert!((gain / gains[index % 30] - 1.0).abs() < 2e-3, "{index}: {gain}");
        }
        let mut ohm = at_rest(&model);
        ohm.iter_mut()
            .enumerate()
            .for_each(|(index, ohm)| *ohm *= gains[index % 30]);
        found.apply(&mut ohm);
        assert!(
            ohm.iter()
                .zip(at_rest(&model))
                .all(|(ohm, rest)| (ohm / rest - 1.0).abs() < 2e-3)
        );
        let text = serde_json::to_string(&found).unwrap();
        assert_eq!(serde_json::from_str::<ZeroGains>(&text).unwrap(), found);
        assert!(found.is_sound(10, 30) && !found.is_sound(9, 30));
    }

    /// A punch of 1.5 mm radius held half a millimetre deep: its effect on the readings is preserved.
    #[test]
    fn a_held_contact_is_not_erased() {
        let model = model();
        let punch = Indenter {
            spread_mm: 0.4,
            ..Indenter::default()
        };
        for seed in 0..20 {
            let mut rng = Seed(seed).rng(Stream::Live);
            let gains = drift(&mut rng);
            let held = punch.press(&model, DVec2::new(11.0, 12.5), 0.5);
            let found = re_zero(|_| held.clone(), &gains, &mut rng).unwrap();
            let mut ohm = readings(&model, &held);
            let before = ohm.clone();
            ohm.iter_mut()
                .enumerate()
                .for_each(|(index, ohm)| *ohm *= gains[index % 30]);
            found.apply(&mut ohm);
            let rest = at_rest(&model);
            // Effect of the contact on the row that it presses most.
            let contact = |ohm: &[f64]| (90..120).map(|index| (rest[index] / ohm[index]).ln()).sum::<f64>();
            let kept = contact(&ohm) / contact(&before);
            assert!(
                found.in_contact[3] && (0.8..1.2).contains(&kept),
                "{seed}: {kept} {:?}",
                found.in_contact
            );
        }
    }

    #[test]
    fn movement_or_contact_on_half_the_rows_is_refused() {
        let model = model();
        let mut rng = Seed(3).rng(Stream::Live);
        let ball = Indenter::default();
        let moving = |frame: usize| ball.press(&model, DVec2::new(12.0, 12.0), 0.04 * frame as f64);
        let error = re_zero(moving, &[1.0; 30], &mut rng).unwrap_err();
        assert!(error.to_string().contains("rows are in contact"), "{error}");
        let new = ZeroGains::estimate(&VecDeque::new(), &at_rest(&model), 30, &NoiseSource::default());
        assert_eq!(new, Err(LiveError::Frames { found: 0, needed: 25 }));
    }

    /// Noise of every kind, known and unknown.
    fn noises() -> Vec<(Noise, Noise)> {
        let additive = Noise {
            additive_ohm: 0.2,
            ..Noise::default()
        };
        let drift = Noise {
            drift: 0.02,
            ..Noise::relative(NOISE)
        };
        let converter = Noise {
            converter_bits: Some(10),
            ..Noise::relative(1e-4)
        };
        let known = [additive, drift, converter, Noise::relative(0.02)];
        let unknown = [additive, drift, Noise::relative(NOISE), Noise::default()];
        let known = known.map(|noise| (noise, noise));
        known
            .into_iter()
            .chain(unknown.map(|noise| (noise, Noise::default())))
            .collect()
    }

    #[test]
    fn jitter_at_rest_is_not_a_contact_for_any_noise() {
        let model = model();
        for (noise, assumed) in noises() {
            for seed in 0..10 {
                let mut rng = Seed(seed).rng(Stream::Live);
                let at_rest = |_| Deformation::from_fn(model.scale, |_, _| DVec3::ZERO);
                let found = re_zero_in(noise, assumed, at_rest, &[1.0; 30], &mut rng);
                let found = found.unwrap_or_else(|error| panic!("{noise:?} {assumed:?} {seed}: {error}"));
                assert_eq!(found.in_contact, [false; 10], "{noise:?} {assumed:?} {seed}");
            }
        }
    }

    #[test]
    fn movement_is_refused_for_any_noise() {
        let model = model();
        let ball = Indenter::default();
        let moving = |frame: usize| ball.press(&model, DVec2::new(12.0, 12.0), 0.04 * frame as f64);
        // Readings change by one percent.
        for (noise, assumed) in noises() {
            let noise = Noise {
                additive_ohm: 0.1 * noise.additive_ohm,
                relative: 0.1 * noise.relative,
                drift: 0.1 * noise.drift,
                converter_bits: noise.converter_bits.map(|_| 14),
                ..noise
            };
            let assumed = if assumed.is_none() { assumed } else { noise };
            let mut rng = Seed(3).rng(Stream::Live);
            let found = re_zero_in(noise, assumed, moving, &[1.0; 30], &mut rng);
            assert!(matches!(found, Err(LiveError::Contact { .. })), "{noise:?} {assumed:?}");
        }
    }

    #[test]
    fn a_broken_wire_is_not_drift() {
        let model = model();
        let mut gains = [1.0; 30];
        gains[4] = 3.0;
        let at_rest = |_| Deformation::from_fn(model.scale, |_, _| DVec3::ZERO);
        let error = re_zero(at_rest, &gains, &mut Seed(4).rng(Stream::Live)).unwrap_err();
        assert!(
            error.to_string().starts_with("row 1, column 5: the reading is 3.0"),
            "{error}"
        );
    }

    /// Row and column parts with median 0 are recovered even if fewer than half of the rows are corrupted.
    #[test]
    fn additive_parts_are_found_despite_outliers() {
        let (rows, columns) = ([-2.0, 0.0, 1.0, 0.0, 3.0], [0.5, 0.0, -0.25]);
        let value = |index: usize| 10.0 + rows[index / 3] + columns[index % 3] - if index == 4 { 7.0 } else { 0.0 };
        let mut rest = Array2::from_shape_fn((5, 3), |(row, column)| value(3 * row + column));
        let (common, of_rows, of_columns) = polish(&mut rest);
        assert_eq!(
            (common, &of_rows.to_vec()[..], &of_columns.to_vec()[..]),
            (10.0, &rows[..], &columns[..])
        );
        assert_eq!(rest[[1, 1]], -7.0);
        assert!(rest.iter().enumerate().all(|(index, rest)| index == 4 || *rest == 0.0));
    }
}
