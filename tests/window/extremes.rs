//! Settings at their limits, and beyond.

use decoupler::window::{Notice, Phase};

use crate::driver::Driver;

/// Presses Train and waits until it ends or says why it cannot begin.
fn try_training(driver: &mut Driver) -> Option<String> {
    driver.click("▶ Train");
    driver.wait("an answer", |driver| {
        matches!(driver.state().phase, Phase::Ended(_) | Phase::Idle)
    });
    driver.settle();
    match driver.notice() {
        Some(Notice::Failed(reason)) => Some(reason.clone()),
        _ => None,
    }
}

fn shows_no_infinities(driver: &Driver) {
    for text in driver.texts() {
        let words = text.split(|letter: char| !letter.is_alphanumeric());
        assert!(
            words.map(str::to_lowercase).all(|word| word != "nan" && word != "inf"),
            "{text}"
        );
    }
}

#[test]
fn extreme_arrays_resistivities_and_geometries_train_or_say_why_not() {
    for changes in [
        &[("Array scale", "1x1_1x3")][..],
        &[("Array scale", "40x40_8x120"), ("Hidden nodes", "4")],
        &[
            ("Training samples", "1"),
            ("Validation samples", "0"),
            ("Test samples", "1"),
        ],
        &[
            ("Training samples", "1"),
            ("Validation samples", "1"),
            ("Test samples", "1"),
        ],
        // Every target is constant.
        &[
            ("Array scale", "1x1_1x3"),
            ("Training samples", "1"),
            ("Validation samples", "0"),
        ],
        &[("Resistivity", "1e-12")],
        &[("Resistivity", "1e12")],
        &[("Height", "1e6")],
        &[("Height", "1e-6")],
        &[("Row pitch", "1e6"), ("Node pitch", "1e6")],
        &[("Row pitch", "1e-6"), ("Node pitch", "1e-6")],
        &[("Column pitch", "1e6"), ("Column node pitch", "1e-6")],
        &[("First row at x", "-1e6"), ("First column at y", "1e6")],
        // The first row lies at x = 0, where an error in percent has no meaning.
        &[("First row at x", "0")],
        &[("Largest compression", "0.001")],
        &[("Largest compression", "99")],
    ] {
        let mut driver = Driver::open();
        driver.configure_small();
        driver.enter("Epochs", "3");
        driver.enter("Training samples", "60");
        driver.enter("Validation samples", "20");
        driver.enter("Test samples", "20");
        for (label, text) in changes {
            driver.enter(label, text);
        }
        driver.wait("an answer", |driver| {
            let drawn = driver.state().skin().map(|skin| skin.sensor);
            drawn == Some(driver.simulation().sensor) || driver.notice().is_some()
        });
        driver.settle();
        if let Some(reason) = try_training(&mut driver) {
            assert!(reason.contains(' ') && driver.says(&reason), "{changes:?}: {reason}");
        } else {
            assert!(driver.has("Decoded surface"), "{changes:?}");
            for label in ["Error", "Top view"] {
                driver.click_button(label);
                driver.settle();
            }
        }
        shows_no_infinities(&driver);
    }
}
