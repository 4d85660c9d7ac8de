//! Sentences about splits and imports.

use decoupler_core::dataset::SplitBy;
use decoupler_files::import::{Cure, ImportError};

/// Returns a sentence on the bias of test errors by a rule of division.
pub(in crate::window::views::train) fn bias(by: SplitBy) -> &'static str {
    match by {
        SplitBy::Time => "The last part of the recording is held out for testing.",
        SplitBy::Group => "Whole groups are held out for testing: no press or session is in two sets.",
        SplitBy::Random => {
            "A random split is optimistic when neighbouring rows are similar. Compare with a split by group, or by time \
             if there are no groups."
        }
    }
}

/// Returns an error of the import, with its cure in terms of the window.
pub(super) fn in_window(error: &ImportError) -> String {
    error.with_cure(|cure| match cure {
        Cure::CallMissing(text) => {
            format!("correct it, or add it to the missing cells under “Filter”: \"{text}\"")
        }
        Cure::NameTimes => "make the columns of their times “time” in both".to_owned(),
        Cure::NameJoinedTime => "make the column of its times “time”".to_owned(),
        Cure::GiveLimit => "give the limit under “Joined files”".to_owned(),
        Cure::GiveTestFiles => "open the joined files of the test too".to_owned(),
        other => other.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use decoupler_files::import::{Joined, Recipe};

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
