//! Files written in the background and native file dialogs, each on its own thread: a network drive that does not answer
//! must not block the window.

use std::{
    fmt::{self, Display},
    path::{Path, PathBuf},
    pin::Pin,
    time::{Duration, Instant},
};

use decoupler_files::export::exit_leaving_nothing;
use directories::ProjectDirs;
use eframe::{
    NativeOptions,
    egui::{self, Align2, Context, FontId, Id, LayerId, Order, Stroke, StrokeKind, Ui},
};
use rfd::FileHandle;
use thiserror::Error;

use super::{
    DecouplerWindow, Desktop,
    remembered::{MIN_SIZE_POINTS, WindowFile},
};
use crate::{
    signals::on_termination,
    window::{
        job::{Background, JobError, Jobs, start_thread},
        shared::{Command, FileInUse, FileTask, Matter, ViewKind, refuse_in_use},
        theme::{Theme, radius, space, type_size},
    },
};

/// Longest time that dropping waits for a file. A file that takes longer is removed when the program ends.
const LONGEST_WAIT: Duration = Duration::from_secs(5);

/// Jobs on threads of their own, each with what it is about.
struct Pending<K, E> {
    name: &'static str,
    all: Jobs,
    jobs: Vec<(K, Background<E>)>,
}

impl<K, E: Send + 'static> Pending<K, E> {
    /// None yet.
    fn new(name: &'static str, all: Jobs) -> Self {
        let jobs = Vec::new();
        Self { name, all, jobs }
    }

    fn start<T: 'static>(
        &mut self,
        about: K,
        work: impl FnOnce() -> T + Send + 'static,
        last: fn(Result<T, JobError>) -> E,
    ) {
        let mut job = Background::prompt(self.name, &self.all);
        job.start(move |report| report.waiting(work), last);
        self.jobs.push((about, job));
    }

    /// Returns the result of the next job that has ended.
    fn next(&mut self) -> Option<(K, E)> {
        let mut jobs = self.jobs.iter().enumerate();
        let (number, result) = jobs.find_map(|(number, (_, job))| Some((number, job.next_event()?)))?;
        Some((self.jobs.remove(number).0, result))
    }
}

/// A file to be written.
pub struct ToWrite {
    /// Task of the file.
    pub task: FileTask,
    /// Its path.
    pub path: PathBuf,
    /// True if the user was not asked yet whether another file at the path may be replaced.
    pub asks: bool,
}

/// Outcome of writing a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Written {
    /// It is there, with the message for the user.
    Done(String),
    /// Another file is there, and the user is to be asked.
    Exists,
    /// It must not be written there, for this reason.
    InUse(String),
    /// It was not written, for this reason.
    Failed(String),
}

/// Files that are being written in the background.
pub struct Files(Pending<ToWrite, Result<Written, JobError>>);

impl Files {
    /// No file yet.
    pub fn new(jobs: Jobs) -> Self {
        Self(Pending::new("file", jobs))
    }

    /// Writes a file, which must not be one of the files `used`.
    pub fn write<X: Display>(
        &mut self,
        to_write: ToWrite,
        used: Vec<FileInUse>,
        write: impl FnOnce(&Path) -> Result<String, X> + Send + 'static,
    ) {
        let (path, asks) = (to_write.path.clone(), to_write.asks);
        // A folder is never replaced as a whole; a file that is being written counts as existing.
        let asks = asks && !to_write.task.is_read() && !to_write.task.words.extensions.is_empty();
        let is_under_way = self.paths().any(|other| other == path);
        let work = move || match refuse_in_use(&path, &used) {
            Err(reason) => Written::InUse(reason),
            // A folder is not a file that could be lost, and a pipe or a device is meant to be written to.
            Ok(()) if asks && (is_under_way || path.is_file()) => Written::Exists,
            Ok(()) => match write(&path) {
                Ok(message) => Written::Done(message),
                Err(reason) => Written::Failed(reason.to_string()),
            },
        };
        self.0.start(to_write, work, |written| written);
    }

    /// Returns the next file that was written, or was not.
    pub fn next_written(&mut self) -> Option<(ToWrite, Written)> {
        let (to_write, written) = self.0.next()?;
        let failed = |error| Written::Failed(format!("cannot write '{}': {error}", to_write.path.display()));
        let written = written.unwrap_or_else(failed);
        Some((to_write, written))
    }

    /// Paths of the files that are being written.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.0.jobs.iter().map(|(to_write, _)| to_write.path.as_path())
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        for (_, job) in &mut self.0.jobs {
            job.wait(LONGEST_WAIT);
        }
    }
}

impl fmt::Debug for Files {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.paths()).finish()
    }
}

/// Shows the folder of a file in the desktop's file manager, on a thread of its own. A desktop without one shows nothing.
pub(super) fn open_folder(path: &Path) {
    let program = match std::env::consts::OS {
        "windows" => "explorer",
        "macos" => "open",
        _ => "xdg-open",
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut command = std::process::Command::new(program);
    command.arg(folder.unwrap_or(Path::new(".")));
    // Without another thread nothing is shown either.
    let _ = start_thread("folder", move || command.status(), |_| ());
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

/// Open dialogs of the desktop, each with its task.
pub struct Dialogs {
    /// Where they are shown.
    pub desktop: Desktop,
    asked: Pending<FileTask, Answer>,
}

impl Dialogs {
    /// No dialog yet.
    pub fn new(desktop: Desktop, jobs: Jobs) -> Self {
        let asked = Pending::new("file dialog", jobs);
        Self { desktop, asked }
    }

    /// Asks for the path of a file; returns true if there is a dialog to ask with. Must run on the window's thread, which
    /// some desktops require.
    pub fn ask(&mut self, task: &FileTask) -> bool {
        if self.desktop == Desktop::None {
            return false;
        }
        let choice = choice(task);
        let asked = Instant::now();
        let work = move || match pollster::block_on(choice) {
            Some(file) => Answer::Chosen(file.path().to_owned()),
            None if asked.elapsed() < NO_PERSON => Answer::NoDialog,
            None => Answer::Cancelled,
        };
        self.asked
            .start(task.clone(), work, |answer| answer.unwrap_or(Answer::NoDialog));
        true
    }

    /// Returns the next answer, if one has come, with its task.
    pub fn next_answer(&mut self) -> Option<(FileTask, Answer)> {
        self.asked.next()
    }
}

/// Shows the dialog.
fn choice(task: &FileTask) -> Pin<Box<dyn Future<Output = Option<FileHandle>> + Send>> {
    let suggestion = task.suggested_path();
    let mut dialog = rfd::AsyncFileDialog::new().set_title(task.title());
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
    let remembered = file.as_ref().map(|file| file.remembered.clone()).unwrap_or_default();
    let icon = eframe::icon_data::from_png_bytes(include_bytes!("../../../assets/icon.png"));
    let mut viewport = egui::ViewportBuilder::default()
        .with_title("Decoupler")
        .with_app_id("decoupler")
        .with_inner_size(remembered.opening_size_points())
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
        // The last checkpoint of a running training stays.
        on_termination(|status| exit_leaving_nothing(i32::from(status)));
        Ok::<Box<dyn eframe::App>, Box<dyn std::error::Error + Send + Sync>>(Box::new(window))
    };
    // A missing library makes the window system panic with the name of the library.
    let run = || eframe::run_native("Decoupler", options, Box::new(create));
    match std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)) {
        Ok(Ok(())) => Ok(()),
        Ok(Err(error)) => Err(OpenError::NoWindow(error.to_string())),
        Err(_) => Err(OpenError::Failed),
    }
}

impl DecouplerWindow {
    /// Gives files dropped on the window to the view that takes them, and shows it.
    pub(super) fn take_dropped(&mut self, ctx: &Context) {
        let dropped = ctx.input_mut(|input| std::mem::take(&mut input.raw.dropped_files));
        let mut paths: Vec<PathBuf> = dropped.iter().map(|file| file.path().to_owned()).collect();
        // A question must be answered first.
        if self.modal.is_some() {
            return;
        }
        paths.append(&mut self.given);
        if paths.is_empty() {
            return;
        }
        match Command::OpenFiles.obstacle(&self.shared) {
            Some(obstacle) => self.notices.fail(Matter::Recording, obstacle),
            None => self.views.open_files(paths),
        }
        self.show(ViewKind::Train);
        ctx.request_repaint();
    }

    /// Shows over the window what dropping the files under the pointer will do.
    pub(super) fn dropping_ui(&self, ui: &Ui) {
        let is_hovered = ui.input(|input| !input.raw.hovered_files.is_empty());
        if !is_hovered || self.modal.is_some() {
            return;
        }
        let palette = Theme::of(ui).palette;
        let painter = ui
            .ctx()
            .layer_painter(LayerId::new(Order::Foreground, Id::unique("dropping")));
        let whole = ui.ctx().content_rect().shrink(space(2));
        let (fill, stroke) = (
            palette.background.gamma_multiply(0.85),
            Stroke::new(2.0, palette.accent),
        );
        painter.rect(whole, radius(), fill, stroke, StrokeKind::Inside);
        let font = FontId::proportional(type_size().title);
        let text = Command::OpenFiles.obstacle(&self.shared);
        let text = text.unwrap_or("Drop to open, or to add to the recording");
        painter.text(whole.center(), Align2::CENTER_CENTER, text, font, palette.text);
    }
}

#[cfg(test)]
mod tests {
    use std::{
        fs,
        sync::{Arc, mpsc::channel},
    };

    use decoupler_files::export::{WriteError, atomic_write};

    use super::*;
    use crate::window::shared::FileWords;

    const WORDS: FileWords = FileWords {
        kind: "table",
        description: "",
        extensions: &["csv"],
    };

    #[test]
    fn every_file_is_reported_even_if_writing_it_panicked() {
        let (woke, wakes) = channel();
        let mut files = Files::new(Jobs::new(Arc::new(move || woke.send(()).unwrap_or(()))));
        let folder = tempfile::tempdir().unwrap();
        let [whole, broken, missing] = ["whole", "broken", "none/missing"].map(|name| folder.path().join(name));
        let message = "it is there".to_owned();
        let to_write = |path: &PathBuf| ToWrite {
            task: FileTask::save(WORDS, "table", |_| Err("unused")),
            path: path.clone(),
            asks: true,
        };
        let write = move |path: &Path| fs::write(path, "text").map(|()| message);
        files.write(to_write(&whole), Vec::new(), write);
        let write = |_: &Path| -> Result<String, WriteError> { panic!("a defect") };
        files.write(to_write(&broken), Vec::new(), write);
        let write = |path: &Path| atomic_write(path, |_| Ok(())).map(|()| String::new());
        files.write(to_write(&missing), Vec::new(), write);
        assert_eq!(files.paths().count(), 3);
        let mut written = Vec::new();
        while written.len() < 3 {
            wakes.recv_timeout(Duration::from_secs(600)).unwrap();
            written.extend(std::iter::from_fn(|| files.next_written()));
        }
        assert_eq!(files.paths().count(), 0);
        written.sort_by_key(|(to_write, _)| {
            [&missing, &whole, &broken]
                .iter()
                .position(|path| **path == to_write.path)
        });
        let written: Vec<_> = written.into_iter().map(|(_, written)| written).collect();
        let [
            Written::Failed(of_missing),
            Written::Done(message),
            Written::Failed(of_broken),
        ] = &written[..]
        else {
            panic!("{written:?}")
        };
        assert!(of_missing.contains("does not exist"), "{of_missing}");
        assert_eq!(message, "it is there");
        assert!(of_broken.contains(&broken.display().to_string()) && of_broken.contains("a defect"));
    }

    #[test]
    fn another_file_is_replaced_only_after_asking() {
        let (woke, wakes) = channel();
        let mut files = Files::new(Jobs::new(Arc::new(move || woke.send(()).unwrap_or(()))));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table");
        fs::write(&path, "mine").unwrap();
        for (asks, outcome, text) in [
            (true, Written::Exists, "mine"),
            (false, Written::Done(String::new()), "new"),
        ] {
            let to_write = ToWrite {
                task: FileTask::save(WORDS, "table", |_| Err("unused")),
                path: path.clone(),
                asks,
            };
            files.write(to_write, Vec::new(), |path| {
                fs::write(path, "new").map(|()| String::new())
            });
            let (_, written) = loop {
                wakes.recv_timeout(Duration::from_secs(600)).unwrap();
                if let Some(written) = files.next_written() {
                    break written;
                }
            };
            assert_eq!(written, outcome);
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
    }

    #[test]
    fn dropping_waits_for_files_being_written() {
        let (begun, has_begun) = channel();
        let (gate, opened) = channel::<()>();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("slow");
        let mut files = Files::new(Jobs::new(Arc::new(|| ())));
        let to_write = ToWrite {
            task: FileTask::save(WORDS, "slow", |_| Err("unused")),
            path: path.clone(),
            asks: true,
        };
        files.write(to_write, Vec::new(), move |path| {
            begun.send(()).unwrap();
            opened.recv().unwrap();
            fs::write(path, "text").map(|()| String::new())
        });
        has_begun.recv().unwrap();
        gate.send(()).unwrap();
        drop(files);
        assert_eq!(fs::read(path).unwrap(), b"text");
    }
}
