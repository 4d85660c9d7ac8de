//! Typing numbers: with units, and with invalid ones rejected in place.

use eframe::egui::{Event, Key, Modifiers, PointerButton, Pos2, accesskit::Role, vec2};
use egui_kittest::kittest::{By, NodeT as _, Queryable as _};

use crate::driver::Driver;

#[test]
fn values_are_accepted_with_their_units() {
    let mut driver = Driver::open();
    driver.enter("Height", "0.6 cm");
    assert_eq!(driver.simulation().sensor.geometry.height_mm, 6.0);
    driver.enter("Row pitch", "1500um");
    assert_eq!(driver.simulation().sensor.geometry.row_pitch_mm, 1.5);
    driver.enter("Largest compression", "15%");
    assert_eq!(driver.simulation().scene.largest_compression, 0.15);
    driver.enter("Resistivity", "2 kohm/mm");
    assert_eq!(driver.simulation().sensor.resistivity_ohm_per_mm, 2000.0);
    driver.enter("Smallest gradient", "1e-9");
    assert_eq!(driver.state().draft.training.stopping.min_gradient, 1e-9);
}

#[test]
fn invalid_values_are_rejected_in_place_and_the_old_value_stays() {
    let mut driver = Driver::open();
    let before = driver.state().draft;
    for (field, typed, reason) in [
        ("Hidden nodes", "0", "0 is too small: at least 1."),
        ("Hidden nodes", "2.5", "“2.5” is not a whole number."),
        (
            "Height",
            "5 kg",
            "“kg” is not a unit of this field: type mm, µm, cm, m, in or none.",
        ),
        ("Height", "thick", "“thick” is not a number: type, for example, 0.5 mm."),
        ("Largest compression", "120 %", "120 % is too large: at most 99 %."),
        ("Seed", "-1", "−1 is too small: at least 0."),
        // No digit is lost unnoticed.
        (
            "Seed",
            "9007199254740993",
            "9007199254740992 is too large: at most 9007199254740991.",
        ),
    ] {
        driver.enter(field, typed);
        assert!(driver.has(reason), "{field}: {typed}: {:#?}", driver.texts());
        assert_eq!(driver.state().draft, before, "{field}: {typed}");
        let by = By::new().role(Role::SpinButton).label(field);
        let described = driver.harness().get(by).accesskit_node().description();
        assert_eq!(described.as_deref(), Some(reason), "it is read out with the field");
    }
    driver.enter("Hidden nodes", "7");
    assert!(!driver.says("too small: at least 1"), "the next number settles it");
    assert_eq!(driver.get("Hidden nodes").value().as_deref(), Some("7"));
}

#[test]
fn a_notice_above_a_field_does_not_interrupt_typing() {
    let mut driver = Driver::open();
    driver.enter("Array scale", "20×20_5×60");
    driver.choose("Axes", "x, y, z");
    driver.type_into("Training samples", "300");
    // The notes on this scene appear above the field during typing.
    driver.wait("the scene's outlook", |driver| {
        let (preview, draft) = (driver.state().preview.as_ref(), driver.simulation());
        preview.is_some_and(|preview| {
            let source = preview.settings.simulation().unwrap();
            (source.sensor, source.scene) == (draft.sensor, draft.scene)
                && preview.test.skin.as_ref().unwrap().outlook.is_some()
        })
    });
    driver.press(Key::Enter);
    assert_eq!(driver.simulation().samples, 300);
}

#[test]
fn a_reason_is_next_to_its_field_and_escape_closes_it() {
    let mut driver = Driver::open();
    driver.enter("Hidden nodes", "0");
    let (field, reason) = (
        driver.get("Hidden nodes").rect(),
        driver.get("0 is too small: at least 1.").rect(),
    );
    assert!(
        reason.top() >= field.bottom() - 1.0 && reason.top() < field.bottom() + 12.0,
        "{field} {reason}"
    );
    driver.get("Hidden nodes").focus();
    driver.harness().run_steps(2);
    driver.press(Key::Escape);
    driver.harness().run_steps(2);
    assert!(!driver.has("0 is too small: at least 1."));
}

/// Clicks twice there, fast.
fn double_click(driver: &mut Driver, at: Pos2) {
    let harness = driver.harness();
    let now = harness.ctx.input(|input| input.time);
    for click in 0..2 {
        for pressed in [true, false] {
            harness.input_mut().time = Some(now + 1.0 + 0.1 * f64::from(click) + if pressed { 0.02 } else { 0.05 });
            harness.input_mut().events.push(Event::PointerMoved(at));
            harness.input_mut().events.push(Event::PointerButton {
                pos: at,
                button: PointerButton::Primary,
                pressed,
                modifiers: Modifiers::NONE,
            });
            harness.step();
        }
    }
    harness.run_steps(3);
    harness.remove_cursor();
    harness.step();
}

/// Double-clicks a slider, which the first click moves off its default value.
pub(crate) fn double_click_slider(driver: &mut Driver, name: &str) {
    driver.get(name).scroll_to_me();
    driver.harness().run_steps(20);
    let rect = driver.get(name).rect();
    double_click(driver, rect.lerp_inside(vec2(0.37, 0.5)));
}

#[test]
fn a_double_click_sets_the_default_value() {
    let mut driver = Driver::open();
    driver.enter("Hidden nodes", "33");
    assert_eq!(driver.get("Hidden nodes").value().as_deref(), Some("33"));
    let at = driver.get("Hidden nodes").rect().center();
    double_click(&mut driver, at);
    assert_eq!(driver.get("Hidden nodes").value().as_deref(), Some("12"));
}

#[test]
fn a_double_click_sets_sliders_and_the_depth_to_their_defaults() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_last_epoch();
    driver.get("Epoch of the displayed network").focus();
    driver.press(Key::ArrowLeft);
    assert!(driver.views().train.scrub.epoch().is_some());
    double_click_slider(&mut driver, "Epoch of the displayed network");
    assert_eq!(driver.views().train.scrub.epoch(), None, "the latest");

    driver.act("Press the middle of the surface");
    driver.enter("Depth", "0.2");
    assert_eq!(driver.views().train.press.finger.depth_share, 0.2);
    let at = driver.get("Depth").rect().center();
    double_click(&mut driver, at);
    assert_eq!(driver.views().train.press.finger.depth_share, 0.8);
}
