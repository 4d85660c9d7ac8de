//! The table of other decoders.

use decoupler::window::DecoderResult;
use decoupler_core::{
    evaluation::{DecoderSet, Run, RunSets, RunSettings},
    job::Job,
    machine::MemoryBudget,
    scene::{Noise, Rows},
};
use decoupler_files::export::format_number;
use eframe::egui::{Key, Modifiers};

use crate::{
    configuring::choose_method,
    driver::{Driver, small, trained},
};

const NAMES: [&str; 8] = [
    "Training mean",
    "Ridge",
    "Network",
    "Network f32",
    "Radial basis",
    "Fuzzy rules",
    "Newton",
    "Network + Newton",
];

/// Waits until every decoder is measured.
fn wait_for_all(driver: &mut Driver) {
    driver.wait("all decoders", |driver| {
        let decoders = &driver.views().train.decoders;
        decoders.measured.is_some() && !decoders.is_measuring()
    });
}

/// The cells of the unfolded table that do not depend on timing.
fn table(driver: &Driver) -> Vec<String> {
    let texts = driver.texts();
    let is_cell = |text: &String| NAMES.iter().any(|name| text.starts_with(&format!("{name}, ")));
    let is_time = |text: &String| text.contains(", µs: ");
    texts
        .into_iter()
        .filter(|text| is_cell(text) && !is_time(text))
        .collect()
}

/// The same cells computed by the library.
fn table_of(run: &Run) -> Vec<String> {
    let sets = RunSets::draw(run.settings(), MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
    let set = DecoderSet::new(*run.settings(), sets.split.training, Some(run.network()));
    let model_based = run.baselines().unwrap().model_based.as_ref();
    let model_based = model_based.and_then(|errors| errors.nodes());
    let model_based = model_based.filter(|errors| !errors.is_rounding());
    let of_decoder = |(wanted, name): (DecoderResult, &str)| {
        let report = set.measure(wanted.kind, wanted.precision, run.test()).unwrap().unwrap();
        let errors = *report.errors.nodes().unwrap();
        let ratio = model_based.map(|model_based| errors.z_mm / model_based.z_mm);
        let figures = [
            Some(("Z %", errors.z_percent)),
            ratio.map(|ratio| ("× model-based", Some(ratio))),
            Some(("residual", report.residual)),
        ];
        let cell = |(heading, value)| format!("{name}, {heading}: {}", format_number(value));
        figures.into_iter().flatten().map(cell).collect::<Vec<_>>()
    };
    DecoderResult::pending(run.problem())
        .into_iter()
        .zip(NAMES)
        .flat_map(of_decoder)
        .collect()
}

fn noisy() -> RunSettings {
    let mut settings = small();
    settings.simulation_mut().unwrap().scene.rows = Rows::Known;
    settings.simulation_mut().unwrap().scene.noise = Noise::relative(1e-3);
    settings
}

#[test]
fn the_decoders_figures_are_the_librarys() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.details();
    assert!(driver.has("Decoding a snapshot"));
    assert!(table(&driver).is_empty(), "folded away until asked for");
    driver.click("More decoders");
    wait_for_all(&mut driver);
    assert_eq!(table(&driver), table_of(&trained(small())));
    let times = driver.texts().into_iter().filter(|text| text.contains(", µs: "));
    let times: Vec<String> = times.filter(|text| !text.starts_with("limit")).collect();
    assert!(
        times.len() == NAMES.len() && times.iter().all(|text| !text.ends_with('–')),
        "{times:?}"
    );
    driver.settle();

    // The next training is measured automatically once it has ended.
    driver.choose("Rows", "Known");
    driver.enter("Relative noise", "0.1");
    assert_eq!(driver.state().draft, noisy());
    driver.train();
    wait_for_all(&mut driver);
    assert_eq!(table(&driver), table_of(&trained(noisy())));
    driver.click("More decoders");
    assert!(table(&driver).is_empty());
    driver.settle();
}

#[test]
fn a_running_training_is_not_measured_until_it_is_paused() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.details();
    driver.click("More decoders");
    wait_for_all(&mut driver);
    choose_method(&mut driver, "Momentum, Eq. (11)");
    driver.enter("Epochs", "1000000");
    driver.click("▶ Train");
    driver.wait_for_epochs(2);
    assert_eq!(driver.views().train.decoders.measured, None);
    assert!(driver.has("They are measured when the training is paused or has ended."));
    driver.press_with(Modifiers::COMMAND, Key::P);
    wait_for_all(&mut driver);
    assert_eq!(table(&driver).len(), 2 * NAMES.len());
    driver.press_with(Modifiers::COMMAND, Key::P);
    assert_eq!(
        driver.views().train.decoders.measured,
        None,
        "the network is another one from now on"
    );
    driver.press_with(Modifiers::COMMAND, Key::Period);
    wait_for_all(&mut driver);
}
