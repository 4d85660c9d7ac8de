//! Frames of the Own data view with a large recording open and a network trained on it.

use std::{
    fmt::Write as _,
    fs, io,
    path::{Path, PathBuf},
    sync::Arc,
    thread::sleep,
    time::{Duration, Instant},
};

use eframe::egui::{self, Event, Key, Modifiers, PointerButton, Pos2, accesskit::Node, pos2};

use super::{Bench, FRAME};

const ROWS: usize = 200_000;
const INPUTS: usize = 16;
const TARGETS: usize = 4;
/// Time within which the training must have begun and ended.
const PATIENCE: Duration = Duration::from_secs(120);

#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        fs::read(&self.0).map_err(|error| error.to_string())
    }
}

pub(super) fn dropped(path: PathBuf) -> Arc<dyn egui::DroppedFile + Send + Sync> {
    Arc::new(Dropped(path))
}

/// Writes readings that are nearly linear in a wandering position and force.
fn write_recording(path: &Path) -> io::Result<()> {
    let names = (1..=INPUTS).map(|input| format!("u{input} (V)"));
    let mut text: String = names
        .chain(["x (mm),y (mm),force (N),angle (deg)".to_owned()])
        .collect::<Vec<_>>()
        .join(",");
    text.push('\n');
    for row in 0..ROWS {
        let t = row as f64 * 0.01;
        let targets = [0.37, 0.23, 0.11, 0.05].map(|rate| (rate * t).sin() * 5.0);
        for input in 0..INPUTS {
            let at = input as f64;
            let sum: f64 = targets
                .iter()
                .enumerate()
                .map(|(k, value)| value * (at + k as f64).cos())
                .sum();
            let _ = write!(text, "{:.5},", sum + 0.01 * sum * sum);
        }
        let [x, y, force, angle] = targets;
        let _ = writeln!(text, "{x:.4},{y:.4},{force:.4},{angle:.4}");
    }
    fs::write(path, text)
}

impl Bench {
    /// Draws a frame, and returns its output for assistive technology.
    fn nodes(&mut self) -> Vec<Node> {
        self.ctx.enable_accesskit();
        self.frame(Vec::new());
        self.ctx.disable_accesskit();
        let nodes = self.nodes.take().map(|update| update.nodes).unwrap_or_default();
        nodes.into_iter().map(|(_, node)| node).collect()
    }

    fn says(&mut self, text: &str) -> bool {
        let nodes = self.nodes();
        let contains = |said: Option<&str>| said.is_some_and(|said| said.contains(text));
        nodes
            .iter()
            .any(|node| contains(node.label()) || contains(node.value()))
    }

    /// Waits until the window contains this text; returns false on a timeout.
    fn wait_for(&mut self, text: &str) -> bool {
        let latest = Instant::now() + PATIENCE;
        while Instant::now() < latest {
            if self.says(text) {
                return true;
            }
            sleep(FRAME);
        }
        false
    }

    fn place_of(&mut self, label: &str) -> Option<Pos2> {
        let nodes = self.nodes();
        let node = nodes.iter().find(|node| node.label() == Some(label))?;
        let bounds = node.bounds()?;
        let middle = |one: f64, other: f64| (0.5 * (one + other)) as f32;
        Some(pos2(middle(bounds.x0, bounds.x1), middle(bounds.y0, bounds.y1)))
    }

    fn click(&mut self, label: &str) -> bool {
        let Some(pos) = self.place_of(label) else { return false };
        let button = |pressed| Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        };
        for events in [
            vec![Event::PointerMoved(pos)],
            vec![button(true)],
            vec![button(false)],
            Vec::new(),
        ] {
            self.frame(events);
        }
        true
    }

    fn press(&mut self, key: Key, modifiers: Modifiers) {
        self.frame(vec![Event::Key {
            key,
            physical_key: None,
            pressed: true,
            repeat: false,
            modifiers,
        }]);
    }
}

/// Prints the time of frames with [`ROWS`] rows open.
pub(super) fn measure() {
    let Ok(folder) = tempfile::tempdir() else { return };
    let path = folder.path().join("large.csv");
    if let Err(error) = write_recording(&path) {
        println!("no recording could be written: {error}");
        return;
    }
    let columns = INPUTS + TARGETS;
    let mut bench = Bench::open();
    bench.dropped.push(path);
    if !bench.wait_for("Test: ") {
        println!("the recording was not opened");
        return;
    }
    let over = |number: usize| {
        let turn = number as f32 * 0.05;
        vec![Event::PointerMoved(pos2(
            700.0 + 120.0 * turn.cos(),
            300.0 + 90.0 * turn.sin(),
        ))]
    };
    let name = |what: &str| format!("own data, {ROWS} × {columns}: {what}");
    bench.measure(&name("columns"), over);
    bench.press(Key::Enter, Modifiers::COMMAND);
    if !bench.wait_for("Epoch 1") {
        println!("no training began");
        return;
    }
    bench.measure(&name("training, error map"), over);
    bench.press(Key::Period, Modifiers::COMMAND);
    bench.wait_for("stopped by you");
    for chart in ["Error map", "Regression", "Sample", "Loss"] {
        if bench.click(chart) {
            bench.measure(&name(&format!("trained, {}", chart.to_lowercase())), over);
        }
    }
    if bench.click("Runs") {
        bench.measure(&name("list of networks"), over);
    }
}
