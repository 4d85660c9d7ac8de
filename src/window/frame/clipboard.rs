//! The clipboard, which reports whether copying succeeded.
//!
//! Text and pictures are copied in the background.

use std::{
    env,
    sync::{Arc, Mutex, PoisonError},
};

use eframe::egui::ColorImage;

use super::{DecouplerWindow, Desktop};
use crate::window::{
    job::{Background, JobError, Wake},
    shared::{Matter, Notice, ToCopy},
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
pub(super) struct Clipboard {
    /// The system's clipboard, which reports whether copying succeeded; without it, the toolkit copies.
    system: Option<Arc<Put>>,
    /// True under Wayland. A compositor may let a program copy only through its focused window, which reports nothing, so text
    /// is copied both ways.
    is_wayland: bool,
}

impl Clipboard {
    /// The clipboard of a desktop.
    pub(super) fn of(desktop: Desktop) -> Self {
        let is_set = |name| env::var_os(name).is_some_and(|value| !value.is_empty());
        Self {
            system: (desktop == Desktop::Native).then(system),
            is_wayland: ["WAYLAND_DISPLAY", "WAYLAND_SOCKET"].into_iter().any(is_set),
        }
    }

    /// Puts `content` on the clipboard. Returns the content left for the toolkit to copy, and the message for the user:
    /// `notice` on success.
    fn take(&self, content: Content, notice: String) -> Copied {
        let Some(put) = &self.system else {
            return (Some(content), Notice::Done(notice));
        };
        let is_text = matches!(content, Content::Text(_));
        let for_toolkit = (self.is_wayland && is_text).then(|| content.clone());
        let notice = match put(content) {
            Ok(()) => Notice::Done(notice),
            Err(_) if for_toolkit.is_some() => Notice::Done(format!("{notice}. {UNCONFIRMED}")),
            Err(reason) => not_copied(&reason),
        };
        (for_toolkit, notice)
    }
}

const UNCONFIRMED: &str = "This desktop does not confirm copying: if pasting fails, export a file instead";

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

/// Outcome of copying: the content left for the toolkit to copy, if any, and the message for the user.
type Copied = (Option<Content>, Notice);

/// Content being copied in the background; the newest wins.
pub(super) struct Copying {
    clipboard: Clipboard,
    job: Background<Result<Copied, JobError>>,
}

impl Copying {
    pub(super) fn new(desktop: Desktop, wake: Wake) -> Self {
        Self {
            clipboard: Clipboard::of(desktop),
            job: Background::prompt("clipboard", wake),
        }
    }
}

/// Notice that nothing was copied.
fn not_copied(reason: &str) -> Notice {
    Notice::Failed(format!("Nothing was copied: {}", reason.trim_end_matches('.')))
}

impl DecouplerWindow {
    /// Copies `to_copy`; `notice` is the message for the user once the clipboard has it.
    pub(super) fn copy(&mut self, to_copy: ToCopy, notice: String) {
        let clipboard = self.copying.clipboard.clone();
        let copy = move || match to_copy {
            ToCopy::Text(text) => clipboard.take(Content::Text(text), notice),
            ToCopy::Picture(figure) => match figure.draw().pixels() {
                Ok((size, rgba)) => clipboard.take(Content::Picture { size, rgba }, notice),
                Err(error) => (None, not_copied(&error.to_string())),
            },
        };
        self.copying.job.abandon();
        self.copying.job.start(move |_| copy(), |copied| copied);
    }

    /// Shows a notice of what was copied.
    pub(super) fn take_copied(&mut self) {
        while let Some(copied) = self.copying.job.next_event() {
            let (for_toolkit, notice) = copied.unwrap_or_else(|error| (None, not_copied(&error.to_string())));
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusing_clipboard_is_reported_as_a_failure_and_never_as_copied() {
        let refusing: Arc<Put> = Arc::new(|_| Err("another program holds it.".to_owned()));
        let willing: Arc<Put> = Arc::new(|_| Ok(()));
        let on = |put: &Arc<Put>, is_wayland| Clipboard {
            system: Some(Arc::clone(put)),
            is_wayland,
        };
        let text = Content::Text("1".to_owned());
        let picture = Content::Picture {
            size: [1, 1],
            rgba: vec![0; 4],
        };
        let refused = Notice::Failed("Nothing was copied: another program holds it".to_owned());
        let done = |text: &str| Notice::Done(text.to_owned());
        let copied = |clipboard: &Clipboard, content: &Content| clipboard.take(content.clone(), "Copied it".to_owned());
        for content in [&text, &picture] {
            let clipboard = on(&refusing, false);
            assert_eq!(copied(&clipboard, content), (None, refused.clone()));
            let clipboard = on(&willing, false);
            assert_eq!(copied(&clipboard, content), (None, done("Copied it")));
        }
        // Under Wayland a window may copy text without learning whether that succeeded.
        let wayland = on(&refusing, true);
        let unconfirmed = done(&format!("Copied it. {UNCONFIRMED}"));
        assert_eq!(copied(&wayland, &text), (Some(text.clone()), unconfirmed));
        assert_eq!(copied(&wayland, &picture), (None, refused));
        let wayland = on(&willing, true);
        assert_eq!(copied(&wayland, &text), (Some(text.clone()), done("Copied it")));
    }
}
