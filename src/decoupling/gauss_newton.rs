use faer::{Mat, linalg::solvers::SolveLstsq};

use super::row_problem::{Range, RowProblem};

/// Linearised equations for one step.
pub(super) struct Linearised {
    /// Unknowns that may move: all, or those not held at a bound.
    pub(super) free: Vec<usize>,
    /// Jacobian (readings × free unknowns), in 1/mm.
    pub(super) jacobian: Mat<f64>,
    /// Right-hand side, −ρ.
    pub(super) right: Vec<f64>,
    /// Largest diagonal entry of JᵀJ.
    pub(super) scale: f64,
}

impl Linearised {
    pub(super) fn new(problem: &mut RowProblem, ranges: &[Range], unknowns: &[f64], hold: bool) -> Self {
        problem.evaluate(unknowns);
        let (problem, equations) = (&*problem, problem.equations());
        let residuals = problem.residuals();
        let is_free = |&unknown: &usize| {
            let Range { lowest, highest } = ranges[unknown];
            let slope: f64 = (0..equations)
                .map(|k| problem.derivative(k, unknown) * residuals[k])
                .sum();
            !(unknowns[unknown] <= lowest && slope >= 0.0 || unknowns[unknown] >= highest && slope <= 0.0)
        };
        let free: Vec<usize> = (0..unknowns.len())
            .filter(|unknown| !hold || is_free(unknown))
            .collect();
        let jacobian = Mat::from_fn(equations, free.len(), |k, column| problem.derivative(k, free[column]));
        let scale = jacobian
            .col_iter()
            .map(|column| column.squared_norm_l2())
            .fold(0.0, f64::max);
        Self {
            right: residuals.iter().map(|residual| -residual).collect(),
            free,
            jacobian,
            scale,
        }
    }
}

/// Minimises `‖J δ − right‖² + damping ‖δ‖²` by a QR decomposition of J stacked on √damping · I.
pub(super) fn damped_step(jacobian: &Mat<f64>, right: &[f64], damping: f64) -> Vec<f64> {
    let (equations, unknowns) = (jacobian.nrows(), jacobian.ncols());
    let below = if damping > 0.0 || equations < unknowns {
        unknowns
    } else {
        0
    };
    let root = damping.sqrt();
    let stacked = Mat::from_fn(equations + below, unknowns, |k, u| {
        if k < equations {
            jacobian[(k, u)]
        } else if k - equations == u {
            root
        } else {
            0.0
        }
    });
    let right = Mat::from_fn(equations + below, 1, |k, _| if k < equations { right[k] } else { 0.0 });
    let solution = stacked.qr().solve_lstsq(&right);
    (0..unknowns).map(|u| solution[(u, 0)]).collect()
}
