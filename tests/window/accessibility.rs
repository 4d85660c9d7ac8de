//! Accessibility: names for screen readers, and everything within reach of the keyboard.

use eframe::egui::{Event, Key, Modifiers, Rect, Shape, accesskit::Role};
use egui_kittest::kittest::{By, NodeT as _, Queryable as _};

use crate::{driver::Driver, every_view::VIEWS};

/// Opens a view and waits for its initial contents.
fn show(driver: &mut Driver, view: &str) {
    driver.click_button(view);
    if view == "Sensor" {
        driver.wait("the analysis", |driver| driver.says("Condition number: "));
    }
    driver.settle();
}

/// Name and place of the focused control.
fn focused(driver: &mut Driver) -> Option<(String, Rect)> {
    let nodes = driver.harness().root().children_recursive();
    let mut focused = nodes.filter(|node| node.accesskit_node().is_focused());
    focused
        .next()
        .map(|node| (node.accesskit_node().label().unwrap_or_default(), node.rect()))
}

/// Presses Tab until the control of this name has the focus.
#[track_caller]
fn tab_to(driver: &mut Driver, name: &str) {
    for _ in 0..200 {
        driver.press(Key::Tab);
        if focused(driver).is_some_and(|(label, _)| label == name) {
            return;
        }
    }
    panic!("Tab never reaches {name}");
}

fn write(driver: &mut Driver, text: &str) {
    driver.press_with(Modifiers::COMMAND, Key::A);
    driver.harness().event(Event::Text(text.to_owned()));
    driver.harness().run_steps(2);
    driver.press(Key::Enter);
}

#[test]
fn a_network_is_configured_and_trained_by_keys_alone() {
    let mut driver = Driver::open();
    tab_to(&mut driver, "Array scale");
    write(&mut driver, "10×6_3×18");
    tab_to(&mut driver, "Hidden nodes");
    write(&mut driver, "6");
    tab_to(&mut driver, "Training samples");
    write(&mut driver, "200");
    tab_to(&mut driver, "Epochs");
    write(&mut driver, "15");
    assert_eq!(driver.state().draft, crate::driver::small());
    tab_to(&mut driver, "▶ Train");
    driver.press(Key::Space);
    driver.wait_for_end();
    // The results are within reach of the keyboard too.
    tab_to(&mut driver, "Regression");
    driver.press(Key::Enter);
    driver.settle();
    assert!(driver.says("Correlation R = "));
    tab_to(&mut driver, "Next snapshot");
    driver.press(Key::Space);
    assert_eq!(driver.snapshot(), 1);
    driver.act("Chart: Section");
    driver.press(Key::CloseBracket);
    assert!(driver.says("7 of 10"));
}

/// Shapes painted within a rectangle.
fn painted(driver: &mut Driver, place: Rect) -> Vec<Shape> {
    let shapes = driver.harness().output().shapes.iter();
    let there = shapes.filter(|shape| shape.shape.visual_bounding_rect().intersects(place));
    there.map(|shape| shape.shape.clone()).collect()
}

#[test]
fn the_focus_is_visible_on_every_control() {
    for view in VIEWS {
        let mut driver = Driver::open();
        show(&mut driver, view);
        driver.press(Key::Tab);
        let (mut seen, mut unseen) = (0, Vec::new());
        for _ in 0..70 {
            let Some((name, place)) = focused(&mut driver) else {
                driver.press(Key::Tab);
                continue;
            };
            // Controls out of sight are not painted, but scrolled to.
            driver.harness().run_steps(2);
            let place = focused(&mut driver).map_or(place, |(_, place)| place);
            let with_focus = painted(&mut driver, place);
            driver.press(Key::Tab);
            driver.harness().run_steps(3);
            let without = painted(&mut driver, place);
            seen += 1;
            if with_focus == without {
                unseen.push(name);
            }
        }
        assert!(unseen.is_empty(), "{view}: the focus is not visible on {unseen:?}");
        assert!(seen > 8, "{view}: {seen}");
    }
}

#[test]
fn the_top_bar_is_reached_from_left_to_right() {
    let mut driver = Driver::open();
    let mut reached: Vec<(String, f32)> = Vec::new();
    for _ in 0..30 {
        driver.press(Key::Tab);
        let Some((name, place)) = focused(&mut driver) else {
            continue;
        };
        if place.bottom() > 44.0 {
            break;
        }
        reached.push((name, place.left()));
    }
    assert!(reached.is_sorted_by(|one, other| one.1 < other.1), "{reached:?}");
    let names = Vec::from_iter(reached.iter().map(|(name, _)| name.as_str()));
    assert!(
        names.starts_with(&VIEWS) && names.ends_with(&["Export", "Search actions", "Keys"]),
        "{names:?}"
    );
}

#[test]
fn the_search_fields_of_the_help_let_the_focus_go() {
    let mut driver = Driver::open();
    driver.act("Glossary");
    assert_eq!(focused(&mut driver).unwrap().0, "Term");
    driver.press(Key::Tab);
    driver.harness().run_steps(2);
    assert_ne!(focused(&mut driver).unwrap().0, "Term");
}

#[test]
fn tables_have_rows_and_facts_are_read_once() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    let roles = |driver: &mut Driver, role| driver.harness().query_all(By::new().role(role)).count();
    assert!(roles(&mut driver, Role::Table) >= 1 && roles(&mut driver, Role::Row) >= 3);
    show(&mut driver, "Sensor");
    let nodes = driver.harness().root().children_recursive();
    let read = nodes.filter(|node| !node.accesskit_node().is_hidden());
    let names = read.filter(|node| {
        let node = node.accesskit_node();
        node.label().or(node.value()).as_deref() == Some("Condition number")
    });
    assert_eq!(names.count(), 0, "the fact is read with its value");
}
