//! The clipboard, which reports whether it took what was put on it.

use std::{
    env, fmt,
    sync::{Arc, Mutex, PoisonError},
};

use super::{Desktop, copying::not_copied};
use crate::window::shared::Notice;

/// Something to be put on the clipboard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// Text.
    Text(String),
    /// Width and height in pixels, and four bytes a pixel, row by row.
    Picture { size: [usize; 2], rgba: Vec<u8> },
}

type Put = dyn Fn(Content) -> Result<(), String> + Send + Sync;

/// Place to which things are copied.
#[derive(Clone)]
pub(super) enum Clipboard {
    /// The system's, which reports whether it took them.
    System(Arc<Put>),
    /// The system's under Wayland: a compositor may let a program copy by its focused window only, which reports nothing.
    /// So text goes both ways.
    Wayland(Arc<Put>),
    /// The toolkit's alone.
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

    /// Puts `content` on the clipboard. Returns what the toolkit has to copy, and the message for the user then: `notice` if
    /// the clipboard has it.
    pub(super) fn take(&self, content: Content, notice: String) -> (Option<Content>, Notice) {
        match self {
            Self::Toolkit => (Some(content), Notice::Done(notice)),
            Self::System(put) => (None, told(put(content), notice)),
            Self::Wayland(put) => match &content {
                Content::Picture { .. } => (None, told(put(content), notice)),
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

const UNCONFIRMED: &str = "This desktop does not confirm it: if it cannot be pasted, export a file instead";

fn told(put: Result<(), String>, notice: String) -> Notice {
    match put {
        Ok(()) => Notice::Done(notice),
        Err(reason) => not_copied(&reason),
    }
}

/// The system's clipboard. Under X11 its contents last as long as what is returned here, for the program that copied hands
/// them out itself.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clipboard_that_refuses_is_told_as_a_failure_and_never_as_copied() {
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
        // A window under Wayland may copy text though it cannot learn whether that worked.
        let wayland = Clipboard::Wayland(refusing);
        let unconfirmed = done(&format!("Copied it. {UNCONFIRMED}"));
        assert_eq!(copied(&wayland, &text), (Some(text.clone()), unconfirmed));
        assert_eq!(copied(&wayland, &picture), (None, refused));
        let wayland = Clipboard::Wayland(Arc::new(|_| Ok(())));
        assert_eq!(copied(&wayland, &text), (Some(text.clone()), done("Copied it")));
    }
}
