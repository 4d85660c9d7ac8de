use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::median_polish::{Polished, median};

/// Takes the unloaded state from recent frames, without erasing a contact that is held.
///
/// From each channel's median over the frames follows its ratio to the resistance at rest. Amplifiers and temperature change
/// whole columns and the whole array; a contact lowers readings of few rows. So the logarithms of the ratios are divided
/// into a common part, one of each column and one of each row by median polish (Tukey, "Exploratory Data Analysis", 1977),
/// which a contact on less than half of the rows does not move. A row is in contact if the mean of what remains, with its
/// own part, is below zero by more than [`ReZero::DEVIATIONS`] of its standard deviations, as the other rows or the noise
/// tell them, or if its readings changed while the frames came. Channels of such rows take the common part and their column's
/// only; all others take their whole ratio.
///
/// A contact that spares less than half of the rows cannot be told from a drift, and is refused where readings move.
#[derive(Clone, Debug)]
pub struct ReZero {
    rows: usize,
    columns: usize,
    /// Resistances at rest: rows × columns.
    rest_ohm: Vec<f64>,
    /// Relative noise of a reading (standard deviation).
    noise: f64,
    /// Latest frames, oldest overwritten first: frames × rows × columns.
    frames_ohm: Vec<f64>,
    next: usize,
    count: usize,
}

/// Gain of every channel in the unloaded state: its reading over the resistance at rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ZeroGains {
    /// Number of column-wires.
    pub columns: usize,
    /// Reading over resistance at rest: rows read × columns, row by row.
    pub gains: Vec<f64>,
    /// Rows that were in contact, and took the gains of their columns only.
    pub in_contact: Vec<bool>,
}

/// Reason for which there is no unloaded state in the frames.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ReZeroError {
    /// Too few frames.
    #[error("{found} frames have come, and {needed} are needed: wait a moment and try again")]
    Frames {
        /// Frames that came.
        found: usize,
        /// Frames needed.
        needed: usize,
    },
    /// Half of the rows or more are in contact.
    #[error("{touched} of {rows} rows are in contact: lift what presses from at least half of the rows and try again")]
    Contact {
        /// Rows in contact.
        touched: usize,
        /// Rows read.
        rows: usize,
    },
    /// A gain is far from 1.
    #[error(
        "row {}, column {}: the reading is {gain:.2} times that at rest, which no drift makes; check the wire, or lift what \
         presses",
        row + 1,
        column + 1
    )]
    Gain {
        /// Index of the row among those read, from 0.
        row: usize,
        /// Column-wire, from 0.
        column: usize,
        /// Its gain.
        gain: f64,
    },
}

/// Median absolute deviation of a normal distribution, in standard deviations.
const NORMAL_MAD: f64 = 0.674_489_750_196_081_7;
/// Largest gain or loss that counts as a drift.
const LARGEST_GAIN: f64 = 2.0;

impl ReZero {
    /// Standard deviations beyond which a row is in contact.
    pub const DEVIATIONS: f64 = 4.0;
    /// Frames that are needed.
    pub const FRAMES: usize = 25;

    /// Prepares for frames of `rest_ohm.len() / columns` rows, with their resistances at rest and the relative noise of a
    /// reading.
    ///
    /// # Panics
    /// If the resistances are not whole rows, or not above 0.
    pub fn new(rest_ohm: Vec<f64>, columns: usize, noise: f64) -> Self {
        assert!(columns > 0 && rest_ohm.len().is_multiple_of(columns) && !rest_ohm.is_empty());
        assert!(rest_ohm.iter().all(|&ohm| ohm > 0.0));
        Self {
            rows: rest_ohm.len() / columns,
            columns,
            noise,
            frames_ohm: vec![0.0; Self::FRAMES * rest_ohm.len()],
            rest_ohm,
            next: 0,
            count: 0,
        }
    }

    /// Takes a frame, rows × columns, all readings finite and above 0. Allocates nothing.
    ///
    /// # Panics
    /// If the frame has another length.
    pub fn observe(&mut self, frame_ohm: &[f64]) {
        let length = self.rest_ohm.len();
        self.frames_ohm[self.next * length..][..length].copy_from_slice(frame_ohm);
        self.next = (self.next + 1) % Self::FRAMES;
        self.count = (self.count + 1).min(Self::FRAMES);
    }

    /// Returns the gains of the unloaded state in the latest frames.
    ///
    /// # Errors
    /// If there are too few frames, too many rows are in contact, or a gain is far from 1.
    pub fn gains(&self) -> Result<ZeroGains, ReZeroError> {
        if self.count < Self::FRAMES {
            let (found, needed) = (self.count, Self::FRAMES);
            return Err(ReZeroError::Frames { found, needed });
        }
        let (ratios, moves) = self.ratios();
        let Polished {
            common,
            of_rows,
            of_columns,
            rest,
        } = Polished::new(&ratios, self.columns);
        // Mean and spread of what is left in each row, its own part included.
        let mean = |row: usize| {
            let of_row = &rest[row * self.columns..(row + 1) * self.columns];
            of_rows[row] + of_row.iter().sum::<f64>() / self.columns as f64
        };
        let spread = median(rest.iter().map(|e| e.abs()).collect()) / NORMAL_MAD;
        let of_mean = spread.max(self.noise / (Self::FRAMES as f64).sqrt()) / (self.columns as f64).sqrt();
        let means: Vec<f64> = (0..self.rows).map(mean).collect();
        let apart = median(means.iter().map(|mean| mean.abs()).collect()) / NORMAL_MAD;
        let limit = -Self::DEVIATIONS * of_mean.max(apart);
        let in_contact: Vec<bool> = (0..self.rows).map(|row| means[row] < limit || moves[row]).collect();
        let touched = in_contact.iter().filter(|touched| **touched).count();
        if 2 * touched >= self.rows && touched > 0 {
            return Err(ReZeroError::Contact {
                touched,
                rows: self.rows,
            });
        }
        let log_gain = |index: usize| {
            let (row, column) = (index / self.columns, index % self.columns);
            if in_contact[row] {
                common + of_columns[column]
            } else {
                ratios[index]
            }
        };
        let gains: Vec<f64> = (0..ratios.len()).map(|index| log_gain(index).exp()).collect();
        let is_far = |gain: &f64| !(1.0 / LARGEST_GAIN..=LARGEST_GAIN).contains(gain);
        if let Some(index) = gains.iter().position(is_far) {
            return Err(ReZeroError::Gain {
                row: index / self.columns,
                column: index % self.columns,
                gain: gains[index],
            });
        }
        Ok(ZeroGains {
            columns: self.columns,
            gains,
            in_contact,
        })
    }

    /// Logarithm of the ratio of each channel's median to its resistance at rest, and whether each row's readings changed
    /// beyond their noise: the medians of the first and the second half of the frames differ in one of its channels.
    fn ratios(&self) -> (Vec<f64>, Vec<bool>) {
        let length = self.rest_ohm.len();
        let mut moves = vec![false; self.rows];
        let mut ratios = Vec::with_capacity(length);
        let half = Self::FRAMES / 2;
        // The standard deviation of a median of n normal values is 1.2533/√n of theirs.
        let of_difference = self.noise * 1.2533 * (2.0 / half as f64).sqrt();
        for index in 0..length {
            let in_order = (self.next..self.next + Self::FRAMES).map(|frame| frame % Self::FRAMES);
            let logs = in_order.map(|frame| (self.frames_ohm[frame * length + index] / self.rest_ohm[index]).ln());
            let logs: Vec<f64> = logs.collect();
            let change = median(logs[..half].to_vec()) - median(logs[Self::FRAMES - half..].to_vec());
            // A channel of a whole array may be so far apart by chance more easily than one alone.
            moves[index / self.columns] |= change.abs() > 1.5 * Self::DEVIATIONS * of_difference;
            ratios.push(median(logs));
        }
        (ratios, moves)
    }
}

impl ZeroGains {
    /// Divides the readings of a frame, rows × columns in ohm, by the gains.
    ///
    /// # Panics
    /// If the frame has another length.
    pub fn apply(&self, frame_ohm: &mut [f64]) {
        assert_eq!(frame_ohm.len(), self.gains.len());
        frame_ohm
            .iter_mut()
            .zip(&self.gains)
            .for_each(|(ohm, gain)| *ohm /= gain);
    }

    /// Returns `true` for gains of so many rows and columns that divide any reading soundly: they may come from a file.
    pub fn is_sound(&self, rows: usize, columns: usize) -> bool {
        let is_gain = |gain: &f64| *gain > 0.0 && gain.is_finite();
        self.columns == columns
            && self.gains.len() == rows * columns
            && self.in_contact.len() == rows
            && self.gains.iter().all(is_gain)
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};
    use rand::Rng;

    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::{Deformation, Indenter, Noise, normal::standard_normal},
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

    /// Gains of columns by 1 %, on top of 2 % for all.
    fn drift(rng: &mut impl Rng) -> Vec<f64> {
        (0..30).map(|_| 1.02 * (1.0 + 0.01 * standard_normal(rng))).collect()
    }

    fn re_zero(deformation: impl Fn(usize) -> Deformation, gains: &[f64], rng: &mut impl Rng) -> ReZero {
        let model = model();
        let source = Noise::relative(NOISE).source(&model).unwrap();
        let mut re_zero = ReZero::new(at_rest(&model), 30, NOISE);
        for frame in 0..ReZero::FRAMES {
            let mut ohm = readings(&model, &deformation(frame));
            ohm.iter_mut()
                .enumerate()
                .for_each(|(index, ohm)| *ohm *= gains[index % 30]);
            source.disturb(&mut ohm, rng);
            re_zero.observe(&ohm);
        }
        re_zero
    }

    #[test]
    fn the_drift_of_an_unloaded_array_is_found() {
        let mut rng = Seed(1).rng(Stream::Live);
        let gains = drift(&mut rng);
        let model = model();
        let re_zero = re_zero(
            |_| Deformation::from_fn(model.scale, |_, _| DVec3::ZERO),
            &gains,
            &mut rng,
        );
        let found = re_zero.gains().unwrap();
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

    /// A punch of 1.5 mm radius held half a millimetre deep: what it changes in the readings is still there afterwards.
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
            let found = re_zero(|_| held.clone(), &gains, &mut rng).gains().unwrap();
            let mut ohm = readings(&model, &held);
            let before = ohm.clone();
            ohm.iter_mut()
                .enumerate()
                .for_each(|(index, ohm)| *ohm *= gains[index % 30]);
            found.apply(&mut ohm);
            let rest = at_rest(&model);
            // The contact, in ohm below rest, of the row that it presses most.
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
    fn what_moves_or_covers_half_the_rows_is_refused() {
        let model = model();
        let mut rng = Seed(3).rng(Stream::Live);
        let ball = Indenter::default();
        let moving = |frame: usize| ball.press(&model, DVec2::new(12.0, 12.0), 0.04 * frame as f64);
        let error = re_zero(moving, &[1.0; 30], &mut rng).gains().unwrap_err();
        assert!(error.to_string().contains("rows are in contact"), "{error}");
        let new = ReZero::new(at_rest(&model), 30, NOISE);
        assert_eq!(new.gains().unwrap_err(), ReZeroError::Frames { found: 0, needed: 25 });
    }

    #[test]
    fn a_broken_wire_is_no_drift() {
        let model = model();
        let mut gains = [1.0; 30];
        gains[4] = 3.0;
        let at_rest = |_| Deformation::from_fn(model.scale, |_, _| DVec3::ZERO);
        let error = re_zero(at_rest, &gains, &mut Seed(4).rng(Stream::Live))
            .gains()
            .unwrap_err();
        assert!(
            error.to_string().starts_with("row 1, column 5: the reading is 3.0"),
            "{error}"
        );
    }
}
