//! Test of the damping on problems with certified solutions: the nonlinear regressions of NIST's Statistical Reference
//! Datasets, each from both of its starting points.
//!
//! Steps follow [`LevenbergMarquardt`](crate::training::levenberg_marquardt), with the default damping and the same rule, until
//! no step lowers the error. Only the equations differ: those of networks consist of products that other models lack,
//! so here J is formed explicitly and the step is found by QR decomposition. The weights of a network are of order 1;
//! so are these parameters, which are in units of their starting values.
//!
//! The models are differentiated with dual numbers, which carry their derivatives with respect to up to nine
//! parameters.

use std::{
    f64::consts::PI,
    ops::{Add, Div, Mul, Neg, Sub},
};

use faer::{Mat, prelude::SolveLstsq};
use serde::Deserialize;

use crate::training::{Damping, StopReason};

#[derive(Deserialize)]
struct Certified {
    problems: Vec<Problem>,
}

#[derive(Deserialize)]
struct Problem {
    name: String,
    starts: [Vec<f64>; 2],
    certified: Vec<f64>,
    predictors: Vec<Vec<f64>>,
    response: Vec<f64>,
}

/// Residuals and their Jacobian with respect to the parameters in units of their starting values.
struct LinearisedProblem {
    residuals: Mat<f64>,
    jacobian: Mat<f64>,
}

/// A model fitted to data from one starting point.
struct Fit<'a> {
    model: Model,
    problem: &'a Problem,
    units: &'a [f64],
}

impl Fit<'_> {
    fn linearised(&self, scaled: &[f64]) -> LinearisedProblem {
        let parameters: Vec<Dual> = (0..scaled.len())
            .map(|k| Dual::parameter(k, scaled[k]) * self.units[k])
            .collect();
        let responses = self.problem.response.iter().enumerate().map(|(row, &response)| {
            let predictors: Vec<f64> = self.problem.predictors.iter().map(|column| column[row]).collect();
            let is_logarithmic = self.problem.name == "Nelson";
            let response = if is_logarithmic { response.ln() } else { response };
            (self.model)(&parameters, &predictors) - response
        });
        let residuals: Vec<Dual> = responses.collect();
        LinearisedProblem {
            residuals: Mat::from_fn(residuals.len(), 1, |row, _| residuals[row].value),
            jacobian: Mat::from_fn(residuals.len(), scaled.len(), |row, k| residuals[row].slopes[k]),
        }
    }

    /// Steps until no step lowers the sum of squares; returns the parameters, the number of steps, and the reason for
    /// stopping.
    fn run(&self) -> (Vec<f64>, usize, StopReason) {
        /// More than any problem needs.
        const MAX_STEPS: usize = 2000;
        let damping = Damping::default();
        let (mut mu, mut scaled) = (damping.mu, vec![1.0; self.units.len()]);
        let mut at = self.linearised(&scaled);
        for steps in 0.. {
            let before = at.residuals.squared_norm_l2();
            let found = damping.search(&mut mu, |mu| {
                let step = step(&at, mu);
                let candidate: Vec<f64> = scaled.iter().zip(step).map(|(scaled, step)| scaled + step).collect();
                let next = self.linearised(&candidate);
                // False for NaN.
                (next.residuals.squared_norm_l2() < before).then_some((candidate, next))
            });
            match found {
                Ok(found) if steps < MAX_STEPS => (scaled, at) = found,
                Ok(_) => return (self.parameters(&scaled), steps, StopReason::EpochsReached),
                Err(reason) => return (self.parameters(&scaled), steps, reason),
            }
        }
        unreachable!("no problem needs that many steps")
    }

    fn parameters(&self, scaled: &[f64]) -> Vec<f64> {
        scaled
            .iter()
            .zip(self.units)
            .map(|(scaled, unit)| scaled * unit)
            .collect()
    }
}

/// Returns the minimiser δ of ‖[J; √mu I] δ + [e; 0]‖.
fn step(at: &LinearisedProblem, mu: f64) -> Vec<f64> {
    let (rows, columns) = (at.jacobian.nrows(), at.jacobian.ncols());
    let matrix = Mat::from_fn(rows + columns, columns, |row, column| match row.checked_sub(rows) {
        None => at.jacobian[(row, column)],
        Some(below) if below == column => mu.sqrt(),
        Some(_) => 0.0,
    });
    let right = Mat::from_fn(rows + columns, 1, |row, _| {
        if row < rows { -at.residuals[(row, 0)] } else { 0.0 }
    });
    let step = matrix.qr().solve_lstsq(&right);
    (0..columns).map(|k| step[(k, 0)]).collect()
}

/// Returns the number of correct digits of the worst parameter: its negative log relative error, at most the 11
/// certified digits.
fn correct_digits(found: &[f64], certified: &[f64]) -> f64 {
    let digits = |(found, certified): (&f64, &f64)| -((found - certified) / certified).abs().log10();
    let digits = found.iter().zip(certified).map(digits);
    // A fit that has diverged to NaN has none.
    digits
        .map(|digits| digits.clamp(0.0, 11.0).max(0.0))
        .fold(11.0, f64::min)
}

/// The best published solver reaches 9.4 digits on average.
#[test]
fn certified_parameters_are_found_to_more_than_nine_digits() {
    let text = include_str!("../../../tests/certified/nist_strd.json");
    let problems = serde_json::from_str::<Certified>(text).unwrap().problems;
    assert_eq!(problems.len(), 27);
    let mut table = String::new();
    let mut all = Vec::new();
    for problem in &problems {
        for (start, units) in problem.starts.iter().enumerate() {
            let model = model(&problem.name);
            let (found, steps, reason) = Fit { model, problem, units }.run();
            let digits = correct_digits(&found, &problem.certified);
            table += &format!(
                "{:10} start {}: {digits:5.2} digits, {steps} steps, {reason:?}\n",
                problem.name,
                start + 1
            );
            all.push((problem.name.as_str(), start, digits));
        }
    }
    let mean = all.iter().map(|(_, _, digits)| digits).sum::<f64>() / all.len() as f64;
    eprintln!("{table}{mean:.2} digits on average");
    assert!(mean >= 9.4, "{mean:.2} digits on average");
    for (name, start, digits) in all {
        // From its first starting point, MGH10 needs a larger mu than the default allows.
        let is_out_of_reach = (name, start) == ("MGH10", 0);
        assert!(
            digits > 6.0 || is_out_of_reach,
            "{name}, start {}: {digits:.2} digits",
            start + 1
        );
    }
}

/// A response from parameters and predictors.
type Model = fn(&[Dual], &[f64]) -> Dual;

/// Returns the model of the problem with this name.
fn model(name: &str) -> Model {
    match name {
        "Misra1a" | "BoxBOD" => |b, x| b[0] * (1.0 - (-b[1] * x[0]).exp()),
        "Misra1b" => |b, x| b[0] * (1.0 - 1.0 / (1.0 + b[1] * x[0] / 2.0).square()),
        "Misra1c" => |b, x| b[0] * (1.0 - (1.0 + 2.0 * b[1] * x[0]).pow(Dual::constant(-0.5))),
        "Misra1d" => |b, x| b[0] * b[1] * x[0] / (1.0 + b[1] * x[0]),
        "Chwirut1" | "Chwirut2" => |b, x| (-b[0] * x[0]).exp() / (b[1] + b[2] * x[0]),
        "Lanczos1" | "Lanczos2" | "Lanczos3" => |b, x| {
            let decay = |k: usize| b[k] * (-b[k + 1] * x[0]).exp();
            decay(0) + decay(2) + decay(4)
        },
        "Gauss1" | "Gauss2" | "Gauss3" => |b, x| {
            let bell = |k: usize| b[k] * (-((x[0] - b[k + 1]) / b[k + 2]).square()).exp();
            b[0] * (-b[1] * x[0]).exp() + bell(2) + bell(5)
        },
        "DanWood" => |b, x| b[0] * Dual::constant(x[0]).pow(b[1]),
        "Kirby2" => |b, x| polynomial(&b[..3], x[0]) / (1.0 + x[0] * polynomial(&b[3..], x[0])),
        "Hahn1" | "Thurber" => |b, x| polynomial(&b[..4], x[0]) / (1.0 + x[0] * polynomial(&b[4..], x[0])),
        // Model of the logarithm of the response.
        "Nelson" => |b, x| b[0] - b[1] * x[0] * (-b[2] * x[1]).exp(),
        "MGH09" => |b, x| b[0] * (x[0] * x[0] + x[0] * b[1]) / (x[0] * x[0] + x[0] * b[2] + b[3]),
        "MGH10" => |b, x| b[0] * (b[1] / (x[0] + b[2])).exp(),
        "MGH17" => |b, x| b[0] + b[1] * (-x[0] * b[3]).exp() + b[2] * (-x[0] * b[4]).exp(),
        "Roszman1" => |b, x| b[0] - b[1] * x[0] - (b[2] / (x[0] - b[3])).atan() / PI,
        "ENSO" => |b, x| {
            let cycle = |period: Dual, cos: Dual, sin: Dual| {
                let phase = 2.0 * PI * x[0] / period;
                cos * phase.cos() + sin * phase.sin()
            };
            b[0] + cycle(Dual::constant(12.0), b[1], b[2]) + cycle(b[3], b[4], b[5]) + cycle(b[6], b[7], b[8])
        },
        "Rat42" => |b, x| b[0] / (1.0 + (b[1] - b[2] * x[0]).exp()),
        "Rat43" => |b, x| b[0] / (1.0 + (b[1] - b[2] * x[0]).exp()).pow(1.0 / b[3]),
        "Eckerle4" => |b, x| b[0] / b[1] * (-0.5 * ((x[0] - b[2]) / b[1]).square()).exp(),
        "Bennett5" => |b, x| b[0] * (b[1] + x[0]).pow(-1.0 / b[2]),
        _ => unreachable!("no model for {name}"),
    }
}

fn polynomial(coefficients: &[Dual], x: f64) -> Dual {
    let highest_first = coefficients.iter().rev().copied();
    highest_first
        .reduce(|sum, coefficient| sum * x + coefficient)
        .expect("at least one coefficient")
}

/// Maximum number of parameters of a problem.
const MAX_PARAMETERS: usize = 9;

#[derive(Clone, Copy, Debug)]
struct Dual {
    value: f64,
    slopes: [f64; MAX_PARAMETERS],
}

impl Dual {
    fn constant(value: f64) -> Self {
        let slopes = [0.0; MAX_PARAMETERS];
        Self { value, slopes }
    }

    fn parameter(index: usize, value: f64) -> Self {
        let mut parameter = Self::constant(value);
        parameter.slopes[index] = 1.0;
        parameter
    }

    /// Returns a function of this number, given its value and derivative there.
    fn chain(self, value: f64, derivative: f64) -> Self {
        let slopes = self.slopes.map(|slope| derivative * slope);
        Self { value, slopes }
    }

    fn combined(self, other: Self, value: f64, by_self: f64, by_other: f64) -> Self {
        let slopes = std::array::from_fn(|k| by_self * self.slopes[k] + by_other * other.slopes[k]);
        Self { value, slopes }
    }

    fn exp(self) -> Self {
        let value = self.value.exp();
        self.chain(value, value)
    }

    fn sin(self) -> Self {
        self.chain(self.value.sin(), self.value.cos())
    }

    fn cos(self) -> Self {
        self.chain(self.value.cos(), -self.value.sin())
    }

    fn atan(self) -> Self {
        self.chain(self.value.atan(), 1.0 / (1.0 + self.value * self.value))
    }

    fn square(self) -> Self {
        self * self
    }

    fn pow(self, exponent: Self) -> Self {
        let value = self.value.powf(exponent.value);
        let by_base = exponent.value * self.value.powf(exponent.value - 1.0);
        self.combined(exponent, value, by_base, value * self.value.ln())
    }
}

impl Neg for Dual {
    type Output = Self;

    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl Add for Dual {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.combined(other, self.value + other.value, 1.0, 1.0)
    }
}

impl Sub for Dual {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self.combined(other, self.value - other.value, 1.0, -1.0)
    }
}

impl Mul for Dual {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        self.combined(other, self.value * other.value, other.value, self.value)
    }
}

impl Div for Dual {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        self.combined(other, value, 1.0 / other.value, -value / other.value)
    }
}

macro_rules! with_constants {
    ($($operator:ident $method:ident),*) => {$(
        impl $operator<f64> for Dual {
            type Output = Self;

            fn $method(self, other: f64) -> Self {
                self.$method(Self::constant(other))
            }
        }

        impl $operator<Dual> for f64 {
            type Output = Dual;

            fn $method(self, other: Dual) -> Dual {
                Dual::constant(self).$method(other)
            }
        }
    )*};
}

with_constants!(Add add, Sub sub, Mul mul, Div div);
