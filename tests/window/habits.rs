//! Habits: undo and redo, the list of all actions, keyboard shortcuts, the size of the interface.

use eframe::egui::{Key, Modifiers, vec2};

use crate::{driver::Driver, training::start_endless};

const UNDO: (Modifiers, Key) = (Modifiers::COMMAND, Key::Z);

/// Waits long enough that the next change counts as a separate one.
pub(crate) fn pause(driver: &mut Driver) {
    let harness = driver.harness();
    for _ in 0..8 {
        harness.input_mut().time = Some(harness.ctx.input(|input| input.time) + 0.5);
        harness.step();
    }
}

#[test]
fn a_change_of_settings_is_undone_and_redone() {
    let mut driver = Driver::open_first(vec2(1440.0, 900.0));
    pause(&mut driver);
    let before = driver.state().draft;
    driver.enter("Hidden nodes", "7");
    pause(&mut driver);
    let after = driver.state().draft;
    assert_eq!((before.hidden, after.hidden), (12, 7));
    driver.press_with(UNDO.0, UNDO.1);
    assert_eq!(driver.state().draft, before);
    driver.press_with(UNDO.0, UNDO.1);
    assert_eq!(driver.state().draft, before, "there is nothing before it");
    driver.act("Redo change of settings");
    assert_eq!(driver.state().draft, after);
    driver.act("Undo change of settings");
    assert_eq!(driver.state().draft, before);
}

#[test]
fn the_settings_of_a_running_training_cannot_be_undone() {
    let mut driver = Driver::open();
    pause(&mut driver);
    driver.configure_small();
    pause(&mut driver);
    start_endless(&mut driver);
    let held = driver.state().draft;
    assert!(driver.has("■ Stop"));
    driver.press_with(UNDO.0, UNDO.1);
    assert_eq!(driver.state().draft, held);
}

#[test]
fn the_list_finds_an_action_by_a_few_letters_or_arrows_and_runs_it() {
    let mut driver = Driver::open();
    driver.press_with(Modifiers::COMMAND, Key::K);
    driver.press_with(Modifiers::COMMAND, Key::Enter);
    assert!(
        driver.says("Ready: press Train"),
        "while it is open, other keys do nothing"
    );
    driver.type_into("Action", "show");
    driver.press(Key::ArrowDown);
    driver.press(Key::Escape);
    assert!(driver.shown() == "Train" && !driver.has("Show Compare"));
    driver.press_with(Modifiers::COMMAND, Key::K);
    driver.type_into("Action", "show");
    assert!(driver.has("Show Compare") && driver.has("Show Sensor"));
    driver.press(Key::ArrowDown);
    driver.press(Key::Enter);
    driver.settle();
    assert_eq!(driver.shown(), "Compare", "the second, after Study");
    driver.click_button("Train");
    driver.press_with(Modifiers::COMMAND, Key::K);
    driver.type_into("Action", "comp");
    assert!(driver.has("Show Compare") && !driver.has("Show Sensor"));
    driver.press(Key::Enter);
    driver.settle();
    assert_eq!(driver.shown(), "Compare");
    assert!(!driver.has("Show Study"), "the list is closed");
}

#[test]
fn every_listed_key_works() {
    let mut driver = Driver::open();
    driver.press(Key::Questionmark);
    assert!(driver.says("Ctrl+K") && driver.says("Next test sample") && driver.says("PageDown"));
    driver.press(Key::Escape);
    assert!(!driver.says("PageDown"));
    driver.press_with(Modifiers::COMMAND, Key::Num2);
    assert_eq!(driver.shown(), "Study");
}

#[test]
fn buttons_keys_and_the_list_agree_on_what_is_available() {
    let listed = |driver: &mut Driver, action: &str| {
        driver.press_with(Modifiers::COMMAND, Key::K);
        driver.type_into("Action", action);
        let is_enabled = driver.is_enabled(action);
        driver.press(Key::Escape);
        is_enabled
    };
    let mut driver = Driver::open();
    assert!(!driver.has("■ Stop") && !listed(&mut driver, "Stop training"));
    assert!(driver.is_enabled("▶ Train") && listed(&mut driver, "Open files"));
    start_endless(&mut driver);
    assert!(driver.has("■ Stop") && listed(&mut driver, "Stop training"));
    assert!(!driver.is_enabled("▶ Train") && !listed(&mut driver, "Open files"));
    driver.press_with(Modifiers::COMMAND, Key::Period);
    driver.wait_for_end();
    assert!(!driver.has("■ Stop") && driver.is_enabled("▶ Train"));
}

#[test]
fn the_interface_grows_and_shrinks_within_limits() {
    let mut driver = Driver::open();
    let scale = |driver: &mut Driver| (10.0 * driver.harness().ctx.zoom_factor()).round() as i32;
    for _ in 0..30 {
        driver.press_with(Modifiers::COMMAND, Key::Plus);
    }
    assert_eq!(scale(&mut driver), 20);
    for _ in 0..30 {
        driver.press_with(Modifiers::COMMAND, Key::Minus);
    }
    assert_eq!(scale(&mut driver), 8);
    driver.press_with(Modifiers::COMMAND, Key::Num0);
    assert_eq!(scale(&mut driver), 10);
}

#[test]
fn the_list_has_the_actions_of_every_view_and_shows_it_first() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.click_button("Study");
    driver.press_with(Modifiers::COMMAND, Key::K);
    driver.type_into("Action", "start training");
    driver.press(Key::Enter);
    driver.wait_for_end();
    assert_eq!(driver.shown(), "Train");
}

#[test]
fn undo_says_what_it_undid_and_shows_it() {
    let mut driver = Driver::open();
    driver.enter("Hidden nodes", "7");
    // Changes less than a second apart are one.
    driver.harness().run_steps(80);
    driver.click_button("Compare");
    driver.act("Undo change of settings");
    driver.settle();
    driver.assert_says("Undone: hidden");
    assert_eq!(
        (driver.shown(), driver.get("Hidden nodes").value().as_deref()),
        ("Train", Some("12"))
    );
    driver.act("Redo change of settings");
    driver.settle();
    driver.assert_says("Redone: hidden");
    assert_eq!(driver.get("Hidden nodes").value().as_deref(), Some("7"));
    driver.harness().run_steps(80);
    driver.choose("Preset", "Best accuracy");
    driver.harness().run_steps(80);
    driver.act("Undo change of settings");
    driver.settle();
    driver.assert_says("Undone: preset Best accuracy");
}

#[test]
fn in_a_narrow_window_the_settings_are_hidden_until_asked_for() {
    let mut driver = Driver::open();
    driver.harness().set_size(vec2(686.0, 457.0));
    driver.settle();
    assert!(!driver.has("Hidden nodes"));
    driver.click("Show or hide the settings");
    driver.settle();
    assert!(driver.has("Hidden nodes"));
    driver.act("Show or hide the settings");
    driver.settle();
    assert!(!driver.has("Hidden nodes"));
}
