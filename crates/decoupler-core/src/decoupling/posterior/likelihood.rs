use super::{
    gaussian::{LinearModel, RoundedReading},
    iteration::log_probability,
    truncated::Marginal,
};
use crate::{
    decoupling::row_problem::{Range, RowProblem},
    numerics::normal_cdf,
    scene::NoiseSource,
};

/// Linearised likelihood of the readings of one row-wire.
///
/// With R(u) the resistances and γ = 1 + drift · η the gain of the snapshot, a reading m before rounding is normal about
/// P = γ R(u) with standard deviation σ = √((relative · P)² + additive²), truncated to m > 0:
///
/// `ln p(m|u,η) = −½ w² − ln σ(P) − ln Φ(P/σ(P)),   w = (m − P)/σ(P)`.
///
/// w is nearly linear in u: with relative noise it is the conductance, up to constants. The two normalising terms,
/// which depend on u through σ, are linearised as well. η is one more unknown, with a standard normal prior.
///
/// The noise is at least the rounding of the readings. A reading that a converter rounded is known to lie in an
/// interval: w is then the distance from the middle of the step, and the normalising term vanishes as the step grows
/// beyond σ.
#[derive(Clone, Debug)]
pub(super) struct Likelihood {
    noise: NoiseSource,
    rounding: f64,
    /// Relative noise, including the rounding.
    relative: f64,
}

/// Rounding of a reading that comes from a few operations in double precision, as a standard deviation.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

impl Likelihood {
    pub(super) fn new(noise: NoiseSource) -> Self {
        Self::rounded(noise, ROUNDING)
    }

    fn rounded(noise: NoiseSource, rounding: f64) -> Self {
        Self {
            relative: libm::hypot(noise.relative(), rounding),
            rounding,
            noise,
        }
    }

    /// Returns the same likelihood for readings rounded to 1/`parts` of the assumed rounding.
    pub(super) fn rounded_finer(&self, parts: f64) -> Self {
        Self::rounded(self.noise, self.rounding / parts)
    }

    /// True if readings share an error, which is then the last unknown.
    pub(super) fn has_drift(&self) -> bool {
        self.noise.drift() > 0.0
    }

    /// Range of η: gains are above 0.
    pub(super) fn drift_range(&self) -> Range {
        Range {
            lowest: -1.0 / self.noise.drift(),
            highest: f64::INFINITY,
        }
    }

    /// Returns the most likely η for readings, given the resistances of the evaluated `problem`.
    pub(super) fn likeliest_drift(&self, problem: &RowProblem) -> f64 {
        let pairs =
            (0..problem.equations()).map(|reading| (problem.reading_ohm(reading), problem.resistance_ohm(reading)));
        self.likeliest_drift_of(pairs)
    }

    /// As [`Self::likeliest_drift`], for pairs of readings and resistances.
    pub(super) fn likeliest_drift_of(&self, pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
        let drift = self.noise.drift();
        let (mut precision, mut linear) = (1.0, 0.0);
        for (reading_ohm, ohm) in pairs {
            // Noise as at gain 1; all readings share the same gain.
            let deviation_ohm = self.deviation_ohm(ohm);
            let slope = drift * ohm / deviation_ohm;
            precision += slope * slope;
            linear += slope * (reading_ohm - ohm) / deviation_ohm;
        }
        (linear / precision).max(-(1.0 - SMALLEST_GAIN) / drift)
    }

    /// ln p(readings | resistances, η), for pairs of readings and resistances, without approximation; −∞ for gains of
    /// 0 and below.
    pub(super) fn log_density(&self, drift: f64, pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
        let gain = 1.0 + self.noise.drift() * drift;
        if gain <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let of_pair = |(reading_ohm, ohm): (f64, f64)| {
            let predicted_ohm = gain * ohm;
            let deviation_ohm = self.deviation_ohm(predicted_ohm);
            let density = match self.noise.rounded_from_ohm(reading_ohm) {
                None => {
                    let misfit = (reading_ohm - predicted_ohm) / deviation_ohm;
                    -0.5 * misfit * misfit - deviation_ohm.ln()
                }
                Some((lowest_ohm, highest_ohm)) => log_probability(
                    (lowest_ohm - predicted_ohm) / deviation_ohm,
                    (highest_ohm - predicted_ohm) / deviation_ohm,
                ),
            };
            // Beyond, Φ is 1 in double precision.
            if predicted_ohm > 9.0 * deviation_ohm {
                density
            } else {
                density - normal_cdf(predicted_ohm / deviation_ohm).ln()
            }
        };
        let sum: f64 = pairs.map(of_pair).sum();
        if sum.is_nan() { f64::NEG_INFINITY } else { sum }
    }

    /// w of every reading, and −∂w/∂ ln P, for proposals: the width of a converter step counts as noise.
    pub(super) fn misfits_and_scales(&self, problem: &RowProblem, drift: f64) -> (Vec<f64>, Vec<f64>) {
        let gain = self.gain(drift);
        let of_reading = |reading| {
            let (read_ohm, predicted_ohm) = (problem.reading_ohm(reading), gain * problem.resistance_ohm(reading));
            let step_ohm = match self.noise.rounded_from_ohm(read_ohm) {
                Some((lowest, highest)) if highest.is_finite() => (highest - lowest) / 12.0_f64.sqrt(),
                _ => 0.0,
            };
            let deviation_ohm = libm::hypot(self.deviation_ohm(predicted_ohm), step_ohm);
            let of_additive = self.noise.additive_ohm().hypot(step_ohm) / deviation_ohm;
            let relative = (1.0 - of_additive * of_additive).max(0.0);
            let misfit = (read_ohm - predicted_ohm) / deviation_ohm;
            (misfit, predicted_ohm / deviation_ohm + relative * misfit)
        };
        (0..problem.equations()).map(of_reading).unzip()
    }

    /// ∂ ln(gain)/∂η.
    pub(super) fn log_gain_slope(&self, drift: f64) -> f64 {
        self.noise.drift() / self.gain(drift)
    }

    fn deviation_ohm(&self, predicted_ohm: f64) -> f64 {
        let (relative_ohm, additive_ohm) = (self.relative * predicted_ohm, self.noise.additive_ohm());
        if additive_ohm == 0.0 {
            relative_ohm
        } else {
            libm::hypot(relative_ohm, additive_ohm)
        }
    }

    /// w of every reading, from the residuals of the evaluated `problem`.
    pub(super) fn misfits(&self, problem: &RowProblem, drift: f64) -> impl Iterator<Item = f64> {
        let gain = self.gain(drift);
        let misfit = move |reading| {
            let predicted_ohm = gain * problem.resistance_ohm(reading);
            (problem.reading_ohm(reading) - predicted_ohm) / self.deviation_ohm(predicted_ohm)
        };
        (0..problem.equations()).map(misfit)
    }

    /// m/(γR) − 1 of every reading m, from the resistances R of the evaluated `problem`.
    pub(super) fn relative_misfits(&self, problem: &RowProblem, drift: f64) -> impl Iterator<Item = f64> {
        let gain = self.gain(drift);
        (0..problem.equations())
            .map(move |reading| problem.reading_ohm(reading) / (gain * problem.resistance_ohm(reading)) - 1.0)
    }

    /// 2 Σ ln(σ(P) Φ(P/σ(P))) over readings, from the resistances of the evaluated `problem`: the log-likelihood
    /// apart from its exponent and constants. σ(P) is omitted for readings that a converter rounded, whose likelihood
    /// is a probability.
    pub(super) fn log_normalisers(&self, problem: &RowProblem, drift: f64) -> f64 {
        let gain = self.gain(drift);
        let of_reading = |reading| {
            let predicted_ohm = gain * problem.resistance_ohm(reading);
            let deviation_ohm = self.deviation_ohm(predicted_ohm);
            let is_rounded = self.noise.rounded_from_ohm(problem.reading_ohm(reading)).is_some();
            let width = if is_rounded { 0.0 } else { deviation_ohm.ln() };
            2.0 * (width + normal_cdf(predicted_ohm / deviation_ohm).ln())
        };
        (0..problem.equations()).map(of_reading).sum()
    }

    fn gain(&self, drift: f64) -> f64 {
        (1.0 + self.noise.drift() * drift).max(SMALLEST_GAIN)
    }

    /// Sets `model` to the likelihood linearised where `problem` was evaluated, without priors and ranges, for
    /// unknowns x = (displacement − current) / width, and η − `drift` if there is drift. Every σ is multiplied by
    /// `blur`.
    pub(super) fn linearise(
        &self,
        model: &mut LinearModel,
        problem: &RowProblem,
        (drift, blur): (f64, f64),
        widths: &[f64],
    ) {
        let (n, readings) = (widths.len(), problem.equations());
        let unknowns = n + usize::from(self.has_drift());
        let gain = self.gain(drift);
        model.equations.clear();
        model.linear.clear();
        model.linear.resize(unknowns, 0.0);
        model.rounded.clear();
        let mut form = vec![0.0; unknowns];
        for reading in 0..readings {
            let (read_ohm, predicted_ohm) = (problem.reading_ohm(reading), gain * problem.resistance_ohm(reading));
            let own_ohm = self.deviation_ohm(predicted_ohm);
            let deviation_ohm = blur * own_ohm;
            let interval_ohm = self.noise.rounded_from_ohm(read_ohm);
            let weight = interval_ohm.map_or(1.0, |(lowest, highest)| narrowness(0.5 * (highest - lowest) / own_ohm));
            // Parts of σ² that grow with the reading, and that do not.
            let additive = (self.noise.additive_ohm() / own_ohm).powi(2);
            let relative = weight * (1.0 - additive).max(0.0);
            let scale = predicted_ohm / deviation_ohm;
            // −∂w/∂ ln P, and ∂(−ln σ − ln Φ)/∂ ln P.
            let slope = scale * (1.0 + relative * (read_ohm - predicted_ohm) / predicted_ohm);
            let signals = predicted_ohm / own_ohm;
            let truncation = if additive > 0.0 {
                inverse_mills(signals) * additive * signals
            } else {
                0.0
            };
            let normalising = -relative - truncation;
            // ∂ ln P/∂x: −∂ ln s/∂x for moving axes.
            let slopes = problem.log_conductance_slopes(reading);
            for ((value, of_unknown), &width) in form.iter_mut().zip(slopes).zip(widths) {
                *value = -of_unknown * width;
            }
            if self.has_drift() {
                form[n] = self.noise.drift() / gain;
            }
            for (linear, value) in model.linear.iter_mut().zip(&form) {
                *linear += normalising * value;
            }
            let misfit = (read_ohm - predicted_ohm) / deviation_ohm;
            form.iter_mut().for_each(|value| *value *= slope);
            match interval_ohm {
                None => {
                    model.equations.extend_from_slice(&form);
                    model.equations.push(misfit);
                }
                Some((lowest, highest)) => model.rounded.push(RoundedReading {
                    form: form.clone(),
                    misfit,
                    range: Range {
                        lowest: misfit + (lowest - read_ohm) / deviation_ohm,
                        highest: misfit + (highest - read_ohm) / deviation_ohm,
                    },
                }),
            }
        }
        if self.has_drift() {
            model.equations.extend((0..n).map(|_| 0.0));
            model.equations.extend([1.0, -drift]);
        }
    }
}

/// Misfits expected at `x`, as [`Likelihood::misfits`] returns them, for a `model` linearised with `blur`.
pub(super) fn expected_misfits(model: &LinearModel, readings: usize, x: &[Marginal], blur: f64) -> Vec<f64> {
    let product = |form: &[f64]| -> f64 { form.iter().zip(x).map(|(value, x)| value * x.mean).sum() };
    if model.rounded.is_empty() {
        let rows = model.equations.chunks_exact(x.len() + 1).take(readings);
        rows.map(|row| blur * (row[x.len()] - product(&row[..x.len()])))
            .collect()
    } else {
        let rows = model.rounded.iter();
        rows.map(|row| blur * (row.misfit - product(&row.form))).collect()
    }
}

/// Minimum gain considered.
const SMALLEST_GAIN: f64 = 1e-6;

/// `−∂ ln P/∂ ln σ` of the probability of an interval of `half_width` standard deviations on either side of the mean:
/// 1 for a narrow one, which is a density, and 0 for a wide one.
fn narrowness(half_width: f64) -> f64 {
    let probability = libm::erf(half_width * std::f64::consts::FRAC_1_SQRT_2);
    let edges = 2.0 * half_width * density(half_width);
    if half_width < 1e-6 {
        1.0
    } else {
        (edges / probability).min(1.0)
    }
}

/// φ(x)/Φ(x) for x ≥ 0.
fn inverse_mills(x: f64) -> f64 {
    density(x) / normal_cdf(x)
}

fn density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt()
}
