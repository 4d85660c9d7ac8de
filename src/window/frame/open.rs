use directories::ProjectDirs;
use eframe::{NativeOptions, egui};
use thiserror::Error;

use super::{
    DecouplerWindow, Desktop,
    remembered::{MIN_SIZE_POINTS, Remembered, WindowFile},
};

/// Reasons for which the window cannot open.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum OpenError {
    /// Nothing to open it on.
    #[error("there is no display to open a window on; `decoupler train --help` does the same work in a terminal")]
    NoDisplay,
    /// No OpenGL on it, or the display refuses.
    #[error("no window can be opened here: {0}; {PACKAGES}")]
    NoWindow(String),
    /// A library that the window needs cannot be loaded, or the window itself failed.
    #[error("the window failed as said above; {PACKAGES}")]
    Failed,
}

/// Advice on the packages that a bare system lacks.
const PACKAGES: &str = "on a bare Debian, install libxcursor1 libxi6 libxkbcommon-x11-0 libgl1-mesa-dri, or work in a \
                        terminal: `decoupler train --help`";

/// Opens the window and returns when it is closed.
///
/// # Errors
/// There is no display, or no OpenGL on it.
pub fn open() -> Result<(), OpenError> {
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
        let window = DecouplerWindow::new(&creation.egui_ctx, Desktop::Native, file);
        let window = match &folders {
            Some(folders) => window.keeping_runs(folders.data_dir().join("runs")),
            None => window,
        };
        Ok::<Box<dyn eframe::App>, Box<dyn std::error::Error + Send + Sync>>(Box::new(window))
    };
    // A library that is not there makes the window system panic, with the library's name.
    let run = || eframe::run_native("Decoupler", options, Box::new(create));
    match std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)) {
        Ok(Ok(())) => Ok(()),
        Ok(Err(error)) => Err(OpenError::NoWindow(error.to_string())),
        Err(_) => Err(OpenError::Failed),
    }
}
