//! Scenes, inputs and presets in the window, and files written before there were scenes.

use decoupler::window::Effect;
use decoupler_core::{
    evaluation::{Preset, RunSettings},
    network::ScalingChoice,
    scene::{Indenter, IndenterShape, Loading, Movement, Noise, Radii, Rows, TiltedBody},
    sensor::ArrayScale,
    training::StoppingRules,
};
use decoupler_files::export::format_number;

use crate::driver::{Driver, small, table_of, trained};

/// Waits until the test set of the draft is displayed.
fn wait_for_scene(driver: &mut Driver) {
    driver.wait("the scene's test set", |driver| {
        let (state, draft) = (driver.state(), driver.state().draft);
        let shown = match (&state.preview, &state.run) {
            (Some(preview), _) => Some(preview.settings),
            (None, run) => run.as_ref().map(|run| *run.settings()),
        };
        shown.is_some_and(|shown| {
            (shown.simulation().unwrap().sensor, shown.simulation().unwrap().scene)
                == (draft.simulation().unwrap().sensor, draft.simulation().unwrap().scene)
        })
    });
}

#[test]
fn known_rows_train_one_small_network_for_each_row() {
    let mut driver = Driver::open();
    driver.configure_small();
    assert!(driver.has("18 inputs, 12 outputs, 198 weights"));
    driver.choose("Rows", "Known");
    // (18 + 1) · 6 + (6 + 1) · 6: x of a known row does not vary.
    assert!(driver.has("10 networks of 18 inputs, 6 outputs and 156 weights: 1560 in total"));
    driver.train();
    assert_eq!(driver.state().run.as_ref().unwrap().weights, 1560);
    assert!(driver.has("Decoded surface"));
}

#[test]
fn with_one_row_only_that_row_is_drawn() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.choose("Rows", "One");
    driver.enter("Row", "4");
    assert_eq!(driver.simulation().scene.rows, Rows::One(3));
    wait_for_scene(&mut driver);
    assert_eq!(driver.views().train.drawing().unwrap().actual.nodes.len(), 6);
    assert!(driver.says("1 of 100"), "a snapshot is one sample");
    driver.train();
    let mut settings = small();
    settings.simulation_mut().unwrap().scene.rows = Rows::One(3);
    assert_eq!(driver.table(), table_of(&trained(settings)));
    driver.click("Show");
    assert!(driver.has("Decoded surface"));

    // A smaller array has a last row too.
    driver.enter("Array scale", "2x3_2x9");
    assert_eq!(driver.simulation().scene.rows, Rows::One(1));
    wait_for_scene(&mut driver);
    driver.settle();
}

#[test]
fn a_training_with_noise_is_compared_with_the_limit_that_noise_sets() {
    let mut driver = Driver::open();
    driver.configure_small();
    assert!(!driver.has("Noise in"), "it has no effect without noise");
    driver.enter("Relative noise", "0.1");
    driver.assert_says("random nodes, all rows, 0.1 % noise");
    assert!(!driver.has("Published"), "the paper's figures are of another scene");
    driver.enter("Training samples", "2000");
    driver.enter("Epochs", "40");
    driver.choose("Scaling", "Whitening");
    wait_for_scene(&mut driver);
    driver.train();
    let mut settings = small();
    settings.simulation_mut().unwrap().scene.noise = Noise::relative(0.001);
    (
        settings.simulation_mut().unwrap().samples,
        settings.training.stopping.epochs,
    ) = (2000, 40);
    settings.inputs.scaling = ScalingChoice::Whitening;
    let run = trained(settings);
    assert_eq!(driver.table(), table_of(&run));
    let model_based = run.baselines().unwrap().model_based.clone().unwrap();
    let model_based = model_based.nodes().unwrap();
    assert!(model_based.z_mm > 0.0);
    let ratio = run.errors().nodes().unwrap().z_mm / model_based.z_mm;
    let said = format!("{} times the model-based error", format_number(ratio));
    driver.assert_says(&said);
}

#[test]
fn only_the_settings_of_the_current_choices_are_shown() {
    let mut driver = Driver::open();
    let shows = |driver: &Driver, names: &[&str]| {
        for name in [
            "Row",
            "Largest shift",
            "Correlation length",
            "Shape",
            "Radius from",
            "Radius to",
            "Largest tilt",
            "Spread",
        ] {
            assert_eq!(driver.has(name), names.contains(&name), "{name}");
        }
    };
    shows(&driver, &[]);
    driver.choose("Loading", "Smooth field");
    shows(&driver, &["Correlation length"]);
    driver.enter("Correlation length", "6.5");
    let correlation_length_mm = 6.5;
    assert_eq!(
        driver.simulation().scene.loading,
        Loading::SmoothField { correlation_length_mm }
    );
    driver.choose("Loading", "Indenter");
    shows(&driver, &["Shape", "Radius from", "Radius to", "Spread"]);
    assert_eq!(
        driver.simulation().scene.loading,
        Loading::Indenter(Indenter::default())
    );
    driver.choose("Shape", "Flat punch");
    shows(
        &driver,
        &["Shape", "Radius from", "Radius to", "Largest tilt", "Spread"],
    );
    driver.enter("Radius from", "8");
    driver.enter("Largest tilt", "12");
    let Loading::Indenter(indenter) = driver.simulation().scene.loading else {
        panic!("{:?}", driver.simulation().scene)
    };
    let (smallest, largest) = (8.0, 8.0);
    let punch = IndenterShape::FlatPunch(TiltedBody {
        radius_mm: Radii { smallest, largest },
        largest_tilt_degrees: 12.0,
    });
    assert_eq!(indenter.shape, punch, "the largest radius follows the smallest");
    driver.choose("Loading", "Random nodes");
    driver.choose("Rows", "One");
    driver.choose("Axes", "x, y, z");
    shows(&driver, &["Row", "Largest shift"]);
    driver.choose("Rows", "All");
    driver.choose("Axes", "z");
    assert_eq!(driver.state().draft, RunSettings::default());
    wait_for_scene(&mut driver);
    driver.settle();
}

#[test]
fn a_shape_from_a_file_that_is_not_offered_is_shown_and_kept() {
    let mut driver = Driver::open();
    let mut settings = RunSettings::default();
    let [_, _, _, edge] = Indenter::all();
    settings.simulation_mut().unwrap().scene.loading = Loading::Indenter(edge);
    driver.window_mut().apply(Effect::Configure(Box::new(settings)));
    wait_for_scene(&mut driver);
    assert_eq!(driver.get("Shape").value().as_deref(), Some("Edge"));
    driver.enter("Largest tilt", "12");
    let Loading::Indenter(indenter) = driver.simulation().scene.loading else {
        panic!("{:?}", driver.state().draft)
    };
    let largest_tilt_degrees = 12.0;
    assert_eq!(indenter.shape, IndenterShape::Edge { largest_tilt_degrees });
    driver.choose("Shape", "Sphere");
    let edges = |driver: &Driver| driver.texts().iter().filter(|text| *text == "Edge").count();
    let elsewhere = edges(&driver);
    driver.click("Shape");
    assert_eq!(edges(&driver), elsewhere, "it is not offered");
}

#[test]
fn the_best_accuracy_sets_how_readings_are_decoded_and_the_paper_all_but_the_array() {
    let mut driver = Driver::open();
    driver.choose("Paper's array", "10×6_3×18");
    driver.enter("Hidden nodes", "7");
    driver.choose("Axes", "x, y, z");
    let before = driver.state().draft;
    driver.choose("Preset", "Best accuracy");
    let draft = driver.state().draft;
    let best = Preset::Best.settings();
    assert_eq!(
        (draft.inputs, draft.simulation().unwrap().samples, draft.training),
        (best.inputs, best.simulation().unwrap().samples, best.training)
    );
    assert_eq!(
        (draft.simulation().unwrap().sensor, draft.hidden),
        (before.simulation().unwrap().sensor, 7)
    );
    assert_eq!(
        (
            draft.simulation().unwrap().scene.rows,
            draft.simulation().unwrap().scene.movement
        ),
        (Rows::Known, Movement::SIDEWAYS)
    );

    // With noise the best network needs more samples, and the preset says so.
    driver.enter("Relative noise", "0.1");
    let noisy = Preset::Best.settings_in(Noise::relative(0.001));
    assert_ne!(noisy.simulation().unwrap().samples, best.simulation().unwrap().samples);
    assert_eq!(driver.simulation().samples, noisy.simulation().unwrap().samples);
    let StoppingRules { epochs, .. } = driver.state().draft.training.stopping;
    assert_eq!(epochs, noisy.training.stopping.epochs);
    driver.enter("Relative noise", "0");
    assert_eq!(driver.state().draft, draft);

    // A number of samples set by the user is kept.
    driver.enter("Training samples", "300");
    driver.enter("Relative noise", "0.1");
    assert_eq!(driver.simulation().samples, 300);
    driver.enter("Relative noise", "0");
    driver.choose("Preset", "Paper");
    let mut papers = RunSettings::default();
    papers.simulation_mut().unwrap().sensor.scale = ArrayScale::PRESETS[0];
    assert_eq!(driver.state().draft, papers);
    wait_for_scene(&mut driver);
}

#[test]
fn scenes_that_move_sideways_are_reported_as_ill_conditioned() {
    let mut driver = Driver::open();
    driver.configure_small();
    assert!(!driver.says("ill-conditioned"));
    driver.choose("Axes", "x, y, z");
    wait_for_scene(&mut driver);
    assert!(driver.says("even rounding hides it"));
    driver.train();
    driver.details();
    assert!(driver.says("This scene is ill-conditioned (condition number"));
    let table = driver.table();
    // Exact readings leave this scene open: solving the equations for every row-wire would take too long.
    assert!(driver.says("There is no model-based row"));
    for row in ["training mean", "linear map", "network"] {
        let y = table.iter().find(|cell| cell.starts_with(&format!("{row}, Y %")));
        assert!(
            y.is_some_and(|cell| !cell.ends_with('–') && !cell.ends_with(" 0")),
            "{table:?}"
        );
    }
    for tab in ["Nodes", "Histogram", "Regression"] {
        driver.show_chart(tab);
        driver.settle();
    }
    driver.click_button("Error");
    driver.click_button("Top view");
    driver.settle();
    for text in driver.texts() {
        let mut words = text.split(|letter: char| !letter.is_alphanumeric());
        assert!(words.all(|word| word != "NaN" && word != "inf"), "{text}");
    }
}
