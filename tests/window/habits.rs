//! What the hands learn: taking changes back, the list of all actions, keys, the size of the interface.

use decoupler::window::Phase;
use eframe::egui::{Key, Modifiers, vec2};

use crate::{driver::Driver, training::start_endless};

const UNDO: (Modifiers, Key) = (Modifiers::COMMAND, Key::Z);

/// Lets the time pass after which changes count as two.
pub(crate) fn pause(driver: &mut Driver) {
    let harness = driver.harness();
    for _ in 0..8 {
        harness.input_mut().time = Some(harness.ctx.input(|input| input.time) + 0.5);
        harness.step();
    }
}

#[test]
fn a_change_of_settings_is_taken_back_and_made_again() {
    let mut driver = Driver::open_first(vec2(1440.0, 900.0));
    pause(&mut driver);
    let before = driver.state().draft;
    assert!(!driver.is_enabled("Undo change of settings"));
    driver.enter("Hidden nodes", "7");
    pause(&mut driver);
    let after = driver.state().draft;
    assert_eq!((before.hidden, after.hidden), (12, 7));
    driver.press_with(UNDO.0, UNDO.1);
    assert_eq!(driver.state().draft, before);
    assert!(!driver.is_enabled("Undo change of settings"));
    driver.click("Redo change of settings");
    assert_eq!(driver.state().draft, after);
    driver.click("Undo change of settings");
    assert_eq!(driver.state().draft, before);
}

#[test]
fn the_settings_of_a_training_that_runs_are_not_taken_back() {
    let mut driver = Driver::open();
    pause(&mut driver);
    driver.configure_small();
    pause(&mut driver);
    start_endless(&mut driver);
    let held = driver.state().draft;
    assert!(driver.state().phase.is_busy());
    driver.press_with(UNDO.0, UNDO.1);
    assert_eq!(driver.state().draft, held);
    assert!(!driver.is_enabled("Undo change of settings"));
}

#[test]
fn the_list_of_actions_finds_one_by_a_few_letters_and_does_it() {
    let mut driver = Driver::open();
    driver.press_with(Modifiers::COMMAND, Key::K);
    driver.type_into("Action", "show");
    assert!(driver.has("Show Compare") && driver.has("Show Trade-off"));
    driver.type_into("Action", "comp");
    assert!(driver.has("Show Compare") && !driver.has("Show Trade-off"));
    driver.press(Key::Enter);
    driver.settle();
    assert_eq!(driver.shown(), "Compare");
    assert!(!driver.has("Show Experiments"), "the list is closed");
}

#[test]
fn the_list_marks_the_next_action_with_an_arrow_and_closes_with_escape() {
    let mut driver = Driver::open();
    driver.press_with(Modifiers::COMMAND, Key::K);
    driver.type_into("Action", "show");
    driver.press(Key::ArrowDown);
    driver.press(Key::Escape);
    assert_eq!(driver.shown(), "Train");
    assert!(!driver.has("Show Compare"));
    driver.press_with(Modifiers::COMMAND, Key::K);
    driver.type_into("Action", "show");
    driver.press(Key::ArrowDown);
    driver.press(Key::Enter);
    driver.settle();
    assert_eq!(driver.shown(), "Compare", "the second, after Experiments");
}

#[test]
fn while_the_list_is_open_keys_do_nothing_else() {
    let mut driver = Driver::open();
    driver.press_with(Modifiers::COMMAND, Key::K);
    driver.press_with(Modifiers::COMMAND, Key::Enter);
    assert_eq!(driver.state().phase, Phase::Idle);
}

#[test]
fn every_key_that_is_listed_is_heard() {
    let mut driver = Driver::open();
    driver.press(Key::Questionmark);
    assert!(driver.says("Ctrl+K") && driver.says("Next test snapshot") && driver.says("PageDown"));
    driver.press(Key::Escape);
    assert!(!driver.says("PageDown"));
    driver.press_with(Modifiers::COMMAND, Key::Num2);
    assert_eq!(driver.shown(), "Experiments");
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
