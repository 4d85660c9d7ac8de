use pulp::{Simd, WithSimd};

use super::{
    gaussian::{Direction, LinearModel, RowPosteriors},
    pack::{LANES, Pack},
    truncated::{Marginal, Site},
};

/// Marginals of all unknowns.
#[derive(Clone, Debug)]
pub(super) struct Marginals {
    pub(super) of_unknowns: Vec<Marginal>,
    /// Number of EP sweeps.
    pub(super) rounds: usize,
    /// False if the factors still changed in the last sweep.
    pub(super) converged: bool,
}

/// Maximum number of EP sweeps.
const MAX_SWEEPS: usize = 400;
/// Number of sweeps after which the update of a factor is halved, and halved again, to damp oscillations.
const UNDAMPED_SWEEPS: usize = 20;
/// Smallest damping factor of an update.
const SMALLEST_SHARE: f64 = 0.1;
/// Change of a mean, relative to the range, below which the factors have converged.
pub(super) const TOLERANCE: f64 = 1e-7;

/// Expectation propagation for several models side by side, with reused memory. The result of a model has the same
/// bits whatever the other lanes contain.
#[derive(Clone, Debug, Default)]
pub(super) struct Propagation {
    gaussians: RowPosteriors,
    of_unknowns: Vec<Site>,
    of_rounded: Vec<Site>,
    /// Linear forms of the rounded readings: rounded readings × unknowns.
    forms: Vec<Pack>,
}

impl Propagation {
    /// Returns the marginals of at most [`LANES`] models, all of the same shape; `None` without a model or if numbers
    /// overflow.
    pub(super) fn marginals(&mut self, models: &[Option<LinearModel>]) -> [Option<Marginals>; LANES] {
        let mut found = [const { None }; LANES];
        let has_first =
            |model: &Option<LinearModel>| model.as_ref().is_some_and(|model| !model.first_factors.is_empty());
        let mut open = [false; LANES];
        for (open, model) in open.iter_mut().zip(models) {
            *open = model.is_some();
        }
        self.propagate(models, &mut open, true, &mut found);
        for (lane, model) in models.iter().enumerate() {
            let is_found = found[lane].as_ref().is_some_and(|marginals| marginals.converged);
            open[lane] = has_first(model) && !is_found;
        }
        self.propagate(models, &mut open, false, &mut found);
        found
    }

    /// Finds the marginals of the models in `open` lanes, which start from their initial factors or without them.
    fn propagate(
        &mut self,
        models: &[Option<LinearModel>],
        open: &mut [bool; LANES],
        with_first: bool,
        found: &mut [Option<Marginals>; LANES],
    ) {
        let begun = models.iter().enumerate().filter(|(lane, _)| open[*lane]);
        let begun = begun.filter_map(|(lane, model)| Some((lane, model.as_ref()?)));
        let Some((_, shape)) = begun.clone().next() else {
            return;
        };
        self.make_room(shape);
        for (lane, model) in begun {
            found[lane] = None;
            self.load(lane, model, with_first);
        }
        pulp::Arch::new().dispatch(Rounds {
            propagation: self,
            models,
            open,
            found,
        });
    }

    fn make_room(&mut self, shape: &LinearModel) {
        let (n, rounded) = (shape.linear.len(), shape.rounded.len());
        self.gaussians.make_room(n, shape.equations.len() / (n + 1) + rounded);
        self.of_unknowns.resize(n, Site::new(0.0));
        self.of_rounded.resize(rounded, Site::new(1.0));
        self.forms.resize(rounded * n, Pack::ZERO);
    }

    fn load(&mut self, lane: usize, model: &LinearModel, with_first: bool) {
        let n = model.linear.len();
        for (unknown, (site, &range)) in self.of_unknowns.iter_mut().zip(&model.ranges).enumerate() {
            let first = model.first_factors.get(unknown).filter(|_| with_first);
            site.begin(lane, range, first.copied());
            self.gaussians.set_single(lane, unknown, site.equation(lane));
            self.gaussians.set_linear(lane, unknown, model.linear[unknown]);
        }
        let rows = model.equations.chunks_exact(n + 1);
        let equations = rows.len();
        for (equation, row) in rows.enumerate() {
            for (column, &value) in row.iter().enumerate() {
                self.gaussians.set_entry(lane, equation, column, value);
            }
        }
        let forms = self.forms.chunks_exact_mut(n);
        for (place, ((site, form), reading)) in self.of_rounded.iter_mut().zip(forms).zip(&model.rounded).enumerate() {
            site.begin(lane, reading.range, None);
            let (root, right) = site.equation(lane);
            for (column, (to, &value)) in form.iter_mut().zip(&reading.form).enumerate() {
                to.set(lane, value);
                self.gaussians.set_entry(lane, equations + place, column, root * value);
            }
            self.gaussians.set_entry(lane, equations + place, n, right);
        }
    }
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Rounds<'a> {
    propagation: &'a mut Propagation,
    models: &'a [Option<LinearModel>],
    open: &'a mut [bool; LANES],
    found: &'a mut [Option<Marginals>; LANES],
}

impl WithSimd for Rounds<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let defects = self.propagation.gaussians.factor();
        for round in 0..MAX_SWEEPS {
            let share = (0.5_f64.powi((round / UNDAMPED_SWEEPS) as i32)).max(SMALLEST_SHARE);
            let moved = self.propagation.sweep(Pack::splat(share), defects);
            self.close_lanes(moved, share, round + 1);
            if !self.open.contains(&true) {
                break;
            }
        }
    }
}

impl Propagation {
    /// One EP sweep over all sites. Returns the largest change of a mean, or NaN if numbers overflow.
    #[inline(always)]
    fn sweep(&mut self, share: Pack, defects: Pack) -> Pack {
        let Self {
            gaussians,
            of_unknowns,
            of_rounded,
            forms,
        } = self;
        let n = of_unknowns.len();
        let mut largest = defects;
        for (unknown, site) in of_unknowns.iter_mut().enumerate() {
            let marginals = gaussians.marginals(Direction::Unknown(unknown));
            let (moved, defects) = site.update(gaussians, marginals, share);
            largest = largest.max_or_nan(moved + defects);
        }
        for (site, form) in of_rounded.iter_mut().zip(forms.chunks_exact(n)) {
            let marginals = gaussians.marginals(Direction::Form(form));
            let (_, defects) = site.update(gaussians, marginals, share);
            largest = largest.max_or_nan(defects);
        }
        largest
    }
}

impl Rounds<'_> {
    /// Closes the lanes whose means changed by less than the tolerance, became NaN, or reached the iteration limit.
    fn close_lanes(&mut self, moved: Pack, share: f64, rounds: usize) {
        for (lane, (open, model)) in self.open.iter_mut().zip(self.models).enumerate() {
            let Some(model) = model.as_ref().filter(|_| *open) else {
                continue;
            };
            let moved = moved.get(lane);
            let converged = moved < model.tolerance * share;
            if moved.is_nan() {
                *open = false;
            } else if converged || rounds == MAX_SWEEPS {
                *open = false;
                let sites = self.propagation.of_unknowns.iter().zip(&model.ranges);
                self.found[lane] = Some(Marginals {
                    of_unknowns: sites.map(|(site, &range)| site.marginal(lane, range)).collect(),
                    rounds,
                    converged,
                });
            }
        }
    }
}

#[cfg(test)]
mod tests;
