//! The Identifiability view: figures, warnings, and the way back to the Train view.

use std::{fmt::Write as _, fs, ops::ControlFlow, path::Path};

use decoupler::window::{Analysis, Effect, Question, SourceKind};
use decoupler_core::{
    dataset::{Folds, SplitBy, Stream},
    evaluation::{CrossValidated, RunSettings},
    identifiability::Identifiability,
    job::Job,
    sensor::{RelativeNoise, SensorModel},
};
use decoupler_files::{
    export::{describe_target, format_number},
    import::Setup,
};
use eframe::egui::{Key, vec2};
use glam::DVec3;

use crate::{
    driver::Driver,
    sources::{Opened, open_small, probe},
};

fn open() -> Driver {
    let mut driver = Driver::open();
    driver.click_button("Identifiability");
    wait_for_the_answer(&mut driver);
    driver
}

/// Waits for the answer to the current question.
fn wait_for_the_answer(driver: &mut Driver) {
    driver.wait("the answer", |driver| {
        let shown = &driver.views().identifiability;
        !shown.is_pending && shown.analysis.is_some()
    });
}

fn analysis(driver: &Driver) -> &Analysis {
    driver.views().identifiability.analysis.as_ref().unwrap()
}

/// Returns the row with the smallest singular value, with all nodes pressed by `compression` of the height, by the library.
fn worst_row(sensor: &SensorModel, compression: f64) -> Identifiability {
    let axes = decoupler_core::sensor::Axes::Z;
    let pressed = vec![DVec3::Z * compression * sensor.geometry.height_mm; sensor.scale.nodes_per_row()];
    let rows = (0..sensor.scale.rows())
        .map(|row| Identifiability::of_row(sensor, row, &pressed, axes, RelativeNoise::default()).unwrap());
    let smallest = |row: &Identifiability| *row.singular_values_per_mm.last().unwrap();
    rows.min_by(|a, b| smallest(a).total_cmp(&smallest(b))).unwrap()
}

#[track_caller]
fn shows_condition_of(driver: &Driver, sensor: &SensorModel) {
    let worst = worst_row(sensor, 0.1);
    let condition = format!("Condition number: {}", format_number(worst.condition()));
    assert!(driver.has(&condition), "{condition} is not among {:#?}", driver.texts());
    assert!(driver.has(&format!("Worst row: {}", worst.row + 1)));
}

#[test]
fn the_figures_are_the_librarys_and_follow_the_geometry() {
    let mut driver = open();
    let mut sensor = driver.state().draft.simulation().unwrap().sensor;
    shows_condition_of(&driver, &sensor);
    assert!(driver.says("Without noise, the readings determine every deformation"));
    driver.enter("Height", "8");
    driver.enter("Column-wires", "40");
    wait_for_the_answer(&mut driver);
    sensor.geometry.height_mm = 8.0;
    sensor.scale = "10×10_5×40".parse().unwrap();
    shows_condition_of(&driver, &sensor);
    driver.settle();
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("values.svg");
    driver.save("Singular values, SVG", &picture);
    driver.click("Dismiss");
    let picture = std::fs::read_to_string(picture).unwrap();
    for word in ["worst row", "other rows", "deformation pattern, best seen first"] {
        assert!(picture.contains(word), "{word}");
    }

    driver.click("Use this sensor in the Train view");
    assert_eq!(
        (driver.shown(), driver.state().draft.simulation().unwrap().sensor),
        ("Train", sensor)
    );
    driver.click_button("Identifiability");
    wait_for_the_answer(&mut driver);
    assert!(!driver.is_enabled("Use this sensor in the Train view"), "it is there");
    shows_condition_of(&driver, &sensor);
}

#[test]
fn a_slider_repeats_the_analysis_and_the_train_view_is_one_click_away() {
    let mut driver = open();
    let before = driver.state().draft;
    driver.get("Node pitch slider").focus();
    driver.press(Key::ArrowRight);
    wait_for_the_answer(&mut driver);
    let pitch = analysis(&driver).question.sensor.geometry.node_pitch_mm;
    assert!(
        pitch > before.simulation().unwrap().sensor.geometry.node_pitch_mm,
        "{pitch}"
    );
    assert_eq!(driver.state().draft, before, "trying changes nothing there");
    driver.click("Reset to the Train view's sensor");
    wait_for_the_answer(&mut driver);
    assert_eq!(analysis(&driver).question, Question::of(before.simulation().unwrap()));
}

#[test]
fn rows_that_mirror_each_other_are_reported_until_the_row_is_known() {
    let mut driver = Driver::open();
    driver.click("10×6");
    driver.click_button("Identifiability");
    wait_for_the_answer(&mut driver);
    assert!(!driver.says("cannot be told apart"));
    // Column nodes at 7.5, 12.5 and 17.5 mirror the rows about x = 12.5.
    driver.enter("First column node at x", "7.5");
    wait_for_the_answer(&mut driver);
    assert!(driver.says("cannot be told apart"), "{:#?}", driver.texts());
    driver.click_button("Row known");
    wait_for_the_answer(&mut driver);
    assert!(!driver.says("cannot be told apart"));
    assert!(driver.has("Most similar rows: the row is known"));
}

#[test]
fn noise_that_hides_everything_is_reported_with_a_remedy() {
    let mut driver = open();
    driver.enter("Relative noise", "0.001");
    wait_for_the_answer(&mut driver);
    let seen = analysis(&driver).patterns_seen();
    assert!((1..10).contains(&seen), "{seen}");
    assert!(driver.has(&format!("Deformation patterns above the noise: {seen} of 10")));
    assert!(driver.says(&format!("The noise hides {} of 10 deformation patterns", 10 - seen)));
    driver.enter("Relative noise", "1");
    wait_for_the_answer(&mut driver);
    assert!(driver.says("the readings hardly constrain the deformation"));
    assert!(driver.says("reduce the height, widen the node pitch, or add column-wires"));
}

#[test]
fn sideways_movement_has_a_picture_for_each_axis() {
    let mut driver = open();
    driver.click_button("In x, y and z");
    wait_for_the_answer(&mut driver);
    assert!(driver.has("Unknowns of a row: 30"));
    driver.click_button("x");
    assert_eq!(driver.views().identifiability.axis, 0);
    driver.settle();
    driver.enter("Column-wires", "12");
    wait_for_the_answer(&mut driver);
    assert!(driver.says("a row has 30 unknowns but only 12 readings") || driver.says("A row has 30 unknowns"));
}

#[test]
fn everything_fits_in_a_narrow_window() {
    let mut driver = Driver::open_sized(vec2(1024.0, 700.0));
    let buttons = ["Trade-off", "Next snapshot"].map(|label| driver.get(label).rect());
    assert!(buttons[0].max.x < buttons[1].min.x, "{buttons:?}");
    driver.click_button("Identifiability");
    wait_for_the_answer(&mut driver);
    driver.settle();
    for label in ["Height slider", "Compression slider", "Row known"] {
        let rect = driver.get(label).rect();
        assert!(rect.max.x < 272.0, "{label}: {rect}");
    }
    for label in ["Worst-seen deformation of each row", "Colour scale of 1/mm"] {
        let rect = driver.get(label).rect();
        assert!(rect.max.x <= 1024.0 && rect.width() > 40.0, "{label}: {rect}");
    }
}

#[test]
fn pattern_and_sensitivity_are_saved_with_their_own_colours() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("identifiability.svg");
    let mut driver = open();
    driver.save("Surfaces, SVG", &path);
    let svg = std::fs::read_to_string(path).unwrap();
    let says = |text: &str| svg.matches(&format!(">{text}</text>")).count();
    assert_eq!(
        [says("Worst-seen deformation"), says("Sensitivity of each node")],
        [1, 1]
    );
    assert_eq!(
        [says("pattern"), says("1/mm")],
        [2, 1],
        "an axis and a key, a key from above"
    );
}

/// Opens a window with a recording in the Identifiability view.
fn open_recording() -> Opened {
    let mut opened = open_small(SourceKind::Recording);
    opened.driver.click_button("Identifiability");
    opened.driver.settle();
    opened
}

/// Analyses the readings.
fn analyse(driver: &mut Driver) {
    driver.click_button("Analyse readings");
    driver.wait("the analysis", |driver| driver.says("folds by time; analysed in"));
    driver.settle();
}

#[test]
fn the_analysis_of_a_recording_agrees_with_the_library() {
    let Opened {
        mut driver,
        setup,
        folder: _folder,
    } = open_recording();
    analyse(&mut driver);
    let plan = setup.plan().unwrap();
    let recording = plan
        .recording(Path::new(""), &mut |_| ControlFlow::Continue(()))
        .unwrap();
    let found = recording.findings(setup.settings(), plan.division.by, &Job::UNINTERRUPTED);
    let found = found.unwrap();
    let sentence = |text: &str| {
        let (first, rest) = text.split_at(1);
        format!("{}{rest}.", first.to_uppercase())
    };
    for (name, target) in ["x", "y"].into_iter().zip(&found.targets) {
        driver.assert_shows(&[sentence(&describe_target(name, target))]);
    }
    // A later change of the settings is reported.
    assert!(!driver.says("have changed since"));
    let hidden = setup.settings().hidden + 1;
    let changed = setup.with_settings(RunSettings {
        hidden,
        ..*setup.settings()
    });
    driver.window_mut().apply(Effect::TakeSetup(Box::new(changed)));
    driver.settle();
    assert!(driver.says("have changed since"), "{:#?}", driver.texts());
}

#[test]
fn channels_of_a_recording_without_information_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "time (s),u1 (V),u2 (V),u3 (V),x (N)\n".to_owned();
    for row in 0..80 {
        let (t, u) = (f64::from(row), f64::from((7 * row) % 13));
        writeln!(text, "{t},{u},{},2.5,{:.6}", 3.0 * u, 5.0 * u + 0.1 * t.cos()).unwrap();
    }
    let setup = probe(folder.path());
    let mut plan = setup.plan().unwrap().clone();
    fs::write(&plan.import.data, text).unwrap();
    plan.import.inputs.push("u3".to_owned());
    plan.import.targets.pop();
    let mut driver = Driver::open();
    driver.take_recording(&Setup::recording(*setup.settings(), plan));
    driver.click_button("Identifiability");
    analyse(&mut driver);
    for expected in ["u3 is 2.5 in every sample", "u2 repeats u1"] {
        assert!(driver.says(expected), "{expected} is not among {:#?}", driver.texts());
    }
}

#[test]
fn a_cross_validation_of_a_recording_agrees_with_the_library() {
    let Opened {
        mut driver,
        setup,
        folder: _folder,
    } = open_recording();
    driver.enter("Folds", "3");
    driver.click_button("Cross-validate");
    driver.wait("the folds", |driver| driver.says("3 folds by time"));
    driver.settle();
    let plan = setup.plan().unwrap();
    let recording = plan
        .recording(Path::new(""), &mut |_| ControlFlow::Continue(()))
        .unwrap();
    let (settings, set) = (setup.settings(), &recording.set);
    let folds = Folds::by(set, 3, SplitBy::Time, &mut settings.seed.rng(Stream::Split)).unwrap();
    let validated = CrossValidated::on_folds(settings, set, folds, &Job::UNINTERRUPTED);
    let errors = validated.unwrap().scores(set);
    let shown = driver.texts();
    for target in errors.network.targets() {
        let cell = format!("network, RMSE: {}", format_number(target.rmse));
        assert!(
            shown.iter().any(|text| text.ends_with(&cell)),
            "{cell} is not among {shown:#?}"
        );
    }
    assert!(driver.says("The readings"), "what they determine: {shown:#?}");
}

#[test]
fn an_analysis_of_a_recording_can_be_cancelled_and_closing_asks_about_it() {
    let mut opened = open_recording();
    opened.change(|settings| settings.training.stopping.epochs = 100_000);
    let driver = &mut opened.driver;
    driver.settle();
    driver.click_button("Cross-validate");
    driver.wait("the trainings", |driver| driver.says("Cross-validation…"));
    assert!(!driver.close(), "the analysis is not lost without a question");
    driver.harness().run_steps(2);
    assert!(
        driver.has("Identifiability: Cross-validation") && driver.says("will be discarded"),
        "{:#?}",
        driver.texts()
    );
    driver.click_button("Stay");
    driver.click_button("■ Cancel");
    driver.settle();
    assert!(driver.is_enabled("Analyse readings"));
}
