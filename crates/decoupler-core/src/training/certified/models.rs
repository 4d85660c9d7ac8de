//! The models of NIST's nonlinear regression problems.

use std::f64::consts::PI;

use super::dual::Dual;

/// A response from parameters and predictors.
pub(super) type Model = fn(&[Dual], &[f64]) -> Dual;

/// Returns the model of the problem with this name.
pub(super) fn model(name: &str) -> Model {
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
        // Of the logarithm of the response.
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
