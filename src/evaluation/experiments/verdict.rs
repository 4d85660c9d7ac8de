use std::fmt;

use serde::Serialize;

use super::{
    Axis, CellResults, ExperimentResults, Growth,
    growth::GrowthLaw,
    measured::{Measured, number, sorted_by},
};

/// Verdict of an experiment on a claim.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Claim, either the paper's or one to compare it with.
    pub claim: &'static str,
    /// Standing of the claim in this run.
    pub standing: Standing,
    /// Numbers that support the verdict.
    pub finding: String,
}

/// Standing of a claim in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// The claim holds, beyond the spread of the trials.
    Holds,
    /// The claim holds for some cells but not for others.
    HoldsInPart,
    /// The claim does not hold.
    Fails,
    /// The spread of the trials is too wide to tell, or results are missing.
    Undecided,
}

impl fmt::Display for Standing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Holds => "holds",
            Self::HoldsInPart => "holds in part",
            Self::Fails => "does not hold",
            Self::Undecided => "undecided",
        })
    }
}

/// Judges the claims that this experiment can test by its finished trials.
pub fn verdicts(results: &ExperimentResults) -> Vec<Verdict> {
    let measured = Measured::all(results);
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
            Axis::Method(_) | Axis::Epochs(_) | Axis::Seed(_) => {}
        }
    }
    verdicts.push(linear_map_is_beaten(&measured));
    verdicts
}

fn missing(claim: &'static str) -> Verdict {
    Verdict {
        claim,
        standing: Standing::Undecided,
        finding: "Too few results to tell.".to_owned(),
    }
}

/// Returns the standing of a claim that is true in `so` of `of` cases.
fn share(so: usize, of: usize) -> Standing {
    match so {
        _ if so == of => Standing::Holds,
        0 => Standing::Fails,
        _ => Standing::HoldsInPart,
    }
}

fn published_is_met(measured: &[Measured]) -> Option<Verdict> {
    let mut met = Vec::new();
    let mut missed = Vec::new();
    for cell in measured {
        let Some(published) = cell.published else { continue };
        let (label, median) = (&cell.label, cell.z.median);
        let against = format!("{} against {}", number(median), number(published));
        if median <= published {
            met.push(format!("{label} ({against})"));
            continue;
        }
        let bound = cell.bound.filter(|bound| *bound > 0.5 * published);
        let bound = bound.map_or(String::new(), |bound| {
            format!("; its hidden nodes can carry {}", number(bound))
        });
        let excess = number(100.0 * (median / published - 1.0));
        missed.push(format!("{label} ({against}, {excess} % more{bound})"));
    }
    if met.is_empty() && missed.is_empty() {
        return None;
    }
    let standing = share(met.len(), met.len() + missed.len());
    let parts = [("Met or beaten at", met), ("missed at", missed)];
    let parts = parts.into_iter().filter(|(_, cells)| !cells.is_empty());
    let parts: Vec<_> = parts
        .map(|(what, cells)| format!("{what} {}", cells.join(", ")))
        .collect();
    Some(Verdict {
        claim: "The published Z error is reached",
        standing,
        finding: sentence(&parts.join("; ")),
    })
}

/// Capitalises the first letter and adds a full stop.
fn sentence(text: &str) -> String {
    let mut characters = text.chars();
    let first: String = characters.next().into_iter().flat_map(char::to_uppercase).collect();
    format!("{first}{}.", characters.as_str())
}

/// Looks for the least error among `cells`, which are sorted by number of hidden nodes.
fn optimum_exists(cells: Vec<Measured>) -> Verdict {
    let claim = "There is an optimal number of hidden nodes";
    let best = cells
        .iter()
        .enumerate()
        .min_by(|one, other| one.1.z.median.total_cmp(&other.1.z.median));
    let (Some((place, best)), Some(last), true) = (best, cells.last(), cells.len() >= 3) else {
        return missing(claim);
    };
    let beyond = &cells[place + 1..];
    let worst = beyond
        .iter()
        .max_by(|one, other| one.z.median.total_cmp(&other.z.median));
    let (standing, finding) = match worst {
        None => (
            Standing::Fails,
            format!(
                "the error still falls at the most, {}; with this training more nodes only help",
                last.figures()
            ),
        ),
        Some(worst) if place == 0 => (
            Standing::Fails,
            format!(
                "the error is least at the fewest, {}, and rises to {}",
                best.figures(),
                worst.figures()
            ),
        ),
        Some(worst) if worst.z.median > best.z.largest => (
            Standing::Holds,
            format!("least at {}; beyond, {}", best.figures(), worst.figures()),
        ),
        Some(worst) => (
            Standing::Undecided,
            format!(
                "least at {}; beyond, {}, which is within the spread of the trials",
                best.figures(),
                worst.figures()
            ),
        ),
    };
    let finding = sentence(&finding);
    Verdict {
        claim,
        standing,
        finding,
    }
}

/// Checks that the errors rise along `measured`, trial by trial of the same seed and repeat.
fn in_order(claim: &'static str, measured: Vec<Measured>) -> Verdict {
    if measured.len() < 2 {
        return missing(claim);
    }
    let pairs = || measured.windows(2).map(|pair| (&pair[0], &pair[1]));
    let rises = pairs().filter(|(before, after)| before.z.median < after.z.median);
    let medians = share(rises.count(), measured.len() - 1);
    let compared = pairs().flat_map(|(before, after)| before.beside(after));
    let (in_order, all) = compared.fold((0, 0), |(in_order, all), (before, after)| {
        (in_order + usize::from(before < after), all + 1)
    });
    let standing = match medians {
        Standing::Holds if in_order < all => Standing::HoldsInPart,
        medians => medians,
    };
    let figures: Vec<_> = measured.iter().map(Measured::figures).collect();
    let finding = format!(
        "{}; so in {in_order} of {all} comparisons of trials with the same seed",
        figures.join("; ")
    );
    Verdict {
        claim,
        standing,
        finding: sentence(&finding),
    }
}

/// Compares a polynomial and an exponential law for the time of the fastest epoch in each cell.
fn time_does_not_explode(results: &ExperimentResults, what: &str, size: impl Fn(usize) -> usize) -> Verdict {
    let claim = "Training time does not grow exponentially";
    let point = |cell: &CellResults| Some((size(cell.cell.column) as f64, cell.least_epoch_seconds()?));
    let points: Vec<_> = results.cells.iter().filter_map(point).collect();
    let Some(growth) = Growth::fit(&points) else {
        return missing(claim);
    };
    let standing = match growth.law() {
        Some(GrowthLaw::Polynomial) => Standing::Holds,
        Some(GrowthLaw::Exponential) => Standing::Fails,
        None => Standing::Undecided,
    };
    let off = |residual: f64| number(100.0 * residual.exp_m1());
    let times = points
        .iter()
        .map(|(x, seconds)| format!("{x}: {} ms", number(1e3 * seconds)));
    let law = match growth.degree {
        1 => "a + b·x",
        2 => "a + b·x²",
        _ => "a + b·x³",
    };
    let finding = format!(
        "Quickest epoch by {what}: {}. {law} describes that within {} %; an exponential, {} % more with each, within \
         {} %.",
        times.collect::<Vec<_>>().join(", "),
        off(growth.polynomial_residual),
        number(100.0 * (growth.factor_per_unit - 1.0)),
        off(growth.exponential_residual),
    );
    Verdict {
        claim,
        standing,
        finding,
    }
}

fn linear_map_is_beaten(measured: &[Measured]) -> Verdict {
    let claim = "The network beats the linear map";
    let cells = measured.iter().filter_map(|cell| Some((cell, cell.linear?)));
    let (wins, losses): (Vec<_>, Vec<_>) = cells.partition(|(cell, linear)| cell.z.median < *linear);
    if wins.is_empty() && losses.is_empty() {
        return missing(claim);
    }
    let list = |cells: &[(&Measured, f64)]| {
        let each = |&(cell, linear): &(&Measured, f64)| {
            format!("{} ({} against {})", cell.label, number(cell.z.median), number(linear))
        };
        cells.iter().map(each).collect::<Vec<_>>().join(", ")
    };
    let parts = [("it loses to it at", &losses), ("it beats it at", &wins)];
    let parts = parts.into_iter().filter(|(_, cells)| !cells.is_empty());
    let parts: Vec<_> = parts.map(|(what, cells)| format!("{what} {}", list(cells))).collect();
    Verdict {
        claim,
        standing: share(wins.len(), wins.len() + losses.len()),
        finding: sentence(&parts.join("; ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::experiments::{PaperTable, Trial, results::tests::trial};

    /// Z errors of the trials of each cell.
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

    fn standing(verdicts: &[Verdict], claim: &str) -> Standing {
        let verdict = verdicts.iter().find(|verdict| verdict.claim.contains(claim));
        verdict.unwrap_or_else(|| panic!("no verdict on {claim}")).standing
    }

    #[test]
    fn an_optimum_needs_a_rise_beyond_the_spread() {
        let cases: [(&[&[f64]], Standing); 5] = [
            (
                &[&[4.0], &[3.0], &[2.0], &[1.7, 1.8], &[1.7, 1.8], &[2.0]],
                Standing::Holds,
            ),
            (
                &[&[4.0], &[3.0], &[2.0], &[1.7, 1.9], &[1.7, 2.9], &[1.9]],
                Standing::Holds,
            ),
            (&[&[4.0], &[3.0], &[2.0], &[1.6, 1.7, 2.9], &[1.8]], Standing::Undecided),
            (&[&[4.0], &[3.0], &[2.0], &[1.0]], Standing::Fails),
            (&[&[1.0], &[3.0], &[4.0], &[5.0]], Standing::Fails),
        ];
        for (cells, expected) in cases {
            let verdicts = judged(PaperTable::HiddenNodes, cells, |_, _| {});
            assert_eq!(standing(&verdicts, "optimal"), expected, "{cells:?}: {verdicts:?}");
        }
        let few = judged(PaperTable::HiddenNodes, &[&[4.0], &[3.0]], |_, _| {});
        assert_eq!(standing(&few, "optimal"), Standing::Undecided);
    }

    #[test]
    fn an_order_holds_if_no_trial_departs_from_it() {
        let cases: [(&[&[f64]], Standing); 5] = [
            (&[&[1.0, 1.4], &[1.3, 1.6], &[2.0]], Standing::Holds),
            (&[&[1.0, 1.2, 1.9], &[1.3, 1.6, 1.8], &[2.0]], Standing::HoldsInPart),
            (&[&[1.0], &[3.0], &[2.0]], Standing::HoldsInPart),
            (&[&[3.0], &[2.0], &[1.0]], Standing::Fails),
            (&[&[3.0]], Standing::Undecided),
        ];
        for (cells, expected) in cases {
            let verdicts = judged(PaperTable::ArrayScales, cells, |_, _| {});
            assert_eq!(standing(&verdicts, "Smaller arrays"), expected, "{cells:?}");
        }
        // The large dataset is the first cell.
        let sizes = |cells| judged(PaperTable::CrossValidation, cells, |_, _| {});
        assert_eq!(
            standing(&sizes(&[&[1.0, 1.1], &[3.0, 3.3]]), "larger dataset"),
            Standing::Holds
        );
        assert_eq!(standing(&sizes(&[&[3.0], &[1.0]]), "larger dataset"), Standing::Fails);
    }

    #[test]
    fn published_figures_and_the_linear_map_are_met_everywhere_in_part_or_nowhere() {
        let of = |cells: [&[f64]; 3]| judged(PaperTable::ArrayScales, &cells, |_, _| {});
        let good = of([&[0.1], &[0.2], &[0.3]]);
        let mixed = of([&[1.0], &[1.7], &[2.0]]);
        let bad = of([&[3.0], &[3.0], &[3.0]]);
        for (claim, mixed_standing) in [
            ("published", Standing::HoldsInPart),
            ("linear map", Standing::HoldsInPart),
        ] {
            assert_eq!(standing(&good, claim), Standing::Holds);
            assert_eq!(standing(&mixed, claim), mixed_standing);
            assert_eq!(standing(&bad, claim), Standing::Fails);
        }
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
                trial.least_epoch_seconds = law(hidden[cell]);
            });
            standing(&verdicts, "time")
        };
        assert_eq!(judge(&|h| 0.01 * h * h), Standing::Holds);
        assert_eq!(judge(&|h| 0.01 * 1.3_f64.powf(h)), Standing::Fails);
    }

    #[test]
    fn nothing_finished_decides_nothing() {
        for table in PaperTable::ALL {
            let verdicts = judged(table, &[], |_, _| {});
            assert!(!verdicts.is_empty());
            assert!(
                verdicts.iter().all(|verdict| verdict.standing == Standing::Undecided),
                "{verdicts:?}"
            );
        }
    }
}
