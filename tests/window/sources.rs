//! The same small training on a simulated array and on a recording, for tests of what both have in common in the Train view.

use std::{fmt::Write as _, fs, path::Path, sync::Arc};

use decoupler::window::{Effect, SourceKind};
use decoupler_core::{
    evaluation::{ErrorMeasure, Run, RunSettings},
    job::Job,
    scene::RowModel,
};
use decoupler_files::{export::format_number, import::Setup};
use tempfile::TempDir;

use crate::{
    driver::{Driver, small},
    recordings::{plan, recording},
};

/// Both kinds of source.
pub(crate) const BOTH: [SourceKind; 2] = [SourceKind::Array, SourceKind::Recording];

/// A window on a small source, and the setup that it trains with.
pub(crate) struct Opened {
    pub(crate) driver: Driver,
    pub(crate) setup: Setup,
    /// Folder of the recording, and for files to be written.
    pub(crate) folder: TempDir,
}

/// Opens a window whose next training is small: 15 epochs with 6 hidden nodes.
pub(crate) fn open_small(source: SourceKind) -> Opened {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open();
    let setup = match source {
        SourceKind::Array => {
            driver.configure_small();
            small().into()
        }
        SourceKind::Recording => {
            let setup = probe(folder.path());
            driver.take_recording(&setup);
            setup
        }
    };
    Opened { driver, setup, folder }
}

/// As [`open_small`], trained to the end.
pub(crate) fn trained_small(source: SourceKind) -> Opened {
    let mut opened = open_small(source);
    opened.driver.train();
    opened.driver.wait_for_last_epoch();
    opened.driver.details();
    opened
}

/// Settings of a small training on a recording.
pub(crate) fn small_settings() -> RunSettings {
    let mut settings = RunSettings::measured(RowModel::Shared);
    settings.hidden = 6;
    settings.training = small().training;
    settings
}

/// A recording of two readings and the position of a probe, written into `folder`.
pub(crate) fn probe(folder: &Path) -> Setup {
    setup(folder, "probe.csv", &recording(120), &["x", "y"])
}

/// A recording of two readings, the presses on 2 × 3 taxels, and the force.
fn skin(folder: &Path) -> Setup {
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
    let targets = ["d1", "d2", "d3", "d4", "d5", "d6", "force"];
    setup(folder, "skin.csv", &text, &targets)
}

/// As [`skin`], but only the force is decoded.
pub(crate) fn force(folder: &Path) -> Setup {
    let skin = skin(folder);
    let mut plan = skin.plan().unwrap().clone();
    plan.import.targets = vec!["force".to_owned()];
    Setup::recording(*skin.settings(), plan)
}

/// As [`skin`], with positions of the taxels from a file of this text.
pub(crate) fn skin_with_positions(folder: &Path, positions: &str) -> Setup {
    let without = skin(folder);
    let path = folder.join("taxels.csv");
    fs::write(&path, positions).unwrap();
    let mut plan = without.plan().unwrap().clone();
    plan.import.positions = Some(path);
    Setup::recording(*without.settings(), plan)
}

fn setup(folder: &Path, name: &str, text: &str, targets: &[&str]) -> Setup {
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    Setup::recording(small_settings(), plan(&path, targets))
}

/// Returns a run of the library that has begun.
pub(crate) fn begun(setup: &Setup) -> Run {
    let sets = setup.sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ()).unwrap();
    sets.run(setup, None, &Job::UNINTERRUPTED).unwrap()
}

/// The same, trained to the end.
pub(crate) fn run_of(setup: &Setup) -> Run {
    let mut run = begun(setup);
    while run.step().is_none() {}
    run
}

/// As `setup`, with another number of epochs.
pub(crate) fn with_epochs(setup: &Setup, epochs: usize) -> Setup {
    let mut settings = *setup.settings();
    settings.training.stopping.epochs = epochs;
    setup.with_settings(settings)
}

/// Returns the figures of the network in the error table, formatted as in the window: `network, Z %: 2.28`, `x (mm), network, RMSE: 0.01`.
pub(crate) fn network_figures(run: &Run) -> Vec<String> {
    let (problem, scores) = (run.problem(), run.scores().unwrap());
    let tables = decoupler_core::evaluation::ErrorTable::of_scores(problem, &scores, None);
    let mut figures = Vec::new();
    for table in &tables {
        let caption = table
            .target
            .as_ref()
            .map_or_else(String::new, |target| format!("{}, ", target.title()));
        let row = table.rows.iter().find(|row| row.name == "network").unwrap();
        for (measure, error) in table.measures.iter().zip(&row.errors) {
            let heading = match measure {
                ErrorMeasure::ZPercent => "Z %",
                ErrorMeasure::ZMm => "mm",
                ErrorMeasure::Rmse => "RMSE",
                ErrorMeasure::Mae => "MAE",
                ErrorMeasure::RangePercent => "% of range",
                _ => continue,
            };
            figures.push(format!("{caption}network, {heading}: {}", format_number(*error)));
        }
    }
    figures
}

impl Opened {
    /// Changes the settings of the next training.
    #[track_caller]
    pub(crate) fn change(&mut self, change: impl FnOnce(&mut RunSettings)) {
        let mut settings = *self.setup.settings();
        change(&mut settings);
        self.setup = self.setup.with_settings(settings);
        self.driver
            .window_mut()
            .apply(Effect::TakeSetup(Box::new(self.setup.clone())));
        self.driver.harness().run_steps(2);
        assert_eq!(self.driver.state().setup().as_ref(), Ok(&self.setup));
    }
}

impl Driver {
    /// Makes this recording the source of the next training, and waits until the window can read it.
    #[track_caller]
    pub(crate) fn take_recording(&mut self, setup: &Setup) {
        let plan = Arc::new(setup.plan().unwrap().clone());
        for effect in [Effect::Import(Ok(plan)), Effect::TakeSetup(Box::new(setup.clone()))] {
            self.window_mut().apply(effect);
        }
        self.harness().run_steps(2);
        self.wait("the recording", |driver| driver.state().recording.plan.is_ok());
        assert_eq!(self.state().setup().as_ref(), Ok(setup));
    }

    /// Asserts that the window shows all of these texts.
    #[track_caller]
    pub(crate) fn assert_shows(&self, texts: &[String]) {
        let shown = self.texts();
        for text in texts {
            assert!(shown.contains(text), "'{text}' is not among {shown:#?}");
        }
    }
}
