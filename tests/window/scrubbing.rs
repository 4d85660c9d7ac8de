//! Past epochs brought back by the slider under the loss curves.

use decoupler::evaluation::Run;
use eframe::egui::Key;

use crate::driver::{Driver, small, table_of, trained};

const SLIDER: &str = "Epoch of the network on show";

#[test]
fn the_network_of_an_epoch_is_that_of_a_training_stopped_there() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_hold();
    let latest = driver.table();
    let pairs = |driver: &Driver| driver.views().train.drawn.pairs_mm().unwrap().to_vec();
    let of_latest = pairs(&driver);
    assert!(driver.has("Latest, epoch 15") && !driver.is_enabled("Latest"));
    driver.get(SLIDER).focus();
    driver.harness().run_steps(2);
    for epoch in [12, 4, 0] {
        while driver.views().train.scrub.epoch().unwrap_or(15) > epoch {
            driver.press(Key::ArrowLeft);
        }
        driver.wait("the network of the epoch", |driver| {
            driver.says(&format!("Of the network of epoch {epoch}."))
        });
        driver.settle();
        let run = if epoch > 0 {
            let mut stopped = small();
            stopped.training.stopping.epochs = epoch;
            trained(stopped)
        } else {
            Run::prepare(small()).unwrap()
        };
        assert_eq!(driver.table(), table_of(&run), "epoch {epoch}");
        assert!(driver.has(&format!("Network of epoch {epoch}")));
        assert_ne!(pairs(&driver), of_latest, "the histogram follows");
    }
    driver.click_button("Latest");
    driver.settle();
    assert_eq!(driver.table(), latest);
    assert_eq!(pairs(&driver), of_latest);
}

#[test]
fn a_replay_goes_through_the_epochs_and_ends_on_the_latest() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_hold();
    let latest = driver.table();
    driver.click_button("Replay the training");
    assert!(driver.views().train.scrub.is_replaying());
    let mut seen = Vec::new();
    for _ in 0..200 {
        if !driver.views().train.scrub.is_replaying() {
            break;
        }
        seen.extend(driver.views().train.scrub.epoch());
        driver.harness().step();
    }
    seen.dedup();
    assert!(seen.is_sorted() && seen.len() > 4, "{seen:?}");
    driver.wait("the end", |driver| driver.has("Latest, epoch 15"));
    driver.settle();
    assert_eq!(driver.table(), latest);
    assert!(driver.comes_to_rest(), "nothing moves any more");
}
