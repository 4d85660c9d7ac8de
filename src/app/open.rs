use eframe::{NativeOptions, egui};
use thiserror::Error;

use super::{DecouplerWindow, DialogKind};

/// Why the window cannot open.
#[derive(Debug, Error)]
pub enum OpenError {
    /// No display, or no OpenGL on it.
    #[error("no window can be opened here ({0}); `decoupler train --help` does the same work in a terminal")]
    NoWindow(String),
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// There is no display to open it on.
pub fn open() -> Result<(), OpenError> {
    let icon = eframe::icon_data::from_png_bytes(include_bytes!("../../assets/icon.png"));
    let mut viewport = egui::ViewportBuilder::default()
        .with_title("Decoupler")
        .with_app_id("decoupler")
        .with_inner_size([1440.0, 900.0])
        .with_min_inner_size([960.0, 640.0]);
    if let Ok(icon) = icon {
        viewport = viewport.with_icon(icon);
    }
    let options = NativeOptions {
        viewport,
        // egui smooths lines and text itself, but not the meshes of the surfaces.
        multisampling: 4,
        ..NativeOptions::default()
    };
    let create = |creation: &eframe::CreationContext<'_>| {
        let window = DecouplerWindow::new(&creation.egui_ctx, DialogKind::Native)?;
        Ok::<Box<dyn eframe::App>, Box<dyn std::error::Error + Send + Sync>>(Box::new(window))
    };
    eframe::run_native("Decoupler", options, Box::new(create)).map_err(|error| OpenError::NoWindow(error.to_string()))
}
