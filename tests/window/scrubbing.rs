//! Past epochs selected with the slider under the charts.

use eframe::egui::Key;

use crate::{
    driver::Driver,
    sources::{BOTH, Opened, begun, network_figures, run_of, trained_small, with_epochs},
};

const SLIDER: &str = "Epoch of the displayed network";

fn answers(driver: &Driver) -> Vec<f64> {
    let result = driver.views().train.result(driver.state()).unwrap();
    result.answers.iter().copied().collect()
}

#[test]
fn the_network_of_an_epoch_equals_that_of_a_training_stopped_there() {
    for source in BOTH {
        let Opened {
            mut driver,
            setup,
            folder: _folder,
        } = trained_small(source);
        let of_latest = answers(&driver);
        let last = driver.epochs();
        assert!(
            driver.has(&format!("Latest, epoch {last}")) && !driver.is_enabled("Latest"),
            "{source:?}: {:#?}",
            driver.texts()
        );
        driver.get(SLIDER).focus();
        driver.harness().run_steps(2);
        for epoch in [last - 1, 4, 0] {
            while driver.views().train.scrub.epoch().unwrap_or(last) > epoch {
                driver.press(Key::ArrowLeft);
            }
            driver.wait("the network of the epoch", |driver| {
                driver.says(&format!("Of the network of epoch {epoch}."))
            });
            driver.settle();
            let run = if epoch > 0 {
                run_of(&with_epochs(&setup, epoch))
            } else {
                begun(&setup)
            };
            driver.assert_shows(&network_figures(&run));
            assert!(driver.has(&format!("Network of epoch {epoch}")));
            if epoch < 5 {
                assert_ne!(answers(&driver), of_latest, "{source:?}");
            }
        }
        driver.click_button("Latest");
        driver.settle();
        driver.assert_shows(&network_figures(&run_of(&setup)));
        assert_eq!(answers(&driver), of_latest);
    }
}

#[test]
fn a_replay_goes_through_the_epochs_on_every_chart_and_ends_on_the_latest() {
    for source in BOTH {
        let Opened {
            mut driver,
            setup,
            folder: _folder,
        } = trained_small(source);
        let last = driver.epochs();
        for chart in ["Loss", "Training state", "Histogram", "Regression"] {
            driver.show_chart(chart);
            driver.settle();
            driver.click_button("Replay the training");
            assert!(driver.has("Stop the replay"), "{source:?}, {chart}");
            let mut seen = Vec::new();
            for _ in 0..200 {
                if driver.has("Replay the training") {
                    break;
                }
                seen.extend(driver.views().train.scrub.epoch());
                driver.harness().step();
            }
            seen.dedup();
            assert!(seen.is_sorted() && seen.len() > 4, "{source:?}, {chart}: {seen:?}");
            driver.wait("the end", |driver| driver.has(&format!("Latest, epoch {last}")));
            driver.settle();
        }
        driver.assert_shows(&network_figures(&run_of(&setup)));
        assert!(driver.becomes_idle(), "{source:?}: nothing moves any more");
    }
}
