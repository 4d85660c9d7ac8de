use std::time::Duration;

use eframe::egui::{Align, Align2, Area, Frame, Id, Label, Layout, Margin, Order, Rect, RichText, Stroke, Ui, vec2};

use super::{DecouplerWindow, files::open_folder};
use crate::window::{
    shared::{Matter, Notice},
    theme::{Theme, space},
    training_worker::{Origin, Request},
};

/// Maximum number of notices shown at a time: they cover a part of the view.
const MAX: usize = 4;

/// Time after which a notice of success closes by itself, from when it was first shown.
const DONE_SECONDS: f64 = 10.0;

/// Notices to the user, from oldest to newest.
#[derive(Debug, Default)]
pub(super) struct Notices(Vec<Entry>);

#[derive(Debug)]
struct Entry {
    matter: Matter,
    notice: Notice,
    /// Time of the first frame that shows it, in seconds.
    since: Option<f64>,
}

impl Entry {
    fn is_done(&self) -> bool {
        !matches!(self.notice, Notice::Failed(_))
    }
}

impl Notices {
    /// Adds a notice. A success replaces all notices about the same matter; a failure replaces only successes and an
    /// identical failure.
    pub(super) fn add(&mut self, matter: Matter, notice: Notice) {
        let is_success = !matches!(notice, Notice::Failed(_));
        let entries = &mut self.0;
        entries.retain(|old| old.matter != matter || !(is_success || old.is_done() || old.notice == notice));
        entries.push(Entry {
            matter,
            notice,
            since: None,
        });
        if entries.len() > MAX {
            // The newest is never the one to go.
            let oldest = entries[..MAX].iter().position(Entry::is_done).unwrap_or(0);
            entries.remove(oldest);
        }
    }

    /// Adds a failure.
    pub(super) fn fail(&mut self, matter: Matter, reason: impl ToString) {
        self.add(matter, Notice::Failed(reason.to_string()));
    }

    /// Removes all notices about this.
    pub(super) fn settle(&mut self, matter: Matter) {
        self.0.retain(|entry| entry.matter != matter);
    }

    /// Removes the notice in this place.
    pub(super) fn dismiss(&mut self, place: usize) {
        self.0.remove(place);
    }

    /// Returns the newest notice.
    pub(super) fn newest(&self) -> Option<&Notice> {
        self.0.last().map(|entry| &entry.notice)
    }

    /// Closes the notices that have been shown long enough at the frame time `now`. Returns the seconds until the next one
    /// closes by itself, if any.
    pub(super) fn pass(&mut self, now: f64) -> Option<f64> {
        let remaining = |entry: &Entry| DONE_SECONDS - (now - entry.since.unwrap_or(now));
        self.0.retain(|entry| !entry.is_done() || remaining(entry) > 0.0);
        for entry in &mut self.0 {
            entry.since.get_or_insert(now);
        }
        let closing = self.0.iter().filter(|entry| entry.is_done());
        closing.map(remaining).min_by(f64::total_cmp)
    }
}

/// Answer of the user to a notice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reply {
    Dismiss,
    /// Show the folder of the file that was written.
    OpenFolder,
    /// Resume the training that was cut short.
    Resume,
    /// Discard the training that was cut short.
    Discard,
}

impl Reply {
    fn name(self) -> &'static str {
        match self {
            Self::Dismiss => "Dismiss",
            Self::OpenFolder => "Open folder",
            Self::Resume => "Resume",
            Self::Discard => "Discard",
        }
    }
}

impl DecouplerWindow {
    /// Shows the notices over the bottom of `middle`, so that nothing moves under the pointer, and does what the user
    /// answers.
    pub(super) fn notices_ui(&mut self, ui: &Ui, middle: Rect) {
        if let Some(seconds) = self.notices.pass(ui.input(|input| input.time)) {
            ui.ctx().request_repaint_after(Duration::from_secs_f64(seconds));
        }
        if self.notices.0.is_empty() {
            return;
        }
        let mut answered = None;
        let area = Area::new(Id::unique("notices"))
            .order(Order::Middle)
            .pivot(Align2::CENTER_BOTTOM);
        let area = area.fixed_pos(middle.center_bottom() - vec2(0.0, space(2)));
        area.show(ui.ctx(), |ui| {
            ui.set_width(middle.width().min(space(200)) - space(4));
            for (place, entry) in self.notices.0.iter().enumerate() {
                // From right to left.
                let replies: &[Reply] = match (&entry.notice, entry.matter) {
                    (Notice::Saved(..), _) => &[Reply::Dismiss, Reply::OpenFolder],
                    (_, Matter::CutShort) if !self.shared.phase.is_busy() => {
                        &[Reply::Dismiss, Reply::Discard, Reply::Resume]
                    }
                    _ => &[Reply::Dismiss],
                };
                answered = notice_ui(ui, entry, replies).map(|reply| (place, reply)).or(answered);
            }
        });
        let Some((place, reply)) = answered else { return };
        match reply {
            Reply::Dismiss => self.notices.dismiss(place),
            Reply::OpenFolder => {
                if let Notice::Saved(_, path) = &self.notices.0[place].notice {
                    open_folder(path);
                }
            }
            Reply::Resume => {
                self.notices.settle(Matter::CutShort);
                self.begin(Origin::Left);
            }
            Reply::Discard => {
                self.notices.settle(Matter::CutShort);
                self.worker.ask(Request::DiscardLeft);
            }
        }
        ui.request_repaint();
    }
}

/// Shows a notice, a failure or a success, with a button for each of the `replies`.
fn notice_ui(ui: &mut Ui, entry: &Entry, replies: &[Reply]) -> Option<Reply> {
    let palette = Theme::of(ui).palette;
    let (text, colour) = match &entry.notice {
        Notice::Done(text) | Notice::Saved(text, _) => (text, palette.good),
        // The end of the program before is no failure of this one.
        Notice::Failed(text) if entry.matter == Matter::CutShort => (text, palette.text),
        Notice::Failed(text) => (text, palette.bad),
    };
    let frame = Frame::popup(ui.style()).stroke(Stroke::new(1.0, colour));
    let mut reply = None;
    frame.inner_margin(Margin::symmetric(12, 6)).show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                for other in replies {
                    if ui.button(other.name()).clicked() {
                        reply = Some(*other);
                    }
                }
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    ui.add(Label::new(RichText::new(text).color(colour)).wrap());
                });
            });
        });
    });
    reply
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(notices: &Notices) -> Vec<&str> {
        let all = notices.0.iter();
        all.map(|entry| match &entry.notice {
            Notice::Done(text) | Notice::Saved(text, _) | Notice::Failed(text) => text.as_str(),
        })
        .collect()
    }

    fn done(text: &str) -> Notice {
        Notice::Done(text.to_owned())
    }

    #[test]
    fn a_success_removes_failures_of_the_same_matter_only() {
        let mut notices = Notices::default();
        notices.fail(Matter::File, "no folder");
        notices.fail(Matter::File, "no folder");
        notices.fail(Matter::File, "read-only");
        notices.fail(Matter::RunList, "unreadable");
        assert_eq!(texts(&notices), ["no folder", "read-only", "unreadable"]);
        notices.add(Matter::File, done("saved"));
        assert_eq!(texts(&notices), ["unreadable", "saved"]);
        notices.fail(Matter::File, "full");
        assert_eq!(texts(&notices), ["unreadable", "full"]);
        notices.settle(Matter::RunList);
        assert_eq!(texts(&notices), ["full"]);
    }

    #[test]
    fn a_success_closes_by_itself_and_a_failure_does_not() {
        let mut notices = Notices::default();
        notices.add(Matter::File, done("saved"));
        notices.fail(Matter::RunList, "unreadable");
        // It is added long before it is shown.
        assert_eq!(notices.pass(1000.0), Some(10.0));
        assert_eq!(notices.pass(1004.0), Some(6.0));
        assert_eq!(notices.pass(1010.0), None);
        assert_eq!(texts(&notices), ["unreadable"]);
        assert_eq!(notices.pass(1e9), None);
        assert_eq!(texts(&notices), ["unreadable"]);
    }

    #[test]
    fn the_list_stays_short_and_keeps_failures_longest() {
        let mut notices = Notices::default();
        notices.fail(Matter::RunList, "0");
        notices.add(Matter::Training, done("1"));
        for number in 2..5 {
            notices.fail(Matter::File, number);
        }
        assert_eq!(texts(&notices), ["0", "2", "3", "4"]);
        notices.add(Matter::Memory, done("5"));
        assert_eq!(texts(&notices), ["2", "3", "4", "5"]);
    }
}
