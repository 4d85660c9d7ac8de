//! Networks and checkpoints of own data.

#![cfg(feature = "files")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{fs, ops::ControlFlow};

use decoupler::{
    dataset::Seed,
    evaluation::{Measured, Run, RunSettings},
    export::{MeasuredCheckpointFile, MeasuredNetworkFile},
    import::{Plan, Progress, Recipe},
    scene::RowModel,
};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use tempfile::TempDir;

fn go_on(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
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
        import: Recipe {
            data: "data.csv".into(),
            inputs: vec!["a".to_owned(), "b".to_owned()],
            targets: vec!["force".to_owned()],
            ..Recipe::default()
        },
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
