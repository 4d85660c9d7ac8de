use super::{
    Posterior,
    expectation_propagation::Marginals,
    factor::Factor,
    likelihood::expected_misfits,
    pack::{LANES, Pack, add, add_to_both, dot, dots},
    truncated::medians,
};
use crate::decoupling::row_problem::Range;

/// Gaussians in square-root form, one in each lane: mean and a factor L of the covariance `Σ = L Lᵀ`.
///
/// Precision matrices square the condition number of the equations; at a noise near rounding, the contributions of
/// the other factors would be lost. L comes from a QR decomposition of the equations themselves, and factors that are
/// added later update L, not Σ (Potter's square-root filter; Bierman, Factorization Methods for Discrete Sequential
/// Estimation, 1977, section V.2). Variances are sums of squares.
#[derive(Clone, Debug, Default)]
pub(super) struct RowPosteriors {
    unknowns: usize,
    mean: Vec<Pack>,
    /// L, row by row: unknowns × unknowns.
    root: Vec<Pack>,
    /// Lᵀa of the last requested direction.
    along: Vec<Pack>,
    /// Number of equations, without those of single unknowns.
    equations: usize,
    /// `[A, b]`, column by column; with room below the equations for one equation of each unknown.
    columns: Vec<Pack>,
    /// c of the linear term.
    linear: Vec<Pack>,
    /// Equations of single unknowns: coefficient and right-hand side.
    singles: Vec<(Pack, Pack)>,
    /// Unknown that belongs to each column.
    order: Vec<[usize; LANES]>,
    /// Squared norms of the remaining columns.
    squares: Vec<Pack>,
    /// A row of L, and Qᵀb + Lᵀc.
    row: Vec<Pack>,
    right: Vec<Pack>,
}

/// A direction in the space of the unknowns.
#[derive(Clone, Copy)]
pub(super) enum Direction<'a> {
    /// One unknown.
    Unknown(usize),
    /// A linear form: one coefficient for each unknown.
    Form(&'a [Pack]),
}

impl RowPosteriors {
    /// Allocates space for this many equations of all unknowns.
    pub(super) fn make_room(&mut self, unknowns: usize, equations: usize) {
        if (self.unknowns, self.equations) == (unknowns, equations) {
            return;
        }
        (self.unknowns, self.equations) = (unknowns, equations);
        self.columns.resize((unknowns + 1) * (equations + unknowns), Pack::ZERO);
        self.root.resize(unknowns * unknowns, Pack::ZERO);
        self.singles.resize(unknowns, (Pack::ZERO, Pack::ZERO));
        self.order.resize(unknowns, [0; LANES]);
        for values in [
            &mut self.mean,
            &mut self.along,
            &mut self.linear,
            &mut self.squares,
            &mut self.row,
            &mut self.right,
        ] {
            values.resize(unknowns, Pack::ZERO);
        }
    }

    /// Sets coefficient `column` of an equation in `lane`, or its right-hand side, which follows all unknowns.
    pub(super) fn set_entry(&mut self, lane: usize, equation: usize, column: usize, value: f64) {
        let height = self.equations + self.unknowns;
        self.columns[column * height + equation].set(lane, value);
    }

    /// Sets the equation of a single unknown in `lane`: coefficient and right-hand side.
    pub(super) fn set_single(&mut self, lane: usize, unknown: usize, (coefficient, right): (f64, f64)) {
        let single = &mut self.singles[unknown];
        single.0.set(lane, coefficient);
        single.1.set(lane, right);
    }

    /// Sets c of an unknown in `lane`.
    pub(super) fn set_linear(&mut self, lane: usize, unknown: usize, value: f64) {
        self.linear[unknown].set(lane, value);
    }

    /// Finds `p(x) ∝ exp(−½ ‖A x − b‖² + cᵀ x)`. Returns 0 where the equations determine all of x, and NaN elsewhere.
    /// Householder's method with column pivoting, which is row-wise stable when the rows differ in size by many
    /// decades (Cox and Higham 1998). The equation of a single unknown takes part only from the reflection of its own
    /// column on.
    #[inline(always)]
    pub(super) fn factor(&mut self) -> Pack {
        let (n, m) = (self.unknowns, self.equations);
        let height = m + n;
        for (unknown, order) in self.order.iter_mut().enumerate() {
            *order = [unknown; LANES];
        }
        for (squares, column) in self.squares.iter_mut().zip(self.columns.chunks_exact_mut(height)) {
            column[m..].fill(Pack::ZERO);
            *squares = dot(&column[..m], &column[..m]);
        }
        let mut defects = Pack::ZERO;
        for k in 0..n {
            self.pivot(k);
            // The column's own equation is last; those of other columns have a 0 there.
            let (single, right) = self.singles[k];
            let rows = k..m + k + 1;
            let (done, rest) = self.columns.split_at_mut((k + 1) * height);
            let reflector = &mut done[k * height..][rows.clone()];
            reflector[m] = single;
            rest[(n - k - 1) * height + m + k] = right;
            let square = self.squares[k] + single * single;
            defects += square.defects();
            let length = square.sqrt();
            let diagonal = length.negated_where_positive(reflector[0]);
            // v = x − diagonal e₁ has vᵀv = 2 length (length + |x₁|).
            reflector[0] -= diagonal;
            let scale = Pack::ONE / (length * reflector[0].abs());
            for (column, squares) in rest.chunks_exact_mut(height).zip(&mut self.squares[k + 1..]) {
                let column = &mut column[rows.clone()];
                // Its last entry is 0.
                let product = -(scale * dot(&reflector[..m], &column[..m]));
                column[0] += product * reflector[0];
                *squares = add(&mut column[1..], product, &reflector[1..]);
            }
            let column = &mut rest[(n - k - 1) * height..][rows];
            let product = -(scale * dot(reflector, column));
            add(column, product, reflector);
            // The reciprocal, since R is divided by it.
            reflector[0] = Pack::ONE / diagonal;
        }
        self.invert();
        defects
    }

    /// Moves the largest of the columns from `k` on to position `k` in each lane.
    #[inline(always)]
    fn pivot(&mut self, k: usize) {
        let (n, height, rows) = (self.unknowns, self.equations + self.unknowns, self.equations + k);
        for lane in 0..LANES {
            let (mut pivot, mut largest) = (k, -1.0);
            for column in k..n {
                let single = self.singles[column].0.get(lane);
                let square = self.squares[column].get(lane) + single * single;
                if square > largest {
                    (pivot, largest) = (column, square);
                }
            }
            if pivot == k {
                continue;
            }
            let (left, right) = self.columns.split_at_mut(pivot * height);
            for (a, b) in left[k * height..][..rows].iter_mut().zip(right) {
                swap(lane, a, b);
            }
            let (left, right) = self.singles.split_at_mut(pivot);
            swap(lane, &mut left[k].0, &mut right[0].0);
            swap(lane, &mut left[k].1, &mut right[0].1);
            for values in [&mut self.squares, &mut self.linear] {
                let (left, right) = values.split_at_mut(pivot);
                swap(lane, &mut left[k], &mut right[0]);
            }
            let unknown = self.order[k][lane];
            self.order[k][lane] = self.order[pivot][lane];
            self.order[pivot][lane] = unknown;
        }
    }

    /// Computes L = P R⁻¹, row i of which belongs to the unknown of column i, and the mean x = L (Qᵀb + Lᵀc).
    #[inline(always)]
    fn invert(&mut self) {
        let (n, height) = (self.unknowns, self.equations + self.unknowns);
        let Self {
            columns,
            row,
            right,
            root,
            linear,
            order,
            ..
        } = self;
        right.copy_from_slice(&columns[n * height..][..n]);
        root.fill(Pack::ZERO);
        for i in 0..n {
            row[i] = columns[i * height + i];
            for j in i + 1..n {
                let column = &columns[j * height..][..j + 1];
                row[j] = -(dot(&row[i..j], &column[i..j]) * column[j]);
            }
            for j in i..n {
                right[j] += linear[i] * row[j];
                for lane in 0..LANES {
                    root[order[i][lane] * n + j].set(lane, row[j].get(lane));
                }
            }
        }
        for (mean, row) in self.mean.iter_mut().zip(root.chunks_exact(n)) {
            *mean = dot(row, right);
        }
    }

    /// Returns means and variances along `direction`.
    #[inline(always)]
    pub(super) fn marginals(&mut self, direction: Direction<'_>) -> (Pack, Pack) {
        let n = self.unknowns;
        let mean = match direction {
            Direction::Unknown(unknown) => {
                self.along.copy_from_slice(&self.root[unknown * n..][..n]);
                self.mean[unknown]
            }
            Direction::Form(form) => {
                self.along.fill(Pack::ZERO);
                for (&value, row) in form.iter().zip(self.root.chunks_exact(n)) {
                    add(&mut self.along, value, row);
                }
                dot(form, &self.mean)
            }
        };
        (mean, dot(&self.along, &self.along))
    }

    /// Multiplies by the `factors` of t along the direction of the last [`Self::marginals`], which returned `means`
    /// and `variances`. Returns a value that is above 0 and finite where the result is a Gaussian.
    #[inline(always)]
    pub(super) fn multiply(&mut self, means: Pack, variances: Pack, factors: Factor<Pack>) -> Pack {
        let Factor { precision, linear } = factors;
        let left = Pack::ONE + precision * variances;
        let shift = linear - precision / left * (means + linear * variances);
        // Σ − precision/left Σ a aᵀ Σ = M Mᵀ with M = L − shrink L (Lᵀa) (Lᵀa)ᵀ.
        let shrink = precision / (left + left.sqrt());
        let Self { mean, root, along, .. } = self;
        let mut pairs = root.chunks_exact_mut(2 * along.len());
        let (mean_pairs, mean_rest) = mean.as_chunks_mut::<2>();
        for (means, rows) in mean_pairs.iter_mut().zip(&mut pairs) {
            let (a, b) = rows.split_at_mut(along.len());
            let covariances = dots([a, b], along);
            means[0] += shift * covariances[0];
            means[1] += shift * covariances[1];
            add_to_both([a, b], covariances.map(|covariance| -(shrink * covariance)), along);
        }
        if let [mean] = mean_rest {
            let row = pairs.into_remainder();
            let covariance = dot(row, along);
            *mean += shift * covariance;
            add(row, -(shrink * covariance), along);
        }
        left
    }
}

#[inline(always)]
fn swap(lane: usize, a: &mut Pack, b: &mut Pack) {
    let value = a.get(lane);
    a.set(lane, b.get(lane));
    b.set(lane, value);
}

/// A linear model whose unknowns, and some of whose readings, are known to be in ranges:
/// `p(x) ∝ exp(−½ ‖A x − b‖² + cᵀ x)` for x within its ranges, times `P(fₖ·x + εₖ in range k)` for each rounded
/// reading, with standard normal ε.
///
/// Its moments have no closed form in several dimensions. They are approximated by expectation propagation (Minka
/// 2001; Cunningham, Hennig and Lacoste-Julien 2011 for ranges): each range is replaced by a Gaussian factor that
/// preserves the mean and variance of its marginal. Tests compare with sampling.
#[derive(Clone, Debug, Default)]
pub(super) struct LinearModel {
    /// `[A, b]`, row by row.
    pub(super) equations: Vec<f64>,
    /// c, one for each unknown.
    pub(super) linear: Vec<f64>,
    /// Ranges of the unknowns, possibly open on one side or both.
    pub(super) ranges: Vec<Range>,
    /// The rounded readings.
    pub(super) rounded: Vec<RoundedReading>,
    /// Initial factors of the unknowns; if empty, those with the moments of their ranges.
    pub(super) first_factors: Vec<Factor>,
    /// Change of a mean, relative to the range, below which the factors have converged.
    pub(super) tolerance: f64,
}

/// A reading that is only known to be in an interval.
#[derive(Clone, Debug)]
pub(super) struct RoundedReading {
    /// f, one coefficient for each unknown.
    pub(super) form: Vec<f64>,
    /// Middle of the interval minus the reading expected at x = 0, in standard deviations of ε.
    pub(super) misfit: f64,
    /// The interval, in standard deviations of ε.
    pub(super) range: Range,
}

/// A point of linearisation.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) displacements_mm: Vec<f64>,
    /// η of the snapshot's gain.
    pub(super) drift: f64,
}

/// The posterior of the equations linearised at a point.
pub(super) struct LinearisedPosterior {
    at: Point,
    pub(super) marginals: Marginals,
    pub(super) means: Point,
    /// w predicted by the linearisation at the means.
    pub(super) misfits: Vec<f64>,
}

impl LinearisedPosterior {
    /// Appends the factors of the ranges, for displacements relative to another point.
    fn append_factors(&self, factors: &mut Vec<Factor>, at: &Point, widths: &[f64]) {
        let points = at.displacements_mm.iter().zip(&self.at.displacements_mm);
        let shifts = points.zip(widths).map(|((to, from), width)| (to - from) / width);
        let marginals = self.marginals.of_unknowns.iter().zip(shifts);
        factors.extend(marginals.map(|(marginal, shift)| marginal.factor.shifted(shift)));
    }
}

impl Posterior {
    /// Sets `model` to the equations of row-wire `row` linearised at a point, where they were evaluated, with a
    /// factor of the noise. Expectation propagation starts from the factors of an earlier linearisation, if there is
    /// one.
    pub(super) fn linearise(
        &self,
        model: &mut LinearModel,
        row: usize,
        (at, blur): (&Point, f64),
        earlier: Option<&LinearisedPosterior>,
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
        if let Some(prior) = self.priors.get(self.place(row)) {
            prior.append_to(&mut model.equations, unknowns, &at.displacements_mm, &self.ranges);
        }
        model.first_factors.clear();
        if let Some(earlier) = earlier {
            earlier.append_factors(&mut model.first_factors, at, &self.widths);
        }
    }

    /// Returns the posterior with these `marginals` of the `model` linearised at `at` with `blur` times the noise.
    pub(super) fn linearised(
        &self,
        model: &LinearModel,
        at: &Point,
        blur: f64,
        mut marginals: Marginals,
    ) -> LinearisedPosterior {
        let n = self.widths.len();
        let misfits = expected_misfits(model, self.problem.equations(), &marginals.of_unknowns, blur);
        let drift = marginals
            .of_unknowns
            .get(n)
            .map_or(0.0, |marginal| at.drift + marginal.mean);
        marginals.of_unknowns.truncate(n);
        let displacements_mm = self.displacements_mm(at, marginals.of_unknowns.iter().map(|marginal| marginal.mean));
        LinearisedPosterior {
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
    pub(super) fn medians_mm(&self, found: &LinearisedPosterior) -> Vec<f64> {
        self.displacements_mm(&found.at, medians(&found.marginals.of_unknowns).into_iter())
    }

    /// Displacements, clamped to their ranges, from x = (displacement − current) / width.
    fn displacements_mm(&self, at: &Point, x: impl Iterator<Item = f64>) -> Vec<f64> {
        let places = x.zip(&at.displacements_mm).zip(&self.widths).zip(&self.ranges);
        places
            .map(|(((x, at), width), range)| range.clamp(at + x * width))
            .collect()
    }
}
