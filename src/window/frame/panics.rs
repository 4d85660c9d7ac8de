//! A panic in the work of each job is shown, the window lives, and the job can be started again.

use std::{fs, path::Path};

use eframe::egui::Key;

use crate::{
    driver::{Driver, small},
    window::{
        job::planned_panic::{MESSAGE, is_pending, plan},
        shared::{Effect, Notice, Phase},
    },
};

/// Starts the job `name` with `begin` and a planned panic, and waits until the window shows it.
#[track_caller]
fn panics(driver: &mut Driver, name: &'static str, begin: impl FnOnce(&mut Driver)) {
    plan(name);
    begin(driver);
    shows_panic(driver, name);
}

#[track_caller]
fn shows_panic(driver: &mut Driver, name: &'static str) {
    let shown = format!("an internal error stopped the thread '{name}': {MESSAGE}. Other work is not affected");
    driver.wait(&shown, |driver| driver.says(&shown));
    assert!(!is_pending(), "{name}");
    for _ in 0..5 {
        let Some(place) = driver.notice().is_some().then_some(0) else {
            break;
        };
        driver.window_mut().notices.dismiss(place);
    }
    // The layout without notices.
    driver.harness().run_steps(2);
}

#[test]
fn jobs_of_a_training_can_be_started_again_after_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    // The thread that trains is started with the window.
    plan("training");
    let mut driver = Driver::open();
    shows_panic(&mut driver, "training");
    assert_eq!(driver.state().phase, Phase::Idle);
    panics(&mut driver, "preview", |driver| {
        driver.choose("Paper's array", "10×8_4×24");
    });
    driver.configure_small();
    panics(&mut driver, "demo network", |driver| {
        driver.act("Press the middle of the surface");
    });
    driver.press(Key::Escape);
    driver.train();
    driver.wait_for_last_epoch();
    driver.wait_for_kept_run();

    driver.act("Press the middle of the surface");
    let answered = |driver: &Driver| driver.says("Training mean, mean mm: 0");
    driver.wait("the other decoders", answered);
    // One new touch each: the next one begins again.
    panics(&mut driver, "decoders of a press", |driver| {
        driver.enter("Depth", "0.3");
    });
    driver.enter("Depth", "0.6");
    driver.wait("the other decoders", |driver| {
        answered(driver) && !driver.says("internal error")
    });
    driver.press(Key::Escape);

    let table = folder.path().join("table.csv");
    panics(&mut driver, "file", |driver| driver.save("Error table, CSV", &table));
    assert!(!table.exists());
    driver.save("Error table, CSV", &table);
    assert!(table.exists());

    panics(&mut driver, "past network", |driver| {
        driver.get("Epoch of the displayed network").focus();
        driver.harness().run_steps(2);
        driver.press(Key::ArrowLeft);
    });
    driver.get("Epoch of the displayed network").focus();
    driver.harness().run_steps(2);
    driver.press(Key::ArrowLeft);
    driver.wait("the network of the epoch", |driver| {
        driver.views().train.scrub.result().is_some()
    });
    driver.click_button("Latest");

    driver.details();
    panics(&mut driver, "comparison of decoders", |driver| {
        driver.click("More decoders");
    });
    driver.click("More decoders");
    driver.click("More decoders");
    driver.wait("a decoder", |driver| !driver.says("internal error"));
    driver.click("More decoders");

    driver.enter("Hidden nodes", "5");
    plan("compared run");
    driver.train();
    driver.click_button("Compare");
    shows_panic(&mut driver, "compared run");
}

#[test]
fn a_press_on_a_large_array_is_answered_again_after_a_panic() {
    let mut driver = Driver::open();
    let mut settings = small();
    settings.simulation_mut().unwrap().sensor.scale = "100x60_3x180".parse().unwrap();
    let simulation = settings.simulation_mut().unwrap();
    (simulation.samples, simulation.test_samples) = (2, 1);
    driver.window_mut().apply(Effect::Configure(Box::new(settings)));
    driver.wait("the surface", |driver| {
        let skin = driver.state().skin();
        skin.is_some_and(|skin| skin.sensor == settings.simulation().unwrap().sensor)
    });
    panics(&mut driver, "press", |driver| {
        driver.act("Press the middle of the surface");
    });
    driver.press(Key::Escape);
    driver.act("Press the middle of the surface");
    driver.wait("the pressed surface", |driver| {
        driver.views().train.press.shown().is_some()
    });
}

#[test]
fn jobs_of_the_other_views_can_be_started_again_after_a_panic() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_kept_run();

    panics(&mut driver, "identifiability analysis", |driver| {
        driver.click_button("Sensor");
    });
    driver.enter("Height", "8");
    driver.wait("the analysis", |driver| driver.says("Condition number: "));
    panics(&mut driver, "picture", |driver| {
        driver.choose_export("Singular values, Copy");
        driver.click_button("Copy");
    });
    driver.choose_export("Singular values, Copy");
    driver.click_button("Copy");
    driver.wait("the picture", |driver| matches!(driver.notice(), Some(Notice::Done(_))));

    driver.click_button("Study");
    panics(&mut driver, "study", |driver| driver.click("▶ Run"));
    assert!(driver.is_enabled("▶ Run"));
    driver.click("Sweep");
    panics(&mut driver, "study", |driver| {
        driver.open_form("Open sweep folder…");
        driver.type_into("File", "nowhere");
        driver.click_button("Open");
    });

    driver.click_button("Live");
    panics(&mut driver, "live decoding", |driver| driver.click("▶ Start"));
    panics(&mut driver, "network file", |driver| {
        driver.click("Play the sample recording");
    });
    driver.click("▶ Start");
    driver.wait("a frame", |driver| driver.has("Live decoded surface"));
}

#[test]
fn jobs_of_a_recording_can_be_started_again_after_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("press.csv");
    let rows = (0..60).map(|row| format!("{},{},{}\n", row, row * row % 17, row * row % 17 + row % 3));
    fs::write(&path, format!("time (s),u (V),d (mm)\n{}", String::from_iter(rows))).unwrap();
    let mut driver = Driver::open();
    let open = |driver: &mut Driver| {
        driver.window_mut().views.open_files(vec![path.clone()]);
        driver.harness().step();
    };
    panics(&mut driver, "reading of a recording", open);
    open(&mut driver);
    driver.wait("the samples", |driver| driver.says("Test: "));
    driver.click_button("Study");
    driver.click("What the readings determine");
    panics(&mut driver, "study", |driver| driver.act("Begin the study"));
    driver.act("Begin the study");
    driver.wait("the findings", |driver| driver.says("R²"));
}

#[test]
fn a_panic_while_settings_are_remembered_is_shown_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("window.json");
    let mut driver = Driver::open_remembering(&path);
    panics(&mut driver, "memory", |driver| driver.act("Light theme"));
    fs::remove_file(&path).unwrap_or_default();
    driver.act("Dark theme");
    driver.wait("the file", |_| Path::new(&path).exists());
}
