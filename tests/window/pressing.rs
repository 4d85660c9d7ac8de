//! Pressing the actual surface with the pointer and the keys, and the answers of all decoders.

use decoupler_core::{
    dataset::Dataset,
    evaluation::{Errors, Run},
    glam::{DVec2, DVec3},
    ndarray::{Array1, Array2},
    scene::{Indenter, IndenterShape, Radii},
};
use decoupler_files::export::format_number;
use eframe::egui::{Event, Key, Modifiers, MouseWheelUnit, PointerButton, Pos2, Rect, TouchPhase, vec2};
use egui_kittest::kittest::NodeT as _;

use crate::driver::{Driver, small, trained};

const ACTUAL: &str = "Actual surface";
const DECODED: &str = "Decoded surface";
const READINGS: &str = "Readings of the actual surface";
const BACK: &str = "Back to the test set";
const PRESS: &str = "Press the middle of the surface";

/// Returns a point of the screen over a node in the middle of the surface, and the row-wire and number of the node, from 0.
fn over_a_node(driver: &mut Driver) -> (Pos2, [usize; 2]) {
    let card = driver.get(ACTUAL).rect();
    let middle = Rect::from_center_size(card.center(), 0.3 * card.size());
    for step in 0..900 {
        let share = vec2((step % 30) as f32 / 30.0, (step / 30) as f32 / 30.0);
        let at = middle.min + share * middle.size();
        driver.harness().hover_at(at);
        driver.harness().step();
        // Of the tooltip: "Row 5, node 3".
        let node = driver.texts().into_iter().find_map(|text| {
            let (row, node) = text.strip_prefix("Row ")?.split_once(", node ")?;
            Some([row.parse::<usize>().ok()? - 1, node.parse::<usize>().ok()? - 1])
        });
        if let Some(node) = node {
            return (at, node);
        }
    }
    panic!("no node in {middle:?}");
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

/// Place in the middle of the nodes of the small array.
fn middle_mm() -> DVec2 {
    let simulation = *small().simulation().unwrap();
    let corners = [(0, 0), (9, 5)].map(|(row, node)| {
        let geometry = &simulation.sensor.geometry;
        geometry.row_node_mm(simulation.sensor.scale, row, node).truncate()
    });
    0.5 * (corners[0] + corners[1])
}

/// Waits until the report, the readings and the surfaces agree with the library about a ball of 4 mm radius.
#[track_caller]
fn wait_for_press(driver: &mut Driver, run: &Run, place_mm: DVec2, depth_mm: f64) {
    let simulation = *run.settings().simulation().unwrap();
    let sensor = simulation.sensor;
    let radius_mm = Radii {
        smallest: 4.0,
        largest: 4.0,
    };
    let ball = Indenter {
        shape: IndenterShape::Sphere { radius_mm },
        ..Indenter::default()
    };
    let deformation = ball.press(&sensor, place_mm, depth_mm);
    let rows = Vec::from_iter(0..sensor.scale.rows());
    let mut readings = Array2::zeros((rows.len(), sensor.scale.columns()));
    let mut targets = Array2::zeros((rows.len(), sensor.scale.coordinates_per_row()));
    let mut largest: f64 = 0.0;
    for &row in &rows {
        let ohm = sensor.row_resistances(row, deformation.row_mm(row)).unwrap();
        let rest = sensor.row_resistances(row, &[DVec3::ZERO; 6]).unwrap();
        let drops = ohm.iter().zip(&rest).map(|(ohm, rest)| 100.0 * (1.0 - ohm / rest));
        largest = drops.fold(largest, f64::max);
        readings.row_mut(row).assign(&Array1::from(ohm));
        for (node, place) in deformation.row_positions_mm(&sensor, row).enumerate() {
            for axis in 0..3 {
                targets[[row, 3 * node + axis]] = place[axis];
            }
        }
    }
    let set = Dataset::new(readings, targets, Some(&rows), vec![0; rows.len()]).unwrap();
    let answers = run.network().decouple(&set);
    let errors = Errors::measure(&set, &answers, simulation.stroke_mm());
    let mean = format!("Network, mean mm: {}", format_number(errors.z_mm));
    let worst = format!("Network, worst mm: {}", format_number(errors.worst_mm));
    driver.wait(&mean, |driver| driver.has(&mean) && driver.has(&worst));
    let z = answers.indexed_iter().filter(|((_, column), _)| column % 3 == 2);
    let (low, high) = z.fold((f64::MAX, f64::MIN), |(low, high), (_, z)| (low.min(*z), high.max(*z)));
    let heights = driver.get(DECODED).value();
    assert_eq!(heights, Some(format!("z {low:.2} to {high:.2} mm")));
    if !driver.has(READINGS) {
        driver.act("Chart: Readings");
    }
    let said = driver.get(READINGS).value().unwrap();
    assert!(said.ends_with(&format!("to {}", format_number(largest))), "{said}");
}

/// Depth in the field, in millimetres.
fn depth_mm(driver: &Driver) -> f64 {
    let text = driver.get("Depth").value().unwrap();
    text.trim_end_matches(" mm").parse().unwrap()
}

#[test]
fn the_whole_window_follows_the_finger() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_last_epoch();
    let run = trained(small());
    driver.act("Chart: Readings");
    driver.settle();
    let before = driver.get(READINGS).value();
    let (at, [row, node]) = over_a_node(&mut driver);
    push(&mut driver, at);
    driver.wait("the press", |driver| driver.says("Network, mean mm: "));
    assert_ne!(driver.get(READINGS).value(), before);
    let heights = driver.get(ACTUAL).value().unwrap();
    assert!(
        heights.starts_with("z 4.2") && (heights.ends_with("to 5.00 mm") || heights.ends_with("to 4.99 mm")),
        "{heights}"
    );
    let simulation = *small().simulation().unwrap();
    let geometry = &simulation.sensor.geometry;
    let place = geometry.row_node_mm(simulation.sensor.scale, row, node);
    let described = |driver: &Driver| driver.get(ACTUAL).accesskit_node().description().unwrap();
    // "…, lowest at x 9.00, y 8.50 mm"
    let text = described(&driver);
    let (x, y) = text.split_once("lowest at x ").unwrap().1.split_once(", y ").unwrap();
    let lowest = DVec2::new(x.parse().unwrap(), y.trim_end_matches(" mm").parse().unwrap());
    assert!(lowest.distance(place.truncate()) < 1.5, "{text}, pressed at {place}");
    for away in [vec2(30.0, 8.0), vec2(-45.0, 20.0), vec2(2.0, -30.0)] {
        let before = described(&driver);
        move_to(&mut driver, at + away);
        driver.wait("the next press", |driver| described(driver) != before);
    }
    driver.harness().drop_at(at);
    driver.harness().step();

    // The wheel and the field set the depth.
    driver.act(PRESS);
    wait_for_press(&mut driver, &run, middle_mm(), 0.8);
    let middle = driver.get(ACTUAL).rect().center();
    move_to(&mut driver, middle);
    driver.harness().event(Event::MouseWheel {
        unit: MouseWheelUnit::Point,
        delta: vec2(0.0, 60.0),
        phase: TouchPhase::Move,
        source: eframe::egui::MouseWheelSource::Wheel,
        modifiers: Modifiers::NONE,
    });
    driver.harness().run_steps(3);
    let lifted_mm = depth_mm(&driver);
    assert!(lifted_mm < 0.75, "{lifted_mm}");
    driver.enter("Depth", "99");
    assert!(
        driver.has("99 mm is too large: at most 1 mm."),
        "no deeper than the scene allows"
    );
    driver.enter("Depth", "1000 um");
    wait_for_press(&mut driver, &run, middle_mm(), 1.0);

    driver.press(Key::Escape);
    assert!(!driver.has(BACK) && !driver.says("Network, mean mm"));
    assert_eq!(driver.get(READINGS).value(), before);
}

#[test]
fn the_other_decoders_answer_alongside_the_network() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_last_epoch();
    driver.act(PRESS);
    driver.wait("the mean's answer", |driver| {
        driver.says("Training mean, worst mm: 0.") && driver.says("Network, worst mm: 0.")
    });
    assert!(!driver.says("Newton, "), "folded until asked for");
    driver.click("Other decoders");
    driver.wait("Newton's answer", |driver| {
        let texts = driver.texts();
        let mut answers = texts.iter().filter(|text| text.contains(", worst mm: "));
        driver.says("Newton, worst mm: ") && answers.all(|text| !text.ends_with('…'))
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
fn a_newcomer_presses_before_any_training_and_a_demo_network_answers() {
    const DEMO: &str = "Decoded by a built-in demo network. Train to use your own.";
    let mut driver = Driver::open();
    driver.configure_small();
    assert!(driver.says("Press the surface on the left"));
    driver.act("Press the middle of the surface");
    driver.wait("the demo network's answer", |driver| driver.says("Network, mean mm: "));
    assert!(driver.has(DECODED) && driver.has(DEMO));
    let rest_mm = 0.8 * 0.5;
    let start = "Network, worst mm: ";
    let text = driver.texts().into_iter().find(|text| text.starts_with(start)).unwrap();
    let worst_mm: f64 = text[start.len()..].parse().unwrap();
    assert!(worst_mm < rest_mm, "{text}");
    assert!(driver.has("Ready: press Train"), "no training of the user is displayed");

    // The user's own network takes over.
    driver.train();
    driver.wait_for_last_epoch();
    wait_for_press(&mut driver, &trained(small()), middle_mm(), 0.8);
    assert!(!driver.has(DEMO));
    driver.click(BACK);
    assert!(!driver.says("Network, mean mm: "));
}

#[test]
fn the_demo_network_is_useful_on_every_array_of_the_paper() {
    let mut driver = Driver::open();
    for (array, columns) in [("10×6_3×18", 18), ("10×8_4×24", 24), ("10×10_5×30", 30)] {
        driver.choose("Paper's array", array);
        driver.wait("its surface", |driver| {
            let skin = driver.state().skin();
            skin.is_some_and(|skin| skin.sensor.scale.columns() == columns)
        });
        driver.act(PRESS);
        driver.wait("the answer", |driver| driver.says("Training mean, mean mm: 0."));
        let mean_mm = |name: &str| -> f64 {
            let start = format!("{name}, mean mm: ");
            let texts = driver.texts().into_iter();
            let text = texts
                .filter_map(|text| Some(text.strip_prefix(&start)?.to_owned()))
                .next();
            text.unwrap().parse().unwrap()
        };
        assert!(mean_mm("Network") < 0.5 * mean_mm("Training mean"), "{array}");
        driver.press(Key::Escape);
    }
}

#[test]
fn the_right_button_and_shift_turn_and_keys_press_too() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_last_epoch();
    let middle = driver.get(ACTUAL).rect().center();
    let camera = |driver: &Driver| driver.state().look.camera;
    let drag = |driver: &mut Driver, button: PointerButton, modifiers: Modifiers| {
        let click = |driver: &mut Driver, pos: Pos2, pressed: bool| {
            driver.harness().event(Event::PointerButton {
                pos,
                button,
                pressed,
                modifiers,
            });
            driver.harness().step();
        };
        driver.harness().event(Event::ModifiersChanged(modifiers));
        move_to(driver, middle);
        click(driver, middle, true);
        for across in [60.0, 80.0] {
            move_to(driver, middle + vec2(across, 10.0));
        }
        click(driver, middle + vec2(80.0, 10.0), false);
        driver.harness().event(Event::ModifiersChanged(Modifiers::NONE));
        driver.harness().run_steps(2);
    };
    let before = camera(&driver);
    drag(&mut driver, PointerButton::Primary, Modifiers::NONE);
    driver.wait("the press", |driver| driver.has(BACK));
    assert_eq!(camera(&driver), before, "pressing turns nothing");
    driver.press(Key::Escape);

    for (button, modifiers) in [
        (PointerButton::Secondary, Modifiers::NONE),
        (PointerButton::Primary, Modifiers::SHIFT),
    ] {
        let before = camera(&driver);
        drag(&mut driver, button, modifiers);
        assert!(!driver.has(BACK), "turning presses nothing");
        assert_ne!(camera(&driver), before, "{button:?} with {modifiers:?}");
    }

    driver.get(ACTUAL).focus();
    driver.harness().run_steps(2);
    let turned = camera(&driver);
    driver.press(Key::ArrowRight);
    driver.press(Key::ArrowRight);
    driver.press(Key::Minus);
    // From the middle by half a row pitch.
    let place_mm = middle_mm() + DVec2::new(0.5, 0.0);
    wait_for_press(&mut driver, &trained(small()), place_mm, 0.75);
    assert_eq!(camera(&driver), turned, "the keys press");
}
