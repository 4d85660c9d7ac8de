use super::{Posterior, expectation_propagation::Marginals, likelihood::expected_misfits, truncated::Factor};
use crate::decoupling::row_problem::Range;

/// A point of linearisation.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) displacements_mm: Vec<f64>,
    /// η of the snapshot's gain.
    pub(super) drift: f64,
}

/// The factors of the unknowns' ranges after expectation propagation, linearised at a point.
pub(super) struct FactorsAt {
    pub(super) factors: Vec<Factor>,
    pub(super) at: Point,
}

impl FactorsAt {
    /// The same factors for unknowns measured from another point.
    fn seen_from(&self, at: &Point, widths: &[f64]) -> Vec<Factor> {
        let points = at.displacements_mm.iter().zip(&self.at.displacements_mm);
        let shifts = points.zip(widths).map(|((to, from), width)| (to - from) / width);
        let shifts = shifts.chain([at.drift - self.at.drift]);
        self.factors.iter().zip(shifts).map(|(factor, shift)| factor.shifted(shift)).collect()
    }
}

/// The posterior of the equations linearised at a point.
pub(super) struct Linearised {
    pub(super) marginals: Marginals,
    pub(super) means: Point,
    pub(super) medians_mm: Vec<f64>,
    /// w that the linearisation expects at the means.
    pub(super) misfits: Vec<f64>,
}

impl Posterior {
    /// The posterior of the equations linearised at `at`, where they were evaluated, with `blur` times the noise; `None`
    /// if numbers overflow. Expectation propagation begins with the factors of an earlier linearisation, if there was one.
    pub(super) fn linearised(
        &self,
        row: usize,
        at: &Point,
        blur: f64,
        earlier: Option<&FactorsAt>,
    ) -> Option<Linearised> {
        let n = self.widths.len();
        let mut model = self.likelihood.linearised(&self.problem, at.drift, blur, &self.widths);
        let ranges = self.ranges.iter().zip(&at.displacements_mm).zip(&self.widths);
        model.ranges = ranges
            .map(|((range, at), width)| Range {
                lowest: (range.lowest - at) / width,
                highest: (range.highest - at) / width,
            })
            .collect();
        if self.likelihood.has_drift() {
            let range = self.likelihood.drift_range();
            model.ranges.push(Range {
                lowest: range.lowest - at.drift,
                highest: range.highest,
            });
        }
        let place = self.rows.iter().position(|&known| known == row);
        let place = place.expect("the row is one of those given");
        let unknowns = model.ranges.len();
        self.priors[place].append_to(&mut model.equations, unknowns, &at.displacements_mm, &self.ranges);
        if let Some(earlier) = earlier {
            model.first_factors = earlier.seen_from(at, &self.widths);
        }
        let mut marginals = model.marginals()?;
        let misfits = expected_misfits(&model, self.problem.equations(), &marginals.of_unknowns, blur);
        let drift = marginals
            .of_unknowns
            .get(n)
            .map_or(0.0, |marginal| at.drift + marginal.mean);
        marginals.of_unknowns.truncate(n);
        let places = marginals.of_unknowns.iter().zip(&at.displacements_mm).zip(&self.widths);
        let places = places.zip(&self.ranges);
        let place = |x: f64, at: f64, width: f64, range: &Range| range.clamp(at + x * width);
        Some(Linearised {
            means: Point {
                displacements_mm: places
                    .clone()
                    .map(|(((marginal, &at), &width), range)| place(marginal.mean, at, width, range))
                    .collect(),
                drift,
            },
            medians_mm: places
                .map(|(((marginal, &at), &width), range)| place(marginal.median, at, width, range))
                .collect(),
            misfits,
            marginals,
        })
    }
}
