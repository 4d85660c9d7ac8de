//! Check of the import: numbers of samples, rows dropped, and warnings.

use std::path::Path;

use decoupler_core::{
    dataset::{Dataset, Seed, SplitBy},
    evaluation::{
        TrainingSize,
        recorded::{channel_remarks, extrapolation},
    },
    text::counted,
};
use decoupler_files::{
    export::{describe_positions, format_number},
    import::{Cure, FileReport, ImportError, Plan, Recording, Watch},
};

use super::{import::file_name, options::bias};
use crate::window::shared::sentence;

/// Outcome of an import.
#[derive(Debug)]
pub(super) struct Checked {
    /// Number of samples for training, validation and test.
    pub(super) samples: [usize; 3],
    /// Size of a training with one network.
    pub(super) size: TrainingSize,
    /// What became of the files and their rows, as sentences.
    pub(super) facts: Vec<String>,
    /// Warnings for the user.
    pub(super) warnings: Vec<String>,
}

/// Imports the samples of a plan and divides them; `seed` is the seed of the run.
///
/// # Errors
/// If that is not possible; the message says what to do.
pub(super) fn check(plan: &Plan, seed: Seed, watch: Watch<'_>) -> Result<Checked, String> {
    let imported = plan.recordings(Path::new(""), watch);
    let (recording, test_recording) = imported.map_err(|error| in_window(&error))?;
    let divided = plan.divide(&recording, test_recording.as_ref(), seed);
    let (split, test) = divided.map_err(|error| in_window(&error))?;
    let recordings = || std::iter::once(&recording).chain(&test_recording);
    let (problem, by) = (&recording.problem, plan.division.by);
    let (inputs, targets) = (problem.features(), &problem.targets);
    let is_random = plan.test.is_none() && by == SplitBy::Random;
    let mut warnings = Vec::from_iter(is_random.then(|| bias(by).to_owned()));
    warnings.extend(Recording::warnings_of(recordings()));
    warnings.extend(channel_remarks(&recording.set, by, &inputs, targets));
    warnings.extend(extrapolation(&split.training, &test, &inputs, targets).1);
    let rows: usize = recordings().map(|recording| recording.rows).sum();
    let joins = recordings().flat_map(|recording| &recording.files).filter_map(joined);
    let dropped = recordings().flat_map(|recording| &recording.dropped);
    let dropped = dropped.map(|dropped| {
        let (count, reason, line) = (dropped.rows, &dropped.reason, dropped.first_line);
        format!("{count} of {rows} rows dropped: {reason} (first on line {line}).")
    });
    let positions = describe_positions(&problem.positions).map(|positions| sentence(&positions));
    let facts = joins.chain(dropped).chain(positions).collect();
    let training = &split.training;
    let validation = split.validation.as_ref().map_or(0, Dataset::samples);
    Ok(Checked {
        samples: [training.samples(), validation, test.samples()],
        size: TrainingSize {
            samples: training.samples(),
            inputs: training.readings().ncols(),
            targets: training.targets().ncols(),
            networks: 1,
        },
        facts,
        warnings,
    })
}

/// Returns a sentence on how a file is joined to the first, if it is joined by time.
fn joined(file: &FileReport) -> Option<String> {
    let (join, name) = (file.join?, file_name(&file.path));
    let offset = join.median_offset.map_or_else(String::new, |offset| {
        format!(", median offset {}", format_number(offset.abs()))
    });
    let (limit, lost) = (format_number(join.limit), counted(join.without_partner, "row"));
    let unused = join.unused;
    Some(format!(
        "{name} is joined by time within {limit}{offset}; {lost} without partner, {unused} of its rows unused."
    ))
}

/// Returns an error of the import, with the remedy in terms of the window.
pub(super) fn in_window(error: &ImportError) -> String {
    error.with_cure(|cure| match cure {
        Cure::CallMissing(text) => {
            format!("correct it, or add it to the missing cells under “Filter”: \"{text}\"")
        }
        Cure::NameTimes => "make the columns of their times “time” in both".to_owned(),
        Cure::NameJoinedTime => "make the column of its times “time”".to_owned(),
        Cure::GiveLimit => "give the limit under “Joined files”".to_owned(),
        Cure::GiveJoinedFiles => "open the joined files of each recording and of the test too".to_owned(),
        other => other.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use decoupler_files::import::{Joined, Recipe};

    use super::*;

    fn recipe() -> Recipe {
        Recipe {
            data: "one.csv".into(),
            inputs: vec!["a".to_owned()],
            targets: vec!["b".to_owned()],
            ..Recipe::default()
        }
    }

    fn error(one: &str, other: Option<&str>, recipe: Recipe) -> String {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("one.csv"), one).unwrap();
        std::fs::write(folder.path().join("two.csv"), other.unwrap_or_default()).unwrap();
        let watch = &mut |_| std::ops::ControlFlow::Continue(());
        let imported: Result<_, ImportError> = recipe.import(Path::new(folder.path()), watch);
        in_window(&imported.unwrap_err())
    }

    #[test]
    fn errors_of_the_import_name_no_argument_of_the_terminal() {
        let joined = |time: Option<&str>| Recipe {
            join: vec![Joined {
                file: "two.csv".into(),
                time: time.map(str::to_owned),
                ..Joined::default()
            }],
            ..recipe()
        };
        let timed = |time| Recipe {
            time: Some("t".to_owned()),
            ..joined(time)
        };
        let cases = [
            error("a,b\n1,bad\n2,3\n", None, recipe()),
            error("a,b\n1,2\n2,3\n", Some("c\n1\n"), joined(None)),
            error("t,a,b\n1,1,2\n2,2,3\n", Some("c\n1\n"), timed(Some("s"))),
            error("t,a,b\n1,1,2\n2,2,3\n", Some("s,c\n1,1\n1,2\n"), timed(Some("s"))),
        ];
        for text in cases {
            assert!(
                !text.contains("--") && (text.contains("“") || text.contains("“Filter”")),
                "{text}"
            );
        }
    }
}
