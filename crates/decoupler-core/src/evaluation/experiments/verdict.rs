use std::{cmp::Ordering, fmt};

use serde::Serialize;

use super::{
    Axis, CellResults, ExperimentResults, Growth,
    growth::GrowthLaw,
    results::{CellErrors, sorted_by},
};
use crate::text::format_number;

/// Verdict of an experiment on a claim.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Claim, either from the paper or for comparison with it.
    pub claim: &'static str,
    /// Status of the claim in this run.
    pub standing: VerdictStatus,
    /// Numbers that support the verdict.
    pub finding: String,
}

/// Status of a claim in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum VerdictStatus {
    /// The claim holds, beyond the spread of the trials.
    Holds,
    /// The claim holds for some cells but not for others.
    HoldsInPart,
    /// The claim does not hold.
    Fails,
    /// The spread of the trials is too wide, or there are too few trials or sizes.
    Undecided,
}

impl fmt::Display for VerdictStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Holds => "holds",
            Self::HoldsInPart => "holds in part",
            Self::Fails => "does not hold",
            Self::Undecided => "not decided",
        })
    }
}

/// Judges the claims that this experiment can test, from its finished trials.
pub fn verdicts(results: &ExperimentResults) -> Vec<Verdict> {
    let measured = CellErrors::all(results);
    let mut verdicts = Vec::new();
    verdicts.extend(published_is_met(&measured));
    if results.experiment.second_axis.is_none() {
        match &results.experiment.axis {
            Axis::Hidden(hidden) => {
                verdicts.push(optimum_exists(sorted_by(measured.clone(), |cell| hidden[cell.column])));
                verdicts.push(time_does_not_explode(results, "hidden nodes", |column| hidden[column]));
            }
            Axis::Samples(samples) => verdicts.push(in_order(
                "The larger dataset gives the smaller error",
                sorted_by(measured.clone(), |cell| std::cmp::Reverse(samples[cell.column])),
            )),
            Axis::Array(arrays) => {
                let nodes = |column: usize| arrays[column].nodes_per_row();
                verdicts.push(in_order(
                    "Smaller arrays are decoupled with smaller errors",
                    sorted_by(measured.clone(), |cell| arrays[cell.column].rows() * nodes(cell.column)),
                ));
                verdicts.push(time_does_not_explode(results, "nodes of a row", nodes));
            }
            _ => {}
        }
    }
    let linear = match results.experiment.recording {
        None => "The network beats the linear map",
        Some(_) => "The network beats ridge regression",
    };
    verdicts.push(linear_is_beaten(linear, &measured));
    verdicts
}

fn missing(claim: &'static str) -> Verdict {
    Verdict {
        claim,
        standing: VerdictStatus::Undecided,
        finding: "Too few results.".to_owned(),
    }
}

/// Returns the status of a claim that is true, false or undecided (`None`) in each of several cases.
fn status_of(cases: impl IntoIterator<Item = Option<bool>>) -> VerdictStatus {
    let (mut is_true, mut is_false, mut is_open) = (false, false, false);
    for case in cases {
        is_true |= case == Some(true);
        is_false |= case == Some(false);
        is_open |= case.is_none();
    }
    match (is_true, is_false) {
        (true, true) => VerdictStatus::HoldsInPart,
        (true, false) if !is_open => VerdictStatus::Holds,
        (false, true) if !is_open => VerdictStatus::Fails,
        _ => VerdictStatus::Undecided,
    }
}

/// Lists the cells in which the error is below a figure, above it, or within the spread of the trials.
fn judge_cells(
    claim: &'static str,
    cells: &[(&CellErrors, f64)],
    [below, above]: [&str; 2],
    note: impl Fn(&CellErrors, f64) -> String,
) -> Verdict {
    let is_below: Vec<Option<bool>> = cells
        .iter()
        .map(|(cell, figure)| Some(cell.against(*figure)?.is_lt()))
        .collect();
    let list = |wanted: Option<bool>| {
        let those = cells.iter().zip(&is_below).filter(|(_, is_below)| **is_below == wanted);
        let each = |((cell, figure), _): (&(&CellErrors, f64), _)| {
            let against = format!(
                "{} against {}",
                format_number(cell.percent.median),
                format_number(*figure)
            );
            format!("{} ({against}{})", cell.label, note(cell, *figure))
        };
        those.map(each).collect::<Vec<_>>().join(", ")
    };
    let open = format!(
        "not decided with fewer than {} trials or within their spread at",
        CellErrors::MIN_TRIALS
    );
    let parts = [
        (below, list(Some(true))),
        (above, list(Some(false))),
        (&*open, list(None)),
    ];
    let parts: Vec<_> = parts
        .into_iter()
        .filter(|(_, cells)| !cells.is_empty())
        .map(|(what, cells)| format!("{what} {cells}"))
        .collect();
    Verdict {
        claim,
        standing: status_of(is_below),
        finding: sentence(&parts.join("; ")),
    }
}

fn published_is_met(measured: &[CellErrors]) -> Option<Verdict> {
    let cells: Vec<_> = measured
        .iter()
        .filter_map(|cell| Some((cell, cell.published?)))
        .collect();
    let note = |cell: &CellErrors, published: f64| {
        if cell.percent.median <= published {
            return String::new();
        }
        let bound = cell.bound.filter(|bound| *bound > 0.5 * published);
        let bound = bound.map_or(String::new(), |bound| {
            format!("; its hidden nodes can carry {}", format_number(bound))
        });
        format!(
            ", {} % more{bound}",
            format_number(100.0 * (cell.percent.median / published - 1.0))
        )
    };
    let claim = "The published Z error is reached";
    (!cells.is_empty()).then(|| judge_cells(claim, &cells, ["met or beaten at", "missed at"], note))
}

/// Capitalises the first letter and adds a full stop.
fn sentence(text: &str) -> String {
    let mut characters = text.chars();
    let first: String = characters.next().into_iter().flat_map(char::to_uppercase).collect();
    format!("{first}{}.", characters.as_str())
}

/// Checks whether the error has a minimum among `cells`, which are sorted by number of hidden nodes.
fn optimum_exists(cells: Vec<CellErrors>) -> Verdict {
    let claim = "There is an optimal number of hidden nodes";
    let best = cells
        .iter()
        .enumerate()
        .min_by(|one, other| one.1.percent.median.total_cmp(&other.1.percent.median));
    let (Some((place, best)), Some(last), true) = (best, cells.last(), cells.len() >= 3) else {
        return missing(claim);
    };
    let is_lower = |others: &[CellErrors]| others.iter().any(|other| best.compare(other) == Some(Ordering::Less));
    let is_lowest = || {
        let others = cells.iter().enumerate().filter(|(other, _)| *other != place);
        others
            .into_iter()
            .all(|(_, other)| best.compare(other) == Some(Ordering::Less))
    };
    let (before, beyond) = (&cells[..place], &cells[place + 1..]);
    let standing = if before.is_empty() || beyond.is_empty() {
        if is_lowest() {
            VerdictStatus::Fails
        } else {
            VerdictStatus::Undecided
        }
    } else if is_lower(before) && is_lower(beyond) {
        VerdictStatus::Holds
    } else {
        VerdictStatus::Undecided
    };
    let ends = [&cells[0], last].into_iter().filter(|end| end.column != best.column);
    let ends: Vec<_> = ends.map(CellErrors::figures).collect();
    let open = match standing {
        VerdictStatus::Undecided => "; not decided: too few trials, or their spread is too wide",
        _ => "",
    };
    let finding = sentence(&format!(
        "minimum at {}; at the ends {}{open}",
        best.figures(),
        ends.join(", ")
    ));
    Verdict {
        claim,
        standing,
        finding,
    }
}

/// Checks that the errors rise along `measured`, beyond the spread of the trials.
fn in_order(claim: &'static str, measured: Vec<CellErrors>) -> Verdict {
    if measured.len() < 2 {
        return missing(claim);
    }
    let pairs = measured.windows(2);
    let standing = status_of(pairs.map(|pair| Some(pair[0].compare(&pair[1])?.is_lt())));
    let figures: Vec<_> = measured.iter().map(CellErrors::figures).collect();
    Verdict {
        claim,
        standing,
        finding: sentence(&figures.join("; ")),
    }
}

/// Compares a polynomial and an exponential law for the time of the fastest epoch in each cell.
fn time_does_not_explode(results: &ExperimentResults, what: &str, size: impl Fn(usize) -> usize) -> Verdict {
    let claim = "Training time does not grow exponentially";
    let point = |cell: &CellResults| Some((size(cell.cell.column) as f64, cell.min_epoch_seconds()?));
    let points: Vec<_> = results.cells.iter().filter_map(point).collect();
    let Some(growth) = Growth::fit(&points) else {
        return missing(claim);
    };
    let standing = match growth.law() {
        Some(GrowthLaw::Polynomial) => VerdictStatus::Holds,
        Some(GrowthLaw::Exponential) => VerdictStatus::Fails,
        None => VerdictStatus::Undecided,
    };
    let off = |residual: f64| format_number(100.0 * residual.exp_m1());
    let times = points
        .iter()
        .map(|(x, seconds)| format!("{x}: {} ms", format_number(1e3 * seconds)));
    let law = match growth.degree {
        1 => "a + b·x",
        2 => "a + b·x²",
        _ => "a + b·x³",
    };
    let finding = format!(
        "Fastest epoch by {what}: {}. {law} fits these times within {} %; an exponential, {} % more with each, within \
         {} %.",
        times.collect::<Vec<_>>().join(", "),
        off(growth.polynomial_residual),
        format_number(100.0 * (growth.factor_per_unit - 1.0)),
        off(growth.exponential_residual),
    ) + match standing {
        VerdictStatus::Undecided => " These sizes and times do not decide between the two.",
        _ => "",
    };
    Verdict {
        claim,
        standing,
        finding,
    }
}

fn linear_is_beaten(claim: &'static str, measured: &[CellErrors]) -> Verdict {
    let cells: Vec<_> = measured.iter().filter_map(|cell| Some((cell, cell.linear?))).collect();
    if cells.is_empty() {
        return missing(claim);
    }
    let labels = ["better at", "worse at"];
    judge_cells(claim, &cells, labels, |_, _| String::new())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::experiments::{PaperTable, Trial, results::tests::trial};

    /// Returns the verdicts on trials with these Z errors in each cell.
    fn judged(table: PaperTable, cells: &[&[f64]], change: impl Fn(usize, &mut Trial)) -> Vec<Verdict> {
        let mut results = ExperimentResults::new(table.experiment());
        for (cell, z_percent) in cells.iter().enumerate() {
            for (seed, z_percent) in (0..).zip(*z_percent) {
                let mut trial = trial(seed, *z_percent);
                change(cell, &mut trial);
                results.record(cell, Ok(trial));
            }
        }
        verdicts(&results)
    }

    fn status(verdicts: &[Verdict], claim: &str) -> VerdictStatus {
        let verdict = verdicts.iter().find(|verdict| verdict.claim.contains(claim));
        verdict.unwrap_or_else(|| panic!("no verdict on {claim}")).standing
    }

    #[test]
    fn an_optimum_needs_a_rise_beyond_the_spread_on_both_sides() {
        let low: &[f64] = &[1.6, 1.7, 1.8];
        let high: &[f64] = &[2.0, 2.1, 2.2];
        let cases: [(&[&[f64]], VerdictStatus); 7] = [
            (&[high, low, low, high], VerdictStatus::Holds),
            // One or two seeds have no spread.
            (&[&[4.0], &[3.0], &[2.0], &[1.0], &[2.0]], VerdictStatus::Undecided),
            (&[&high[..2], &low[..2], &high[..2]], VerdictStatus::Undecided),
            (&[high, &[1.6, 1.7, 2.9], &[1.8, 1.9, 2.0]], VerdictStatus::Undecided),
            (&[&[1.7, 1.9, 2.0], low, high], VerdictStatus::Undecided),
            (&[high, high, low], VerdictStatus::Fails),
            (&[low, high, high], VerdictStatus::Fails),
        ];
        for (cells, expected) in cases {
            let verdicts = judged(PaperTable::HiddenNodes, cells, |_, _| {});
            assert_eq!(status(&verdicts, "optimal"), expected, "{cells:?}: {verdicts:?}");
        }
        let few = judged(PaperTable::HiddenNodes, &[high, low], |_, _| {});
        assert_eq!(status(&few, "optimal"), VerdictStatus::Undecided);
    }

    #[test]
    fn an_order_holds_if_the_ranges_of_the_trials_do_not_overlap() {
        let rising: [&[f64]; 3] = [&[1.0, 1.1, 1.2], &[1.3, 1.4, 1.6], &[2.0, 2.1, 2.2]];
        let [small, middle, large] = rising;
        let cases: [(&[&[f64]], VerdictStatus); 6] = [
            (&rising, VerdictStatus::Holds),
            (&[small, &[1.2, 1.4, 1.6], large], VerdictStatus::Undecided),
            (&[small, large, middle], VerdictStatus::HoldsInPart),
            (&[large, middle, small], VerdictStatus::Fails),
            (&[&[1.0], &[2.0], &[3.0]], VerdictStatus::Undecided),
            (&[small], VerdictStatus::Undecided),
        ];
        for (cells, expected) in cases {
            let verdicts = judged(PaperTable::ArrayScales, cells, |_, _| {});
            assert_eq!(status(&verdicts, "Smaller arrays"), expected, "{cells:?}");
        }
        // The large dataset is the first cell.
        let sizes = |cells: [&[f64]; 2]| judged(PaperTable::CrossValidation, &cells, |_, _| {});
        assert_eq!(status(&sizes([small, large]), "larger dataset"), VerdictStatus::Holds);
        assert_eq!(status(&sizes([large, small]), "larger dataset"), VerdictStatus::Fails);
    }

    #[test]
    fn published_figures_and_the_linear_map_are_beaten_everywhere_in_part_or_nowhere() {
        let of = |z: [f64; 3]| {
            let cells = z.map(|z| [z, z + 0.01, z + 0.02]);
            judged(
                PaperTable::ArrayScales,
                &cells.each_ref().map(|cell| &cell[..]),
                |_, _| {},
            )
        };
        let good = of([0.1, 0.2, 0.3]);
        let mixed = of([0.99, 1.69, 1.99]);
        let bad = of([3.0, 3.0, 3.0]);
        let within = of([0.1, 0.2, 2.27]);
        for claim in ["published", "linear map"] {
            assert_eq!(status(&good, claim), VerdictStatus::Holds);
            assert_eq!(status(&mixed, claim), VerdictStatus::HoldsInPart);
            assert_eq!(status(&bad, claim), VerdictStatus::Fails);
        }
        assert_eq!(status(&within, "published"), VerdictStatus::Undecided);
        let one_seed = judged(PaperTable::ArrayScales, &[&[0.1], &[0.1], &[0.1]], |_, _| {});
        assert!(
            one_seed
                .iter()
                .all(|verdict| verdict.standing == VerdictStatus::Undecided)
        );
        let published = mixed
            .iter()
            .find(|verdict| verdict.claim.contains("published"))
            .unwrap();
        assert_eq!(
            published.finding,
            "Met or beaten at 10×6_3×18 (1.00 against 1.41), 10×10_5×30 (2.00 against 2.28); missed at 10×8_4×24 (1.70 \
             against 1.63, 4.29 % more)."
        );
    }

    #[test]
    fn time_is_judged_by_the_law_that_fits_better() {
        let hidden = [6.0, 8.0, 10.0, 12.0, 14.0, 16.0_f64];
        let cells: [&[f64]; 6] = [&[1.0]; 6];
        let judge = |law: &dyn Fn(f64) -> f64| {
            let verdicts = judged(PaperTable::HiddenNodes, &cells, |cell, trial| {
                trial.min_epoch_seconds = law(hidden[cell]);
            });
            status(&verdicts, "time")
        };
        assert_eq!(judge(&|h| 0.01 * h * h * h), VerdictStatus::Holds);
        assert_eq!(judge(&|h| 0.01 * 1.3_f64.powf(h)), VerdictStatus::Fails);
        let three = judged(PaperTable::ArrayScales, &cells[..3], |cell, trial| {
            trial.min_epoch_seconds = [1.0, 2.0, 4.0][cell];
        });
        assert_eq!(status(&three, "time"), VerdictStatus::Undecided);
    }

    #[test]
    fn without_finished_trials_nothing_is_decided() {
        for table in PaperTable::ALL {
            let verdicts = judged(table, &[], |_, _| {});
            assert!(!verdicts.is_empty());
            assert!(
                verdicts
                    .iter()
                    .all(|verdict| verdict.standing == VerdictStatus::Undecided),
                "{verdicts:?}"
            );
        }
    }
}
