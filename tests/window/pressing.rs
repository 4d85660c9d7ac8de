//! Pressing the actual surface with the pointer, and the answers of all decoders.

use decoupler::window::Touch;
use decoupler_core::{dataset::Dataset, ndarray::Array2};
use decoupler_core::{
    evaluation::{Errors, Run, RunSettings},
    glam::DVec3,
    sensor::SensorModel,
};
use decoupler_files::export::format_number;
use eframe::egui::{Event, Key, Modifiers, MouseWheelUnit, Pos2, Rect, TouchPhase, vec2};

use crate::driver::{Driver, small, trained};

const ACTUAL: &str = "Actual surface";
const READINGS: &str = "Readings of the actual surface";

/// Returns a point of the screen over a node in the middle of the surface, and the node.
fn over_a_node(driver: &mut Driver) -> (Pos2, usize) {
    let card = driver.get(ACTUAL).rect();
    let middle = Rect::from_center_size(card.center(), 0.3 * card.size());
    for step in 0..900 {
        let share = vec2((step % 30) as f32 / 30.0, (step / 30) as f32 / 30.0);
        let at = middle.min + share * middle.size();
        driver.harness().hover_at(at);
        driver.harness().step();
        if let Some(node) = driver.views().train.lights.node {
            return (at, node);
        }
    }
    panic!("no node in {middle:?}");
}

fn touch(driver: &Driver) -> Touch {
    driver.views().train.press.touch().cloned().unwrap()
}

/// Presses the mouse button there and draws one frame.
fn push(driver: &mut Driver, at: Pos2) {
    driver.harness().drag_at(at);
    driver.harness().step();
}

/// Moves the mouse there and draws one frame.
fn move_to(driver: &mut Driver, at: Pos2) {
    driver.harness().hover_at(at);
    driver.harness().step();
}

/// Returns the readings under the finger, the errors of the network and the description of its surface, computed by the
/// library from a set of one snapshot.
fn expected(run: &Run, touch: &Touch) -> (Array2<f64>, Errors, String) {
    let settings: RunSettings = *run.settings();
    let sensor: SensorModel = settings.simulation().unwrap().sensor;
    let rows = Vec::from_iter(0..sensor.scale.rows());
    let deformation = touch.deformation(&sensor, settings.simulation().unwrap().stroke_mm());
    let mut readings = Array2::zeros((rows.len(), sensor.scale.columns()));
    let mut targets = Array2::zeros((rows.len(), sensor.scale.coordinates_per_row()));
    for &row in &rows {
        let ohm = sensor.row_resistances(row, deformation.row_mm(row)).unwrap();
        readings
            .row_mut(row)
            .assign(&decoupler_core::ndarray::Array1::from(ohm));
        for (node, place) in deformation.row_positions_mm(&sensor, row).enumerate() {
            for axis in 0..3 {
                targets[[row, 3 * node + axis]] = place[axis];
            }
        }
    }
    let set = Dataset::new(readings.clone(), targets, Some(&rows), vec![0; rows.len()]).unwrap();
    let decoupled_mm = run.network().decouple(&set);
    let errors = Errors::measure(&set, &decoupled_mm, settings.simulation().unwrap().stroke_mm());
    let z = decoupled_mm.indexed_iter().filter(|((_, column), _)| column % 3 == 2);
    let (low, high) = z.fold((f64::MAX, f64::MIN), |(low, high), (_, z)| (low.min(*z), high.max(*z)));
    (readings, errors, format!("z {low:.2} to {high:.2} mm"))
}

/// Asserts that the report and the readings in the frame just drawn agree with the library about the touch.
#[track_caller]
fn assert_shows_touch(driver: &Driver, run: &Run) {
    let (readings, errors, heights) = expected(run, &touch(driver));
    assert_eq!(driver.get("Decoded surface").value(), Some(heights));
    let mean = format!("Network, mean mm: {}", format_number(errors.z_mm));
    let worst = format!("Network, worst mm: {}", format_number(errors.worst_mm));
    assert!(driver.has(&mean) && driver.has(&worst), "{mean}: {:?}", driver.texts());
    let settings = *run.settings();
    let rest = settings
        .simulation()
        .unwrap()
        .sensor
        .row_resistances(0, &[DVec3::ZERO; 6])
        .unwrap();
    let shown = driver.views().train.drops_percent().unwrap();
    let drop = 100.0 * (1.0 - readings[[0, 4]] / rest[4]);
    assert!((shown[[0, 4]] - drop).abs() < 1e-9, "{} {drop}", shown[[0, 4]]);
    let largest = shown.iter().copied().fold(0.0, f64::max);
    let said = driver.get(READINGS).value().unwrap();
    assert!(said.ends_with(&format!("to {}", format_number(largest))), "{said}");
}

#[test]
fn the_whole_window_follows_the_finger_in_the_same_frame() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_last_epoch();
    let run = trained(small());
    let before = driver.get(READINGS).value();
    let (at, node) = over_a_node(&mut driver);
    push(&mut driver, at);
    let place = small().simulation().unwrap().sensor.geometry.row_node_mm(
        small().simulation().unwrap().sensor.scale,
        node / 6,
        node % 6,
    );
    let print = touch(&driver).print.unwrap();
    assert!(
        print.place_mm.distance(place.truncate()) < 1.0,
        "{} at {place}",
        print.place_mm
    );
    assert_eq!(print.depth_mm, 0.8);
    assert_shows_touch(&driver, &run);
    assert_ne!(driver.get(READINGS).value(), before);
    let heights = driver.get(ACTUAL).value().unwrap();
    assert!(
        heights.starts_with("z 4.2") && heights.ends_with("to 5.00 mm"),
        "{heights}"
    );
    assert!(driver.has("Decoded surface"));

    for away in [vec2(30.0, 8.0), vec2(-45.0, 20.0), vec2(2.0, -30.0)] {
        let before = touch(&driver);
        move_to(&mut driver, at + away);
        assert_ne!(touch(&driver), before);
        assert_shows_touch(&driver, &run);
    }
    driver.harness().drop_at(at);
    driver.harness().step();
    // The wheel and the slider set the depth of the touch.
    let depth_mm = touch(&driver).print.unwrap().depth_mm;
    move_to(&mut driver, at);
    driver.harness().event(Event::MouseWheel {
        unit: MouseWheelUnit::Point,
        delta: vec2(0.0, 60.0),
        phase: TouchPhase::Move,
        source: eframe::egui::MouseWheelSource::Wheel,
        modifiers: Modifiers::NONE,
    });
    driver.harness().run_steps(3);
    let lifted_mm = touch(&driver).print.unwrap().depth_mm;
    assert!(lifted_mm < depth_mm - 0.05, "{lifted_mm} of {depth_mm}");
    assert_shows_touch(&driver, &run);
    driver.enter("Depth", "99");
    assert!(
        driver.has("99 mm is too large: at most 1 mm."),
        "no deeper than the scene allows"
    );
    assert_eq!(
        touch(&driver).print.unwrap().depth_mm,
        lifted_mm,
        "what was pressed stays"
    );
    driver.enter("Depth", "1000 um");
    assert_eq!(touch(&driver).print.unwrap().depth_mm, 1.0);
    assert_shows_touch(&driver, &run);

    driver.press(Key::Escape);
    assert!(!driver.views().train.press.is_pressing());
    assert_eq!(driver.get(READINGS).value(), before);
    assert!(!driver.says("Network, mean mm"));
}

#[test]
fn the_other_decoders_answer_alongside_the_network() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_last_epoch();
    let (at, _) = over_a_node(&mut driver);
    push(&mut driver, at);
    driver.harness().drop_at(at);
    driver.wait("Newton's answer", |driver| {
        driver
            .texts()
            .iter()
            .any(|text| text.starts_with("Newton, worst mm: ") && !text.ends_with('…'))
    });
    let worst = |driver: &Driver, name: &str| -> f64 {
        let start = format!("{name}, worst mm: ");
        let text = driver
            .texts()
            .into_iter()
            .find(|text| text.starts_with(&start))
            .unwrap();
        text[start.len()..].parse().unwrap()
    };
    assert!(
        worst(&driver, "Newton") < 1e-6,
        "without noise Newton's method is exact"
    );
    for name in ["Ridge", "Radial basis", "Network + Newton", "Training mean"] {
        assert!(worst(&driver, name) < 1.0, "{name}");
    }
    assert!(worst(&driver, "Training mean") > worst(&driver, "Ridge"));
    driver.settle();
}

#[test]
fn a_newcomer_presses_before_any_training_and_a_small_network_answers() {
    let mut driver = Driver::open();
    driver.configure_small();
    assert!(driver.says("Press the surface on the left"));
    driver.click_button("Press it");
    driver.wait("the small network's answer", |driver| driver.says("Network, mean mm: "));
    assert!(driver.has("Decoded surface") && driver.says("A small network answers"));
    let rest_mm = 0.8 * 0.5;
    let start = "Network, worst mm: ";
    let text = driver.texts().into_iter().find(|text| text.starts_with(start)).unwrap();
    let worst_mm: f64 = text[start.len()..].parse().unwrap();
    assert!(worst_mm < rest_mm, "{text}");
    assert!(driver.state().run.is_none(), "no training of the user is displayed");

    // The user's own network takes over.
    driver.train();
    driver.wait_for_last_epoch();
    driver.settle();
    assert_shows_touch(&driver, &trained(small()));
    assert!(!driver.says("A small network answers"));
    driver.click("Back to the test set");
    assert!(!driver.says("Network, mean mm: "));
}

#[test]
fn a_single_node_is_dragged_up_and_down_within_the_stroke() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_last_epoch();
    let run = trained(small());
    driver.click_button("Node");
    let test = run.test().clone();
    let z_of = |node: usize| test.targets()[[node / 6, 3 * (node % 6) + 2]];
    let (at, node) = over_a_node(&mut driver);
    push(&mut driver, at);
    let held = touch(&driver);
    assert!(
        (5.0 - held.nodes_mm[&(node / 6, node % 6)] - z_of(node)).abs() < 1e-12,
        "a hold moves nothing"
    );
    let mut before = held;
    for (down, expected) in [(12.0, None), (900.0, Some(1.0)), (-900.0, Some(0.0))] {
        move_to(&mut driver, at + vec2(0.0, down));
        let now = touch(&driver);
        let depth_mm = now.nodes_mm[&(node / 6, node % 6)];
        match expected {
            Some(limit_mm) => assert_eq!(depth_mm, limit_mm, "the stroke ends there"),
            None => assert!(depth_mm > before.nodes_mm[&(node / 6, node % 6)], "{depth_mm}"),
        }
        let others = |touch: &Touch| -> Vec<f64> {
            let others = touch
                .nodes_mm
                .iter()
                .filter(|(place, _)| **place != (node / 6, node % 6));
            others.map(|(_, depth_mm)| *depth_mm).collect()
        };
        assert_eq!(others(&now), others(&before));
        assert_eq!(others(&now).len(), 59);
        assert_shows_touch(&driver, &run);
        before = now;
    }
    driver.harness().drop_at(at);
    driver.click("Next snapshot");
    assert!(
        !driver.views().train.press.is_pressing(),
        "the test set is displayed again"
    );
}

#[test]
fn turning_is_one_click_away_and_keys_press_too() {
    let mut driver = Driver::open();
    driver.configure_small();
    let middle = driver.get(ACTUAL).rect().center();
    let camera = |driver: &Driver| driver.state().look.camera;
    let before = camera(&driver);
    let drag = |driver: &mut Driver| {
        move_to(driver, middle);
        push(driver, middle);
        move_to(driver, middle + vec2(60.0, 10.0));
        move_to(driver, middle + vec2(80.0, 10.0));
        driver.harness().drop_at(middle);
        driver.harness().run_steps(2);
    };
    drag(&mut driver);
    assert!(driver.views().train.press.is_pressing());
    assert_eq!(camera(&driver), before, "pressing turns nothing");
    driver.press(Key::Escape);

    driver.click_button("Turn");
    drag(&mut driver);
    assert!(!driver.views().train.press.is_pressing());
    assert_ne!(camera(&driver), before);

    driver.click_button("Press");
    driver.get(ACTUAL).focus();
    driver.harness().run_steps(2);
    driver.press(Key::ArrowRight);
    let first = touch(&driver).print.unwrap();
    let turned = camera(&driver);
    driver.press(Key::ArrowRight);
    driver.press(Key::Minus);
    let second = touch(&driver).print.unwrap();
    assert_eq!(
        second.place_mm - first.place_mm,
        decoupler_core::glam::DVec2::new(0.5, 0.0),
        "half a row pitch"
    );
    assert!(second.depth_mm < first.depth_mm);
    assert_eq!(camera(&driver), turned, "the keys press now");
}
