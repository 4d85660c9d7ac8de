use super::{
    Posterior, expectation_propagation::Marginals, factor::Factor, likelihood::expected_misfits,
    linear_model::LinearModel, marginal::medians,
};
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
    at: Point,
    pub(super) marginals: Marginals,
    pub(super) means: Point,
    /// w that the linearisation expects at the means.
    pub(super) misfits: Vec<f64>,
}

impl Linearised {
    /// Appends the factors of the ranges, for displacements measured from another point.
    fn append_factors(&self, factors: &mut Vec<Factor>, at: &Point, widths: &[f64]) {
        let points = at.displacements_mm.iter().zip(&self.at.displacements_mm);
        let shifts = points.zip(widths).map(|((to, from), width)| (to - from) / width);
        let marginals = self.marginals.of_unknowns.iter().zip(shifts);
        factors.extend(marginals.map(|(marginal, shift)| marginal.factor.shifted(shift)));
    }
}

impl Posterior {
    /// Makes `model` the equations of row-wire `row` linearised at a point, where they were evaluated, with a factor of the
    /// noise. Expectation propagation begins with the factors of an earlier linearisation, if there was one.
    pub(super) fn linearise(
        &self,
        model: &mut LinearModel,
        row: usize,
        (at, blur): (&Point, f64),
        earlier: Option<&Linearised>,
    ) {
        self.likelihood
            .linearise(model, &self.problem, (at.drift, blur), &self.widths);
        let ranges = self.ranges.iter().zip(&at.displacements_mm).zip(&self.widths);
        model.ranges.clear();
        model.ranges.extend(ranges.map(|((range, at), width)| Range {
            lowest: (range.lowest - at) / width,
            highest: (range.highest - at) / width,
        }));
        if self.likelihood.has_drift() {
            let range = self.likelihood.drift_range();
            model.ranges.push(Range {
                lowest: range.lowest - at.drift,
                highest: range.highest,
            });
        }
        let unknowns = model.ranges.len();
        self.priors[self.place(row)].append_to(&mut model.equations, unknowns, &at.displacements_mm, &self.ranges);
        model.first_factors.clear();
        if let Some(earlier) = earlier {
            earlier.append_factors(&mut model.first_factors, at, &self.widths);
        }
    }

    /// The posterior with these `marginals` of the `model` linearised at `at` with `blur` times the noise.
    pub(super) fn linearised(
        &self,
        model: &LinearModel,
        at: &Point,
        blur: f64,
        mut marginals: Marginals,
    ) -> Linearised {
        let n = self.widths.len();
        let misfits = expected_misfits(model, self.problem.equations(), &marginals.of_unknowns, blur);
        let drift = marginals
            .of_unknowns
            .get(n)
            .map_or(0.0, |marginal| at.drift + marginal.mean);
        marginals.of_unknowns.truncate(n);
        let displacements_mm = self.displacements_mm(at, marginals.of_unknowns.iter().map(|marginal| marginal.mean));
        Linearised {
            at: at.clone(),
            means: Point {
                displacements_mm,
                drift,
            },
            misfits,
            marginals,
        }
    }

    /// The medians of the displacements.
    pub(super) fn medians_mm(&self, found: &Linearised) -> Vec<f64> {
        self.displacements_mm(&found.at, medians(&found.marginals.of_unknowns).into_iter())
    }

    /// Displacements within their ranges from x = (displacement − present) / width.
    fn displacements_mm(&self, at: &Point, x: impl Iterator<Item = f64>) -> Vec<f64> {
        let places = x.zip(&at.displacements_mm).zip(&self.widths).zip(&self.ranges);
        places
            .map(|(((x, at), width), range)| range.clamp(at + x * width))
            .collect()
    }
}
