//! Settings of a recording that are chosen automatically.

use decoupler::window::SourceKind;
use egui_kittest::kittest::NodeT as _;

use crate::{
    driver::Driver,
    recordings::{opened, opened_text, recording, written},
};
use decoupler_core::{evaluation::RunSettings, training::StoppingRules};

/// Settings that a choice decides, each with the part of the form that it is folded into.
const CHOSEN: [(&str, Option<&str>); 6] = [
    ("Hidden nodes", None),
    ("Method", None),
    ("Scaling", Some("Advanced")),
    ("Epochs", Some("Advanced")),
    ("Restarts", Some("Advanced")),
    ("Combine restarts", Some("Advanced")),
];

fn unfold(driver: &mut Driver) {
    for (name, part) in CHOSEN {
        if let Some(part) = part {
            driver.unfold_to(part, name);
        }
    }
}

/// Returns the value of a setting that cannot be changed; panics if it can be.
#[track_caller]
fn fixed(driver: &Driver, name: &str) -> String {
    assert!(!driver.is_enabled(name), "{name} is enabled");
    let nodes = driver.get(name);
    nodes.accesskit_node().value().unwrap_or_default()
}

#[test]
fn chosen_settings_are_disabled_show_what_was_chosen_and_are_kept_when_the_choice_is_turned_off() {
    let (mut driver, _path, _folder) = opened(90);
    unfold(&mut driver);
    for (name, _) in CHOSEN {
        assert_eq!(fixed(&driver, name), "automatic", "{name}");
    }
    driver.get("Hidden nodes").hover();
    driver.wait("the tooltip", |driver| driver.says("To set it yourself, untick"));
    driver.click("▶ Train");
    driver.wait_for_training();
    unfold(&mut driver);
    let run = driver.state().run.as_ref().unwrap();
    let (setup, asked) = (run.setup.clone(), run.asked.clone());
    let chosen: RunSettings = *setup.settings();
    assert_ne!(chosen, asked.settings, "the choice differs from the defaults");
    let expected = [
        ("Hidden nodes", chosen.hidden.to_string()),
        ("Method", chosen.training.method.name().to_owned()),
        ("Epochs", chosen.training.stopping.epochs.to_string()),
        ("Restarts", chosen.starts.to_string()),
        ("Combine restarts", "average their answers".to_owned()),
    ];
    for (name, value) in &expected {
        assert_eq!(fixed(&driver, name), *value, "{name}");
    }
    driver.assert_says("Chosen: ");

    driver.choose_by_hand();
    driver.wait("the recording with the chosen memory", |driver| {
        driver.state().setup().ok().as_ref() == Some(&setup)
    });
    driver.settle();
    for name in ["Hidden nodes", "Method", "Epochs", "Restarts"] {
        assert!(driver.is_enabled(name), "{name}");
    }
    assert_eq!(driver.state().settings(), chosen);
    // The trained network can be trained further.
    assert!(driver.has("Train longer"));
}

#[test]
fn another_seed_is_no_setting_of_the_choice_but_another_plan_is_chosen_for_again() {
    let (mut driver, _path, _folder) = opened(90);
    driver.click("▶ Train");
    driver.wait_for_training();
    assert_ne!(fixed(&driver, "Hidden nodes"), "automatic");
    driver.unfold_to("Samples", "Seed");
    driver.enter("Seed", "3");
    driver.settle();
    assert!(driver.state().recording.is_auto);
    assert_eq!(fixed(&driver, "Hidden nodes"), "automatic");
}

#[test]
fn a_given_memory_is_kept_by_the_choice() {
    let (mut driver, _path, _folder) = opened(90);
    driver.unfold_to("History of readings", "Lags");
    assert!(driver.says("Chosen with the other settings unless it is given here"));
    driver.enter("Lags", "3");
    driver.settle();
    driver.assert_says("lags 3");
    driver.click("▶ Train");
    driver.wait_for_training();
    let run = driver.state().run.as_ref().unwrap();
    let memory = run.setup.plan().unwrap().import.memory.clone().unwrap();
    assert_eq!(memory.lags.len(), 1);
    assert!(memory.averages.is_empty() && run.search.is_some());
}

#[test]
fn one_network_per_row_wire_is_set_by_hand() {
    let mut text = String::new();
    for (row, line) in recording(60).lines().enumerate() {
        let row_wire = if row == 0 {
            "row".to_owned()
        } else {
            (1 + row % 2).to_string()
        };
        text += &format!("{line},{row_wire}\n");
    }
    let (mut driver, _path, _folder) = opened_text(&text);
    driver.mean("row", "row-wire");
    driver.unfold_to("Advanced", "Scaling");
    assert!(driver.is_enabled("Choose settings automatically"));
    driver.choose("Rows", "Known");
    driver.settle();
    assert!(!driver.is_enabled("Choose settings automatically"));
    assert!(driver.is_enabled("Hidden nodes") && driver.is_enabled("Method"));
    driver.unfold_to("Advanced", "Epochs");
    driver.enter("Epochs", "3");
    driver.click("▶ Train");
    driver.wait_for_training();
    assert!(driver.state().run.as_ref().unwrap().search.is_none());
}

#[test]
fn the_choice_is_remembered() {
    let folder = tempfile::tempdir().unwrap();
    let (file, path) = (
        folder.path().join("window.json"),
        written(&folder, "press.csv", &recording(60)),
    );
    let is_auto = |next: &dyn Fn(&mut Driver)| {
        let mut driver = Driver::open_remembering(&file);
        match driver.state().source {
            SourceKind::Array => driver.open_recordings(&[&path]),
            SourceKind::Recording => driver.wait("the samples", |driver| driver.says("Test: ")),
        }
        driver.settle();
        next(&mut driver);
        drop(driver);
        Driver::open_remembering(&file).state().recording.is_auto
    };
    assert!(is_auto(&|driver| {
        driver.unfold_to("Samples", "Seed");
        driver.enter("Seed", "4");
    }));
    // By hand with the default settings.
    assert!(!is_auto(&|driver| {
        driver.choose_by_hand();
        assert_eq!(
            driver.state().settings().training.stopping,
            StoppingRules::recorded(&driver.state().settings().training.method)
        );
    }));
}
