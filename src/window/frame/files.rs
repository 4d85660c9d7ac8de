//! Files written in the background, each on its own thread.
//!
//! Native file dialogs, each awaited on its own thread.
//!
//! Checks of typed paths, each on its own thread: a network drive that does not answer must not block the window.

use std::{
    fmt::{self, Display},
    fs,
    path::{Path, PathBuf},
    pin::Pin,
    sync::Arc,
    time::{Duration, Instant},
};

use directories::ProjectDirs;
use eframe::{
    NativeOptions,
    egui::{self, Align2, Context, FontId, Id, LayerId, Order, Stroke, StrokeKind, Ui},
};
use rfd::FileHandle;
use thiserror::Error;

use super::{
    DecouplerWindow, Desktop,
    remembered::{MIN_SIZE_POINTS, Remembered, WindowFile},
};
use crate::window::{
    job::{Background, JobError, Wake},
    shared::{Effect, FileInUse, FileTask, refuse_in_use},
    theme::{Theme, radius, space, type_size},
};

/// Longest time that dropping waits for a file. A file that takes longer is removed when the program ends.
const LONGEST_WAIT: Duration = Duration::from_secs(5);

/// Message about a file, or the reason why it was not written, unless the thread failed.
type Written = Result<Result<String, String>, JobError>;

/// Files that are being written.
pub struct Files {
    wake: Wake,
    under_way: Vec<(PathBuf, Background<Written>)>,
}

impl Files {
    /// No file yet. `wake` is called when one is written.
    pub fn new(wake: Wake) -> Self {
        Self {
            wake,
            under_way: Vec::new(),
        }
    }

    /// Writes the file `path` in the background. `write` returns the message for the user.
    pub fn write<X: Display>(
        &mut self,
        path: PathBuf,
        write: impl FnOnce(&Path) -> Result<String, X> + Send + 'static,
    ) {
        let mut job = Background::prompt("file", Arc::clone(&self.wake));
        let target = path.clone();
        job.start(
            move |_| write(&target).map_err(|error| error.to_string()),
            |written| written,
        );
        self.under_way.push((path, job));
    }

    /// Returns the message about the next file that was written, or the reason why it was not.
    pub fn next_written(&mut self) -> Option<Result<String, String>> {
        let mut jobs = self.under_way.iter().enumerate();
        let (number, written) = jobs.find_map(|(number, (_, job))| Some((number, job.next_event()?)))?;
        let (path, _) = self.under_way.remove(number);
        Some(match written {
            Ok(written) => written,
            Err(error) => Err(format!("cannot write '{}': {error}", path.display())),
        })
    }

    /// Paths of the files that are being written.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.under_way.iter().map(|(path, _)| path.as_path())
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        for (_, job) in &mut self.under_way {
            job.wait(LONGEST_WAIT);
        }
    }
}

impl fmt::Debug for Files {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.paths()).finish()
    }
}

/// A dialog answered sooner than this was never shown: the desktop has none. The limit allows for a busy machine; a user
/// who cancels as fast is asked in the window.
const NO_PERSON: Duration = Duration::from_secs(1);

/// Answer to a question for a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The user chose this file.
    Chosen(PathBuf),
    /// The user cancelled.
    Cancelled,
    /// There is no dialog here; ask in the window.
    NoDialog,
}

/// Open dialogs, each with its task.
#[derive(Debug)]
pub struct Dialogs {
    desktop: Desktop,
    asked: Vec<(FileTask, Background<Answer>)>,
}

impl Dialogs {
    /// No dialog yet.
    pub fn new(desktop: Desktop) -> Self {
        Self {
            desktop,
            asked: Vec::new(),
        }
    }

    /// Asks for the path of a file; returns true if there is a dialog to ask with. `wake` is called when the answer has
    /// come. Must run on the window's thread, which some desktops require.
    pub fn ask(&mut self, task: &FileTask, wake: Wake) -> bool {
        if self.desktop == Desktop::None {
            return false;
        }
        let choice = choice(task);
        let asked = Instant::now();
        let mut job = Background::prompt("file dialog", wake);
        job.start(
            move |_| match pollster::block_on(choice) {
                Some(file) => Answer::Chosen(file.path().to_owned()),
                None if asked.elapsed() < NO_PERSON => Answer::NoDialog,
                None => Answer::Cancelled,
            },
            |answer| answer.unwrap_or(Answer::NoDialog),
        );
        self.asked.push((task.clone(), job));
        true
    }

    /// Returns the next answer, if one has come, with its task.
    pub fn next_answer(&mut self) -> Option<(FileTask, Answer)> {
        let mut jobs = self.asked.iter().enumerate();
        let (number, answer) = jobs.find_map(|(number, (_, job))| Some((number, job.next_event()?)))?;
        let (task, _) = self.asked.remove(number);
        Some((task, answer))
    }

    /// Returns true while a dialog is open.
    pub fn is_asking(&self) -> bool {
        !self.asked.is_empty()
    }
}

/// Shows the dialog.
fn choice(task: &FileTask) -> Pin<Box<dyn Future<Output = Option<FileHandle>> + Send>> {
    let suggestion = task.suggested_path();
    let mut dialog = rfd::AsyncFileDialog::new().set_title(format!("{} {}", task.verb(), task.words.kind));
    if task.is_read() && task.words.extensions.len() > 1 {
        dialog = dialog.add_filter(task.words.kind, task.words.extensions);
    }
    for extension in task.words.extensions {
        dialog = dialog.add_filter(extension.to_uppercase(), &[extension]);
    }
    if let Some(folder) = suggestion.parent() {
        dialog = dialog.set_directory(folder);
    }
    if task.is_read() && task.words.extensions.is_empty() {
        Box::pin(dialog.pick_folder())
    } else if task.is_read() {
        // Checkpoints of the terminal may have any name.
        Box::pin(dialog.add_filter("All files", &["*"]).pick_file())
    } else {
        if let Some(name) = suggestion.file_name() {
            dialog = dialog.set_file_name(name.to_string_lossy());
        }
        Box::pin(dialog.save_file())
    }
}

/// Reasons why the window cannot open.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum OpenError {
    /// There is no display.
    #[error("there is no display to open a window on; `decoupler train --help` does the same work in a terminal")]
    NoDisplay,
    /// There is no OpenGL, or the display refuses a window.
    #[error("no window can be opened here: {0}; {PACKAGES}")]
    NoWindow(String),
    /// A library that the window needs cannot be loaded, or the window itself failed.
    #[error("the window failed with the error above; {PACKAGES}")]
    Failed,
}

/// Advice on the packages that a bare system lacks.
const PACKAGES: &str = "on a bare Debian, install libxcursor1 libxi6 libxkbcommon-x11-0 libgl1-mesa-dri, or work in a \
                        terminal: `decoupler train --help`";

/// Time between two checkpoints of a running training.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(10);

/// Opens the window with these files, as if they were dropped on it, and returns when it is closed.
///
/// # Errors
/// If there is no display, or no OpenGL on it.
pub fn open(files: Vec<PathBuf>) -> Result<(), OpenError> {
    let displays = ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"];
    if cfg!(target_os = "linux") && displays.iter().all(|name| std::env::var_os(name).is_none()) {
        return Err(OpenError::NoDisplay);
    }
    // Systems without a home folder keep no runs, which the run list says, and remember nothing.
    let folders = ProjectDirs::from("", "", "decoupler");
    let file = folders
        .as_ref()
        .map(|folders| WindowFile::read(folders.data_dir().join("window.json")));
    let size_points = match &file {
        Some(file) => file.remembered.opening_size_points(),
        None => Remembered::default().opening_size_points(),
    };
    let icon = eframe::icon_data::from_png_bytes(include_bytes!("../../../assets/icon.png"));
    let mut viewport = egui::ViewportBuilder::default()
        .with_title("Decoupler")
        .with_app_id("decoupler")
        .with_inner_size(size_points)
        .with_min_inner_size(MIN_SIZE_POINTS);
    if let Ok(icon) = icon {
        viewport = viewport.with_icon(icon);
    }
    let options = NativeOptions {
        viewport,
        // egui smooths lines and text itself; smoothing the meshes too doubles the time of a frame without a graphics card.
        multisampling: 0,
        ..NativeOptions::default()
    };
    let create = |creation: &eframe::CreationContext<'_>| {
        let mut window = DecouplerWindow::new(&creation.egui_ctx, Desktop::Native, file);
        window.given = files;
        let window = match &folders {
            Some(folders) => window
                .keeping_runs(folders.data_dir().join("runs"))
                .keeping_trainings(folders.data_dir().to_owned(), CHECKPOINT_INTERVAL),
            None => window,
        };
        window.save_on_termination();
        Ok::<Box<dyn eframe::App>, Box<dyn std::error::Error + Send + Sync>>(Box::new(window))
    };
    // A missing library makes the window system panic with the name of the library.
    let run = || eframe::run_native("Decoupler", options, Box::new(create));
    match std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)) {
        Ok(Ok(())) => Ok(()),
        Ok(Err(error)) => Err(OpenError::NoWindow(without_source_line(&error.to_string()))),
        Err(_) => Err(OpenError::Failed),
    }
}

/// Returns a message of the window system without the source line that it names: "os error at FILE:LINE: cause".
fn without_source_line(message: &str) -> String {
    let parts = message.split_once("os error at ");
    let cause = parts.and_then(|(before, after)| Some((before, after.split_once(": ")?.1)));
    cause.map_or(message.to_owned(), |(before, cause)| format!("{before}{cause}"))
}

/// Result of checking a path to which a file is to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// Nothing that would be lost. Other problems with the path are reported when the file is written.
    Nothing,
    /// Another file.
    File,
    /// A file in use, and why it must not be overwritten.
    InUse(String),
}

/// Paths that are being checked.
pub(super) struct PathChecks {
    wake: Wake,
    under_way: Vec<(PathBuf, Background<Found>)>,
}

impl PathChecks {
    /// None yet. `wake` is called when a path has been checked.
    pub(super) fn new(wake: Wake) -> Self {
        Self {
            wake,
            under_way: Vec::new(),
        }
    }

    /// Checks `path`, which must not be one of the files `used`.
    pub(super) fn start(&mut self, path: PathBuf, used: Vec<FileInUse>) {
        // Each check has its own thread: one that never ends does not block the others.
        let mut job = Background::prompt("path", Arc::clone(&self.wake));
        let checked = path.clone();
        job.start(
            move |_| check_path(&checked, &used),
            |found| found.unwrap_or_else(|error| Found::InUse(error.to_string())),
        );
        self.under_way.push((path, job));
    }

    /// Returns the next path that has been checked, with the result.
    pub(super) fn next_checked(&mut self) -> Option<(PathBuf, Found)> {
        let mut jobs = self.under_way.iter().enumerate();
        let (number, found) = jobs.find_map(|(number, (_, job))| Some((number, job.next_event()?)))?;
        let (path, _) = self.under_way.remove(number);
        Some((path, found))
    }
}

fn check_path(path: &Path, used: &[FileInUse]) -> Found {
    match refuse_in_use(path, used) {
        Err(reason) => Found::InUse(reason),
        // A folder is not a file that could be lost, and a pipe or a device is meant to be written to.
        Ok(()) if fs::metadata(path).is_ok_and(|found| found.is_file()) => Found::File,
        Ok(()) => Found::Nothing,
    }
}

impl DecouplerWindow {
    /// Gives files dropped on the window to the view that takes them, and shows it.
    pub(super) fn take_dropped(&mut self, ctx: &Context, effects: &mut Vec<Effect>) {
        let dropped = ctx.input_mut(|input| std::mem::take(&mut input.raw.dropped_files));
        let mut paths: Vec<PathBuf> = dropped.iter().map(|file| file.path().to_owned()).collect();
        // A question must be answered first.
        if self.is_asked() {
            return;
        }
        paths.append(&mut self.given);
        if paths.is_empty() {
            return;
        }
        let place = self
            .views
            .all()
            .into_iter()
            .position(|view| view.take_files(&paths, &self.shared, effects));
        if let Some(place) = place {
            self.show(place);
            ctx.request_repaint();
        }
    }

    /// Shows over the window what dropping the files under the pointer will do.
    pub(super) fn dropping_ui(&self, ui: &Ui) {
        let is_hovered = ui.input(|input| !input.raw.hovered_files.is_empty());
        if !is_hovered || self.is_asked() {
            return;
        }
        let palette = Theme::of(ui).palette;
        let painter = ui
            .ctx()
            .layer_painter(LayerId::new(Order::Foreground, Id::unique("dropping")));
        let whole = ui.ctx().content_rect().shrink(space(2));
        painter.rect_filled(whole, f32::from(radius()), palette.background.gamma_multiply(0.85));
        painter.rect_stroke(
            whole,
            f32::from(radius()),
            Stroke::new(2.0, palette.accent),
            StrokeKind::Inside,
        );
        let font = FontId::proportional(type_size().title);
        let hovered = ui.input(|input| input.raw.hovered_files.clone());
        let paths: Vec<PathBuf> = hovered.into_iter().filter_map(|file| file.path).collect();
        let text = in_words(&paths, self.shared.phase.is_busy(), self.views.has_recording());
        painter.text(whole.center(), Align2::CENTER_CENTER, text, font, palette.text);
    }
}

/// Returns a sentence on what dropping these files will do.
fn in_words(paths: &[PathBuf], is_busy: bool, has_recording: bool) -> &'static str {
    // Only their names: reading files would block the window.
    let is_document = |path: &PathBuf| {
        let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
        extension.is_some_and(|extension| extension == "json" || extension == "checkpoint")
    };
    if is_busy {
        "A training is running: stop it before you open other files"
    } else if paths.iter().any(is_document) {
        "Drop to open the recipe, network or checkpoint"
    } else if has_recording {
        "Drop to add to the recording"
    } else {
        "Drop to open as a recording"
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, sync::mpsc::channel};

    use decoupler_files::export::WriteError;

    use super::*;

    #[test]
    fn messages_of_the_window_system_name_no_source_file() {
        for (message, expected) in [
            (
                "winit: os error at /build/winit/mod.rs:788: no server: 3",
                "winit: no server: 3",
            ),
            (r"os error at C:\build\mod.rs:1: no server", "no server"),
            ("no OpenGL: none found", "no OpenGL: none found"),
        ] {
            assert_eq!(without_source_line(message), expected);
        }
    }

    #[test]
    fn every_file_is_reported_even_if_writing_it_panicked() {
        let (woke, wakes) = channel();
        let mut files = Files::new(Arc::new(move || woke.send(()).unwrap_or(())));
        let folder = tempfile::tempdir().unwrap();
        let [whole, broken, missing] = ["whole", "broken", "none/missing"].map(|name| folder.path().join(name));
        let message = "it is there".to_owned();
        files.write(whole, move |path| fs::write(path, "text").map(|()| message));
        files.write(broken.clone(), |_| -> Result<String, WriteError> { panic!("a defect") });
        files.write(missing, |path| {
            decoupler_files::export::atomic_write(path, |_| Ok(())).map(|()| String::new())
        });
        assert_eq!(files.paths().count(), 3);
        let mut written = Vec::new();
        while written.len() < 3 {
            wakes.recv_timeout(Duration::from_secs(60)).unwrap();
            written.extend(std::iter::from_fn(|| files.next_written()));
        }
        assert_eq!(files.paths().count(), 0);
        let has = |wanted: &dyn Fn(&Result<String, String>) -> bool| written.iter().any(wanted);
        assert!(has(&|outcome| outcome.as_deref() == Ok("it is there")));
        assert!(has(&|outcome| outcome
            .as_ref()
            .is_err_and(|reason| reason.contains("does not exist"))));
        let name = broken.display().to_string();
        assert!(has(&|outcome| {
            let reason = outcome.as_ref().err();
            reason.is_some_and(|reason| reason.contains(&name) && reason.contains("a defect"))
        }));
    }

    #[test]
    fn dropping_waits_for_files_being_written() {
        let (begun, has_begun) = channel();
        let (gate, opened) = channel::<()>();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("slow");
        let mut files = Files::new(Arc::new(|| ()));
        files.write(path.clone(), move |path| {
            begun.send(()).unwrap();
            opened.recv().unwrap();
            fs::write(path, "text").map(|()| String::new())
        });
        has_begun.recv().unwrap();
        gate.send(()).unwrap();
        drop(files);
        assert_eq!(fs::read(path).unwrap(), b"text");
    }

    #[test]
    fn the_effect_of_a_drop_depends_on_the_file_and_on_the_open_files() {
        for (name, is_busy, has_recording, beginning) in [
            ("press.csv", false, false, "Drop to open as a recording"),
            ("press.csv", false, true, "Drop to add"),
            ("net.json", false, true, "Drop to open the recipe, network"),
            ("half.CHECKPOINT", false, false, "Drop to open the recipe, network"),
            ("press.csv", true, false, "A training is running"),
        ] {
            let text = in_words(&[PathBuf::from(name)], is_busy, has_recording);
            assert!(text.starts_with(beginning), "{name}: {text}");
        }
    }
}
