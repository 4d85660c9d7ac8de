//! The clipboard, which reports whether copying succeeded.
//!
//! Text and pictures are copied in the background.

use std::{
    env, fmt,
    sync::{Arc, Mutex, PoisonError},
};

use decoupler_files::figure::Figure;
use eframe::egui::ColorImage;

use super::{DecouplerWindow, Desktop};
use crate::window::{
    job::{Background, JobError, Wake},
    shared::{Matter, Notice},
};

/// Content for the clipboard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// Text.
    Text(String),
    /// Width and height in pixels, and four bytes per pixel, row by row.
    Picture { size: [usize; 2], rgba: Vec<u8> },
}

type Put = dyn Fn(Content) -> Result<(), String> + Send + Sync;

/// Destination of copies.
#[derive(Clone)]
pub(super) enum Clipboard {
    /// The system's clipboard, which reports whether copying succeeded.
    System(Arc<Put>),
    /// The system's clipboard under Wayland. A compositor may let a program copy only through its focused window, which
    /// reports nothing, so text is copied both ways.
    Wayland(Arc<Put>),
    /// The toolkit's clipboard alone.
    Toolkit,
}

impl Clipboard {
    /// The clipboard of a desktop.
    pub(super) fn of(desktop: Desktop) -> Self {
        let has_wayland = ["WAYLAND_DISPLAY", "WAYLAND_SOCKET"]
            .iter()
            .any(|name| env::var_os(name).is_some_and(|value| !value.is_empty()));
        match desktop {
            Desktop::None => Self::Toolkit,
            Desktop::Native if has_wayland => Self::Wayland(system()),
            Desktop::Native => Self::System(system()),
        }
    }

    /// Puts `content` on the clipboard. Returns the content left for the toolkit to copy, and the message for the user:
    /// `notice` on success.
    pub(super) fn take(&self, content: Content, notice: String) -> (Option<Content>, Notice) {
        match self {
            Self::Toolkit => (Some(content), Notice::Done(notice)),
            Self::System(put) => (None, outcome(put(content), notice)),
            Self::Wayland(put) => match &content {
                Content::Picture { .. } => (None, outcome(put(content), notice)),
                Content::Text(_) => {
                    let notice = match put(content.clone()) {
                        Ok(()) => notice,
                        Err(_) => format!("{notice}. {UNCONFIRMED}"),
                    };
                    (Some(content), Notice::Done(notice))
                }
            },
        }
    }
}

const UNCONFIRMED: &str = "This desktop does not confirm copying: if pasting fails, export a file instead";

fn outcome(put: Result<(), String>, notice: String) -> Notice {
    match put {
        Ok(()) => Notice::Done(notice),
        Err(reason) => not_copied(&reason),
    }
}

/// Returns access to the system's clipboard. Under X11 its contents last only as long as the returned value, because the
/// program that copied serves them itself.
fn system() -> Arc<Put> {
    let opened: Mutex<Option<arboard::Clipboard>> = Mutex::new(None);
    Arc::new(move |content| {
        let mut opened = opened.lock().unwrap_or_else(PoisonError::into_inner);
        let put = || -> Result<arboard::Clipboard, arboard::Error> {
            // After a failure it is opened again.
            let mut clipboard = opened.take().map_or_else(arboard::Clipboard::new, Ok)?;
            match content {
                Content::Text(text) => clipboard.set_text(text)?,
                Content::Picture {
                    size: [width, height],
                    rgba,
                } => {
                    let bytes = rgba.into();
                    clipboard.set_image(arboard::ImageData { width, height, bytes })?;
                }
            }
            Ok(clipboard)
        };
        *opened = Some(put().map_err(|error| error.to_string())?);
        Ok(())
    })
}

impl fmt::Debug for Clipboard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::System(_) => "System",
            Self::Wayland(_) => "Wayland",
            Self::Toolkit => "Toolkit",
        })
    }
}

/// Something to be copied.
#[derive(Debug)]
pub(super) enum ToCopy {
    /// Text as it is.
    Text(String),
    /// A picture, still to be drawn.
    Picture(Box<Figure>),
}

impl ToCopy {
    fn into_content(self) -> Result<Content, String> {
        match self {
            Self::Text(text) => Ok(Content::Text(text)),
            Self::Picture(figure) => {
                let (size, rgba) = figure.draw().pixels().map_err(|error| error.to_string())?;
                Ok(Content::Picture { size, rgba })
            }
        }
    }
}

/// Outcome of copying: the content left for the toolkit to copy, if any, and the message for the user.
type Copied = (Option<Content>, Notice);

/// Content being copied in the background; the newest wins.
#[derive(Debug)]
pub(super) struct Copying {
    clipboard: Clipboard,
    job: Background<Result<Copied, JobError>>,
}

impl Copying {
    pub(super) fn new(clipboard: Clipboard, wake: Wake) -> Self {
        Self {
            clipboard,
            job: Background::prompt("clipboard", wake),
        }
    }

    /// Copies `to_copy`; `notice` is the message for the user once the clipboard has it.
    pub(super) fn start(&mut self, to_copy: ToCopy, notice: String) {
        let clipboard = self.clipboard.clone();
        self.job.abandon();
        self.job.start(
            move |_| match to_copy.into_content() {
                Ok(content) => clipboard.take(content, notice),
                Err(reason) => (None, not_copied(&reason)),
            },
            |copied| copied,
        );
    }
}

/// Notice that nothing was copied.
pub(super) fn not_copied(reason: &str) -> Notice {
    Notice::Failed(format!("Nothing was copied: {}", reason.trim_end_matches('.')))
}

impl DecouplerWindow {
    /// Copies text; `notice` is the message for the user once the clipboard has it.
    pub(super) fn copy_text(&mut self, text: String, notice: String) {
        match &self.copying.clipboard {
            // There is nothing to wait for.
            toolkit @ Clipboard::Toolkit => {
                let copied = toolkit.take(Content::Text(text), notice);
                self.report_copied(copied);
            }
            _ => self.copying.start(ToCopy::Text(text), notice),
        }
    }

    /// Shows a notice of what was copied.
    pub(super) fn take_copied(&mut self) {
        while let Some(copied) = self.copying.job.next_event() {
            self.report_copied(copied.unwrap_or_else(|error| (None, not_copied(&error.to_string()))));
        }
    }

    fn report_copied(&mut self, (for_toolkit, notice): Copied) {
        match for_toolkit {
            Some(Content::Text(text)) => self.ctx.copy_text(text),
            Some(Content::Picture { size, rgba }) => {
                self.ctx.copy_image(ColorImage::from_rgba_unmultiplied(size, &rgba));
            }
            None => {}
        }
        self.notices.add(Matter::Clipboard, notice);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusing_clipboard_is_reported_as_a_failure_and_never_as_copied() {
        let refusing: Arc<Put> = Arc::new(|_| Err("another program holds it.".to_owned()));
        let text = Content::Text("1".to_owned());
        let picture = Content::Picture {
            size: [1, 1],
            rgba: vec![0; 4],
        };
        let refused = Notice::Failed("Nothing was copied: another program holds it".to_owned());
        let done = |text: &str| Notice::Done(text.to_owned());
        let copied = |clipboard: &Clipboard, content: &Content| clipboard.take(content.clone(), "Copied it".to_owned());
        for content in [&text, &picture] {
            let clipboard = Clipboard::System(Arc::clone(&refusing));
            assert_eq!(copied(&clipboard, content), (None, refused.clone()));
            let clipboard = Clipboard::System(Arc::new(|_| Ok(())));
            assert_eq!(copied(&clipboard, content), (None, done("Copied it")));
        }
        // Under Wayland a window may copy text without learning whether that succeeded.
        let wayland = Clipboard::Wayland(refusing);
        let unconfirmed = done(&format!("Copied it. {UNCONFIRMED}"));
        assert_eq!(copied(&wayland, &text), (Some(text.clone()), unconfirmed));
        assert_eq!(copied(&wayland, &picture), (None, refused));
        let wayland = Clipboard::Wayland(Arc::new(|_| Ok(())));
        assert_eq!(copied(&wayland, &text), (Some(text.clone()), done("Copied it")));
    }
}
