//! Inspecting errors: the item under the pointer lights up everywhere; sections, colours and scales.

use decoupler_files::figure::SequentialMap;
use eframe::egui::{Key, Pos2, accesskit::Role, pos2, vec2};
use egui_kittest::kittest::{By, NodeT as _, Queryable as _};

use crate::driver::Driver;

/// The window with the small network trained.
fn trained() -> Driver {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_last_epoch();
    driver.settle();
    driver
}

fn lit(driver: &Driver) -> Option<usize> {
    driver.views().train.lights.node
}

/// Returns the description of the picture with this label.
fn description(driver: &mut Driver, role: Role, part: &str) -> String {
    let by = By::new().role(role);
    let nodes = driver.harness().get_all(by);
    let found = nodes
        .filter(|node| node.accesskit_node().label().unwrap_or_default().contains(part))
        .find_map(|node| node.accesskit_node().description());
    found.unwrap_or_else(|| panic!("nothing describes {part}"))
}

/// Moves the pointer over a place in small steps until a node is lit.
fn hover_a_node(driver: &mut Driver, from: Pos2, step: eframe::egui::Vec2, count: usize) -> Option<(usize, Pos2)> {
    (0..count).find_map(|number| {
        let at = from + step * number as f32;
        driver.harness().hover_at(at);
        driver.harness().run_steps(2);
        lit(driver).map(|node| (node, at))
    })
}

fn plot_place(driver: &mut Driver, part: &str) -> eframe::egui::Rect {
    let by = By::new().role(Role::Image);
    let nodes = driver.harness().get_all(by);
    let mut found = nodes.filter(|node| node.accesskit_node().label().unwrap_or_default().contains(part));
    found.next().unwrap_or_else(|| panic!("no {part}")).rect()
}

#[test]
fn a_node_lit_on_a_surface_is_lit_in_the_charts_and_the_readings() {
    let mut driver = trained();
    driver.click("Top view");
    let surface = driver.get("Decoded surface").rect();
    let found = hover_a_node(&mut driver, surface.center() - vec2(60.0, 0.0), vec2(3.0, 2.0), 40);
    let (node, _) = found.expect("a node under the pointer");
    for (tab, halo) in [("Nodes", "1 point of lit"), ("Regression", "lit: ")] {
        driver.show_chart(tab);
        let place = driver.get("Decoded surface").rect();
        let again = hover_a_node(&mut driver, place.center() - vec2(60.0, 0.0), vec2(3.0, 2.0), 40);
        assert!(again.is_some(), "{tab}");
        let text = description(&mut driver, Role::Image, "z (mm)");
        let has_halo = text.contains(halo) || text.contains("points of lit");
        assert!(has_halo, "{tab}: {text}");
    }
    let _ = node;
}

#[test]
fn a_node_pointed_at_in_a_chart_is_lit_on_the_surfaces() {
    let mut driver = trained();
    driver.show_chart("Nodes");
    driver.settle();
    let plot = plot_place(&mut driver, "z (mm) against node");
    let drawn = driver.views().train.drawing().unwrap();
    let (nodes, count) = (drawn.actual.nodes.len(), 60);
    assert_eq!(nodes, count, "10 × 6");
    // Across the plot at all heights: the path crosses some points, and gaps between them.
    let mut found = Vec::new();
    for row in (1..20).step_by(2) {
        let y = plot.top() + plot.height() * row as f32 / 20.0;
        for column in 8..36 {
            driver
                .harness()
                .hover_at(pos2(plot.left() + plot.width() * column as f32 / 40.0, y));
            driver.harness().run_steps(2);
            found.push(lit(&driver));
        }
    }
    let nodes_lit = found.iter().flatten().count();
    assert!(nodes_lit > 5, "{nodes_lit} of {}", found.len());
    assert!(found.iter().flatten().all(|node| *node < nodes));
    assert!(found.contains(&None), "between the points nothing is lit");
    // From the left to the right of the plot the nodes follow each other.
    let halves = found
        .chunks(28)
        .flat_map(|row| [(&row[..10], 0..30), (&row[18..], 30..60)]);
    for (half, expected) in halves {
        assert!(half.iter().flatten().all(|node| expected.contains(node)), "{half:?}");
    }
}

#[test]
fn a_section_follows_keys_clicks_and_the_readings_and_is_exported() {
    let mut driver = trained();
    driver.click("Section");
    driver.settle();
    let words = |driver: &mut Driver| description(driver, Role::Image, "along ");
    let first = words(&mut driver);
    assert!(first.contains("y along row-wire 6 (mm): actual from"), "{first}");
    assert!(first.contains("; decoded from "), "{first}");
    driver.press(Key::CloseBracket);
    assert!(words(&mut driver).contains("row-wire 7"));
    driver.press(Key::OpenBracket);
    driver.press(Key::OpenBracket);
    assert!(words(&mut driver).contains("row-wire 5"));
    driver.enter("Wire of the section", "4");
    assert!(words(&mut driver).contains("row-wire 4"));
    driver.press(Key::Backslash);
    assert!(words(&mut driver).contains("x along column-wire"));
    driver.click_button("Row-wire");
    // A click on the map of readings chooses its wires: the last row.
    driver.act("Chart: Readings");
    let readings = driver.get("Readings of the actual surface").rect();
    driver.harness().drag_at(readings.left_bottom() + vec2(12.0, -4.0));
    driver.harness().drop_at(readings.left_bottom() + vec2(12.0, -4.0));
    driver.harness().run_steps(3);
    assert!(words(&mut driver).contains("row-wire 10"), "{}", words(&mut driver));
    // A click on the surface from above chooses the nearest wire: the middle of ten.
    driver.click("Top view");
    let surface = driver.get("Decoded surface").rect();
    driver.harness().drag_at(surface.center());
    driver.harness().drop_at(surface.center());
    driver.harness().run_steps(3);
    let clicked = words(&mut driver);
    assert!(
        ["row-wire 5", "row-wire 6"].iter().any(|wire| clicked.contains(wire)),
        "{clicked}"
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("section.svg");
    driver.save("Chart, SVG", &path);
    let svg = std::fs::read_to_string(&path).unwrap();
    assert!(svg.contains("along row-wire") && svg.contains("beyond the nodes"));
}

#[test]
fn colours_and_scales_are_chosen_at_the_bar_and_colours_are_remembered() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("window.json");
    let mut driver = Driver::open_remembering(&path);
    driver.click("Colour scale of z (mm)");
    driver.click("Cividis");
    driver.settle();
    assert_eq!(driver.state().look.colours, SequentialMap::Cividis);
    let value = |driver: &Driver, label: &str| driver.get(label).accesskit_node().value().unwrap();
    assert_eq!(value(&driver, "Colour scale of z (mm)"), "4.00 to 5.00");
    driver.click("Colour scale of z (mm)");
    driver.click("Locked");
    driver.settle();
    driver.press(Key::Escape);
    assert_ne!(value(&driver, "Colour scale of z (mm)"), "4.00 to 5.00");
    driver.click("Colour scale of z (mm)");
    driver.click("Locked");
    driver.settle();
    driver.press(Key::Escape);
    driver.settle();
    assert_eq!(value(&driver, "Colour scale of z (mm)"), "4.00 to 5.00");
    driver.configure_small();
    driver.train();
    driver.click_button("Error");
    driver.settle();
    let free = value(&driver, "Colour scale of error (mm)");
    driver.press(Key::PageDown);
    driver.settle();
    let next = value(&driver, "Colour scale of error (mm)");
    assert_ne!(free, next, "it fits each snapshot");
    driver.click("Colour scale of error (mm)");
    driver.click("Locked");
    driver.settle();
    driver.press(Key::Escape);
    driver.press(Key::PageUp);
    driver.settle();
    assert_eq!(value(&driver, "Colour scale of error (mm)"), next, "locked");
    drop(driver);
    let driver = Driver::open_remembering(&path);
    assert_eq!(driver.state().look.colours, SequentialMap::Cividis);
}

#[test]
fn a_right_click_copies_and_exports_what_the_view_shows() {
    let mut driver = trained();
    let cell = driver
        .table()
        .into_iter()
        .find(|cell| cell.starts_with("network, Z %"))
        .unwrap();
    driver.right_click(&cell);
    let table = driver.click_and_copy("Copy error table");
    assert!(table.lines().any(|line| line.starts_with("network\t")), "{table}");
    driver.right_click(&cell);
    driver.click("Export error table…");
    assert!(driver.has("Export data"));
}

#[test]
fn a_picture_is_copied_from_its_card() {
    let mut driver = trained();
    driver.right_click("Decoded surface");
    driver.click("Copy surfaces");
    driver.wait("the picture", |driver| driver.says("Copied the surfaces as a picture"));
}
