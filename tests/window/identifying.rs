//! What the readings of a recording determine.

use std::{fmt::Write as _, fs, ops::ControlFlow, path::Path};

use decoupler::window::{Effect, SourceKind};
use decoupler_core::{
    dataset::{Folds, SplitBy, Stream},
    evaluation::{CrossValidated, RunSettings},
    job::Job,
};
use decoupler_files::{
    export::{describe_target, format_number},
    import::Setup,
};

use crate::{
    driver::Driver,
    sources::{Opened, open_small, probe},
};

/// Opens a window with a recording in the Study view, with this topic.
fn open_recording(topic: &str) -> Opened {
    let mut opened = open_small(SourceKind::Recording);
    opened.driver.click_button("Study");
    opened.driver.click(topic);
    opened.driver.settle();
    opened
}

const READINGS: &str = "What the readings determine";
const FOLDS: &str = "Cross-validation";

/// Analyses the readings.
fn analyse(driver: &mut Driver) {
    driver.click_button("▶ Run");
    driver.wait("the analysis", |driver| driver.says("folds by time; analysed in"));
    driver.settle();
}

#[test]
fn the_analysis_of_a_recording_agrees_with_the_library() {
    let Opened {
        mut driver,
        setup,
        folder: _folder,
    } = open_recording(READINGS);
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
    assert!(!driver.says("Result of the previous settings"));
    let hidden = setup.settings().hidden + 1;
    let changed = setup.with_settings(RunSettings {
        hidden,
        ..*setup.settings()
    });
    driver.window_mut().apply(Effect::TakeSetup(Box::new(changed)));
    driver.settle();
    driver.assert_says("Result of the previous settings");
    // Findings about another recording are not shown.
    let mut other = plan.clone();
    other.import.data = plan.import.data.with_file_name("other.csv");
    fs::copy(&plan.import.data, &other.import.data).unwrap();
    let other = Setup::recording(*setup.settings(), other);
    driver.window_mut().apply(Effect::TakeSetup(Box::new(other)));
    driver.settle();
    assert!(!driver.says("analysed in"), "{:#?}", driver.texts());
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
    driver.click_button("Study");
    driver.click(READINGS);
    analyse(&mut driver);
    for expected in ["u3 is 2.5 in every sample", "u2 repeats u1"] {
        driver.assert_says(expected);
    }
}

#[test]
fn a_cross_validation_of_a_recording_agrees_with_the_library() {
    let Opened {
        mut driver,
        setup,
        folder: _folder,
    } = open_recording(FOLDS);
    driver.enter("Folds", "3");
    driver.click_button("▶ Run");
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
    assert!(driver.says("with these settings, use ridge"), "{shown:#?}");
}
