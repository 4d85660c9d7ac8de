//! The first minute: the initial scene, the glossary, and empty views that fill on a click.

use decoupler_core::{
    evaluation::{Run, RunSettings},
    scene::Loading,
};
use decoupler_files::export::format_number;
use eframe::egui::{Key, vec2};

use crate::driver::Driver;

fn open_first() -> Driver {
    Driver::open_first(vec2(1440.0, 900.0))
}

/// Asserts that the displayed table contains the baselines computed by the library for `settings`.
#[track_caller]
fn shows_the_baselines_of(driver: &Driver, settings: RunSettings) {
    let run = Run::prepare(settings).unwrap();
    let baselines = run.baselines().unwrap();
    for (name, errors) in [("training mean", &baselines.mean), ("linear map", &baselines.linear)] {
        let errors = errors.nodes().unwrap();
        let cells = [
            format!("{name}, Z %: {}", format_number(errors.z_percent)),
            format!("{name}, mm: {}", format_number(errors.z_mm)),
        ];
        for cell in cells {
            assert!(driver.has(&cell), "{cell} in {:#?}", driver.table());
        }
    }
}

#[test]
fn the_window_opens_on_a_print_and_the_papers_scene_is_one_click_away() {
    let mut driver = open_first();
    driver.wait("the baselines", |driver| !driver.table().is_empty());
    let opened = driver.state().draft;
    assert!(matches!(
        opened.simulation().unwrap().scene.loading,
        Loading::Indenter(_)
    ));
    shows_the_baselines_of(&driver, opened);
    assert!(!driver.has("Published"), "the paper has no print");
    // A print: most of the surface is at rest, and the middle of it is pressed.
    let depths_mm = driver.views().train.drawing().unwrap().actual.nodes.iter();
    let depths_mm: Vec<f64> = depths_mm.map(|node| 5.0 - node.z).collect();
    let at_rest = depths_mm.iter().filter(|depth_mm| **depth_mm < 0.01).count();
    let deepest_mm = depths_mm.iter().copied().fold(0.0, f64::max);
    assert!(at_rest > 40 && deepest_mm > 0.2, "{at_rest} at rest, {deepest_mm} mm");

    driver.choose("Preset", "Paper");
    assert_eq!(driver.state().draft, RunSettings::default());
    driver.wait("the published errors", |driver| driver.has("Published"));
    shows_the_baselines_of(&driver, RunSettings::default());
    driver.choose("Preset", "Press demo");
    assert_eq!(driver.state().draft, opened);
}

#[test]
fn only_the_papers_own_network_is_announced_to_take_seconds() {
    const SAYS: &str = "The paper's network takes a few seconds";
    let mut driver = Driver::open();
    assert!(driver.says(SAYS));
    driver.enter("Array scale", "2x2_1x6");
    driver.wait("the small array", |driver| {
        let skin = driver.state().skin();
        skin.is_some_and(|skin| skin.sensor.scale.rows() == 2)
    });
    driver.settle();
    assert!(driver.says("Press Train to fill in") && !driver.says(SAYS));
}

#[test]
fn nouns_after_one_are_singular() {
    let mut driver = Driver::open();
    driver.enter("Array scale", "1x1_1x1");
    driver.assert_has("1 row-wire of 1 node over 1 column-wire of 1 node");
    driver.enter("Hidden nodes", "1");
    driver.act("Chart: Readings");
    driver.wait("its readings", |driver| driver.has("Readings of the actual surface"));
    let texts = driver.texts();
    let plural = |text: &&String| {
        let words: Vec<&str> = text.split_whitespace().collect();
        words.windows(2).any(|pair| {
            pair[0] == "1" && ["nodes", "rows", "row-wires", "column-wires", "unknowns", "equations"].contains(&pair[1])
        })
    };
    assert_eq!(texts.iter().find(plural), None);
}

#[test]
fn a_linear_map_that_beats_the_network_is_marked() {
    const MARK: &str = "Better than what is used.";
    let mut driver = Driver::open();
    driver.configure_small();
    driver.enter("Epochs", "1");
    driver.train();
    driver.settle();
    let result = *driver.state().result().unwrap().errors.nodes().unwrap();
    let linear = driver.state().run.as_ref().unwrap().baselines.linear.clone();
    let linear = *linear.nodes().unwrap();
    assert!(linear.z_mm < result.z_mm, "one epoch is too few");
    driver.assert_has(MARK);
    driver.enter("Epochs", "60");
    driver.enter("Hidden nodes", "10");
    driver.enter("Training samples", "1000");
    driver.train();
    driver.settle();
    let result = *driver.state().result().unwrap().errors.nodes().unwrap();
    assert!(result.z_mm < linear.z_mm);
    assert!(!driver.has(MARK));
}

#[test]
fn every_term_has_the_same_text_in_the_glossary_and_as_a_tooltip() {
    let mut driver = open_first();
    driver.wait("the baselines", |driver| !driver.table().is_empty());
    let place = driver.get("stroke %").rect().center();
    driver.harness().hover_at(place);
    driver.harness().run_steps(60);
    const DEFINITION: &str = "Mean |error| of z in percent of the full scale, the distance a node can travel.";
    const EQUATION: &str = "100 · mean(|decoded z − z|) / stroke";
    assert!(
        driver.says(DEFINITION) && driver.says(EQUATION),
        "under the pointer: {:#?}",
        driver.texts()
    );
    driver.harness().remove_cursor();
    driver.harness().run_steps(5);
    assert!(!driver.says(EQUATION));

    driver.press(Key::Questionmark);
    driver.click("Glossary");
    driver.type_into("Term", "stroke");
    assert!(driver.has(DEFINITION) && driver.has(EQUATION));
    driver.type_into("Term", "whitening");
    assert!(!driver.has(DEFINITION) && driver.has("component / √(σ² + noise²)"));
    driver.type_into("Term", "no such term");
    assert!(driver.has("No matches"));
    driver.press(Key::Escape);
    assert!(!driver.has("No matches"));
}

#[test]
fn about_has_the_version_and_the_licences_of_all_libraries() {
    let mut driver = open_first();
    driver.act("about");
    assert!(driver.has(concat!("Decoupler ", env!("CARGO_PKG_VERSION"))));
    driver.assert_says("Decoupler contains these libraries");
    driver.click("Glossary");
    assert!(!driver.says("Decoupler contains these libraries"));
}

#[test]
fn the_list_of_actions_finds_terms_too() {
    let mut driver = open_first();
    driver.act("pareto");
    driver.assert_says("no other is both faster and more accurate");
}

#[test]
fn compare_opens_on_the_last_two_runs() {
    let mut driver = Driver::open();
    driver.configure_small();
    for hidden in ["3", "4", "5"] {
        let kept = driver.runs().len();
        driver.enter("Hidden nodes", hidden);
        driver.train();
        driver.wait("the run in the list", |driver| driver.runs().len() > kept);
    }
    driver.click_button("Compare");
    driver.wait("both surfaces", |driver| {
        driver.has("Surface of A") && driver.has("Surface of B")
    });
    let hidden = |driver: &Driver| {
        let pinned = [0, 1].map(|place| driver.state().runs.pinned(place));
        pinned.map(|run| run.map(|run| run.file.settings.hidden))
    };
    assert_eq!(hidden(&driver), [Some(4), Some(5)]);
    // What the user chooses stays.
    driver.click("10×6_3×18 h3 lm as A");
    driver.wait("the chosen run", |driver| hidden(driver) == [Some(3), Some(5)]);
    driver.click_button("Train");
    driver.click_button("Compare");
    driver.settle();
    assert_eq!(hidden(&driver), [Some(3), Some(5)]);
}

#[test]
fn the_sample_recording_is_replayed_without_any_training() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open_keeping(&folder.path().join("runs"));
    driver.click_button("Live");
    driver.click_button("Play the sample recording");
    driver.wait("its frames", |driver| driver.views().live.shown.counts.decoded > 2);
    assert!(driver.says("sample network.json"));
    assert!(folder.path().join("samples/sample recording.csv").exists());
    driver.click("■ Stop");
    driver.settle();
    assert_eq!(driver.notice(), None);
}
