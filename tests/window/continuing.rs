//! Several starts, checkpoints, and continuing with another method.

use std::{fs, path::Path, time::Duration};

use decoupler::window::{Effect, Notice, Phase};
use decoupler_core::{
    evaluation::{Run, RunSettings, Spread, StartRecord},
    job::Job,
    training::{Method, StopReason, StoppingRules},
};
use decoupler_files::export::{CheckpointFile, NetworkFile, format_number};

use crate::{
    configuring::choose_method,
    driver::{Driver, small, table_of, trained},
    sources::{BOTH, begun, network_figures, open_small, run_of, with_epochs},
};

const SAVE: &str = "Checkpoint, resumable";
const OPEN: &str = "Open files";

/// Types `path` into the form of an action and confirms.
fn enter_path(driver: &mut Driver, button: &str, path: &Path) {
    if button == OPEN {
        driver.act(button);
    } else {
        driver.export(button);
    }
    driver.type_into("File", &path.display().to_string());
    driver.click_button(if button == OPEN { "Open" } else { "Save" });
}

/// Opens a checkpoint without scrolling to the button, which would move the table and the times out of view.
fn open(driver: &mut Driver, path: &Path) {
    driver.window_mut().apply(Effect::OpenTraining(path.to_owned()));
}

fn save(driver: &mut Driver, button: &str, path: &Path) {
    enter_path(driver, button, path);
    let saved = format!("Saved {}", path.display());
    driver.wait("the file", |driver| driver.has(&saved));
    driver.click("Dismiss");
}

fn momentum(epochs: usize) -> RunSettings {
    let mut settings = small();
    settings.training.method = Method::MOMENTUM;
    settings.training.stopping.epochs = epochs;
    settings
}

/// Begins a training that does not end by itself.
fn start_endless(driver: &mut Driver) {
    driver.configure_small();
    choose_method(driver, "Momentum, Eq. (11)");
    driver.enter("Epochs", "1000000");
    assert_eq!(driver.state().draft, momentum(1_000_000));
    driver.click("▶ Train");
    driver.wait_for_epochs(5);
}

/// Presses Pause and waits until the last epoch is shown.
fn pause(driver: &mut Driver) {
    driver.click("⏸ Pause");
    driver.wait_for_last_epoch();
    assert!(driver.has("Paused"));
}

fn stepped(settings: RunSettings, epochs: usize) -> Run {
    let mut run = Run::prepare(settings).unwrap();
    (0..epochs).for_each(|_| {
        run.step();
    });
    run
}

fn ended(driver: &mut Driver) {
    driver.wait_for_end();
    driver.settle();
}

#[test]
fn several_starts_keep_the_best_and_show_how_all_spread() {
    for source in BOTH {
        let mut opened = open_small(source);
        opened.change(|settings| settings.starts = 4);
        opened.driver.train();
        let run = run_of(&opened.setup);
        let (starts, shown) = (run.starts(), opened.driver.state().run.as_ref().unwrap());
        assert_eq!(shown.starts, starts);
        assert_eq!(shown.history, run.leader().history());
        opened.driver.details();
        opened.driver.assert_shows(&network_figures(&run));
        assert!(opened.driver.has("SPREAD OVER 4 RESTARTS"));
        let percent = Spread::of(starts.iter().filter_map(StartRecord::percent)).unwrap();
        let validation = Spread::of(starts.iter().map(StartRecord::deciding_mse)).unwrap();
        assert!(percent.smallest < percent.largest, "the starts differ");
        let deciding = match starts[0].validation_mse {
            Some(_) => "validation mse",
            None => "training mse",
        };
        let of_test = run.problem().test_percent_name();
        let mut expected = Vec::new();
        for (name, spread) in [(of_test, percent), (deciding, validation)] {
            for (column, value) in [
                ("min", spread.smallest),
                ("median", spread.median),
                ("max", spread.largest),
            ] {
                expected.push(format!("{name}, {column}: {}", format_number(value)));
            }
        }
        let kept = run.leader_number() + 1;
        expected.push(format!("Restart {kept} is kept: it has the lowest {deciding}."));
        opened.driver.assert_shows(&expected);

        opened.change(|settings| settings.starts = 1);
        opened.driver.train();
        assert!(!opened.driver.says("SPREAD OVER"), "one start has no spread");
    }
}

#[test]
fn the_spread_is_shown_while_the_starts_train() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.enter("Restarts", "3");
    choose_method(&mut driver, "Momentum, Eq. (11)");
    driver.enter("Epochs", "1000000");
    driver.click("▶ Train");
    driver.wait("a later look at the starts", |driver| {
        let starts = driver.state().run.as_ref().map(|run| run.starts.as_slice());
        driver.is_enabled("⏸ Pause") && starts.is_some_and(|starts| starts.len() == 3 && starts[0].epochs > 1)
    });
    driver.details();
    assert!(driver.has("SPREAD OVER 3 RESTARTS"));
    driver.click("■ Stop");
    ended(&mut driver);
    let settings = RunSettings {
        starts: 3,
        ..momentum(1_000_000)
    };
    let mut run = stepped(settings, driver.epochs());
    run.stop();
    let shown = driver.state().run.as_ref().unwrap();
    assert_eq!(shown.history, run.leader().history(), "the leader's, whole");
    assert_eq!(shown.starts, run.starts());
}

#[test]
fn a_training_saved_and_opened_ends_in_the_same_network_file_as_one_never_interrupted() {
    for source in BOTH {
        let mut opened = open_small(source);
        let [checkpoint, network] = ["run.checkpoint", "network.json"].map(|name| opened.folder.path().join(name));
        opened.change(|settings| settings.training = momentum(1_000_000).training);
        let (driver, setup) = (&mut opened.driver, &opened.setup);
        driver.click("▶ Train");
        driver.wait_for_epochs(5);
        driver.open_menu();
        driver.choose_export(SAVE);
        assert!(!driver.is_enabled("Save…"), "a training is paused first");
        assert!(driver.says("A training under way cannot be saved"));
        driver.press(eframe::egui::Key::Escape);
        pause(driver);
        save(driver, SAVE, &checkpoint);
        let (held, history) = (driver.epochs(), driver.state().run.as_ref().unwrap().history.clone());

        let mut driver = Driver::open();
        enter_path(&mut driver, OPEN, &checkpoint);
        driver.wait("the training", |driver| driver.epochs() == held);
        driver.settle();
        assert!(driver.has("Paused"));
        driver.wait("the settings of the file", |driver| {
            driver.state().setup().as_ref() == Ok(setup)
        });
        assert_eq!(driver.state().run.as_ref().unwrap().history, history);
        assert!(driver.has(&format!("Epoch {held} of 1000000")));

        driver.click("▶ Resume");
        driver.wait_for_epochs(20);
        driver.click("■ Stop");
        ended(&mut driver);
        save(&mut driver, "Network file, JSON", &network);
        let mut whole = begun(setup);
        (0..driver.epochs()).for_each(|_| {
            whole.step();
        });
        whole.stop();
        let found = NetworkFile::load(&network).unwrap();
        let mut expected = NetworkFile::from_run(&whole, found.recorded.as_ref()).unwrap();
        // Only the wall time differs.
        expected.training.seconds = found.training.seconds;
        // The window adds what it has measured of the training readings.
        expected.drift.clone_from(&found.drift);
        assert_eq!(found, expected);
        assert_eq!(found.setup(), *setup);
        let bits = |file: &NetworkFile| -> Vec<u64> {
            let weights = file.network.values()[0].mlp().weights();
            weights.iter().map(|weight| weight.to_bits()).collect()
        };
        assert_eq!(bits(&found), bits(&expected));
    }
}

#[test]
fn checkpoints_of_the_terminal_open_in_the_window_and_the_windows_in_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let [terminal, window] = ["terminal", "window"].map(|name| folder.path().join(name));
    let settings = RunSettings { starts: 3, ..small() };
    CheckpointFile::from_run(&stepped(settings, 7), None)
        .unwrap()
        .save(&terminal)
        .unwrap();
    let mut driver = Driver::open();
    enter_path(&mut driver, OPEN, &terminal);
    driver.wait("the training", |driver| driver.epochs() == 7);
    driver.details();
    assert!(driver.state().draft == settings && driver.has("SPREAD OVER 3 RESTARTS"));
    save(&mut driver, SAVE, &window);
    driver.click("▶ Resume");
    ended(&mut driver);
    let whole = trained(settings);
    assert_eq!(driver.table(), table_of(&whole));
    assert_eq!(driver.state().run.as_ref().unwrap().history, whole.leader().history());

    let mut run = CheckpointFile::load(&window)
        .unwrap()
        .resume(&Job::UNINTERRUPTED, &mut |_| ())
        .unwrap()
        .0;
    while run.step().is_none() {}
    assert_eq!(run.starts(), whole.starts());
    // One that has ended opens as ended, and can be given more epochs.
    CheckpointFile::from_run(&run, None).unwrap().save(&terminal).unwrap();
    enter_path(&mut driver, OPEN, &terminal);
    driver.wait("the ended training", |driver| {
        driver.state().phase == Phase::Ended(StopReason::EpochsReached)
    });
    assert!(driver.has("Train longer"));
}

/// Starts run in parallel: their wall time is saved, and without it no time is shown.
#[test]
fn a_checkpoint_shows_the_wall_time_of_all_starts_or_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    let mut file = CheckpointFile::from_run(&stepped(RunSettings { starts: 3, ..small() }, 6), None).unwrap();
    for (saved, all, an_epoch) in [(Some(3600), "1 h 0 min", "10 min 0 s"), (None, "–", "–")] {
        file.wall_time = saved.map(Duration::from_secs);
        file.save(&path).unwrap();
        let mut driver = Driver::open();
        open(&mut driver, &path);
        driver.wait("the training", |driver| {
            let result = driver.state().run.as_ref().and_then(|run| run.result.as_ref());
            result.is_some_and(|result| result.wall_time == file.wall_time)
        });
        driver.details();
        let texts = driver.texts();
        for (name, value) in [("Training time", all), ("Time per epoch", an_epoch)] {
            let place = texts.iter().rposition(|text| text == name).unwrap();
            assert_eq!(texts[place + 1], value, "{texts:#?}");
        }
    }
}

#[test]
fn an_invalid_or_damaged_checkpoint_is_explained_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    let (table, phase, draft) = (driver.table(), driver.state().phase, driver.state().draft);
    CheckpointFile::from_run(&stepped(momentum(50), 3), None)
        .unwrap()
        .save(&path)
        .unwrap();
    let intact = fs::read_to_string(&path).unwrap();
    let cases = [
        ("is cut off", intact[..intact.len() / 2].to_owned()),
        ("is damaged", intact.replacen("\"hidden\":6", "\"hidden\":7", 1)),
        ("is not a checkpoint", "epoch,training\n0,1\n".to_owned()),
        ("has version 99", intact.replacen("\"version\":", "\"version\":99", 1)),
    ];
    for (reason, contents) in cases {
        fs::write(&path, &contents).unwrap();
        open(&mut driver, &path);
        driver.wait("the reason", |driver| driver.notice().is_some());
        let expected = CheckpointFile::load(&path).unwrap_err().to_string();
        assert!(expected.contains(reason), "{expected}");
        assert_eq!(driver.notice(), Some(&Notice::Failed(expected.clone())));
        assert!(driver.has(&expected));
        assert_eq!(
            (driver.table(), driver.state().phase, driver.state().draft),
            (table.clone(), phase, draft)
        );
        driver.click("Dismiss");
    }
    fs::write(&path, &intact).unwrap();
    open(&mut driver, &path);
    driver.wait("the intact one", |driver| driver.has("Paused"));
}

#[test]
fn levenberg_marquardt_continues_where_momentum_ended() {
    let mut driver = Driver::open();
    driver.configure_small();
    choose_method(&mut driver, "Momentum, Eq. (11)");
    driver.train();
    assert_eq!(driver.epochs(), 15);
    choose_method(&mut driver, "Levenberg-Marquardt");
    driver.click("Train longer");
    ended(&mut driver);
    let mut run = trained(momentum(15));
    run.continue_with(Method::default()).unwrap();
    run.set_stopping(StoppingRules {
        epochs: 30,
        ..StoppingRules::default()
    })
    .unwrap();
    while run.step().is_none() {}
    let shown = driver.state().run.as_ref().unwrap();
    assert_eq!(shown.history, run.leader().history());
    assert_eq!(shown.stages, run.leader().stages());
    assert!(driver.epochs() > 15);
    let mse = |epoch: usize| shown.history[epoch].training_mse;
    assert!(mse(driver.epochs()) < 0.5 * mse(15));
    assert_eq!(driver.table(), table_of(&run));
    assert!(driver.has(&format!("Epoch {} of 30", driver.epochs())));
    assert!(
        driver.says(" from epoch 15"),
        "the chart marks where the method changed"
    );
    assert!(!driver.says("previous settings"));
    driver.show_chart("Training state");
    driver.settle();
    assert!(driver.says(" from epoch 15"));

    driver.enter("Hidden nodes", "7");
    assert!(!driver.has("Train longer"), "another network begins again");
}

#[test]
fn more_epochs_of_the_same_method_give_the_result_of_a_longer_training() {
    for source in BOTH {
        let mut opened = open_small(source);
        opened.change(|settings| settings.training = momentum(15).training);
        let (driver, setup) = (&mut opened.driver, &opened.setup);
        driver.train();
        driver.click("Train longer");
        ended(driver);
        let whole = run_of(&with_epochs(setup, 30));
        assert_eq!(driver.state().run.as_ref().unwrap().history, whole.leader().history());
        driver.details();
        driver.assert_shows(&network_figures(&whole));
        driver.click("▶ Train");
        ended(driver);
        assert_eq!(driver.epochs(), 15, "Train begins again");
    }
}

#[test]
fn a_paused_training_can_be_continued_with_another_method_or_resumed_as_it_was() {
    let mut driver = Driver::open();
    start_endless(&mut driver);
    pause(&mut driver);
    assert!(!driver.has("Train longer"), "Resume does that");
    assert!(!driver.is_enabled("Hidden nodes") && !driver.is_enabled("Restarts"));
    choose_method(&mut driver, "Levenberg-Marquardt");
    assert!(driver.has("Train longer"));
    driver.click("▶ Resume");
    assert_eq!(driver.state().draft, momentum(1_000_000), "as it was");
    driver.wait_for_epochs(5);
    pause(&mut driver);

    let held = driver.epochs();
    choose_method(&mut driver, "Levenberg-Marquardt");
    driver.enter("Mu", "1e-2");
    driver.enter("Epochs", "4");
    driver.click("Train longer");
    ended(&mut driver);
    let mut run = stepped(momentum(1_000_000), held);
    let training = driver.state().draft.training;
    run.continue_with(training.method).unwrap();
    run.set_stopping(StoppingRules {
        epochs: held + 4,
        ..training.stopping
    })
    .unwrap();
    while run.step().is_none() {}
    assert_eq!(driver.state().run.as_ref().unwrap().history, run.leader().history());
    assert_eq!(driver.state().draft.training.stopping.epochs, 4, "what was typed stays");
}

#[test]
fn bayesian_regularisation_says_how_many_weights_the_data_determine() {
    let mut driver = Driver::open();
    driver.configure_small();
    choose_method(&mut driver, "Bayesian regularisation");
    driver.train();
    let mut settings = small();
    settings.training.method = driver.state().draft.training.method;
    let run = trained(settings);
    let leader = run.leader();
    let effective = leader.history()[leader.best_epoch()].effective_parameters.unwrap();
    let weights = leader.weights();
    let text = format!("Effective parameters {} of {weights} weights", format_number(effective));
    driver.details();
    assert!(driver.has(&text), "{text} is not in {:#?}", driver.texts());
    choose_method(&mut driver, "Levenberg-Marquardt");
    driver.train();
    assert!(!driver.says("Effective parameters"));
}
