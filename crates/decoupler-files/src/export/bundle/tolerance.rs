use super::{
    exact::Growth,
    portable::Portable,
    tables::names,
    weights::{Arithmetic, Digits},
};
use decoupler_core::decoupling::LARGEST_ERROR;

/// Largest deviation of a bundle of floating-point numbers from its decoder, relative to the widest range of an output.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    pub(super) limit: f64,
    /// The limit of the precision, without regard to the decoder.
    usual: f64,
    /// Change of an output, in parts of its range, per relative error of the numbers that are added up in a layer.
    amplification: f64,
}

impl Tolerance {
    /// Usual limit of double precision.
    pub(super) const DOUBLE: f64 = 1e-12;
    /// Largest limit, whatever the decoder.
    pub(super) const LARGEST: f64 = 0.01;
    /// Usual limit of single precision.
    pub(super) const SINGLE: f64 = 1e-5;

    /// The usual limit. Where the `deviation` of an evaluation comes near it, because the decoder's own sums let rounding
    /// errors grow this much, the bound on these: each of n numbers that are added up has a relative error of at most some
    /// n units (N. J. Higham, Accuracy and Stability of Numerical Algorithms, section 3.1).
    pub(super) fn of(portable: &Portable, arithmetic: Arithmetic, growth: &Growth, deviation: f64) -> Self {
        /// Other programs add up in another order, and may be this much closer or farther.
        const NEAR: f64 = 0.5;
        // Next to the sums: difference, division, logarithm, weight and the function of a layer.
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

    /// The limit of an iteration on the equations of the sensor: the error within which an answer counts as their solution.
    pub(super) fn of_equations() -> Self {
        Self {
            limit: LARGEST_ERROR,
            usual: LARGEST_ERROR,
            amplification: 0.0,
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
