use glam::DVec3;
use rand::Rng;

use super::diagnosis::{Diagnosis, FaultCause, FaultyWire, PERSISTENCE, SURE};
use crate::{
    numerics::chi_squared_quantile,
    scene::{Loading, NoiseSource, Scene},
    sensor::{SensorError, SensorModel},
};

/// Detects neighbouring wires that touch: their readings remain equal while the array is pressed in different ways.
///
/// Eq. (2) explains equal readings of two row-wires by some deformation, so that χ² of a single frame says little. But it
/// is improbable that each of several presses happens to be such a deformation. Readings of two wires are *equal* if Q =
/// Σ_k (ln m_k − ln m′_k)²/2σ_k² is below the value that touching wires exceed with a probability of [`EXCEEDED`], where
/// σ is the relative noise of a reading without the common gain error of a snapshot, which cancels. Wires that do not
/// touch have equal readings with probability q in a frame that presses them. This is estimated by draws from the scene,
/// with and without noise, and the larger value is used: readings may have less noise than assumed. Every frame in which
/// they are unequal adds ln(EXCEEDED/(1 − q)) to the evidence for a short, and every *new press* with equal readings adds
/// ln(1/q). A press is new if its mean readings differ from those at rest and from all presses counted before by at least
/// half of the typical difference in the scene. Thus a sustained contact, an array with symmetric rows at rest, or a slow
/// movement counts only once. The sum is kept at or above 0, as in a cumulative sum test (Page, "Continuous inspection
/// schemes", Biometrika 41, 1954): for presses that are independent given the scene, the mean number of presses between
/// false alarms exceeds e^[`LIMIT`].
///
/// Wires that are mirror images of each other in the array have equal readings whenever they are pressed alike, for
/// example by a bar across both or on the line between them. In scenes with an indenter, they are not judged.
#[derive(Clone, Debug)]
pub(super) struct Shorts {
    pairs: Vec<Pair>,
    source: NoiseSource,
    log_full_scale: f64,
    /// True if the readings of a snapshot have a common gain error.
    has_drift: bool,
    /// Mean logarithms of the readings of a pair.
    signature: Vec<f64>,
}

/// Two neighbouring wires.
#[derive(Clone, Debug)]
struct Pair {
    wire: FaultyWire,
    /// Corresponding readings of both wires, as indices in a frame.
    readings: Vec<(usize, usize)>,
    /// ln q.
    log_equal: f64,
    /// Minimum root mean square distance of a new press from earlier ones.
    distance: f64,
    evidence: f64,
    /// Mean logarithms of the readings of each counted press, preceded by the state at rest.
    presses: Vec<f64>,
    /// Number of consecutive unequal frames.
    apart: usize,
    is_held: bool,
}

/// Probability that the readings of touching wires count as unequal.
const EXCEEDED: f64 = 1e-4;
/// Normal deviate that is exceeded with that probability.
const DEVIATE: f64 = 3.719_016_485_455_68;
/// Evidence above which a short is reported: one false alarm in 10¹⁰ presses.
const LIMIT: f64 = 23.025_850_929_940_457;
/// Maximum number of presses kept for comparison. Wires with equal readings too often for this number are not judged.
const MAX_PRESSES: usize = 64;
/// Number of draws from the scene, and limit on the pairs of nodes evaluated in all of them.
const DRAWS: usize = 1000;
const MIN_DRAWS: usize = 100;
const MAX_NODE_PAIRS: usize = 30_000_000;

/// Readings of a pair in one frame.
struct Comparison {
    is_equal: bool,
    /// Distance of two signatures that noise alone seldom exceeds.
    noise: f64,
}

impl Shorts {
    /// Prepares to compare neighbouring wires; `rows` are the row-wires read.
    ///
    /// # Errors
    /// If the model has no resistance.
    pub(super) fn new(
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        log_full_scale: f64,
        rng: &mut impl Rng,
    ) -> Result<Self, SensorError> {
        let (scale, noise) = (model.scale, scene.noise.in_test());
        let columns = scale.columns();
        let row_pairs = (1..rows.len())
            .filter(|&index| rows[index] == rows[index - 1] + 1)
            .map(|index| {
                let readings = (0..columns).map(|k| ((index - 1) * columns + k, index * columns + k));
                (FaultyWire::Rows(rows[index - 1]), readings.collect())
            });
        let column_pairs = (1..columns).map(|k| {
            let readings = (0..rows.len()).map(|index| (index * columns + k - 1, index * columns + k));
            (FaultyWire::Columns(k - 1), readings.collect())
        });
        let pairs: Vec<(FaultyWire, Vec<(usize, usize)>)> = row_pairs.chain(column_pairs).collect();
        let mut shorts = Self {
            pairs: Vec::new(),
            source: noise.source(model)?,
            log_full_scale,
            has_drift: noise.drift > 0.0,
            signature: vec![0.0; columns.max(rows.len())],
        };
        let frames_ohm = draw(model, scene, rows, rng)?;
        let mut noisy_ohm = frames_ohm.clone();
        let length = rows.len() * columns;
        for frame_ohm in noisy_ohm.chunks_exact_mut(length) {
            shorts.source.disturb(frame_ohm, rng);
        }
        let (at_rest_ohm, drawn_ohm) = frames_ohm.split_at(length);
        let may_be_pressed_alike = matches!(scene.loading, Loading::Indenter(_));
        for (wire, readings) in pairs {
            let is_mirrored = shorts.compare(&readings, at_rest_ohm).is_equal;
            if is_mirrored && may_be_pressed_alike {
                continue;
            }
            let pair = shorts.judge(wire, readings, at_rest_ohm, [drawn_ohm, &noisy_ohm[length..]]);
            shorts.pairs.extend(pair);
        }
        Ok(shorts)
    }

    /// Estimates how often wires that do not touch have equal readings; `None` if a short could never be established.
    fn judge(
        &mut self,
        wire: FaultyWire,
        readings: Vec<(usize, usize)>,
        at_rest_ohm: &[f64],
        drawn_ohm: [&[f64]; 2],
    ) -> Option<Pair> {
        let length = readings.len();
        self.compare(&readings, at_rest_ohm);
        let mut presses = Vec::with_capacity((MAX_PRESSES + 1) * length);
        presses.extend_from_slice(&self.signature[..length]);
        let mut found: Vec<(f64, [bool; 2])> = Vec::new();
        let [exact_ohm, noisy_ohm] = drawn_ohm.map(|ohm| ohm.chunks_exact(at_rest_ohm.len()));
        let (mut before, mut between) = (Vec::new(), Vec::new());
        for (exact_ohm, noisy_ohm) in exact_ohm.zip(noisy_ohm) {
            let is_equal = self.compare(&readings, exact_ohm).is_equal;
            let compared = self.compare(&readings, noisy_ohm);
            let distance = distance(&self.signature[..length], &presses);
            if distance > compared.noise {
                found.push((distance, [is_equal, compared.is_equal]));
                let signature = &self.signature[..length];
                if !before.is_empty() {
                    between.push(self::distance(signature, &before));
                }
                before.clear();
                before.extend_from_slice(signature);
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        between.sort_by(f64::total_cmp);
        let distance = 0.5 * found.get(found.len() / 2)?.0.min(*between.get(between.len() / 2)?);
        let pressed = found.iter().filter(|(other, _)| *other >= distance);
        let count = |which: usize| pressed.clone().filter(|(_, is_equal)| is_equal[which]).count();
        let equal = count(0).max(count(1));
        let log_equal = ((equal + 1) as f64 / (pressed.count() + 2) as f64).ln();
        (-log_equal * MAX_PRESSES as f64 > LIMIT).then_some(Pair {
            wire,
            readings,
            log_equal,
            distance,
            evidence: 0.0,
            presses,
            apart: 0,
            is_held: false,
        })
    }

    /// Adds a frame: `raw_ohm` as received, and `frame_ohm` divided by the gains of the unloaded state. Rows share the
    /// amplifiers of the columns, so their raw readings are compared; columns have separate amplifiers, so their
    /// corrected readings are compared.
    pub(super) fn observe(&mut self, raw_ohm: &[f64], frame_ohm: &[f64]) {
        let mut pairs = std::mem::take(&mut self.pairs);
        for pair in &mut pairs {
            let ohm = match pair.wire {
                FaultyWire::Rows(_) | FaultyWire::Row(_) => raw_ohm,
                FaultyWire::Columns(_) | FaultyWire::Column(_) => frame_ohm,
            };
            let compared = self.compare(&pair.readings, ohm);
            pair.take(&compared, &self.signature[..pair.readings.len()]);
        }
        self.pairs = pairs;
    }

    /// The touching wires with the most evidence, if there are any.
    pub(super) fn held(&self) -> Option<Diagnosis> {
        let held = self.pairs.iter().filter(|pair| pair.is_held);
        let best = held.max_by(|a, b| a.evidence.total_cmp(&b.evidence))?;
        let odds = (best.evidence - LIMIT).max(0.0).exp() * SURE / (1.0 - SURE);
        Some(Diagnosis {
            wire: best.wire,
            cause: FaultCause::Shorted,
            probability: 1.0 / (1.0 + 1.0 / odds),
        })
    }

    /// Returns `true` if the readings of these wires were equal in the last frame.
    pub(super) fn are_equal(&self, wire: FaultyWire) -> bool {
        self.pairs.iter().any(|pair| pair.wire == wire && pair.apart == 0)
    }

    /// Compares the readings of two wires, and writes their mean logarithms to the signature.
    fn compare(&mut self, readings: &[(usize, usize)], frame_ohm: &[f64]) -> Comparison {
        let (mut q, mut count, mut variance) = (0.0, 0, 0.0);
        let signature = &mut self.signature[..readings.len()];
        for (mean, &(one, other)) in signature.iter_mut().zip(readings) {
            let (one, other) = (frame_ohm[one].ln(), frame_ohm[other].ln());
            *mean = 0.5 * (one + other);
            let own = self.source.relative_to(mean.exp()).own.max(SMALLEST_NOISE);
            variance += 0.5 * own * own;
            if one < self.log_full_scale || other < self.log_full_scale {
                q += (one - other).powi(2) / (2.0 * own * own);
                count += 1;
            }
        }
        if self.has_drift {
            let mean = signature.iter().sum::<f64>() / signature.len() as f64;
            signature.iter_mut().for_each(|value| *value -= mean);
        }
        let length = readings.len() as f64;
        Comparison {
            is_equal: count > 0 && q <= chi_squared_quantile(count, DEVIATE),
            // The mean square difference has twice the variance, with a relative spread of √(2/n).
            noise: (2.0 * variance / length * (1.0 + 4.0 * (2.0 / length).sqrt())).sqrt(),
        }
    }
}

/// The frame at rest, and frames drawn from the scene, without noise.
fn draw(model: &SensorModel, scene: &Scene, rows: &[usize], rng: &mut impl Rng) -> Result<Vec<f64>, SensorError> {
    let scale = model.scale;
    let columns = scale.columns();
    let node_pairs = rows.len() * scale.nodes_per_row() * columns * scale.nodes_per_column();
    let draws = (MAX_NODE_PAIRS / node_pairs).clamp(MIN_DRAWS, DRAWS);
    let mut frames_ohm = vec![0.0; (draws + 1) * rows.len() * columns];
    let at_rest = vec![DVec3::ZERO; scale.nodes_per_row()];
    let sampler = scene.sampler(model);
    for (frame, frame_ohm) in frames_ohm.chunks_exact_mut(rows.len() * columns).enumerate() {
        let deformation = (frame > 0).then(|| sampler.draw(rng));
        for (&row, ohm) in rows.iter().zip(frame_ohm.chunks_exact_mut(columns)) {
            let displacements_mm = deformation.as_ref().map_or(&at_rest[..], |drawn| drawn.row_mm(row));
            model.row_resistances_into(row, displacements_mm, ohm)?;
        }
    }
    Ok(frames_ohm)
}

/// Minimum noise assumed.
const SMALLEST_NOISE: f64 = 1e-6;

impl Pair {
    fn take(&mut self, compared: &Comparison, signature: &[f64]) {
        if !compared.is_equal {
            self.apart += 1;
            self.evidence += EXCEEDED.ln() - (-self.log_equal.exp()).ln_1p();
            if self.evidence <= 0.0 {
                self.evidence = 0.0;
                self.presses.truncate(signature.len());
            }
            self.is_held &= self.apart < PERSISTENCE;
            return;
        }
        self.apart = 0;
        let is_new = || {
            let mut presses = self.presses.chunks_exact(signature.len());
            presses.all(|press| distance(signature, press) >= self.distance.max(compared.noise))
        };
        if self.presses.len() <= MAX_PRESSES * signature.len() && is_new() {
            self.presses.extend_from_slice(signature);
            self.evidence -= self.log_equal;
            self.is_held |= self.evidence >= LIMIT;
        }
    }
}

/// Root mean square difference.
fn distance(one: &[f64], other: &[f64]) -> f64 {
    let squares = one.iter().zip(other).map(|(a, b)| (a - b).powi(2));
    (squares.sum::<f64>() / one.len() as f64).sqrt()
}
