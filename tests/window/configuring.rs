//! Configuring the next training.

use decoupler::window::Effect;
use decoupler_core::{
    evaluation::{Run, RunSettings},
    sensor::ArrayScale,
    training::Method,
};
use eframe::egui::{Key, Modifiers, accesskit::Role, vec2};
use egui_kittest::kittest::NodeT as _;

use crate::{
    driver::{Driver, small, table_of},
    every_view::CONTROLS,
};

#[test]
fn the_window_opens_on_the_papers_array_with_a_surface_and_says_what_to_do() {
    let mut driver = Driver::open();
    driver.settle();
    assert_eq!(driver.state().draft, RunSettings::default());
    assert!(driver.has("Ready: press Train"));
    assert!(driver.is_enabled("▶ Train"));
    assert!(!driver.has("■ Stop") && !driver.has("⏸ Pause"), "nothing runs");
    let surface = driver.get("Actual surface").accesskit_node();
    assert_eq!(surface.role(), Role::Image);
    let value = surface.value().unwrap();
    // Nodes rest at 5 mm and are pressed by up to a fifth of that.
    let numbers: Vec<f64> = value.split(' ').filter_map(|word| word.parse().ok()).collect();
    assert!(
        matches!(numbers[..], [low, high] if (4.0..4.2).contains(&low) && (4.8..=5.0).contains(&high)),
        "{value}"
    );
    assert!(driver.says("1 of 10"), "100 test samples are 10 snapshots of 10 rows");
    assert!(!driver.has("Decoded surface") && !driver.has("Train longer"));
}

#[test]
fn the_baselines_are_shown_before_a_training() {
    let mut driver = Driver::open();
    let has_baselines =
        |driver: &Driver| matches!(&driver.state().preview, Some(preview) if preview.baselines.is_some());
    driver.wait("the baselines", has_baselines);
    let pending = |driver: &Driver| -> Vec<String> {
        let run = Run::prepare(driver.state().draft).unwrap();
        let blank = |cell: String| match cell.split_once(": ") {
            Some((name, _)) if cell.starts_with("network") => format!("{name}: –"),
            _ => cell,
        };
        table_of(&run).into_iter().map(blank).collect()
    };
    let expected = pending(&driver);
    assert_eq!(driver.table()[..expected.len()], expected);
    assert!(driver.has("Published") && driver.says("Press Train to fill in the network's row"));
    driver.open_menu();
    assert!(!driver.is_enabled("Network…"));
    driver.get("Network…").hover();
    driver.wait("the reason", |driver| driver.says("Nothing is trained yet"));
    driver.press(eframe::egui::Key::Escape);

    // Other samples to train on, the same to test on.
    driver.enter("Training samples", "200");
    // The paper has no figures for 200 samples.
    let expected = pending(&driver);
    driver.wait("the new baselines", |driver| driver.table() == expected);
}

#[test]
fn rules_of_thumb_are_shown_in_plain_words() {
    let mut driver = Driver::open();
    assert!(driver.has("Rules of thumb: 5, or 9 to 18"));
    assert!(driver.has("30 inputs, 20 outputs, 632 weights"));
    assert!(!driver.says("Eq. (12)"));
    driver.get("Rules of thumb: 5, or 9 to 18").hover();
    driver.wait("the equations", |driver| {
        driver.says("(Eq. 12)") && driver.says("(Eq. 13)")
    });
}

#[test]
fn presets_set_the_array_and_its_surface_follows() {
    let mut driver = Driver::open();
    for scale in ArrayScale::PRESETS {
        driver.choose("Paper's array", &scale.to_string());
        assert_eq!(driver.simulation().sensor.scale, scale);
        assert_eq!(driver.get("Array scale").value(), Some(scale.to_string()));
        driver.wait("its surface", |driver| {
            let drawn = driver.views().train.drawing();
            drawn.is_some_and(|drawn| drawn.actual.nodes.len() == scale.rows() * scale.nodes_per_row())
        });
    }
    driver.settle();
}

#[test]
fn any_array_can_be_typed_and_an_invalid_one_is_explained_and_rejected() {
    let mut driver = Driver::open();
    driver.enter("Array scale", "4x5_2x16");
    let scale = driver.simulation().sensor.scale;
    assert_eq!(scale.to_string(), "4×5_2×16");
    assert!(driver.says("4 row-wires of 5 nodes over 16 column-wires of 2 nodes"));
    assert!(
        driver.says("more than the 3·M2 = 15"),
        "departing from the paper's rule is noted"
    );
    for (wrong, reason) in [
        ("10x6", "'10x6' is not an array scale: write M1xM2_M3xM4"),
        (
            "0x6_3x18",
            "the number of row-wires (M1) is 0: it must be from 1 to 512",
        ),
        ("4x5_2x9999", "column-wires (M4) is 9999"),
    ] {
        driver.enter("Array scale", wrong);
        assert_eq!(driver.simulation().sensor.scale, scale, "{wrong}");
        driver.assert_says(reason);
        assert_eq!(
            driver.get("Array scale").value(),
            Some(scale.to_string()),
            "the old one stays"
        );
        let described = driver.get("Array scale").accesskit_node().description();
        assert!(
            described.is_some_and(|text| text.contains(reason)),
            "it is read out with the field"
        );
    }
    driver.enter("Array scale", "4x5_2x15");
    assert_eq!(driver.get("Array scale").value().as_deref(), Some("4×5_2×15"));
    assert!(!driver.says("is not an array scale") && !driver.says("3·M2 = 15"));
    driver.settle();
}

#[test]
fn a_method_shows_only_its_own_settings() {
    let mut driver = Driver::open();
    let damping = ["Mu", "Mu decrease", "Mu increase", "Largest mu"];
    let descent = ["Learning rate", "Momentum"];
    assert!(damping.iter().all(|name| driver.has(name)));
    assert!(!descent.iter().any(|name| driver.has(name)));
    choose_method(&mut driver, "Momentum, Eq. (11)");
    assert!(descent.iter().all(|name| driver.has(name)));
    assert!(!damping.iter().any(|name| driver.has(name)));
    assert_eq!(driver.state().draft.training.method.short_name(), "gdm");
    driver.enter("Learning rate", "0.25");
    choose_method(&mut driver, "Levenberg-Marquardt");
    assert_eq!(driver.state().draft.training.method, Method::default());
    driver.settle();
}

/// Picks a method from the list.
pub(crate) fn choose_method(driver: &mut Driver, name: &str) {
    driver.click("Method");
    driver.click_button(name);
}

#[test]
fn the_geometry_changes_the_surface_and_the_preset_brings_the_papers_settings_back() {
    let mut driver = Driver::open();
    driver.enter("Height", "8");
    driver.enter("Row pitch", "2.5");
    driver.enter("Resistivity", "1e3");
    driver.wait("the new surface", |driver| {
        driver
            .state()
            .skin()
            .is_some_and(|skin| skin.sensor == driver.simulation().sensor)
    });
    let x_mm: Vec<f64> = driver
        .views()
        .train
        .drawing()
        .unwrap()
        .actual
        .nodes
        .iter()
        .map(|node| node.x)
        .collect();
    assert!((x_mm[10] - x_mm[0] - 2.5).abs() < 1e-12, "rows are 2.5 mm apart");
    assert_eq!(driver.simulation().sensor.resistivity_ohm_per_mm, 1e3);
    assert!(
        driver.get("Actual surface").value().unwrap().contains("to 7.9")
            || driver.get("Actual surface").value().unwrap().contains("to 8")
    );
    driver.enter("Hidden nodes", "3");
    driver.choose("Preset", "Paper");
    assert_eq!(driver.state().draft, RunSettings::default());
    driver.settle();
}

#[test]
fn changing_the_settings_hides_old_results_and_changing_them_back_restores_them() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    let table = driver.table();
    assert!(!table.is_empty());
    driver.choose("Paper's array", "10×8_4×24");
    driver.wait("the other array's surface", |driver| driver.state().preview.is_some());
    let networks = driver.table().into_iter().filter(|cell| cell.starts_with("network, "));
    assert!(networks.into_iter().all(|cell| cell.ends_with('–')) && !driver.has("Decoded surface"));
    driver.choose("Paper's array", "10×6_3×18");
    assert_eq!(driver.table(), table);
    assert!(driver.has("Decoded surface"));

    // Faster than the worker draws the other array.
    assert!(driver.becomes_idle());
    let run = *driver.state().run.as_ref().unwrap().settings();
    let mut other = run;
    other.simulation_mut().unwrap().sensor.scale = ArrayScale::PRESETS[1];
    driver.window_mut().apply(Effect::Configure(Box::new(other)));
    driver.window_mut().apply(Effect::Configure(Box::new(run)));
    driver.wait_for_frame("the other array's surface");
    driver.settle();
    assert_eq!(driver.state().draft, small());
    assert_eq!(
        driver.table(),
        table,
        "the other array's surface came too late to be shown"
    );
}

#[test]
fn keys_start_a_training_and_step_through_the_snapshots() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.press(Key::PageDown);
    driver.press(Key::PageDown);
    driver.press(Key::PageUp);
    assert_eq!(driver.snapshot(), 1);
    assert!(driver.says("2 of 10"));
    driver.press_with(Modifiers::COMMAND, Key::Enter);
    driver.wait_for_end();
    assert_eq!(driver.snapshot(), 1, "training keeps the displayed snapshot");
    driver.settle();
}

#[test]
fn the_first_training_beats_the_linear_map() {
    let mut driver = Driver::open_first(vec2(1440.0, 900.0));
    driver.train();
    driver.settle();
    let praise = "times as accurate as the linear map";
    let texts = driver.texts();
    let text = texts.iter().find(|text| text.contains(praise));
    let text = text.unwrap_or_else(|| panic!("{texts:#?}"));
    // "On z 1.74 times as accurate…"
    let times = text.split(' ').find_map(|word| word.parse::<f64>().ok()).unwrap();
    assert!(times > 1.5, "{text}");
}

#[test]
fn the_train_view_has_few_controls() {
    let count = |driver: &mut Driver| {
        let nodes = driver.harness().root().children_recursive();
        nodes
            .filter(|node| CONTROLS.contains(&node.accesskit_node().role()))
            .count()
    };
    let mut driver = Driver::open_first(vec2(1440.0, 900.0));
    driver.settle();
    let visible = count(&mut driver);
    for part in ["Scene", "Samples", "Advanced"] {
        driver.click(part);
    }
    driver.settle();
    let folded = count(&mut driver) - visible;
    assert!(visible <= 30 && folded <= 20, "{visible} visible, {folded} folded");
}
