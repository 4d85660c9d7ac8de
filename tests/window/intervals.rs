//! Prediction intervals of a training on a recording.

use std::{fmt::Write as _, path::Path};

use decoupler::window::{Command, Effect, Phase};
use decoupler_core::{
    dataset::SplitBy,
    evaluation::{Coverage, Intervals},
    job::Job,
};
use decoupler_files::export::format_number;
use rand::{RngExt as _, SeedableRng as _, rngs::ChaCha8Rng};

use crate::{driver::Driver, recordings::opened_text};

/// Readings of two channels and a target that they determine but for noise.
pub(crate) fn noisy(rows: usize) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut text = "u1 (V),u2 (V),x (mm)\n".to_owned();
    for _ in 0..rows {
        let [u1, u2, noise]: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        writeln!(text, "{u1},{u2},{}", u1 + 0.3 * u2 + 0.1 * noise).unwrap();
    }
    text
}

/// Trains until the frame in which the calibration begins. It is begun again if it ended between two frames, which are far
/// apart on a busy machine.
pub(crate) fn train_to_calibration(driver: &mut Driver) {
    driver.click("▶ Train");
    while driver.state().phase != Phase::Calibrating {
        driver.wait_for_frame("the calibration");
        if matches!(driver.state().phase, Phase::Ended(_)) {
            driver.click("▶ Train");
        }
    }
}

#[test]
fn intervals_are_calibrated_at_the_end_of_a_training() {
    let (mut driver, _, _folder) = opened_text(&noisy(300));
    driver.limit_epochs("10");
    driver.train_recording();
    driver.wait_for_kept_run();

    let setup = driver.state().run.as_ref().unwrap().setup.clone();
    let sets = setup.sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ()).unwrap();
    let training = &sets.sets.split.training;
    let expected = Intervals::cross_validate(setup.settings(), training, SplitBy::Time, &Job::UNINTERRUPTED).unwrap();
    assert_eq!(driver.kept(0).intervals.as_ref(), Some(&expected));
    let coverage: Coverage = driver.state().result().unwrap().coverage[0].unwrap();
    // 90 % of the noise is within 0.09.
    assert!((coverage.half_width / 0.09 - 1.0).abs() < 0.2, "{coverage:?}");
    driver.assert_shows(&[
        format!("x (mm), 90 % ±: {}", format_number(coverage.half_width)),
        format!("x (mm), holds %: {}", format_number(100.0 * coverage.share)),
    ]);

    // Another epoch makes them invalid; they are calibrated again at its end.
    driver.limit_epochs("1");
    driver.click_button("Train longer");
    driver.wait("the second end", |driver| {
        let result = driver.state().result();
        result.is_some_and(|result| result.is_idle && result.epochs_run == 11)
    });
    let again = driver.state().result().unwrap().coverage[0].unwrap();
    assert_ne!(again, coverage);
}

#[test]
fn pausing_after_the_last_epoch_keeps_the_intervals() {
    // Its calibration takes much longer than a frame.
    let (mut driver, _, _folder) = opened_text(&noisy(10_000));
    driver.limit_epochs("20");
    train_to_calibration(&mut driver);
    // As if clicked before the window knew.
    driver.window_mut().apply(Effect::Do(Command::PauseTraining));
    driver.wait_for_training();
    driver.wait_for_kept_run();
    driver.details();
    assert!(!driver.says("No 90 % intervals"), "{:#?}", driver.texts());
    assert!(driver.kept(0).intervals.is_some());
}

#[test]
fn stopping_a_calibration_keeps_the_network_without_intervals() {
    // Its five trainings take much longer than most frames, and less than the minute above which none is begun.
    let (mut driver, _, _folder) = opened_text(&noisy(20_000));
    driver.limit_epochs("60");
    let mut is_interrupted = || {
        train_to_calibration(&mut driver);
        driver.assert_says("Calibrating the 90 % intervals");
        // As if clicked, but in this frame.
        driver.window_mut().apply(Effect::Do(Command::StopTraining));
        driver.wait_for_training();
        assert!(!driver.says("Stopped at epoch"));
        driver.details();
        driver.has("No 90 % intervals: interrupted.")
    };
    // On a busy machine the frame may take longer than the calibration.
    assert!((0..20).any(|_| is_interrupted()), "{:#?}", driver.texts());
    // Those that ended before have intervals.
    driver.wait("the kept run", |driver| {
        let newest = driver.runs().len().checked_sub(1);
        newest.is_some_and(|newest| driver.kept(newest).intervals.is_none())
    });
}
