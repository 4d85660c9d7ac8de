use std::fmt;

use ndarray::{Array2, Axis};
use rand::{Rng, RngExt, SeedableRng, rngs::ChaCha8Rng};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Baselines, Errors, TestErrors};
use crate::{
    dataset::Dataset,
    decoupling::{Posterior, SampledPosterior},
    scene::{Loading, Scene},
    sensor::{SensorError, SensorModel},
};

/// Reasons for which a test set has no Bayesian reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum NoReference {
    /// The posterior of a row did not converge.
    NotConverged,
    /// The rounding of the readings decides which part stays unknown, and no more is known of it than the order of magnitude.
    Rounding,
    /// The posterior could not be sampled well enough.
    Sampling,
    /// Sampling the posteriors would take too long.
    TooLarge,
}

/// Factor by which the rounding of readings may be finer than the posterior takes it to be.
const FINER_ROUNDING: f64 = 4.0;
/// Share of the reference that may depend on that factor.
const OWED_TO_ROUNDING: f64 = 0.05;
/// Relative noise next to which no rounding of readings counts.
const SMALLEST_BESIDE_ROUNDING: f64 = 1e-13;
/// Number of samples, spread over the test set, on which that is tried.
const TRIED_SAMPLES: usize = 100;

/// Errors of the Bayesian reference on a test set whose readings have the scene's noise: the limit that physics sets to
/// decoders of the row's own readings.
///
/// The posterior of each row under the prior that the scene draws from has medians, which are the answers with the least
/// expected absolute error: no decoder of the same readings does better on average. Each row is judged by its own readings
/// and taken as known, even in scenes whose decoders do not know the row; those cannot quite reach it.
///
/// The prior of random nodes is uniform, cut at 0 and at the stroke. Eq. (2) is linearised at the true deformation, and
/// expectation propagation finds the medians; a decoder that has to find where to linearise can come close. Other loadings
/// have priors of any shape, such as few parameters of a press, and posteriors with several modes and curved valleys:
/// theirs are sampled without linearisation (`SampledPosterior`). There is no reference if the samples are too few to be
/// trusted, or if the true deformations do not look like samples of their posteriors, as they must.
///
/// Without noise the rounding of the readings takes its place. It hides much of what is badly seen; elsewhere the errors
/// are 0 or next to it, for simulated readings are rounded as the model at the truth is ([`Errors::times`]). Between the
/// two the errors depend on how finely the readings are rounded: there is no reference then. `rng` draws the samples.
///
/// # Errors
/// If the sensor has no resistances at rest.
///
/// # Panics
/// If a sample of `test` has no row-wire, or one that the scene does not read.
pub fn reference_errors(
    model: &SensorModel,
    scene: &Scene,
    test: &Dataset,
    rng: &mut impl Rng,
) -> Result<Result<Errors, NoReference>, SensorError> {
    let is_noisy = !scene.noise.in_test().is_none();
    if scene.loading != Loading::RandomNodes && is_noisy {
        return Ok(sampled_medians_mm(model, scene, test, rng)?
            .map(|medians_mm| Errors::measure(test, &medians_mm, scene.stroke_mm(&model.geometry))));
    }
    let linearised = linearised_errors(model, scene, test, rng)?;
    // Without noise other loadings have a limit only where readings determine everything, whatever the prior.
    let is_limit = |errors: &Errors| scene.loading == Loading::RandomNodes || errors.is_rounding();
    Ok(linearised.and_then(|errors| Some(errors).filter(is_limit).ok_or(NoReference::Rounding)))
}

/// Errors of the medians of posteriors linearised at the truth.
fn linearised_errors(
    model: &SensorModel,
    scene: &Scene,
    test: &Dataset,
    rng: &mut impl Rng,
) -> Result<Result<Errors, NoReference>, SensorError> {
    let rows = test.row_wires_read().expect("samples of a scene know their row-wire");
    let mut posterior = Posterior::new(model, scene, rows, rng)?;
    let measured =
        |test: &Dataset, limits_mm: &Array2<f64>| Errors::measure(test, limits_mm, scene.stroke_mm(&model.geometry));
    let Some(limits) = limits_mm(&mut posterior, test) else {
        return Ok(Err(NoReference::NotConverged));
    };
    let errors = measured(test, &limits);
    if !errors.is_rounding() && scene.noise.in_test().relative < SMALLEST_BESIDE_ROUNDING {
        let every = test.samples().div_ceil(TRIED_SAMPLES).max(1);
        let tried: Vec<usize> = (0..test.samples()).step_by(every).collect();
        let some = test.select(&tried);
        let z_mm = measured(&some, &limits.select(Axis(0), &tried)).z_mm;
        let finer = limits_mm(&mut posterior.rounded_finer(FINER_ROUNDING), &some);
        let is_same = |finer: Array2<f64>| measured(&some, &finer).z_mm >= (1.0 - OWED_TO_ROUNDING) * z_mm;
        if !finer.is_some_and(is_same) {
            return Ok(Err(NoReference::Rounding));
        }
    }
    Ok(Ok(errors))
}

/// The answers of the posterior that knows where to linearise (samples × 3·M2); `None` if that of any row did not converge.
fn limits_mm(posterior: &mut Posterior, test: &Dataset) -> Option<Array2<f64>> {
    /// Samples whose posteriors are found at once.
    const BLOCK: usize = 64;
    let rows = test.row_wires_read().expect("samples of a scene know their row-wire");
    let mut limits_mm = Array2::zeros(test.targets().dim());
    let (mut readings_ohm, mut truths_mm) = (Vec::new(), Vec::new());
    for (block, mut limits_mm) in limits_mm.axis_chunks_iter_mut(Axis(0), BLOCK).enumerate() {
        let samples = block * BLOCK..block * BLOCK + limits_mm.nrows();
        let rows: Vec<usize> = samples.clone().map(|sample| rows[test.row_index(sample)]).collect();
        readings_ohm.clear();
        truths_mm.clear();
        for sample in samples {
            readings_ohm.extend_from_slice(test.sample_readings(sample));
            truths_mm.extend_from_slice(test.sample_targets(sample));
        }
        let limits_mm = limits_mm
            .as_slice_mut()
            .expect("rows of a standard array are contiguous");
        if !posterior.limits(&rows, &readings_ohm, &truths_mm, limits_mm) {
            return None;
        }
    }
    Some(limits_mm)
}

/// Medians of the posteriors of all samples (samples × 3·M2), by importance sampling from the scene's own prior.
fn sampled_medians_mm(
    model: &SensorModel,
    scene: &Scene,
    test: &Dataset,
    rng: &mut impl Rng,
) -> Result<Result<Array2<f64>, NoReference>, SensorError> {
    let rows = test.row_wires_read().expect("samples of a scene know their row-wire");
    if SampledPosterior::node_pairs(model, scene) * test.samples() as f64 > MAX_NODE_PAIRS {
        return Ok(Err(NoReference::TooLarge));
    }
    let seed: u64 = rng.random();
    // Each row and each sample has its own stream, so that results do not depend on the number of threads.
    let stream = |number: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(number as u64);
        rng
    };
    let mut medians_mm = test.targets().to_owned();
    let (mut total_mm, mut owed_mm, mut ranks) = (0.0, 0.0, Vec::new());
    for (row_index, &row) in rows.iter().enumerate() {
        let samples: Vec<usize> = (0..test.samples())
            .filter(|&sample| test.row_index(sample) == row_index)
            .collect();
        if samples.is_empty() {
            continue;
        }
        let mut posterior = SampledPosterior::new(model, scene, row)?;
        let prior = posterior.prior_samples(&mut stream(test.samples() + row_index));
        let found: Vec<_> = samples
            .par_iter()
            .map_with(posterior, |posterior, &sample| {
                let (readings_ohm, truth_mm) = (test.sample_readings(sample), test.sample_targets(sample));
                posterior.medians(readings_ohm, truth_mm, &prior, &mut stream(sample))
            })
            .collect();
        for (sample, found) in samples.into_iter().zip(found) {
            let pairs = found.coordinates_mm.iter().zip(test.sample_targets(sample));
            let error_mm: f64 = pairs.map(|(median, truth)| (median - truth).abs()).sum();
            total_mm += error_mm;
            owed_mm += error_mm * OWED_TO_SAMPLING / found.effective_samples;
            ranks.push(found.rank_of_truth);
            medians_mm
                .row_mut(sample)
                .iter_mut()
                .zip(found.coordinates_mm)
                .for_each(|(to, from)| *to = from);
        }
    }
    // Written so that NaN is refused.
    let is_trusted = owed_mm <= MAX_OWED_TO_SAMPLING * total_mm && are_uniform(&mut ranks);
    Ok(if is_trusted {
        Ok(medians_mm)
    } else {
        Err(NoReference::Sampling)
    })
}

/// Share by which a median of n independent samples has a larger expected error than the true one, times n: half the
/// variance of a normal median π/2n times the density at it, over the mean absolute deviation (√(2/π) each), is π/4n.
const OWED_TO_SAMPLING: f64 = std::f64::consts::FRAC_PI_4;
/// Share of the reference that may be owed to the number of samples.
const MAX_OWED_TO_SAMPLING: f64 = 0.02;
/// Pairs of nodes up to which posteriors are sampled: some minutes of one core.
const MAX_NODE_PAIRS: f64 = 1e11;

/// Returns false if values cannot come from the uniform distribution from 0 to 1 (Kolmogorov and Smirnov): it does so
/// wrongly once in 100 000 sets.
fn are_uniform(values: &mut [f64]) -> bool {
    const LARGEST_DISTANCE: f64 = 2.5;
    values.sort_by(f64::total_cmp);
    let count = values.len() as f64;
    let distance =
        |(index, &value): (usize, &f64)| (value - index as f64 / count).max((index + 1) as f64 / count - value);
    let largest = values.iter().enumerate().map(distance).fold(0.0, f64::max);
    values.iter().all(|value| value.is_finite()) && largest * count.sqrt() <= LARGEST_DISTANCE
}

/// Reasons for which the Bayesian reference of an error table is no bound for decoders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReferenceNote {
    /// There is none.
    Missing(NoReference),
    /// Its error is above that of the training mean.
    AboveMean,
}

impl ReferenceNote {
    /// The note on the reference of these baselines; `None` if it is a bound.
    pub fn of(baselines: &Baselines) -> Option<Self> {
        match &baselines.reference {
            None => baselines.no_reference.map(Self::Missing),
            Some(reference) if is_above(reference, &baselines.mean) => Some(Self::AboveMean),
            Some(_) => None,
        }
    }
}

fn is_above(reference: &TestErrors, mean: &TestErrors) -> bool {
    reference
        .nodes()
        .zip(mean.nodes())
        .is_some_and(|(reference, mean)| reference.z_mm > mean.z_mm)
}

impl fmt::Display for ReferenceNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missing(NoReference::NotConverged) => {
                "There is no Bayesian reference: the posterior of some row did not converge. Lower the compression, or let \
                 nodes move along z only."
            }
            Self::Missing(NoReference::Rounding) => {
                "There is no Bayesian reference: the deformation shows in the last digits of the readings only, so that their \
                 rounding decides what can be known. Raise the compression or the height, or let nodes move along z only; \
                 with noise of 1e-12 or more there is one."
            }
            Self::Missing(NoReference::Sampling) => {
                "There is no Bayesian reference: too few of the deformations sampled from the loading explain the readings \
                 to estimate their posterior. Raise the noise, or let nodes move along z only."
            }
            Self::Missing(NoReference::TooLarge) => {
                "There is no Bayesian reference: sampling the posteriors of that many or such large rows would take many \
                 minutes. Lower the number of test samples, or the size of the array."
            }
            Self::AboveMean => {
                "The Bayesian reference is no bound here, for it is above the training mean: the readings determine next \
                 to nothing, and both differ by chance. Lower the noise, or draw more test samples."
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Dataset, Seed, Stream},
        evaluation::Errors,
        scene::{Movement, Noise, Scene},
        sensor::SensorModel,
    };

    fn errors(model: &SensorModel, noise: f64, movement: Movement, snapshots: usize) -> Result<Errors, NoReference> {
        let scene = Scene {
            movement,
            noise: Noise::relative(noise),
            ..Scene::default()
        };
        let rows: Vec<usize> = (0..model.scale.rows()).collect();
        let mut test =
            Dataset::simulate(model, &scene, snapshots * rows.len(), &mut Seed(2).rng(Stream::Test)).unwrap();
        test.disturb(model, &scene.noise, &mut Seed(2).rng(Stream::TestNoise))
            .unwrap();
        let mut rng = Seed(2).rng(Stream::Expectation);
        reference_errors(model, &scene, &test, &mut rng).unwrap()
    }

    fn z_mm(model: &SensorModel, noise: f64, snapshots: usize) -> f64 {
        errors(model, noise, Movement::Z, snapshots).unwrap().z_mm
    }

    #[test]
    fn no_limit_is_told_where_only_rounding_sets_it() {
        let model = SensorModel::new("2x6_3x18".parse().unwrap());
        assert_eq!(errors(&model, 0.0, Movement::SIDEWAYS, 10), Err(NoReference::Rounding));
        let sharp = errors(&model, 0.0, Movement::Z, 10).unwrap().z_mm;
        assert!(sharp < 1e-10, "{sharp}");
        // Six unknowns and four readings: whatever the rounding, a plane of deformations stays unknown.
        let blind = SensorModel::new("2x6_3x4".parse().unwrap());
        let [without, with] = [0.0, 1e-8].map(|noise| errors(&blind, noise, Movement::Z, 10).unwrap().z_mm);
        assert!(
            without > 0.05 && (without / with - 1.0).abs() < 0.02,
            "{without} {with}"
        );
    }

    /// Changes of the readings near their rounding, in the two ways in which they come: decoders that know nothing of the
    /// rounding fall below what the posterior takes for the limit.
    #[test]
    fn strokes_near_rounding_have_no_limit() {
        let model = SensorModel::new("4x3_2x9".parse().unwrap());
        let mut flat = model;
        flat.geometry.height_mm = 3e-6;
        for (model, largest_compression) in [(&model, 1e-12), (&model, 1e-11), (&flat, 0.2)] {
            let scene = Scene {
                largest_compression,
                ..Scene::default()
            };
            let test = Dataset::simulate(model, &scene, 80, &mut Seed(2).rng(Stream::Test)).unwrap();
            let found = reference_errors(model, &scene, &test, &mut Seed(2).rng(Stream::Expectation)).unwrap();
            assert_eq!(found, Err(NoReference::Rounding), "{largest_compression}");
        }
    }

    /// One node: the posterior is normal with standard deviation ε/s while that is small against the stroke; when it is
    /// large, readings determine nothing, and the middle of the stroke is off by a quarter of it.
    #[test]
    fn one_node_has_the_closed_form_at_both_ends() {
        let mut model = SensorModel::new("1x1_1x4".parse().unwrap());
        model.geometry.column_node_x0_mm = model.geometry.row_x0_mm;
        let noise = 1e-4;
        // With R = g·d the derivative of ln R is z/d², here averaged over where the node may be.
        let mut expected = 0.0;
        for step in 0..1000 {
            let z = 4.0 + (f64::from(step) + 0.5) / 1000.0;
            let information: f64 = (0..4).map(|k| (z / (z * z + (k as f64 - 1.5).powi(2))).powi(2)).sum();
            expected += noise / information.sqrt() * (2.0 / std::f64::consts::PI).sqrt() / 1000.0;
        }
        let found = z_mm(&model, noise, 20_000);
        assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
        let blind = z_mm(&model, 1.0, 5_000);
        assert!((blind - 0.25).abs() < 0.02, "{blind}");
        assert!(z_mm(&model, 0.0, 5) < 1e-14);
    }

    #[test]
    fn more_noise_never_helps() {
        let model = SensorModel::new("2x4_2x12".parse().unwrap());
        let errors = [1e-5, 1e-4, 1e-3, 1e-2].map(|noise| z_mm(&model, noise, 30));
        assert!(errors.is_sorted(), "{errors:?}");
    }

    /// Median of values with weights.
    fn weighted_median(mut pairs: Vec<(f64, f64)>) -> f64 {
        pairs.sort_by(|one, other| one.0.total_cmp(&other.0));
        let total: f64 = pairs.iter().map(|(_, weight)| weight).sum();
        let mut below = 0.0;
        let middle = pairs.iter().find(|(_, weight)| {
            below += weight;
            below >= 0.5 * total
        });
        middle.unwrap().0
    }

    /// Errors of the medians of 20 000 deformations drawn by the scene itself, weighed by the density of the readings as
    /// the documentation of [`Noise`] defines it; the gain, if it drifts, is integrated by the midpoint rule.
    fn by_plain_weighing(model: &SensorModel, scene: &Scene, test: &Dataset) -> f64 {
        let sampler = scene.sampler(model);
        let mut rng = Seed(77).rng(Stream::Expectation);
        let draws: Vec<_> = (0..20_000).map(|_| sampler.draw(&mut rng)).collect();
        let Noise {
            relative,
            additive_ohm,
            drift,
            ..
        } = scene.noise;
        let gains: Vec<(f64, f64)> = if drift == 0.0 {
            vec![(1.0, 1.0)]
        } else {
            let at = |k: i32| 0.25 * f64::from(k);
            (-14..=14)
                .map(|k| (1.0 + drift * at(k), (-0.5 * at(k) * at(k)).exp()))
                .collect()
        };
        let mut answers = test.targets().to_owned();
        for row in 0..model.scale.rows() {
            let ohms: Vec<Vec<f64>> = draws
                .iter()
                .map(|draw| model.row_resistances(row, draw.row_mm(row)).unwrap())
                .collect();
            for sample in (0..test.samples()).filter(|&sample| test.row_index(sample) == row) {
                let log_density = |ohms: &[f64], gain: f64| -> f64 {
                    let pairs = ohms.iter().zip(test.sample_readings(sample));
                    pairs
                        .map(|(ohm, reading)| {
                            let deviation = (relative * gain * ohm).hypot(additive_ohm);
                            -0.5 * ((reading - gain * ohm) / deviation).powi(2) - deviation.ln()
                        })
                        .sum()
                };
                let logs: Vec<Vec<f64>> = (ohms.iter())
                    .map(|ohms| gains.iter().map(|&(gain, _)| log_density(ohms, gain)).collect())
                    .collect();
                let largest = logs.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
                let weight = |logs: &Vec<f64>| -> f64 {
                    logs.iter()
                        .zip(&gains)
                        .map(|(log, (_, share))| share * (log - largest).exp())
                        .sum()
                };
                let weights: Vec<f64> = logs.iter().map(weight).collect();
                for node in 0..model.scale.nodes_per_row() {
                    let places = draws.iter().zip(&weights).filter(|(_, weight)| **weight > 1e-9);
                    let places =
                        places.map(|(draw, &weight)| (model.geometry.height_mm - draw.row_mm(row)[node].z, weight));
                    answers[[sample, 3 * node + 2]] = weighted_median(places.collect());
                }
            }
        }
        Errors::measure(test, &answers, scene.stroke_mm(&model.geometry)).z_mm
    }

    /// With mean and covariance of the loading alone the reference of a ball would be twice as large. A tilted edge lifts
    /// off, which leaves nodes at exactly 0.
    #[test]
    fn loadings_of_any_shape_have_the_reference_of_plain_sampling() {
        let model = SensorModel::new("2x3_2x9".parse().unwrap());
        let noises = [
            Noise::relative(5e-3),
            Noise {
                additive_ohm: 0.3,
                ..Noise::default()
            },
            Noise {
                drift: 0.05,
                ..Noise::relative(1e-2)
            },
        ];
        for (loading, noise) in ["indenter:sphere", "indenter:edge", "smooth:3"].into_iter().zip(noises) {
            let scene = Scene {
                loading: loading.parse().unwrap(),
                noise,
                ..Scene::default()
            };
            let mut test = Dataset::simulate(&model, &scene, 16, &mut Seed(5).rng(Stream::Test)).unwrap();
            test.disturb(&model, &noise, &mut Seed(5).rng(Stream::TestNoise))
                .unwrap();
            let mut rng = Seed(5).rng(Stream::Expectation);
            let found = reference_errors(&model, &scene, &test, &mut rng).unwrap().unwrap().z_mm;
            let expected = by_plain_weighing(&model, &scene, &test);
            assert!((found / expected - 1.0).abs() < 0.04, "{loading}: {found} {expected}");
        }
    }

    /// One node of a smooth field is uniform, as a random node is: sampling and linearisation meet at all noises.
    #[test]
    fn sampling_agrees_with_linearisation_where_both_hold() {
        let model = SensorModel::new("1x1_1x4".parse().unwrap());
        for noise in [0.3, 1e-2, 1e-3, 1e-5, 1e-8] {
            let random = Scene {
                noise: Noise::relative(noise),
                ..Scene::default()
            };
            let smooth = Scene {
                loading: "smooth:4".parse().unwrap(),
                ..random
            };
            let mut test = Dataset::simulate(&model, &random, 60, &mut Seed(6).rng(Stream::Test)).unwrap();
            test.disturb(&model, &random.noise, &mut Seed(6).rng(Stream::TestNoise))
                .unwrap();
            let z_mm = |scene| {
                let mut rng = Seed(6).rng(Stream::Expectation);
                reference_errors(&model, scene, &test, &mut rng).unwrap().unwrap().z_mm
            };
            let (sampled, linearised) = (z_mm(&smooth), z_mm(&random));
            assert!(
                (sampled / linearised - 1.0).abs() < 0.03,
                "{noise}: {sampled} {linearised}"
            );
        }
    }

    #[test]
    fn a_test_set_that_its_posteriors_do_not_explain_has_no_reference() {
        let mut uniform: Vec<f64> = (0..100).map(|k| (f64::from(k) + 0.5) / 100.0).collect();
        assert!(are_uniform(&mut uniform));
        assert!(!are_uniform(&mut [0.99; 20]) && !are_uniform(&mut [f64::NAN; 20]));
        // Readings of another sensor: no press explains them.
        let model = SensorModel::new("2x3_2x9".parse().unwrap());
        let mut other = model;
        other.resistivity_ohm_per_mm *= 1.2;
        let scene = Scene {
            loading: "indenter".parse().unwrap(),
            noise: Noise::relative(1e-3),
            ..Scene::default()
        };
        let mut test = Dataset::simulate(&other, &scene, 40, &mut Seed(5).rng(Stream::Test)).unwrap();
        test.disturb(&other, &scene.noise, &mut Seed(5).rng(Stream::TestNoise))
            .unwrap();
        let found = reference_errors(&model, &scene, &test, &mut Seed(5).rng(Stream::Expectation)).unwrap();
        assert_eq!(found, Err(NoReference::Sampling));
    }

    #[test]
    fn a_reference_above_the_mean_is_no_bound() {
        let model = SensorModel::new("2x2_2x6".parse().unwrap());
        let set = Dataset::simulate(&model, &Scene::default(), 4, &mut Seed(0).rng(Stream::Test)).unwrap();
        let off = |by_mm: f64| {
            let answers = set.targets().mapv(|value| value + by_mm);
            TestErrors::Nodes(Errors::measure(&set, &answers, 1.0))
        };
        let baselines = |reference: Option<TestErrors>| Baselines {
            mean: off(0.25),
            linear: off(0.1),
            no_reference: reference.is_none().then_some(NoReference::NotConverged),
            reference,
        };
        assert_eq!(ReferenceNote::of(&baselines(Some(off(0.2)))), None);
        assert_eq!(
            ReferenceNote::of(&baselines(Some(off(0.26)))),
            Some(ReferenceNote::AboveMean)
        );
        let missing = ReferenceNote::of(&baselines(None)).unwrap().to_string();
        assert!(missing.contains("converge") && missing.contains("Lower"), "{missing}");
    }
}
