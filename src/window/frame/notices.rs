use eframe::egui::{Align, Frame, Layout, Margin, RichText, Stroke, Ui};

use crate::window::{
    shared::{Matter, Notice},
    theme::{Theme, radius},
};

/// Maximum number of notices shown at a time: they take space from the view below.
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

    /// Returns all notices with their subjects.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Matter, &Notice)> {
        self.0.iter().map(|entry| (entry.matter, &entry.notice))
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
pub enum Reply {
    /// Dismiss it.
    Dismiss,
    /// Show the folder of the file that was written.
    OpenFolder,
    /// Restart the training thread.
    Restart,
    /// Connect again to the stream that has ended.
    Reconnect,
    /// Resume the training that was cut short.
    Resume,
    /// Discard the training that was cut short.
    Discard,
}

impl Reply {
    fn name(&self) -> &'static str {
        match self {
            Self::Dismiss => "Dismiss",
            Self::OpenFolder => "Open folder",
            Self::Restart => "Start again",
            Self::Reconnect => "Try again",
            Self::Resume => "Resume",
            Self::Discard => "Discard",
        }
    }
}

/// Shows a notice in a strip above the view, a failure or a success, and a button for each of the `remedies`.
pub fn notice_ui(ui: &mut Ui, notice: &Notice, remedies: Vec<Reply>) -> Option<Reply> {
    let mut reply = None;
    let palette = Theme::of(ui).palette;
    // The end of the program before is no failure of this one.
    let is_offer = remedies.iter().any(|reply| matches!(reply, Reply::Resume));
    let (text, colour) = match notice {
        Notice::Done(text) | Notice::Saved(text, _) => (text, palette.good),
        Notice::Failed(text) if is_offer => (text, palette.text),
        Notice::Failed(text) => (text, palette.bad),
    };
    let frame = Frame::new()
        .fill(palette.panel)
        .stroke(Stroke::new(1.0, colour))
        .corner_radius(radius())
        .inner_margin(Margin::symmetric(12, 6));
    frame.show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                if ui.button(Reply::Dismiss.name()).clicked() {
                    reply = Some(Reply::Dismiss);
                }
                for remedy in remedies {
                    if ui.button(remedy.name()).clicked() {
                        reply = Some(remedy);
                    }
                }
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    ui.add(eframe::egui::Label::new(RichText::new(text).color(colour)).wrap());
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
