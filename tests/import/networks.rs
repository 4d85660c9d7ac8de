//! Recipes, networks and checkpoints of own data.

use std::{fs, ops::ControlFlow, path::Path};

use decoupler::{
    dataset::{Division, Seed, SplitBy},
    evaluation::{Measured, Run, RunSettings},
    export::{MeasuredCheckpointFile, MeasuredNetworkFile, RecipeFile, describe_worse_than_ridge},
    import::{Plan, Progress, Recipe},
    scene::RowModel,
    training::Method,
};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use tempfile::TempDir;

fn go_on(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn recipe(inputs: &[&str], target: &str) -> Recipe {
    Recipe {
        data: "data.csv".into(),
        inputs: inputs.iter().map(|&name| name.to_owned()).collect(),
        targets: vec![target.to_owned()],
        ..Recipe::default()
    }
}

/// A recording whose target is a curved function of its two readings, and its plan.
fn curved(folder: &TempDir) -> Plan {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut line = || {
        let (a, b): (f64, f64) = (rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
        format!("{a},{b},{}\n", (2.0 * a).sin() + a * b)
    };
    let text: String = (0..200).map(|_| line()).collect();
    fs::write(folder.path().join("data.csv"), format!("a,b,force (N)\n{text}")).unwrap();
    Plan {
        import: recipe(&["a", "b"], "force"),
        ..Plan::default()
    }
}

fn settings() -> RunSettings {
    let mut settings = RunSettings::from(Measured { rows: RowModel::Shared });
    settings.hidden = 5;
    settings.training.stopping.epochs = 30;
    // The correlation of neighbouring errors is measured on the way.
    let mut measured_at = settings.training.method.settings();
    let setting = measured_at
        .iter_mut()
        .find(|setting| setting.name == "correlation epoch");
    *setting.unwrap().value = 10.0;
    settings
}

#[test]
fn networks_of_own_data_are_saved_with_the_names_of_their_columns() {
    let folder = tempfile::tempdir().unwrap();
    let plan = curved(&folder);
    let sets = plan.sets(folder.path(), Seed(0), &mut go_on).unwrap();
    let (inputs, targets) = (sets.recording.inputs.clone(), sets.recording.targets.clone());
    let mut run = Run::on_sets(settings(), sets.split, sets.test).unwrap();
    while run.step().is_none() {}
    let file = MeasuredNetworkFile::from_run(&run, plan, (&inputs, &targets)).unwrap();
    assert!(
        file.errors[0].rmse < 0.2 * file.ridge[0].rmse,
        "{:?} {:?}",
        file.errors,
        file.ridge
    );
    let path = folder.path().join("network.json");
    file.save(&path).unwrap();
    let read = MeasuredNetworkFile::load(&path).unwrap();
    assert_eq!(read, file);
    assert_eq!(read.targets[0].title(), "force (N)");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replacen("force", "farce", 1)).unwrap();
    assert!(
        MeasuredNetworkFile::load(&path)
            .unwrap_err()
            .to_string()
            .contains("checksum")
    );
}

#[test]
fn the_cure_of_a_network_worse_than_ridge_is_not_the_method_that_it_was_trained_by() {
    let folder = tempfile::tempdir().unwrap();
    let plan = curved(&folder);
    let sets = plan.sets(folder.path(), Seed(0), &mut go_on).unwrap();
    let (inputs, targets) = (sets.recording.inputs.clone(), sets.recording.targets.clone());
    let mut run = Run::on_sets(settings(), sets.split, sets.test).unwrap();
    run.step();
    let mut file = MeasuredNetworkFile::from_run(&run, plan, (&inputs, &targets)).unwrap();
    file.errors[0].rmse = 0.5 * file.ridge[0].rmse;
    assert!(describe_worse_than_ridge(&file).is_empty());
    file.errors[0].rmse = (1.0 + 1e-7) * file.ridge[0].rmse;
    let hardly = &describe_worse_than_ridge(&file)[0];
    assert!(
        hardly.contains("is no better than ridge regression (RMSE") && !hardly.contains("against"),
        "{hardly}"
    );
    file.errors[0].rmse = 2.0 * file.ridge[0].rmse;
    for (method, is_advised) in [(Method::default(), true), (Method::recorded_regularization(), false)] {
        file.settings.training.method = method;
        let warnings = describe_worse_than_ridge(&file);
        assert_eq!(warnings.len(), 1);
        assert_eq!(warnings[0].contains("Bayesian"), is_advised, "{warnings:?}");
    }
}

#[test]
fn a_checkpoint_of_own_data_resumes_with_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let plan = curved(&folder);
    let sets = || plan.sets(folder.path(), Seed(0), &mut go_on).unwrap();
    let mut whole = Run::on_sets(settings(), sets().split, sets().test).unwrap();
    let path = folder.path().join("checkpoint.json");
    let checksum = MeasuredCheckpointFile::checksum(&sets());
    for epoch in 0.. {
        if epoch == 14 {
            MeasuredCheckpointFile::from_run(&whole, &plan, &checksum)
                .unwrap()
                .save(&path)
                .unwrap();
        }
        if whole.step().is_some() {
            break;
        }
    }
    let saved = MeasuredCheckpointFile::load(&path).unwrap();
    assert_eq!((saved.samples_crc32.as_str(), &saved.plan), (checksum.as_str(), &plan));
    let mut resumed = saved.resume(sets()).unwrap();
    while resumed.step().is_none() {}
    assert_eq!(resumed.network(), whole.network());
    // Another sample is noticed.
    let data = folder.path().join("data.csv");
    fs::write(&data, fs::read_to_string(&data).unwrap().replacen("0.", "0.0", 1)).unwrap();
    assert_ne!(MeasuredCheckpointFile::checksum(&sets()), checksum);
}

#[test]
fn a_recipe_repeats_the_import_from_another_folder() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("data.csv"), "t,x,y\n0,1,2\n1,3,4\n2,5,6\n3,7,8\n").unwrap();
    let mut plan = Plan {
        import: recipe(&["x"], "y"),
        division: Division {
            by: SplitBy::Random,
            ..Division::default()
        },
        ..Plan::default()
    };
    plan.import.conditions = vec!["t>0".parse().unwrap()];
    plan.import.missing = vec!["x=-1".parse().unwrap()];
    let path = folder.path().join("import.json");
    RecipeFile::save(&plan.within(folder.path()), &path).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert!(
        text.contains("\"data\": \"data.csv\"") && text.contains("\"t>0\""),
        "{text}"
    );
    let read = RecipeFile::load(&path).unwrap();
    assert_eq!(read, plan.within(folder.path()));
    let sets = read.sets(Path::new(""), Seed(0), &mut go_on).unwrap();
    assert_eq!(sets.recording.set.readings().column(0).to_vec(), [3.0, 5.0, 7.0]);
    for (from, to, cause) in [
        ("\"inputs\"", "\"imputs\"", "unknown field `imputs`"),
        ("\"version\": 1", "\"version\": 9", "version 9"),
        (
            "decoupler import",
            "decoupler network",
            "its format is \"decoupler network\"",
        ),
    ] {
        fs::write(&path, text.replace(from, to)).unwrap();
        let error = RecipeFile::load(&path).unwrap_err().to_string();
        assert!(error.contains(cause), "{error}");
    }
}
