//! Files written from the window.

use decoupler::{
    export::{NetworkFile, format_number},
    network::Networks,
};
use eframe::egui::{Key, Modifiers};

use crate::{
    driver::{Driver, small, trained},
    folders::names,
};

const NETWORK: &str = "Type a path for the network";
const ERRORS: &str = "Type a path for the error table";
const LOSS: &str = "Type a path for the loss curves";

fn trained_driver() -> Driver {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver
}

#[test]
fn a_saved_network_gives_the_same_outputs_bit_by_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.json");
    let mut driver = trained_driver();
    driver.save(NETWORK, &path);
    assert!(
        driver.has(&format!("Saved {}", path.display())),
        "{:#?}",
        driver.texts()
    );
    assert_eq!(names(folder.path()), ["network.json"]);
    let file = NetworkFile::load(&path).unwrap();
    let run = trained(small());
    assert_eq!(file.settings, small());
    let bits = |network: &Networks| network.decouple(run.test()).mapv(f64::to_bits);
    assert_eq!(bits(&file.network), bits(&run.network()));
    driver.click("Dismiss");
    assert!(!driver.says("Saved "));
}

#[test]
fn saved_tables_hold_what_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let [errors, loss] = ["errors.csv", "loss.csv"].map(|name| folder.path().join(name));
    let mut driver = trained_driver();
    driver.save(ERRORS, &errors);
    driver.click("Dismiss");
    driver.save(LOSS, &loss);
    assert_eq!(names(folder.path()), ["errors.csv", "loss.csv"]);

    let mut cells = Vec::new();
    for record in csv::Reader::from_path(&errors).unwrap().records() {
        let record = record.unwrap();
        for (place, column) in ["Z %", "X %", "Y %", "mm", "stroke %"].iter().enumerate() {
            let number: f64 = record[place + 1].parse().unwrap();
            cells.push(format!("{}, {column}: {}", &record[0], format_number(number)));
        }
    }
    assert_eq!(cells, driver.table());

    let history = &driver.state().run.as_ref().unwrap().history;
    let mut rows = 0;
    for (record, epoch) in csv::Reader::from_path(&loss).unwrap().records().zip(history) {
        let record = record.unwrap();
        assert_eq!(record[0].parse(), Ok(epoch.epoch));
        assert_eq!(record[1].parse(), Ok(epoch.training_mse));
        assert_eq!(record[2].parse::<f64>().ok(), epoch.validation_mse);
        assert_eq!(record[3].parse::<f64>().ok(), epoch.test_mse);
        rows += 1;
    }
    assert_eq!(rows, history.len());
}

#[test]
fn what_cannot_be_saved_is_explained_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("none").join("network.json");
    let mut driver = trained_driver();
    for button in [NETWORK, ERRORS, LOSS] {
        driver.save(button, &missing);
        let reason = format!(
            "cannot write '{}': the folder '{}' does not exist; make it first",
            missing.display(),
            folder.path().join("none").display()
        );
        assert!(driver.has(&reason), "{:#?}", driver.texts());
        driver.click("Dismiss");
        driver.save(button, folder.path());
        let reason = format!(
            "cannot write '{}': it is a folder; give the name of a file",
            folder.path().display()
        );
        assert!(driver.has(&reason), "{:#?}", driver.texts());
        driver.click("Dismiss");
    }
    assert!(names(folder.path()).is_empty());
    driver.save(NETWORK, &folder.path().join("network.json"));
    assert!(driver.says("Saved "), "after a failure the next one works");
}

#[test]
fn a_form_is_closed_without_writing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("errors.csv").display().to_string();
    let mut driver = trained_driver();
    driver.open_form(ERRORS);
    driver.type_into("File", &path);
    driver.click_button("Cancel");
    assert!(!driver.has("File"));
    driver.open_form(ERRORS);
    driver.type_into("File", &path);
    driver.press(Key::Escape);
    assert!(!driver.has("File"));
    driver.settle();
    assert!(driver.notice().is_none());
    assert!(names(folder.path()).is_empty());

    driver.open_form(ERRORS);
    driver.type_into("File", "  ");
    assert!(!driver.is_enabled("Save"), "a file needs a name");
    let (phase, shown) = (driver.state().phase, driver.views().train.snapshot);
    driver.press_with(Modifiers::COMMAND, Key::Enter);
    driver.press(Key::PageDown);
    assert_eq!(
        (driver.state().phase, driver.views().train.snapshot),
        (phase, shown),
        "nothing happens behind the form"
    );
}

#[test]
fn enter_saves_and_the_suggested_name_tells_runs_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("loss.csv");
    let mut driver = trained_driver();
    // Without a desktop the dialog's button opens the form too.
    driver.click("Loss curves…");
    let suggested = driver.get("File").value().unwrap();
    assert!(suggested.ends_with("loss-10x6_3x18-h6-lm-seed0.csv"), "{suggested}");
    driver.settle();
    assert!(driver.get("File").is_focused(), "typing begins at once");
    driver.enter("File", &path.display().to_string());
    driver.wait("the file", |driver| driver.says("Saved "));
    assert_eq!(names(folder.path()), ["loss.csv"]);
}

#[test]
fn what_worked_closes_by_itself_and_the_window_rests_and_what_failed_stays() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_hold();
    let missing = folder.path().join("none").join("network.json");
    driver.save(NETWORK, &missing);
    assert!(driver.says("does not exist"));
    // Fifteen seconds.
    driver.harness().run_steps(60);
    assert!(driver.says("does not exist"), "a failure waits for the user");
    let path = folder.path().join("network.json");
    driver.open_form(NETWORK);
    driver.type_into("File", &path.display().to_string());
    driver.click_button("Save");
    driver.wait("the file", |driver| driver.says("Saved "));
    assert!(!driver.says("does not exist"), "the same has worked now");
    driver.harness().run_steps(60);
    assert_eq!(driver.notice(), None);
    assert!(driver.comes_to_rest());
}
