//! Surfaces of own data: targets that have positions on the skin, actual and decoded, and what is said where there are none.

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use decoupler::{app::Notice, export::RecipeFile};
use eframe::egui::vec2;
use egui_kittest::kittest::NodeT as _;
use tempfile::TempDir;

use crate::{
    driver::Driver,
    recordings::{opened, recording, written},
};

/// Two readings of a press on 2 × 3 taxels, and the force.
fn skin(folder: &TempDir) -> PathBuf {
    let mut text = "time (s),u1 (V),u2 (V),d1 (mm),d2 (mm),d3 (mm),d4 (mm),d5 (mm),d6 (mm),force (N)\n".to_owned();
    for row in 0..60 {
        let t = f64::from(row);
        let (u, v) = ((0.37 * t).sin(), (0.23 * t).cos());
        write!(text, "{},{u:.6},{v:.6}", 0.1 * t).unwrap();
        for taxel in 0..6 {
            write!(text, ",{:.6}", 1.0 + 0.1 * f64::from(taxel) * u + 0.2 * v).unwrap();
        }
        writeln!(text, ",{:.6}", 10.0 * u).unwrap();
    }
    written(folder, "skin.csv", &text)
}

/// Positions of the taxels in an order of their own.
const GRID: &str = "target,x,y\nd6,4,10\nd1,0,0\nd2,0,5\nd4,4,0\nd3,0,10\nd5,4,5\n";

/// What a surface tells assistive technology: the range of its nodes.
#[track_caller]
fn range(driver: &Driver, surface: &str) -> String {
    let label = format!("{surface} surface of the sample");
    driver.get(&label).accesskit_node().value().unwrap_or_default()
}

fn give_targets(driver: &mut Driver) {
    for target in ["d1", "d2", "d3", "d4", "d5", "d6", "force"] {
        let label = format!("Meaning of {target}");
        if driver.get(&label).accesskit_node().value().as_deref() != Some("target") {
            driver.mean(target, "target");
        }
    }
}

/// Trains on a skin whose targets have positions, of which the window says this, until the surfaces are there.
fn with_surfaces(files: [&Path; 2], positions: &str) -> Driver {
    let mut driver = Driver::open();
    driver.drop_files(&files);
    driver.wait("the columns", |driver| driver.has("Meaning of d6"));
    give_targets(&mut driver);
    driver.wait("the positions", |driver| driver.says(positions));
    driver.limit_epochs("3");
    driver.train_own_data();
    driver.wait("the surfaces", |driver| driver.has("Actual surface of the sample"));
    driver
}

#[test]
fn targets_with_positions_are_shown_as_surfaces_beside_the_other_charts() {
    let folder = tempfile::tempdir().unwrap();
    let (path, taxels) = (skin(&folder), written(&folder, "taxels.csv", GRID));
    let mut driver = with_surfaces([&path, &taxels], "6 targets have positions: a grid of 2 × 3");
    // The first of the last 12 samples: d1 is the lowest and d6 the highest, or the other way round.
    let of_sample = |row: f64| {
        let (u, v) = ((0.37 * row).sin(), (0.23 * row).cos());
        let ends = [1.0 + 0.2 * v, 1.0 + 0.5 * u + 0.2 * v];
        let [low, high] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        (low, high)
    };
    let told = |driver: &Driver| {
        let text = range(driver, "Actual");
        let numbers = text.strip_prefix("value ").unwrap().strip_suffix(" mm").unwrap();
        let (low, high) = numbers.split_once(" to ").unwrap();
        (low.parse::<f64>().unwrap(), high.parse::<f64>().unwrap())
    };
    let is_near = |one: (f64, f64), other: (f64, f64)| (one.0 - other.0).abs() < 5e-3 && (one.1 - other.1).abs() < 5e-3;
    assert!(
        is_near(told(&driver), of_sample(48.0)),
        "{:?} {:?}",
        told(&driver),
        of_sample(48.0)
    );
    assert!(range(&driver, "Decoded").starts_with("value "), "the network's");
    driver.enter("Test sample", "5");
    driver.settle();
    assert!(
        is_near(told(&driver), of_sample(52.0)),
        "{:?} {:?}",
        told(&driver),
        of_sample(52.0)
    );
    driver.click_button("Error");
    driver.settle();
    assert!(range(&driver, "Error").starts_with("error ") && driver.has("Colour scale of error (mm)"));
    assert!(driver.has("Colour scale of value (mm)"));
    let picture = folder.path().join("surfaces.svg");
    driver.save("Chart, SVG", &picture);
    assert!(
        matches!(driver.notice(), Some(Notice::Done(_))),
        "{:?}",
        driver.notice()
    );
    assert!(fs::read_to_string(&picture).unwrap().contains("value (mm)"));
    driver.click("Sample");
    driver.settle();
    assert!(
        driver.says("percent of the range of each target"),
        "the node plot is there too"
    );

    // The recipe keeps the file, and so does the network.
    let recipe = folder.path().join("recipe.json");
    driver.save("Recipe, JSON", &recipe);
    assert_eq!(
        RecipeFile::load(&recipe).unwrap().import.positions,
        Some(taxels.clone())
    );
    let saved = folder.path().join("network.json");
    driver.save("Network file, JSON", &saved);
    let mut other = Driver::open();
    other.drop_files(&[&saved]);
    other.wait("its surfaces", |driver| driver.has("Actual surface of the sample"));
}

#[test]
fn scattered_positions_have_surfaces_that_end_where_they_end() {
    let folder = tempfile::tempdir().unwrap();
    // A hexagon around d6.
    let hexagon = "target,x,y\nd1,5,0\nd2,2.5,4.33\nd3,-2.5,4.33\nd4,-5,0\nd5,-2.5,-4.33\nd6,0,0\n";
    let (path, taxels) = (skin(&folder), written(&folder, "taxels.csv", hexagon));
    let mut driver = with_surfaces([&path, &taxels], "6 targets have positions, scattered over the skin");
    assert!(
        range(&driver, "Decoded").starts_with("value "),
        "{}",
        range(&driver, "Decoded")
    );
    driver.click("Top view");
    driver.settle();
    let picture = folder.path().join("surfaces.svg");
    driver.save("Chart, SVG", &picture);
    let svg = fs::read_to_string(&picture).unwrap();
    assert!(
        svg.contains("Between the nodes: thin-plate spline"),
        "{:#?}",
        driver.texts()
    );
}

#[test]
fn positions_on_an_oblique_line_or_wrong_say_so_and_are_closed_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = skin(&folder);
    let oblique = written(&folder, "oblique.csv", "target,x,y\nd1,0,0\nd2,3,1\nd3,6,2\n");
    let wrong = written(&folder, "wrong.csv", "target,x,y\nd1,0,0\nd9,4,0\n");
    let mut driver = Driver::open();
    driver.drop_files(&[&path]);
    driver.wait("the columns", |driver| driver.has("Meaning of d6"));
    give_targets(&mut driver);
    driver.drop_files(&[&oblique]);
    driver.wait("the positions", |driver| {
        driver.says("3 targets have positions, scattered over the skin")
    });
    driver.limit_epochs("2");
    driver.train_own_data();
    driver.wait("all targets of a sample", |driver| {
        driver.says("percent of the range of each target")
    });
    driver.click("Surfaces");
    driver.settle();
    assert!(driver.says("No surface goes through the positions of the targets: all nodes are on one line"));
    assert!(driver.says("The chart “Sample” shows all targets."));

    // Another file, by its path.
    driver.click("Positions");
    driver.open_form("Type the path of the positions");
    driver.type_into("File", &wrong.display().to_string());
    driver.click_button("Open");
    driver.wait("the reason", |driver| driver.says("line 3: there is no target 'd9'"));
    driver.click_button("Close wrong.csv");
    driver.wait("the import without them", |driver| {
        driver.says("Test: 12") && !driver.says("no target 'd9'")
    });
    assert!(!driver.says("wrong.csv") && !driver.says("have positions"));
}

#[test]
fn positions_without_a_recording_say_what_to_open_first() {
    let folder = tempfile::tempdir().unwrap();
    let taxels = written(&folder, "taxels.csv", GRID);
    let mut driver = Driver::open();
    driver.drop_files(&[&taxels]);
    driver.wait("the notice", |driver| {
        matches!(driver.notice(), Some(Notice::Failed(_)))
    });
    assert!(
        driver.says("has positions of targets: open their recording first"),
        "{:#?}",
        driver.texts()
    );

    // Networks without positions have the charts that they had.
    let (mut driver, _path, _folder) = opened(40);
    driver.limit_epochs("2");
    driver.train_own_data();
    driver.wait("the map", |driver| driver.has("Error over the position"));
    assert!(!driver.has("Surfaces"));
}

#[test]
fn the_notes_of_a_square_plot_have_room_in_any_window() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, "press.csv", &recording(40));
    for size in [vec2(1440.0, 900.0), vec2(1440.0, 760.0), vec2(1024.0, 700.0)] {
        let mut driver = Driver::open_sized(size);
        driver.open_recordings(&[&path]);
        driver.limit_epochs("2");
        driver.train_own_data();
        driver.click("Regression");
        driver.settle();
        let places = driver.places();
        let (text, place) = places.iter().find(|(text, _)| text.starts_with("Fitted line")).unwrap();
        assert!(place.height() < 40.0, "at {size}, '{text}' is at {place:?}");
    }
}
