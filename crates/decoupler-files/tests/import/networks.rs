//! Networks and checkpoints of recordings, the recordings named in them, and recipes.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use decoupler_core::{
    dataset::{Division, Simulation, SplitBy},
    evaluation::{Run, RunSettings, TargetErrors, TestErrors},
    job::Job,
    network::Networks,
    scene::RowModel,
};
use decoupler_files::{
    export::{CheckpointFile, NetworkFile, RecipeFile, RunFolder, describe_worse_than_ridge},
    import::{Plan, Setup, SetupError, SetupSets, file_crc32},
};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use crate::support::{folder, go_on, recipe};

/// A recording in `folder` whose target is a curved function of its two readings, and its plan.
fn curved(folder: &Path) -> Plan {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut line = || {
        let (a, b): (f64, f64) = (rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
        format!("{a},{b},{}\n", (2.0 * a).sin() + a * b)
    };
    let text: String = (0..200).map(|_| line()).collect();
    fs::write(folder.join("data.csv"), format!("a,b,force (N)\n{text}")).unwrap();
    Plan {
        import: recipe("a b", "force"),
        ..Plan::default()
    }
}

fn settings() -> RunSettings {
    let mut settings = RunSettings::measured(RowModel::Shared);
    settings.hidden = 5;
    settings.training.stopping.epochs = 30;
    settings
}

/// A run on the recording in `folder`, with its sets.
fn prepared(folder: &Path) -> (Run, SetupSets) {
    let setup = Setup::recording(settings(), curved(folder));
    let sets = setup.sets(folder, &Job::UNINTERRUPTED, &mut |_| ()).unwrap();
    let run = sets.run(&setup, None, &Job::UNINTERRUPTED).unwrap();
    (run, sets)
}

fn trained(folder: &Path) -> NetworkFile {
    let (mut run, sets) = prepared(folder);
    while run.step().is_none() {}
    NetworkFile::from_run(&run, sets.recorded()).unwrap()
}

/// The checkpoint of a run on the recording in `folder` after seven epochs, and the network that it ends with.
fn paused(folder: &Path) -> (CheckpointFile, NetworkFile) {
    let (mut run, sets) = prepared(folder);
    (0..7).for_each(|_| {
        run.step();
    });
    let paused = CheckpointFile::from_run(&run, sets.recorded()).unwrap();
    while run.step().is_none() {}
    (paused, NetworkFile::from_run(&run, sets.recorded()).unwrap())
}

/// Two sibling folders: one for recordings, and one for files that name them.
fn folders(root: &Path) -> [PathBuf; 2] {
    ["recordings", "networks"].map(|name| {
        let folder = root.join(name);
        fs::create_dir_all(&folder).unwrap();
        folder
    })
}

/// The network of a training that is resumed and finished.
fn finished(checkpoint: CheckpointFile) -> Networks {
    let mut resumed = checkpoint.resume(&Job::UNINTERRUPTED, &mut |_| ()).unwrap().0;
    while resumed.step().is_none() {}
    resumed.network()
}

/// The reason why a training cannot be resumed.
fn refusal(checkpoint: CheckpointFile) -> SetupError {
    checkpoint.resume(&Job::UNINTERRUPTED, &mut |_| ()).err().unwrap()
}

fn missing(checkpoint: &CheckpointFile) -> Vec<&Path> {
    checkpoint.recorded.as_ref().unwrap().missing()
}

fn worse_than_ridge(file: &NetworkFile) -> Option<String> {
    describe_worse_than_ridge(&file.problem, &file.scores)
}

#[test]
fn networks_of_recordings_are_saved_with_the_names_of_their_channels() {
    let folder = folder(&[]);
    let file = trained(folder.path());
    let [network, ridge] = [&file.scores.network, &file.scores.baselines.linear].map(|errors| errors.targets()[0]);
    assert!(network.rmse < 0.2 * ridge.rmse, "{network:?} {ridge:?}");
    let path = folder.path().join("network.json");
    file.save(&path).unwrap();
    let read = NetworkFile::load(&path).unwrap();
    assert_eq!(read, file);
    assert_eq!(read.problem.targets[0].title(), "force (N)");
    assert_eq!(read.source_name(), "data");
    let sets = read
        .setup()
        .sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ())
        .unwrap();
    let bits = |file: &NetworkFile| file.network.decouple(&sets.sets.test).mapv(f64::to_bits);
    assert_eq!(bits(&read), bits(&file));
    let test = read.test_set().unwrap();
    assert_eq!(
        TestErrors::of_targets(&test, read.network.decouple(&test).view()),
        read.scores.network
    );
}

#[test]
fn the_remark_on_a_network_worse_than_ridge_claims_no_cause() {
    let folder = folder(&[]);
    let mut file = trained(folder.path());
    let ridge = file.scores.baselines.linear.targets()[0];
    let with_rmse = |rmse: f64| TestErrors::Targets(vec![TargetErrors { rmse, ..ridge }]);
    file.scores.network = with_rmse(0.5 * ridge.rmse);
    assert!(worse_than_ridge(&file).is_none());
    file.scores.network = with_rmse((1.0 + 1e-7) * ridge.rmse);
    let hardly = worse_than_ridge(&file).unwrap();
    assert!(
        hardly.contains("is no better than ridge regression for force (RMSE") && hardly.contains(" for both)"),
        "{hardly}"
    );
    file.scores.network = with_rmse(2.0 * ridge.rmse);
    let worse = worse_than_ridge(&file).unwrap();
    assert!(
        worse.ends_with(": use ridge, or compare other settings by cross-validation"),
        "{worse}"
    );
    // Five targets make one sentence that names three.
    let ridge = TestErrors::Targets(vec![ridge; 5]);
    file.problem.targets = vec![file.problem.targets[0].clone(); 5];
    file.scores.network = TestErrors::Targets(vec![with_rmse(2.0 * ridge.targets()[0].rmse).targets()[0]; 5]);
    file.scores.baselines.linear = ridge;
    let warning = worse_than_ridge(&file).unwrap();
    assert!(
        warning.contains("worse than ridge regression for force (RMSE"),
        "{warning}"
    );
    assert_eq!(
        (warning.matches("force").count(), warning.contains(" and 2 more: ")),
        (3, true),
        "{warning}"
    );
}

#[test]
fn files_are_found_when_they_move_together_with_their_recording_or_when_it_is_given_again() {
    let root = folder(&[]);
    let at = |name: &str| root.path().join(name);
    let [recordings, networks] = folders(&at("here"));
    let (checkpoint, whole) = paused(&recordings);
    checkpoint.save(&networks.join("run.checkpoint")).unwrap();
    whole.save(&networks.join("network.json")).unwrap();
    let check = |folder: &Path| {
        let file = NetworkFile::load(&folder.join("network.json")).unwrap();
        assert!(file.recorded.as_ref().unwrap().missing().is_empty(), "{folder:?}");
        assert_eq!(file.network, whole.network);
        let checkpoint = CheckpointFile::load(&folder.join("run.checkpoint")).unwrap();
        assert_eq!(finished(checkpoint), whole.network, "{folder:?}");
    };
    check(&networks);
    // Both folders, to another place.
    fs::rename(at("here"), at("there")).unwrap();
    check(&at("there/networks"));
    // All files into one folder, as in a message to a colleague.
    fs::create_dir(at("sent")).unwrap();
    for file in [
        "networks/run.checkpoint",
        "networks/network.json",
        "recordings/data.csv",
    ] {
        let file = at("there").join(file);
        fs::rename(&file, at("sent").join(file.file_name().unwrap())).unwrap();
    }
    check(&at("sent"));
    // The recording under another name.
    let renamed = at("sent/press.csv");
    fs::rename(at("sent/data.csv"), &renamed).unwrap();
    let mut read = CheckpointFile::load(&at("sent/run.checkpoint")).unwrap();
    let data = at("recordings/data.csv");
    assert_eq!(missing(&read), [data.as_path()], "as it was saved");
    let error = refusal(read.clone()).to_string();
    assert!(error.contains("cannot read") && error.contains("data.csv"), "{error}");
    read.recorded = read.recorded.map(|recorded| recorded.relocated(&data, &renamed));
    assert!(missing(&read).is_empty());
    assert_eq!(finished(read), whole.network);
}

#[test]
fn no_saved_file_has_an_absolute_path() {
    let root = folder(&[]);
    let [recordings, networks] = folders(root.path());
    let (checkpoint, whole) = paused(&recordings);
    checkpoint.save(&networks.join("run.checkpoint")).unwrap();
    whole.save(&networks.join("network.json")).unwrap();
    let plan = &whole.recorded.as_ref().unwrap().plan;
    assert!(plan.import.data.is_absolute());
    RecipeFile::Recording(plan.clone())
        .save(&networks.join("recipe.json"))
        .unwrap();
    let (mut kept, _) = RunFolder::open(&networks.join("runs")).unwrap();
    kept.keep(Arc::new(whole.clone())).unwrap();
    assert_eq!(kept.runs().runs[0].name, "data h5 br");
    let entries = [networks.clone(), networks.join("runs")].map(|folder| fs::read_dir(folder).unwrap());
    let mut files = 0;
    for entry in entries.into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_file() {
            let text = fs::read_to_string(&path).unwrap();
            assert!(!text.contains(&*root.path().to_string_lossy()), "{path:?}: {text}");
            let names_it = text.contains("../recordings/data.csv");
            assert!(
                names_it || path.to_string_lossy().ends_with(".name.json"),
                "{path:?}: {text}"
            );
            files += 1;
        }
    }
    assert_eq!(files, 5, "three files, and a run with its name");
}

#[test]
fn only_the_runs_in_use_are_in_memory() {
    let root = folder(&[]);
    let [recordings, runs] = folders(root.path());
    let (mut kept, _) = RunFolder::open(&runs).unwrap();
    let file = Arc::new(trained(&recordings));
    for _ in 0..5 {
        kept.keep(Arc::clone(&file)).unwrap();
    }
    let ids = Vec::from_iter(kept.runs().runs.iter().map(|run| run.id));
    let loaded = |folder: &RunFolder| {
        let loaded = folder.runs().runs.iter().map(|run| run.file.is_some());
        Vec::from_iter(loaded)
    };
    kept.pin([Some(ids[1]), None]).unwrap();
    assert!(kept.load_used().is_empty());
    assert_eq!(loaded(&kept), [false, true, false, false, true]);
    assert!(kept.runs().runs.iter().all(|run| *run.load(&runs).unwrap() == *file));
    kept.pin([None, Some(ids[3])]).unwrap();
    kept.remove(ids[4]).unwrap();
    assert!(kept.load_used().is_empty());
    assert_eq!(loaded(&kept), [false, false, false, true]);
    // Damaged since it was listed: it is named once and leaves the list.
    let damaged = format!("run-{}.json", ids[2]);
    fs::write(runs.join(&damaged), "{").unwrap();
    kept.pin([Some(ids[2]), None]).unwrap();
    let problems = kept.load_used();
    assert!(problems.len() == 1 && problems[0].contains(&damaged), "{problems:?}");
    assert_eq!(kept.runs().runs.len(), 3);
    assert!(kept.look().is_empty() && kept.load_used().is_empty());
    // Runs that have no file stay.
    let mut unkept = RunFolder::default();
    for _ in 0..3 {
        unkept.keep(Arc::clone(&file)).unwrap();
    }
    assert!(unkept.load_used().is_empty());
    assert_eq!(loaded(&unkept), [true; 3]);
}

#[test]
fn a_recipe_repeats_the_import_from_another_folder() {
    let folder = folder(&[]);
    fs::write(folder.path().join("data.csv"), "t,x,y\n0,1,2\n1,3,4\n2,5,6\n3,7,8\n").unwrap();
    let mut plan = Plan {
        import: recipe("x", "y"),
        division: Division {
            by: SplitBy::Random,
            ..Division::default()
        },
        ..Plan::default()
    };
    plan.import.conditions = vec!["t>0".parse().unwrap()];
    plan.import.missing = vec!["x=-1".parse().unwrap()];
    let path = folder.path().join("import.json");
    RecipeFile::Recording(plan.within(folder.path())).save(&path).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert!(
        text.contains("\"data\": \"data.csv\"") && text.contains("\"t>0\""),
        "{text}"
    );
    let read = RecipeFile::load_recording(&path).unwrap();
    assert_eq!(read, plan.within(folder.path()));
    assert_eq!(RecipeFile::load(&path).unwrap(), RecipeFile::Recording(read.clone()));
    let recording = read.recording(Path::new(""), &mut go_on).unwrap();
    assert_eq!(recording.set.readings().column(0).to_vec(), [3.0, 5.0, 7.0]);
    for (from, to, cause) in [
        ("\"inputs\"", "\"imputs\"", "unknown field `imputs`"),
        (
            "\"recording\"",
            "\"recorded\"",
            "unknown variant `recorded`, expected `simulated` or `recording`",
        ),
        (
            "decoupler recipe",
            "decoupler network",
            "its format is \"decoupler network\"",
        ),
    ] {
        assert!(text.contains(from), "{from}");
        fs::write(&path, text.replace(from, to)).unwrap();
        let error = RecipeFile::load(&path).unwrap_err().to_string();
        assert!(error.contains(cause), "{error}");
    }
}

#[test]
fn a_recipe_of_an_array_has_only_differences_from_the_papers_array() {
    let folder = folder(&[]);
    let path = folder.path().join("array.json");
    let written = |source: &str| {
        let text =
            format!(r#"{{"format": "decoupler recipe", "version": 1, "program": "by hand", "source": {source}}}"#);
        fs::write(&path, text).unwrap();
        RecipeFile::load(&path)
    };
    assert_eq!(
        written(r#"{"simulated": {}}"#).unwrap(),
        RecipeFile::Simulated(Simulation::default())
    );
    let mut expected = Simulation::default();
    expected.sensor.scale = "10x6_3x18".parse().unwrap();
    expected.sensor.geometry.height_mm = 6.0;
    expected.scene.noise.relative = 1e-3;
    expected.samples = 500;
    let text = r#"{"simulated": {"sensor": {"scale": "10x6_3x18", "geometry": {"height_mm": 6}},
        "scene": {"noise": {"relative": 1e-3}}, "samples": 500}}"#;
    assert_eq!(written(text).unwrap(), RecipeFile::Simulated(expected));
    for (text, cause) in [
        (r#"{"simulated": {"sample": 500}}"#, "unknown field `sample`"),
        (
            r#"{"simulated": {"samples": 0}}"#,
            "training samples: 0 is not possible",
        ),
        (
            r#"{"simulated": {"sensor": {"geometry": {"height_mm": -6}}}}"#,
            "the height is -6 mm",
        ),
        (
            r#"{"simulated": {"scene": {"largest_compression": 2}}}"#,
            "the largest compression is 200 %",
        ),
    ] {
        let error = written(text).unwrap_err().to_string();
        assert!(error.contains(cause) && error.contains("array.json"), "{error}");
    }
    RecipeFile::Simulated(expected).save(&path).unwrap();
    assert_eq!(RecipeFile::load(&path).unwrap(), RecipeFile::Simulated(expected));
    let error = RecipeFile::load_recording(&path).unwrap_err();
    assert!(
        error.to_string().contains("is the recipe of a simulated array"),
        "{error}"
    );
}

/// Makes a pipe without a writer.
#[cfg(unix)]
fn pipe(path: &Path) {
    assert!(
        std::process::Command::new("mkfifo")
            .arg(path)
            .status()
            .unwrap()
            .success()
    );
}

#[cfg(unix)]
#[test]
fn a_pipe_named_by_a_file_is_refused_before_it_is_opened() {
    let folder = folder(&[]);
    let plan = curved(folder.path()).within(folder.path());
    let recipe = folder.path().join("recipe.json");
    RecipeFile::Recording(plan.clone()).save(&recipe).unwrap();
    let file = trained(folder.path());
    let data = plan.import.data;
    fs::remove_file(&data).unwrap();
    pipe(&data);
    let error = RecipeFile::load(&recipe).unwrap_err().to_string();
    assert!(error.contains("data.csv' is a pipe or device"), "{error}");
    let error = file.test_set().unwrap_err().to_string();
    assert!(error.contains("data.csv' is a pipe or device"), "{error}");
    let error = file_crc32(&data, &mut go_on).unwrap_err().to_string();
    assert!(error.contains("data.csv' is a pipe or device"), "{error}");
}
