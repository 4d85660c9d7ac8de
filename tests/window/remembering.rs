//! The state that the window restores when it next opens.

use std::{fs, path::PathBuf};

use decoupler_core::{
    evaluation::RunSettings,
    scene::{Loading, Noise},
};

use eframe::egui::{Pos2, Vec2, vec2};

use crate::driver::{Driver, small};

/// Returns a file that does not exist yet, in a temporary folder.
fn file() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data").join("window.json");
    (folder, path)
}

/// The paper's settings except for loading and noise.
fn is_a_print(settings: &RunSettings) -> bool {
    let mut papers = *settings;
    let scene = &mut papers.simulation_mut().unwrap().scene;
    (scene.loading, scene.noise) = (Loading::RandomNodes, Noise::default());
    papers == RunSettings::default() && matches!(settings.simulation().unwrap().scene.loading, Loading::Indenter(_))
}

#[test]
fn theme_view_and_settings_are_restored_and_nothing_is_trained() {
    let (_folder, path) = file();
    let mut driver = Driver::open_remembering(&path);
    assert!(is_a_print(&driver.state().draft), "the first start");
    assert!(driver.state().look.is_dark && driver.shown() == "Train");
    driver.configure_small();
    driver.act("Light theme");
    driver.click_button("Compare");
    assert_eq!(driver.shown(), "Compare");
    drop(driver);
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains("\"view\": \"Compare\""), "{text}");

    let driver = Driver::open_remembering(&path);
    assert_eq!(driver.state().draft, small());
    assert_eq!(driver.shown(), "Compare");
    assert!(!driver.state().look.is_dark);
    assert!(driver.says("Ready: press Train"));
    assert!(driver.state().run.is_none());
}

#[test]
fn files_of_earlier_versions_and_other_programs_open_and_a_damaged_one_is_reported_and_replaced() {
    let (_folder, path) = file();
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let earlier = include_str!("../fixtures/version_0.1.0/data/window.json");
    let other = r#"{"is_dark": "no", "view": "Rocket", "draft": {"hidden": -1}}"#;
    let usual = RunSettings::default().training;
    for (text, epochs) in [(earlier, 1_000_000), (other, usual.stopping.epochs)] {
        fs::write(&path, text).unwrap();
        let driver = Driver::open_remembering(&path);
        let mut draft = driver.state().draft;
        assert_eq!(draft.training.stopping.epochs, epochs);
        draft.training = usual;
        assert!(is_a_print(&draft) && driver.notice().is_none());
        assert!(text == earlier || driver.state().look.is_dark && driver.shown() == "Train");
    }
    for text in [r#"{"is_dark": false, "view": "Comp"#, "", "\u{0}"] {
        fs::write(&path, text).unwrap();
        let mut driver = Driver::open_remembering(&path);
        let notice = format!("'{}' is damaged", path.display());
        driver.assert_says(&notice);
        driver.wait("another file", |_| fs::read_to_string(&path).unwrap().len() > 100);
        drop(driver);
        assert!(Driver::open_remembering(&path).notice().is_none());
    }
}

#[test]
fn an_unwritable_location_is_reported_once() {
    let (folder, path) = file();
    // A file where the folder should be.
    fs::write(folder.path().join("data"), "").unwrap();
    let mut driver = Driver::open_remembering(&path);
    driver.wait("the reason", |driver| driver.says("will not be restored"));
    driver.click("Dismiss");
    driver.act("Light theme");
    driver.settle();
    assert_eq!(driver.notice(), None);
}

#[test]
fn a_window_that_remembers_becomes_idle() {
    let (_folder, path) = file();
    drop(Driver::open_remembering(&path));
    let mut driver = Driver::open_remembering(&path);
    driver.wait("the last events", |driver| !driver.table().is_empty());
    assert!(driver.becomes_idle());
}

/// Returns the edges of the columns on the left and on the right.
fn edges(driver: &Driver) -> [Pos2; 2] {
    let places = driver.places().into_iter();
    let edges = places.filter(|(label, _)| label == "Resize panel");
    let mut edges = Vec::from_iter(edges.map(|(_, edge)| edge.center()));
    edges.sort_by(|one, other| one.x.total_cmp(&other.x));
    edges.try_into().unwrap()
}

/// Drags an edge of a column by this many points.
fn drag(driver: &mut Driver, from: Pos2, points: f32) {
    let harness = driver.harness();
    harness.drag_at(from);
    harness.step();
    harness.hover_at(from + vec2(points, 0.0));
    harness.run_steps(2);
    harness.drop_at(from + vec2(points, 0.0));
    harness.run_steps(2);
    harness.remove_cursor();
    harness.step();
}

/// Place and size of the middle of the Train view.
fn middle(driver: &Driver) -> (f32, Vec2) {
    let left = driver.get("Actual surface").rect();
    (left.left(), left.size())
}

#[test]
fn dragged_column_widths_are_remembered() {
    let (_folder, path) = file();
    // Wide enough for two columns.
    let wide = vec2(1800.0, 900.0);
    let mut driver = Driver::open_remembering(&path);
    driver.harness().set_size(wide);
    driver.settle();
    let usual = edges(&driver);
    drag(&mut driver, usual[0], 40.0);
    drag(&mut driver, usual[1], 30.0);
    let drawn = edges(&driver);
    assert!((drawn[0].x - usual[0].x - 40.0).abs() < 5.0, "{usual:?}, {drawn:?}");
    assert!((drawn[1].x - usual[1].x - 30.0).abs() < 5.0, "{usual:?}, {drawn:?}");
    assert!(driver.becomes_idle());
    let seen = middle(&driver);
    drop(driver);

    let mut driver = Driver::open_remembering(&path);
    driver.harness().set_size(wide);
    driver.settle();
    assert_eq!((edges(&driver), middle(&driver)), (drawn, seen));
    // No further than the surfaces allow.
    drag(&mut driver, drawn[0], 900.0);
    drag(&mut driver, drawn[1], -900.0);
    assert!(middle(&driver).1.x >= 280.0, "{:?}", middle(&driver));
    let [left, _] = edges(&driver);
    drag(&mut driver, left, -900.0);
    assert!(edges(&driver)[0].x >= 240.0, "{:?}", edges(&driver));
}
