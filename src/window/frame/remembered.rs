use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use decoupler_core::{
    dataset::Simulation,
    evaluation::{RunSettings, TrainingSize, Workload},
};
use decoupler_files::{
    export::{WriteError, atomic_write},
    figure::SequentialMap,
    machine::memory_budget,
};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::DecouplerWindow;
use crate::window::{
    job::{Background, JobError, Jobs},
    shared::{Matter, OpenPlan, SourceKind},
};

/// Default size of the window, in points.
const DEFAULT_SIZE_POINTS: [f32; 2] = [1440.0, 900.0];

/// Minimum size of the window, in points.
pub(super) const MIN_SIZE_POINTS: [f32; 2] = [960.0, 640.0];

/// State of the window that is restored at the next start. A value is stored only once the user has set it.
///
/// In the file, a value that cannot be read or is outside its limits counts as missing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct Remembered {
    /// The theme, if the user has chosen one.
    pub(super) is_dark: Option<bool>,
    /// Colours of values, if the user has chosen them.
    pub(super) colours: Option<SequentialMap>,
    /// The name of the current view.
    pub(super) view: Option<String>,
    /// The settings of the next training on a simulated array.
    pub(super) draft: Option<RunSettings>,
    /// Source of the next training.
    pub(super) source: Option<SourceKind>,
    /// Settings of the next training on a recording.
    pub(super) recording: Option<RunSettings>,
    /// Whether they are chosen automatically.
    pub(super) is_auto: Option<bool>,
    /// Plan of the recording that is open, with absolute paths.
    pub(super) plan: Option<OpenPlan>,
    /// Width and height of the window.
    pub(super) size_points: Option<[f32; 2]>,
    /// Interface scale relative to the default, if the user has chosen one.
    pub(super) scale: Option<f32>,
    /// Width of the column on the left, if the user has changed it.
    pub(super) form_points: Option<f32>,
    /// As for the column on the right.
    pub(super) report_points: Option<f32>,
}

/// The file of the remembered state, as read at the start.
#[derive(Clone, Debug)]
pub struct WindowFile {
    pub(super) path: PathBuf,
    pub(super) remembered: Remembered,
    /// Message on a file that cannot be read.
    pub(super) damage: Option<String>,
}

impl WindowFile {
    /// Reads the file at `path`; a missing file counts as empty.
    pub fn read(path: PathBuf) -> Self {
        let remembered = Remembered::read(&path);
        let damage = remembered.is_none().then(|| {
            let path = path.display();
            format!("View, theme and settings of the last start are not restored: '{path}' is damaged")
        });
        Self {
            path,
            remembered: remembered.unwrap_or_default(),
            damage,
        }
    }
}

impl Remembered {
    /// Reads the file at `path`; a missing file counts as empty. Returns `None` if the file is damaged.
    fn read(path: &Path) -> Option<Self> {
        /// Much more than the program writes.
        const LARGEST_BYTES: u64 = 1 << 20;
        // Opening a pipe would wait for a program that writes to it.
        let Some(found) = fs::metadata(path).ok().filter(fs::Metadata::is_file) else {
            return Some(Self::default());
        };
        let text = (found.len() <= LARGEST_BYTES).then(|| fs::read(path).ok()).flatten()?;
        let values: Map<String, Value> = serde_json::from_slice(&text).ok()?;
        let mut read = json!({});
        for (name, mut value) in values {
            // As version 0.1.0 wrote the settings of an array.
            if let Some(source) = value.get_mut("source").filter(|source| source.get("sensor").is_some()) {
                *source = json!({ "simulated": source.take() });
            }
            let before = std::mem::replace(&mut read[&name], value);
            if Self::deserialize(&read).is_err() {
                read[&name] = before;
            }
        }
        let mut read = Self::deserialize(&read).ok()?;
        read.draft = read.draft.filter(is_within_limits);
        Some(read)
    }

    /// Writes the file at `path`, and creates its folder if it is missing.
    pub(super) fn write(&self, path: &Path) -> Result<(), WriteError> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|source| WriteError::io(folder, source))?;
        }
        atomic_write(path, |file| {
            serde_json::to_writer_pretty(file, self).map_err(Into::into)
        })
    }

    /// Returns the width and height with which the window opens; the window system limits them to the screen.
    pub(super) fn opening_size_points(&self) -> [f32; 2] {
        let is_possible = |size: &[f32; 2]| {
            let mut sides = size.iter().zip(MIN_SIZE_POINTS);
            sides.all(|(side, least)| side.is_finite() && *side >= least)
        };
        self.size_points.filter(is_possible).unwrap_or(DEFAULT_SIZE_POINTS)
    }

    /// Remembers the size of a window.
    pub(super) fn take_size_points(&mut self, size: [f32; 2]) {
        self.size_points = Some(size.map(f32::round));
    }
}

/// Returns `true` if the settings could be trained with on this machine.
pub(super) fn is_within_limits(settings: &RunSettings) -> bool {
    let Some(Simulation { sensor, scene, .. }) = settings.simulation() else {
        return false;
    };
    settings.check_counts().is_ok()
        && settings.training.check().is_ok()
        && sensor.check().is_ok()
        && scene.check().is_ok()
        && TrainingSize::drawn(settings)
            .is_ok_and(|size| Workload::of(settings, size).check_memory(memory_budget()).is_ok())
}

/// Longest time that closing waits for the file.
const LONGEST_WAIT: Duration = Duration::from_secs(2);

type Written = Result<Result<(), WriteError>, JobError>;

/// The file of the remembered state, written in the background.
#[derive(Debug)]
pub(super) struct Memory {
    path: PathBuf,
    /// Contents of the file, or those being written to it.
    written: Remembered,
    latest: Remembered,
    job: Background<Written>,
    has_reported: bool,
}

impl Memory {
    pub(super) fn new(file: WindowFile, jobs: &Jobs) -> Self {
        let WindowFile { path, remembered, .. } = file;
        Self {
            path,
            written: remembered.clone(),
            latest: remembered,
            job: Background::prompt("memory", jobs),
            has_reported: false,
        }
    }

    /// Updates the state to be remembered; writes it if `may_write`, otherwise later.
    fn keep(&mut self, latest: Remembered, may_write: bool) {
        self.latest = latest;
        if may_write && self.latest != self.written && !self.job.is_under_way() {
            self.written = self.latest.clone();
            let (path, remembered) = (self.path.clone(), self.latest.clone());
            self.job.start(move |_| remembered.write(&path), |written| written);
        }
    }

    /// Returns the reason why nothing is remembered, once.
    fn next_failure(&mut self) -> Option<String> {
        let reason = match self.job.next_event()? {
            Ok(Ok(())) => return None,
            Ok(Err(error)) => error.to_string(),
            Err(error) => error.to_string(),
        };
        let is_first = !std::mem::replace(&mut self.has_reported, true);
        is_first.then(|| format!("View, theme and settings will not be restored at the next start: {reason}"))
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        self.job.wait(LONGEST_WAIT);
        if self.latest != self.written && !self.has_reported {
            // No one is left to notify.
            let _ = self.latest.write(&self.path);
        }
    }
}

impl DecouplerWindow {
    /// Remembers what the user sees.
    pub(super) fn remember(&mut self) {
        let Some(memory) = &mut self.memory else { return };
        let (is_usual_size, is_held) = self.ctx.input(|input| {
            let viewport = input.viewport();
            let is_unusual = [viewport.maximized, viewport.fullscreen, viewport.minimized].contains(&Some(true));
            (!is_unusual, input.pointer.any_down())
        });
        if is_usual_size {
            let size = self.ctx.content_rect().size() * self.ctx.zoom_factor();
            self.chosen.take_size_points(size.into());
        }
        let shared = &self.shared;
        let latest = Remembered {
            view: Some(shared.shown.name().to_owned()),
            draft: Some(shared.draft),
            source: Some(shared.source),
            recording: Some(shared.recording.settings),
            is_auto: Some(shared.recording.is_auto),
            plan: match &shared.recording.plan {
                Ok(plan) => Some(plan.clone()),
                // An import that is incomplete now may be completed later.
                Err(_) if self.views.has_recording() => memory.latest.plan.take(),
                Err(_) => None,
            },
            ..self.chosen.clone()
        };
        // A drag is written when it ends.
        memory.keep(latest, !is_held);
        if let Some(reason) = memory.next_failure() {
            self.notices.fail(Matter::Memory, reason);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a file with this text in it.
    fn read(text: &str) -> Remembered {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("window.json");
        fs::write(&path, text).unwrap();
        Remembered::read(&path).unwrap_or_default()
    }

    #[test]
    fn the_file_is_read_back_bit_by_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("not yet there").join("window.json");
        let mut draft = RunSettings::default();
        draft.simulation_mut().unwrap().scene.largest_compression = 0.1 + 0.2;
        let mut written = Remembered {
            is_dark: Some(false),
            view: Some("Compare".to_owned()),
            draft: Some(draft),
            ..Remembered::default()
        };
        written.take_size_points([1203.4, 800.0]);
        written.write(&path).unwrap();
        assert_eq!(Remembered::read(&path), Some(written.clone()));
        assert_eq!(written.opening_size_points(), [1203.0, 800.0]);
    }

    #[test]
    fn an_unreadable_value_is_dropped_and_the_others_are_kept() {
        for text in ["", "[]", "{", "{}", "\u{0}"] {
            assert_eq!(read(text), Remembered::default(), "{text}");
        }
        let text = r#"{"is_dark": false, "view": 3, "draft": {"hidden": 5}, "size_points": "large", "later": 1}"#;
        let expected = Remembered {
            is_dark: Some(false),
            ..Remembered::default()
        };
        assert_eq!(read(text), expected);
    }

    #[test]
    fn settings_outside_the_limits_are_dropped() {
        let change: [fn(&mut RunSettings); 6] = [
            |draft| draft.hidden = 0,
            |draft| draft.simulation_mut().unwrap().samples = usize::MAX,
            |draft| draft.simulation_mut().unwrap().test_samples = 0,
            |draft| draft.simulation_mut().unwrap().scene.largest_compression = 2.0,
            |draft| draft.training.stopping.goal_mse = f64::NAN,
            |draft| draft.simulation_mut().unwrap().sensor.geometry.height_mm = -1.0,
        ];
        for (number, change) in change.into_iter().enumerate() {
            let mut draft = RunSettings::default();
            change(&mut draft);
            let text = serde_json::to_string(&Remembered {
                draft: Some(draft),
                ..Remembered::default()
            });
            assert_eq!(read(&text.unwrap()).draft, None, "change {number}");
        }
    }

    #[test]
    fn a_window_opens_neither_too_small_nor_without_a_size() {
        for text in ["[0, 0]", "[-1440, 900]", "[1440]", "[1e99, 900]", "[959, 900]"] {
            let read = read(&format!(r#"{{"size_points": {text}}}"#));
            assert_eq!(read.opening_size_points(), DEFAULT_SIZE_POINTS, "{text}");
        }
    }
}
