//! Separate recordings for testing.

use std::{fs, ops::ControlFlow};

use decoupler_core::dataset::Seed;
use decoupler_files::import::{FileSet, Plan, Recipe};

#[test]
fn training_rows_are_refused_as_test_rows() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..40).map(|row| format!("{row},{}\n", 2 * row)).collect();
    for name in ["train.csv", "test.csv"] {
        fs::write(folder.path().join(name), format!("u,x\n{rows}")).unwrap();
    }
    fs::create_dir(folder.path().join("sub")).unwrap();
    let tested = |data: &str| {
        let plan = Plan {
            import: Recipe {
                data: "train.csv".into(),
                inputs: vec!["u".to_owned()],
                targets: vec!["x".to_owned()],
                ..Recipe::default()
            },
            test: Some(FileSet {
                data: data.into(),
                ..FileSet::default()
            }),
            ..Plan::default()
        };
        let recordings = plan.recordings(folder.path(), &mut |_| ControlFlow::Continue(()));
        let (recording, test) = recordings.map_err(|error| error.to_string())?;
        let (_, test) = plan.divide(&recording, test.as_ref(), Seed(0)).unwrap();
        Ok::<_, String>(test.samples())
    };
    assert_eq!(tested("test.csv"), Ok(40));
    for same in ["train.csv", "sub/../train.csv"] {
        let reason = tested(same).unwrap_err();
        assert!(
            reason.contains("is trained on, so it cannot be a test file"),
            "{reason}"
        );
    }
}
