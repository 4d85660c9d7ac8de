use super::{Posterior, expectation_propagation::Marginals, likelihood::expected_misfits};
use crate::decoupling::row_problem::Range;

/// A point of linearisation.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) displacements_mm: Vec<f64>,
    /// η of the snapshot's gain.
    pub(super) drift: f64,
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
    /// if numbers overflow.
    pub(super) fn linearised(&self, row: usize, at: &Point, blur: f64) -> Option<Linearised> {
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
