use std::path::{Path, PathBuf};

use eframe::egui::{Align, Color32, Frame, Id, Layout, Margin, Modal, RichText, ScrollArea, Ui, ViewportCommand, vec2};

use decoupler_core::text::counted;

use super::DecouplerWindow;
use crate::window::{
    shared::{Effect, FileTask, Matter, Unfinished},
    theme::{Palette, Theme, semibold, space, type_size},
    widgets::{dim_ui, ghost_button, primary_button},
};

/// Stage of closing the window.
#[derive(Debug)]
pub(super) enum Closing {
    /// The user is asked what to do with unfinished work.
    Asking(Question),
    /// Checkpoints are to be saved, and the user is asked where.
    ChoosingPaths(Paths),
    /// The window closes once every file is written.
    Finishing,
    /// The window closes, whatever is lost.
    Now,
}

/// Work that was unfinished when the user was asked, in lines that keep their positions.
#[derive(Debug, Default)]
pub(super) struct Question {
    lines: Vec<Line>,
    /// Number of lines when the question was first shown.
    height: usize,
    /// True if something could be saved then: saving is the default.
    suggests_saving: bool,
}

#[derive(Debug)]
struct Line {
    /// The view and the work in it, or the path of a file.
    subject: (&'static str, String),
    progress: String,
    fate: Fate,
    /// True if its result is kept after the window closes.
    is_kept: bool,
}

/// Consequence of closing for the work of a line.
#[derive(Debug)]
enum Fate {
    /// A checkpoint can be saved.
    Savable(FileTask),
    /// It is lost.
    Discarded,
    /// The window waits for it.
    Awaited,
    /// It has ended since the question.
    Ended,
}

/// Files whose paths are asked for, one after the other.
#[derive(Debug)]
pub(super) struct Paths {
    /// The task whose path is being asked for first.
    left: Vec<FileTask>,
    chosen: Vec<PathBuf>,
}

/// Answer of the user to the question.
enum Answer {
    Stay,
    Save,
    Discard,
}

impl Question {
    /// Updates the lines to the work that is unfinished now: lines stay even when their work has ended, new ones are appended.
    fn follow(&mut self, unfinished: Vec<Line>) {
        for line in &mut self.lines {
            line.fate = Fate::Ended;
        }
        for new in unfinished {
            match self.lines.iter_mut().find(|line| line.subject == new.subject) {
                Some(line) => *line = new,
                None => self.lines.push(new),
            }
        }
        if self.height == 0 {
            self.height = self.lines.len();
            self.suggests_saving = !self.savings().is_empty();
        }
    }

    /// Returns true if there is nothing to ask about: no work was unfinished.
    fn is_idle(&self) -> bool {
        self.lines.iter().all(|line| matches!(line.fate, Fate::Awaited))
    }

    fn loses_something(&self) -> bool {
        let is_lost = |line: &Line| matches!(line.fate, Fate::Savable(_) | Fate::Discarded);
        self.lines.iter().any(is_lost)
    }

    fn savings(&self) -> Vec<FileTask> {
        let savings = self.lines.iter().filter_map(|line| match &line.fate {
            Fate::Savable(task) => Some(task.clone()),
            _ => None,
        });
        savings.collect()
    }
}

impl Line {
    fn of(view: &'static str, unfinished: Unfinished) -> Self {
        Self {
            subject: (view, unfinished.work.to_owned()),
            progress: unfinished.progress,
            fate: unfinished.saving.map_or(Fate::Discarded, Fate::Savable),
            is_kept: unfinished.is_kept,
        }
    }

    /// Consequence of closing as text, with its colour.
    fn fate(&self, palette: &Palette) -> (&'static str, Color32) {
        match (&self.fate, self.is_kept) {
            (Fate::Savable(_), _) => ("can be saved as a checkpoint", palette.text),
            (Fate::Discarded, _) => ("will be discarded", palette.warning),
            (Fate::Awaited, _) => ("will be finished first", palette.dim),
            (Fate::Ended, true) => ("has ended, nothing is lost", palette.good),
            (Fate::Ended, false) => ("has ended: stay to export its result", palette.warning),
        }
    }
}

impl DecouplerWindow {
    /// Lets the window close if nothing would be lost.
    pub(super) fn take_close_request(&mut self) {
        let is_requested = self.ctx.input(|input| input.viewport().close_requested());
        match &mut self.closing {
            None if is_requested => {
                let mut question = Question::default();
                question.follow(self.unfinished());
                // Files alone need no question: the window shows that it waits for them.
                self.closing = Some(if question.is_idle() {
                    Closing::Finishing
                } else {
                    Closing::Asking(question)
                });
            }
            Some(Closing::Asking(_)) => {
                let unfinished = self.unfinished();
                if let Some(Closing::Asking(question)) = &mut self.closing {
                    question.follow(unfinished);
                }
            }
            // Cancelling the save cancels closing too.
            Some(Closing::ChoosingPaths(_)) if !self.dialogs.is_asking() && self.saving.is_none() => {
                self.closing = None;
            }
            _ => {}
        }
        let may_close = match self.closing {
            Some(Closing::Finishing) => self.awaited_files().is_empty(),
            Some(Closing::Now) => true,
            _ => false,
        };
        if may_close && !is_requested {
            self.ctx.send_viewport_cmd(ViewportCommand::Close);
        }
        if is_requested && may_close {
            self.worker.forget();
        }
        if is_requested && !may_close {
            self.ctx.send_viewport_cmd(ViewportCommand::CancelClose);
            // The question must be visible.
            self.ctx.send_viewport_cmd(ViewportCommand::Minimized(false));
        }
    }

    /// The work of every view that closing would cut short, and the files that are being written.
    fn unfinished(&mut self) -> Vec<Line> {
        let mut lines = Vec::new();
        for view in self.views.all() {
            let unfinished = view.unfinished(&self.shared);
            lines.extend(unfinished.into_iter().map(|work| Line::of(view.name(), work)));
        }
        let file = |path: PathBuf| Line {
            subject: ("File", path.display().to_string()),
            progress: "being written".to_owned(),
            fate: Fate::Awaited,
            is_kept: true,
        };
        lines.extend(self.awaited_files().into_iter().map(file));
        let runs = &self.shared.runs;
        if runs.path.is_some() && runs.unwritten > 0 {
            let count = counted(runs.unwritten as u64, "run");
            let unwritten = Unfinished {
                work: "Unwritten runs",
                progress: format!("{count} could not be written to the folder of runs"),
                saving: None,
                is_kept: true,
            };
            lines.push(Line::of("Run list", unwritten));
        }
        lines
    }

    /// Files that closing waits for.
    pub(super) fn awaited_files(&self) -> Vec<PathBuf> {
        self.files.paths().map(Path::to_owned).collect()
    }

    /// Notes the path of `task` if it is one of the checkpoints to be saved before closing. Returns false if another of
    /// them is being written there: the path is then asked for again.
    pub(super) fn take_path_on_closing(&mut self, task: &FileTask, path: &Path) -> bool {
        let Some(Closing::ChoosingPaths(paths)) = &mut self.closing else {
            return true;
        };
        if !paths.left.first().is_some_and(|asked| asked.is_same_file(task)) {
            return true;
        }
        if paths.chosen.iter().any(|chosen| chosen == path) {
            let reason = format!(
                "'{}' is the file of the other checkpoint; choose another name",
                path.display()
            );
            self.notices.fail(Matter::File, reason);
            self.type_path(task.clone());
            return false;
        }
        paths.chosen.push(path.to_owned());
        paths.left.remove(0);
        match paths.left.first().cloned() {
            Some(next) => self.apply(Effect::ChooseFile(next)),
            None => self.closing = Some(Closing::Finishing),
        }
        true
    }

    /// Asks about unfinished work, or shows what closing waits for.
    pub(super) fn closing_ui(&mut self, ui: &Ui) {
        match &self.closing {
            Some(Closing::Asking(question)) => {
                let answer = question_ui(ui, question);
                let savings = question.savings();
                match answer {
                    None => return,
                    Some(Answer::Stay) => self.closing = None,
                    Some(Answer::Discard) => self.closing = Some(Closing::Finishing),
                    Some(Answer::Save) => {
                        let first = savings.first().cloned();
                        self.closing = Some(Closing::ChoosingPaths(Paths {
                            left: savings,
                            chosen: Vec::new(),
                        }));
                        if let Some(first) = first {
                            self.apply(Effect::ChooseFile(first));
                        }
                    }
                }
            }
            Some(Closing::Finishing) => {
                let names = self.awaited_files().into_iter().map(|path| path.display().to_string());
                let text = format!(
                    "Still being written: {}. The window will close afterwards.",
                    names.collect::<Vec<_>>().join(", ")
                );
                match finishing_ui(ui, &text) {
                    None => return,
                    Some(Answer::Discard) => self.closing = Some(Closing::Now),
                    Some(_) => self.closing = None,
                }
            }
            Some(Closing::ChoosingPaths(_) | Closing::Now) | None => return,
        }
        ui.request_repaint();
    }
}

/// Shows a modal card; dismissing it means staying.
fn card_ui(ui: &Ui, heading: &str, add: impl FnOnce(&mut Ui) -> Option<Answer>) -> Option<Answer> {
    let frame = Frame::popup(ui.style()).inner_margin(Margin::same(16));
    let modal = Modal::new(Id::unique("closing")).frame(frame).show(ui.ctx(), |ui| {
        ui.set_width(space(150));
        ui.label(RichText::new(heading).font(semibold(type_size().title)));
        ui.add_space(space(1));
        add(ui)
    });
    let left = modal.should_close().then_some(Answer::Stay);
    modal.inner.or(left)
}

/// Lists the unfinished work with the consequences of closing, and asks. Lines and buttons never move.
fn question_ui(ui: &Ui, question: &Question) -> Option<Answer> {
    /// Height of a line, in points.
    const LINE: f32 = space(6);
    /// Number of lines above which the list scrolls.
    const MAX_LINES: usize = 8;
    /// Minimum width of the buttons, in points, so that they do not move when a name changes.
    const BUTTON: f32 = space(34);
    const SAVE: &str = "Save checkpoints and close…";
    const STAY: &str = "Stay";
    card_ui(ui, "Close with unsaved work?", |ui| {
        let height = LINE * question.height.min(MAX_LINES) as f32;
        let list = ScrollArea::vertical().max_height(height).min_scrolled_height(height);
        list.auto_shrink([false, false]).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 0.0;
            for line in &question.lines {
                line_ui(ui, line, LINE);
            }
        });
        ui.add_space(space(3));
        let loses = question.loses_something();
        let savings = question.savings().len();
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let mut answer = None;
            let suggested = if question.suggests_saving { SAVE } else { STAY };
            let name = if loses { "Discard and close" } else { "Close" };
            // From right to left.
            for (name, is_possible, meaning) in [
                (SAVE, savings > 0, Answer::Save),
                (name, true, Answer::Discard),
                (STAY, true, Answer::Stay),
            ] {
                let button = ui.add_enabled_ui(is_possible, |ui| {
                    let size = vec2(BUTTON, space(7));
                    if name == suggested {
                        ui.add(primary_button(name).min_size(size))
                    } else {
                        ui.add(ghost_button(name).min_size(size))
                    }
                });
                let nothing = "Nothing here can be saved as a checkpoint.";
                if button.inner.on_disabled_hover_text(nothing).clicked() {
                    answer = Some(meaning);
                }
            }
            answer
        })
        .inner
    })
}

fn line_ui(ui: &mut Ui, line: &Line, height: f32) {
    let palette = Theme::of(ui).palette;
    let (fate, colour) = line.fate(&palette);
    let (place, subject) = &line.subject;
    ui.allocate_ui_with_layout(
        vec2(ui.available_width(), height),
        Layout::right_to_left(Align::Center),
        |ui| {
            ui.label(RichText::new(fate).color(colour));
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                ui.set_min_height(height);
                ui.label(RichText::new(format!("{place}: {subject}")).font(semibold(type_size().body)));
                if !matches!(line.fate, Fate::Ended) {
                    ui.style_mut().wrap_mode = Some(eframe::egui::TextWrapMode::Truncate);
                    dim_ui(ui, &line.progress);
                }
            });
        },
    );
}

/// Shows the files that closing waits for.
fn finishing_ui(ui: &Ui, text: &str) -> Option<Answer> {
    card_ui(ui, "Finishing files", |ui| {
        ui.label(text);
        ui.add_space(space(3));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let stays = ui.add(primary_button("Stay")).clicked().then_some(Answer::Stay);
            let closes = ui.add(ghost_button("Close without them")).clicked();
            stays.or(closes.then_some(Answer::Discard))
        })
        .inner
    })
}
