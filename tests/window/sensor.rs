//! The Sensor view: the array of the draft, figures and warnings.

use decoupler_core::{
    evaluation::RunSettings,
    identifiability::Identifiability,
    sensor::{RelativeNoise, SensorModel},
};
use decoupler_files::export::format_number;
use glam::DVec3;

use crate::driver::Driver;

fn open() -> Driver {
    let mut driver = Driver::open();
    driver.click_button("Sensor");
    wait_for_the_answer(&mut driver);
    driver
}

/// Waits for the analysis of the current array.
fn wait_for_the_answer(driver: &mut Driver) {
    driver.harness().run_steps(2);
    driver.wait("the analysis", |driver| {
        driver.says("Condition number: ") && !driver.has("Computing")
    });
}

/// Returns the row with the smallest singular value, with all nodes pressed by a tenth of the height, by the library.
fn worst_row(sensor: &SensorModel) -> Identifiability {
    let axes = decoupler_core::sensor::Axes::Z;
    let pressed = vec![DVec3::Z * 0.1 * sensor.geometry.height_mm; sensor.scale.nodes_per_row()];
    let rows = (0..sensor.scale.rows())
        .map(|row| Identifiability::of_row(sensor, row, &pressed, axes, RelativeNoise::default()).unwrap());
    let smallest = |row: &Identifiability| *row.singular_values_per_mm.last().unwrap();
    rows.min_by(|a, b| smallest(a).total_cmp(&smallest(b))).unwrap()
}

#[track_caller]
fn shows_condition_of(driver: &Driver, sensor: &SensorModel) {
    let worst = worst_row(sensor);
    let condition = format!("Condition number: {}", format_number(worst.condition()));
    driver.assert_has(&condition);
    assert!(driver.has(&format!("Worst row: {}", worst.row + 1)));
}

#[test]
fn the_array_is_that_of_the_train_view_and_the_figures_are_the_librarys() {
    let mut driver = open();
    let mut sensor = RunSettings::default().simulation().unwrap().sensor;
    shows_condition_of(&driver, &sensor);
    assert!(driver.says("Without noise, the readings determine every deformation"));
    driver.enter("Height", "8");
    driver.enter("Array scale", "10x10_5x40");
    wait_for_the_answer(&mut driver);
    sensor.geometry.height_mm = 8.0;
    sensor.scale = "10×10_5×40".parse().unwrap();
    shows_condition_of(&driver, &sensor);
    driver.settle();
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("values.svg");
    driver.save("Singular values, SVG", &picture);
    driver.click("Dismiss");
    let picture = std::fs::read_to_string(picture).unwrap();
    for word in ["worst row", "other rows", "deformation pattern, best seen first"] {
        assert!(picture.contains(word), "{word}");
    }

    driver.click_button("Train");
    assert_eq!(driver.get("Array scale").value().as_deref(), Some("10×10_5×40"));
    assert_eq!(driver.get("Height").value().as_deref(), Some("8 mm"));
    driver.enter("Height", "5");
    driver.click_button("Sensor");
    wait_for_the_answer(&mut driver);
    sensor.geometry.height_mm = 5.0;
    shows_condition_of(&driver, &sensor);
}

#[test]
fn rows_that_mirror_each_other_are_reported_until_the_row_is_known() {
    let mut driver = Driver::open();
    driver.choose("Paper's array", "10×6_3×18");
    driver.click_button("Sensor");
    wait_for_the_answer(&mut driver);
    assert!(!driver.says("cannot be told apart"));
    // Column nodes at 7.5, 12.5 and 17.5 mirror the rows about x = 12.5.
    driver.enter("First column node at x", "7.5");
    wait_for_the_answer(&mut driver);
    driver.assert_says("cannot be told apart");
    driver.choose("Rows", "Known");
    wait_for_the_answer(&mut driver);
    assert!(!driver.says("cannot be told apart"));
    assert!(driver.has("Most similar rows: the row is known"));
}

#[test]
fn noise_that_hides_everything_is_reported_with_a_remedy() {
    let mut driver = open();
    driver.enter("Relative noise", "0.1");
    wait_for_the_answer(&mut driver);
    let texts = driver.texts();
    let above = "Deformation patterns above the noise: ";
    let seen = texts.iter().find_map(|text| text.strip_prefix(above)).unwrap();
    let seen: usize = seen.strip_suffix(" of 10").unwrap().parse().unwrap();
    assert!((1..10).contains(&seen), "{seen}");
    assert!(driver.says(&format!("The noise hides {} of 10 deformation patterns", 10 - seen)));
    driver.enter("Relative noise", "100");
    wait_for_the_answer(&mut driver);
    assert!(driver.says("the readings hardly constrain the deformation"));
    assert!(driver.says("reduce the height, widen the node pitch, or add column-wires"));
}

#[test]
fn sideways_movement_has_a_picture_for_each_axis() {
    let mut driver = open();
    driver.choose("Axes", "x, y, z");
    wait_for_the_answer(&mut driver);
    assert!(driver.has("Unknowns of a row: 30"));
    let along_z = driver.get("Worst-seen deformation of each row").value();
    driver.click_button("x");
    driver.settle();
    assert_ne!(driver.get("Worst-seen deformation of each row").value(), along_z);
    driver.enter("Array scale", "10x10_5x12");
    wait_for_the_answer(&mut driver);
    assert!(driver.says("a row has 30 unknowns but only 12 readings") || driver.says("A row has 30 unknowns"));
}

#[test]
fn pattern_and_sensitivity_are_saved_with_their_own_colours() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("identifiability.svg");
    let mut driver = open();
    driver.save("Surfaces, SVG", &path);
    let svg = std::fs::read_to_string(path).unwrap();
    let says = |text: &str| svg.matches(&format!(">{text}</text>")).count();
    assert_eq!(
        [says("Worst-seen deformation"), says("Sensitivity of each node")],
        [1, 1]
    );
    assert_eq!(
        [says("pattern"), says("1/mm")],
        [2, 1],
        "an axis and a key, a key from above"
    );
}

#[test]
fn a_recording_has_no_array_and_the_view_says_where_its_readings_are_studied() {
    let mut driver = Driver::open();
    driver.click_button("Recording");
    driver.click_button("Sensor");
    driver.settle();
    assert!(driver.says("For a recording, Study measures it") && !driver.has("Array scale"));
}
