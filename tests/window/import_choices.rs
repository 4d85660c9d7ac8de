//! Choices of an import are kept when a file is added or the files are read again.

use std::{fmt::Write as _, fs, path::Path};

use decoupler_core::dataset::SplitBy;
use decoupler_files::{export::RecipeFile, import::Plan};
use eframe::egui::{Event, Key, Modifiers, MouseWheelSource, MouseWheelUnit, TouchPhase, vec2};
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use tempfile::TempDir;

use crate::{
    driver::Driver,
    recordings::{opened, opened_text, recording, written},
};

/// The import as it is saved now.
fn saved_plan(driver: &mut Driver, folder: &TempDir) -> Plan {
    let path = folder.path().join("saved recipe.json");
    // A file of that name is asked about.
    let _ = fs::remove_file(&path);
    driver.save("Recipe, JSON", &path);
    RecipeFile::load_recording(&path).unwrap()
}

/// Changes the missing-cell markers, which reads the files again.
fn set_missing(driver: &mut Driver, text: &str) {
    driver.unfold_to("Filter", "Missing cells");
    driver.enter("Missing cells", text);
    driver.wait("the files", |driver| !driver.says("Reading "));
    driver.wait("the samples", |driver| driver.says("Test: "));
    driver.settle();
}

/// Picks an option of the layout of text.
fn set_layout(driver: &mut Driver, field: &str, option: &str) {
    driver.unfold_to("File format", field);
    driver.click(field);
    driver.click_button(option);
    driver.wait("the files", |driver| !driver.says("Reading "));
    driver.settle();
}

fn meaning(driver: &Driver, column: &str) -> Option<String> {
    driver.get(&format!("Meaning of {column}")).accesskit_node().value()
}

fn sensor_and_states(rows: usize) -> (String, String) {
    let (mut sensor, mut states) = (String::new(), String::new());
    for row in 0..rows {
        let t = 1000.0 + 0.05 * row as f64;
        let x = (row % 20) as f64;
        writeln!(sensor, "{t:.3},{:.3},{:.3},{:.3}", 0.5 * x, x * x / 20.0, row % 7).unwrap();
        writeln!(states, "{:.3},{x},{}", t + 0.004, row % 4).unwrap();
    }
    (sensor, states)
}

#[test]
fn the_limit_of_a_join_and_units_survive_other_files_missing_cells_and_layouts() {
    let folder = tempfile::tempdir().unwrap();
    let (sensor, states) = sensor_and_states(80);
    let sensor = written(&folder, "sensor.csv", &sensor);
    let states = written(&folder, "states.csv", &states);
    let mut driver = Driver::open();
    // Alone, the column has no stem in front.
    driver.open_recordings(&[&states]);
    driver.enter("Unit of c2", "mm");
    driver.mean("c3", "unused");
    driver.drop_files(&[&sensor]);
    driver.wait("the join", |driver| driver.says("states.csv is joined by time"));
    driver.settle();
    assert_eq!(meaning(&driver, "states.c3").as_deref(), Some("unused"));
    driver.click("Joined files");
    driver.enter("Limit", "0.0045");
    driver.wait("the limit", |driver| driver.says("within 0.00450"));

    set_missing(&mut driver, "-1");
    driver.wait("the same limit", |driver| driver.says("within 0.00450"));
    set_layout(&mut driver, "Decimal", "point");
    driver.wait("the same limit", |driver| driver.says("within 0.00450"));
    let third = written(&folder, "third.csv", &sensor_and_states(80).1);
    driver.drop_files(&[&third]);
    driver.wait("the third file", |driver| driver.says("third.csv is joined by time"));
    driver.settle();
    driver.assert_says("states.csv is joined by time within 0.00450");
    let plan = saved_plan(&mut driver, &folder);
    let of_states = plan.import.join.iter().find(|joined| joined.file == states).unwrap();
    assert_eq!(of_states.limit, Some(0.0045));
    assert_eq!(plan.import.units.get("states.c2").map(String::as_str), Some("mm"));
    assert!(!plan.import.targets.contains(&"states.c3".to_owned()));
}

#[test]
fn conditions_name_their_columns_even_if_another_file_comes_first() {
    let folder = tempfile::tempdir().unwrap();
    let (sensor, states) = sensor_and_states(80);
    let sensor = written(&folder, "sensor.csv", &sensor);
    let states = written(&folder, "states.csv", &states);
    let mut driver = Driver::open();
    driver.open_recordings(&[&states]);
    driver.unfold_to("Filter", "Only rows with");
    driver.enter("Only rows with", "c3<3 and c2 >= 1");
    driver.enter("Missing cells", "-1, c2=99");
    driver.wait("the samples", |driver| driver.says("c3<3"));
    driver.drop_files(&[&sensor]);
    driver.wait("the join", |driver| driver.says("states.csv is joined by time"));
    driver.settle();
    let plan = saved_plan(&mut driver, &folder);
    assert_eq!(plan.import.conditions[0].to_string(), "states.c3<3 and states.c2>=1");
    let missing: Vec<String> = plan.import.missing.iter().map(ToString::to_string).collect();
    assert_eq!(missing, ["-1", "states.c2=99"]);
}

/// Rows of five sessions and two columns that could be groups.
fn sessions() -> String {
    let mut text = "session,block,u,v,force (N)\n".to_owned();
    for row in 0..50 {
        let (u, v) = (f64::from(row % 7), f64::from(row % 5));
        writeln!(text, "s{},b{},{u},{v},{}", row / 10, row / 5, u + 2.0 * v).unwrap();
    }
    text
}

#[test]
fn a_split_and_its_shares_are_kept_if_a_column_is_a_group() {
    let (mut driver, _path, folder) = opened_text(&sessions());
    driver.assert_says("group, 20 % test");
    driver.unfold_to("Samples", "Test share");
    driver.choose("Split by", "time");
    driver.enter("Test share", "30");
    driver.enter("Validation share", "25");
    driver.settle();
    assert!(driver.says("time, 30 % test"));
    set_missing(&mut driver, "-1");
    set_layout(&mut driver, "Separator", "comma");
    driver.assert_says("time, 30 % test");
    let division = saved_plan(&mut driver, &folder).division;
    assert_eq!((division.by, division.test_fraction), (SplitBy::Time, 0.3));
    assert_eq!(division.validation_fraction, Some(0.25));
}

#[test]
fn the_last_chosen_group_applies_and_a_wrong_layout_loses_no_choices() {
    let (mut driver, _path, folder) = opened_text(&sessions());
    driver.mean("session", "unused");
    driver.mean("v", "group");
    driver.mean("block", "group");
    driver.mean("u", "unused");
    // A single column of text, which cannot be used.
    set_layout(&mut driver, "Separator", "tab");
    assert!(!driver.has("Meaning of block"));
    set_layout(&mut driver, "Separator", "comma");
    for (column, expected) in [("session", "unused"), ("block", "group"), ("u", "unused")] {
        assert_eq!(meaning(&driver, column).as_deref(), Some(expected), "{column}");
    }
    assert_ne!(meaning(&driver, "v").as_deref(), Some("group"));
    driver.mean("v", "input");
    let plan = saved_plan(&mut driver, &folder);
    assert_eq!(plan.division.by, SplitBy::Group);
    assert_eq!(plan.import.group.as_deref(), Some("block"));
}

fn choose_test_file(driver: &mut Driver, path: &Path) {
    if !driver.has("Test file…") {
        driver.unfold_to("Samples", "Test share");
    }
    driver.open_form("Test file…");
    driver.type_into("File", &path.display().to_string());
    driver.click_button("Open");
    driver.settle();
}

#[test]
fn selected_columns_get_a_meaning_together() {
    let mut text = "a,b,c,d,e,f,force (N)\n".to_owned();
    for row in 0..40 {
        let cells = (0..7).map(|column| ((row * (column + 3) + column) % 11).to_string());
        text += &(Vec::from_iter(cells).join(",") + "\n");
    }
    let (mut driver, _path, _folder) = opened_text(&text);
    let select = |driver: &mut Driver, name: &str, held: Modifiers| {
        let harness = driver.harness();
        harness.get_by_label(&format!("Select {name}")).click_modifiers(held);
        harness.run_steps(3);
        driver.settle();
    };
    let all = |driver: &Driver| ["a", "b", "c", "d", "e", "f"].map(|name| meaning(driver, name).unwrap());
    // A range, and one more.
    select(&mut driver, "b", Modifiers::NONE);
    select(&mut driver, "d", Modifiers::SHIFT);
    select(&mut driver, "f", Modifiers::COMMAND);
    driver.mean("c", "target");
    assert_eq!(all(&driver), ["input", "target", "target", "target", "input", "target"]);
    // A meaning that only one column can have is not given to all.
    driver.mean("f", "group");
    assert_eq!(all(&driver), ["input", "target", "target", "target", "input", "group"]);
    // A column that is not selected changes alone.
    driver.mean("a", "unused");
    assert_eq!(all(&driver), ["unused", "target", "target", "target", "input", "group"]);
    // By the keyboard.
    driver.get("Select a").focus();
    driver.settle();
    driver.press(Key::Space);
    driver.get("Select b").focus();
    driver.settle();
    driver.press_with(Modifiers::SHIFT, Key::Space);
    driver.settle();
    driver.mean("b", "input");
    assert_eq!(all(&driver), ["input", "input", "target", "target", "input", "group"]);
}

#[test]
fn another_test_file_replaces_the_first() {
    let (mut driver, path, folder) = opened(60);
    let [one, other] =
        [("one.csv", 30), ("other.csv", 20)].map(|(name, rows)| written(&folder, name, &recording(rows)));
    choose_test_file(&mut driver, &one);
    driver.wait("its samples", |driver| driver.has("Test: 30"));
    choose_test_file(&mut driver, &other);
    driver.wait("its samples", |driver| driver.has("Test: 20"));
    assert!(
        driver.has("other.csv, for the test") && !driver.says("one.csv"),
        "{:#?}",
        driver.texts()
    );
    set_missing(&mut driver, "-1");
    assert!(driver.has("Test: 20"));
    // Training samples cannot test anything.
    choose_test_file(&mut driver, &path);
    driver.assert_says("press.csv is trained on");
    assert!(driver.has("other.csv, for the test"), "the previous one stays");
}

#[test]
fn joined_recordings_and_their_files_for_the_test_are_opened_together() {
    let folder = tempfile::tempdir().unwrap();
    let files = [(80, ""), (30, "_test")].map(|(rows, end)| {
        let (sensor, states) = sensor_and_states(rows);
        let file = |name: &str, text: &str| written(&folder, &format!("{name}{end}.csv"), text);
        [file("sensor", &sensor), file("states", &states)]
    });
    let mut driver = Driver::open();
    driver.open_recordings(&Vec::from_iter(files.iter().flatten().map(|path| path.as_path())));
    driver.assert_has("Test: 30");
    driver.click("Close states_test.csv");
    driver.wait("a share for the test", |driver| driver.has("Test: 16"));
}

#[test]
fn a_unit_takes_effect_when_its_row_scrolls_out_of_view() {
    let mut text = (1..=120)
        .map(|column| format!("u{column}"))
        .collect::<Vec<_>>()
        .join(",")
        + ",force\n";
    for row in 0..12 {
        let cells: Vec<String> = (0..121)
            .map(|column| ((row * 7 + column * 3) % 11).to_string())
            .collect();
        text += &(cells.join(",") + "\n");
    }
    let (mut driver, _path, folder) = opened_text(&text);
    driver.type_into("Unit of u3", "m V");
    let over = driver.get("Meaning of u3").rect().center();
    let harness = driver.harness();
    harness.event(Event::PointerMoved(over));
    for _ in 0..5 {
        harness.event(Event::MouseWheel {
            unit: MouseWheelUnit::Point,
            delta: vec2(0.0, -400.0),
            phase: TouchPhase::Move,
            source: MouseWheelSource::Wheel,
            modifiers: Modifiers::NONE,
        });
        harness.run_steps(4);
    }
    assert!(driver.harness().query_by_label("Unit of u3").is_none(), "out of view");
    let plan = saved_plan(&mut driver, &folder);
    assert_eq!(plan.import.units.get("u3").map(String::as_str), Some("m V"));
}
