//! The state that the window remembers: whatever the file contains, the window opens, draws and closes, and then remembers
//! possible values.

use std::{fs, path::Path};

use decoupler::window::{DecouplerWindow, Desktop, WindowFile};
use eframe::egui::{Context, Pos2, RawInput, Rect, vec2};
use serde_json::Value;

use crate::{
    corpus::replay,
    mutation::{accepted, mutated_document},
};

/// Number of frames that the window draws.
const FRAMES: usize = 2;

/// Opens the window on the file, draws it, and closes it; returns the description of what it has read.
fn open(path: &Path) -> String {
    let file = WindowFile::read(path.to_owned());
    let read = format!("{file:?}");
    // Outside of names, which may be any text.
    let unescaped = read.replace("\\\"", "");
    assert!(
        !unescaped.split('"').step_by(2).any(|part| part.contains("NaN")),
        "{read}"
    );
    let ctx = Context::default();
    let mut window = DecouplerWindow::new(&ctx, Desktop::None, Some(file));
    for _ in 0..FRAMES {
        window.take_events();
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(1440.0, 900.0))),
            ..RawInput::default()
        };
        ctx.run_ui(input, |ui| window.show_ui(ui))
            .drop_without_applying_deltas();
        let notice = window.notice().map(|notice| format!("{notice:?}")).unwrap_or_default();
        assert!(!notice.contains("panic"), "{notice}: {read}");
    }
    read
}

/// Returns true if the file is read as the state of a window.
fn check(path: &Path, bytes: &[u8]) -> bool {
    fs::write(path, bytes).unwrap();
    let first = open(path);
    let written = fs::read(path).unwrap();
    let is_rewritten = serde_json::from_slice::<Value>(&written).is_ok_and(|state| state["view"].is_string());
    assert!(is_rewritten, "{}", String::from_utf8_lossy(&written));
    let second = open(path);
    // The second window changes nothing.
    assert_eq!(fs::read(path).unwrap(), written, "{first}\n{second}");
    !first.contains("draft: None")
}

#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("window.json");
    replay!(3, |bytes: &[u8]| {
        usize::from(check(&path, bytes)) + accepted(1, |rng| check(&path, &mutated_document(bytes, rng)))
    });
}
