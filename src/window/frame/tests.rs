use std::{
    ops::{Deref, DerefMut},
    path::PathBuf,
    sync::{
        Arc,
        mpsc::{Receiver, channel},
    },
    time::Duration,
};

use eframe::egui::Context;

use super::{DecouplerWindow, Desktop};
use crate::window::{
    shared::{Command, Effect, FileTask, FileWords, Matter, Notice, Phase, saying_saved},
    training_worker::Worker,
};
use decoupler_files::export::NetworkFile;

/// A window, and the events of its threads.
struct Opened {
    window: DecouplerWindow,
    woken: Receiver<()>,
}

impl Opened {
    fn new() -> Self {
        let (wake, woken) = channel();
        let wake = Arc::new(move || {
            // At the end of a test the threads outlive the receiver.
            let _ = wake.send(());
        });
        let window = DecouplerWindow::woken_by(wake, &Context::default(), Desktop::None, None);
        Self { window, woken }
    }

    /// A window with a small network, trained.
    fn trained() -> Self {
        let mut window = Self::new();
        window.wait(|window| window.shared.test().is_some());
        let mut small = window.shared.draft;
        small.simulation_mut().unwrap().sensor.scale = "4x4_2x12".parse().unwrap();
        (
            small.hidden,
            small.simulation_mut().unwrap().samples,
            small.training.stopping.epochs,
        ) = (3, 40, 5);
        window.apply(Effect::Configure(Box::new(small)));
        window.apply(Effect::Do(Command::Train));
        window.wait(|window| matches!(window.shared.phase, Phase::Ended(_)));
        window
    }

    /// Takes events until `holds`; each may take a minute.
    #[track_caller]
    fn wait(&mut self, holds: impl Fn(&DecouplerWindow) -> bool) {
        loop {
            self.window.take_events();
            if holds(&self.window) {
                return;
            }
            let event = self.woken.recv_timeout(Duration::from_secs(600));
            assert!(event.is_ok(), "it never came: {:?}", self.window.shared);
        }
    }
}

impl Deref for Opened {
    type Target = DecouplerWindow;

    fn deref(&self) -> &DecouplerWindow {
        &self.window
    }
}

impl DerefMut for Opened {
    fn deref_mut(&mut self) -> &mut DecouplerWindow {
        &mut self.window
    }
}

/// Saves the displayed network.
fn export(window: &mut DecouplerWindow, path: PathBuf) {
    let task = save_task(window);
    window.answer(task, path, false);
}

/// Returns the task of saving the displayed network.
fn save_task(window: &DecouplerWindow) -> FileTask {
    let words = FileWords {
        kind: "network",
        description: "",
        extensions: &["json"],
    };
    let run = window.shared.run.as_ref().unwrap().id;
    FileTask::of_run(words, "network", Some(run), |run| {
        let file = run.unwrap().network_file()?;
        Ok(saying_saved(move |path| file.save(path)))
    })
}

#[test]
fn a_worker_that_died_takes_no_results_with_it_also_when_another_is_started() {
    let mut window = Opened::trained();
    let ended = window.shared.phase;
    window.worker = Worker::dying(&window.jobs);
    window.wait(|window| window.notice().is_some());
    let Some(Notice::Failed(reason)) = window.notice() else {
        panic!("{:?}", window.notice())
    };
    assert!(
        reason.contains("an internal error stopped the thread 'training': a test"),
        "{reason}"
    );
    assert_eq!(window.shared.phase, ended);
    assert!(window.shared.result().is_some());
    window.apply(Effect::Settle(Matter::Training));

    export(&mut window, "network.json".into());
    window.wait(|window| window.notice().is_some());
    let lost = "the network was lost when the training thread ended; train again";
    assert_eq!(window.notice(), Some(&Notice::Failed(lost.to_owned())));
    assert_eq!(
        window.shared.phase, ended,
        "the new worker has nothing to report the old one"
    );
    window.apply(Effect::Settle(Matter::File));
    window.apply(Effect::Do(Command::TrainLonger));
    window.wait(|window| window.notice().is_some());
    assert_eq!(window.notice(), Some(&Notice::Failed(lost.to_owned())));
    assert_eq!(window.shared.phase, ended);
    window.apply(Effect::Do(Command::Train));
    window.wait(|window| matches!(window.shared.phase, Phase::Ended(_)));
}

#[test]
fn a_picture_that_died_with_the_worker_is_drawn_by_the_next() {
    let mut window = Opened::new();
    window.worker = Worker::dying(&window.jobs);
    window.wait(|window| {
        window
            .shared
            .preview
            .as_ref()
            .is_some_and(|preview| preview.baselines.is_some())
    });
}

#[test]
fn a_training_that_cannot_begin_leaves_the_one_before_to_be_exported() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.json");
    let mut window = Opened::trained();
    let (ended, shown) = (window.shared.phase, window.shared.draft);
    let mut impossible = shown;
    impossible.training.stopping.goal_mse = f64::NAN;
    window.apply(Effect::Configure(Box::new(impossible)));
    window.apply(Effect::Do(Command::Train));
    window.wait(|window| window.notice().is_some());
    assert!(matches!(window.notice(), Some(Notice::Failed(_))));
    assert_eq!(window.shared.phase, ended, "the current training has ended in this way");
    assert!(window.shared.result().is_some());

    window.apply(Effect::Settle(Matter::Settings));
    export(&mut window, path.clone());
    window.wait(|window| window.notice().is_some());
    assert_eq!(
        window.notice(),
        Some(&Notice::Saved(format!("Saved {}", path.display()), path.clone()))
    );
    let file = NetworkFile::load(&path).unwrap();
    assert_eq!(file.settings.hidden, shown.hidden);
}

#[test]
fn a_file_asked_for_before_another_training_began_is_refused_not_written_about_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.json");
    let mut window = Opened::trained();
    // The desktop's dialog is open.
    let task = save_task(&window);
    let mut other = window.shared.draft;
    other.hidden = 4;
    window.apply(Effect::Configure(Box::new(other)));
    window.apply(Effect::Do(Command::Train));
    window.wait(|window| {
        matches!(window.shared.phase, Phase::Ended(_)) && window.shared.run.as_ref().unwrap().settings().hidden == 4
    });
    window.answer(task, path.clone(), false);
    window.wait(|window| window.notice().is_some());
    let Some(Notice::Failed(reason)) = window.notice() else {
        panic!("{:?}", window.notice())
    };
    assert!(reason.contains("another training has replaced"), "{reason}");
    assert!(!path.exists());
}

#[test]
fn a_training_that_cannot_begin_leaves_the_settings_own_test_set_on_show() {
    let mut window = Opened::new();
    window.wait(|window| window.shared.test().is_some());
    let mut impossible = window.shared.draft;
    impossible.simulation_mut().unwrap().sensor.scale = "4x4_2x12".parse().unwrap();
    impossible.training.stopping.goal_mse = f64::NAN;
    window.apply(Effect::Configure(Box::new(impossible)));
    // Before the new test set is there.
    window.apply(Effect::Do(Command::Train));
    window.wait(|window| window.notice().is_some());
    window.wait(|window| {
        window
            .shared
            .skin()
            .is_some_and(|skin| skin.sensor == impossible.simulation().unwrap().sensor)
    });
}
