use eframe::egui::{
    Align, Button, Frame, Id, Key, Layout, Margin, Modal, RichText, ScrollArea, TextEdit, Ui, WidgetInfo,
    accesskit::Role, vec2,
};

use crate::window::{
    glossary::{self, Term},
    shared::Action,
    theme::{Theme, space},
    widgets::dim_ui,
};

/// The list of all actions, open: typing narrows it, Enter does the one that is marked.
#[derive(Debug, Default)]
pub(super) struct Palette {
    typed: String,
    /// The place of the marked action among those that match.
    marked: usize,
}

/// Answer of the user to the list.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Reply {
    /// Do the action of this name.
    Pick(String),
    /// Explain this term.
    Define(&'static str),
    /// Nothing.
    Close,
}

/// Shows the list over the window.
pub(super) fn palette_ui(ui: &Ui, palette: &mut Palette, actions: &[Action]) -> Option<Reply> {
    let mut reply = None;
    let frame = Frame::popup(ui.style()).inner_margin(Margin::same(12));
    let modal = Modal::new(Id::unique("palette")).frame(frame).show(ui.ctx(), |ui| {
        ui.set_width(space(110));
        let found = matching(actions, &palette.typed);
        let terms = terms(&palette.typed);
        // Before the field, in which arrows and Enter mean something else.
        let (down, up, enter) = ui.input_mut(|input| {
            let mut take = |key| input.consume_key(eframe::egui::Modifiers::NONE, key);
            (take(Key::ArrowDown), take(Key::ArrowUp), take(Key::Enter))
        });
        let last = (found.len() + terms.len()).saturating_sub(1);
        palette.marked = palette.marked.min(last);
        if down {
            palette.marked = (palette.marked + 1).min(last);
        }
        if up {
            palette.marked = palette.marked.saturating_sub(1);
        }
        let field = TextEdit::singleline(&mut palette.typed)
            .hint_text("Search actions")
            .margin(vec2(space(2), space(2)))
            .desired_width(f32::INFINITY);
        let field = ui.add(field);
        field.widget_info(|| WidgetInfo::labeled(Role::SearchInput, true, "Action"));
        field.request_focus();
        if field.changed() {
            palette.marked = 0;
        }
        ui.add_space(space(2));
        ScrollArea::vertical().max_height(space(90)).show(ui, |ui| {
            for (place, action) in found.iter().enumerate() {
                let is_marked = place == palette.marked;
                let row = action_ui(ui, action, is_marked);
                if is_marked && (down || up) {
                    row.scroll_to_me(None);
                }
                if action.is_possible && (row.clicked() || (is_marked && enter)) {
                    reply = Some(Reply::Pick(action.name.clone()));
                }
            }
            for (place, term) in terms.iter().enumerate() {
                let is_marked = found.len() + place == palette.marked;
                let row = term_ui(ui, term, is_marked);
                if is_marked && (down || up) {
                    row.scroll_to_me(None);
                }
                if row.clicked() || (is_marked && enter) {
                    reply = Some(Reply::Define(term.name));
                }
            }
            if found.is_empty() && terms.is_empty() {
                dim_ui(ui, "No matches");
            }
        });
    });
    if modal.should_close() {
        reply = Some(Reply::Close);
    }
    reply
}

/// One action and its keys. Returns the response of the whole line.
fn action_ui(ui: &mut Ui, action: &Action, is_marked: bool) -> eframe::egui::Response {
    let dim = Theme::of(ui).palette.dim;
    let keys = action.keys.map(|keys| ui.ctx().format_shortcut(&keys));
    let width = ui.available_width();
    let line = ui.allocate_ui_with_layout(vec2(width, space(7)), Layout::left_to_right(Align::Center), |ui| {
        ui.add_enabled_ui(action.is_possible, |ui| {
            let text = Button::selectable(is_marked, action.name.as_str());
            let text = text
                .min_size(vec2(width, space(7)))
                .right_text(RichText::new(keys.unwrap_or_default()).color(dim));
            let button = ui.add(text);
            // Without the keys, by its name alone.
            button.widget_info(|| WidgetInfo::labeled(Role::Button, action.is_possible, &action.name));
            button
        })
        .inner
    });
    let reason = "Not available now";
    line.inner.on_disabled_hover_text(reason)
}

/// A term of the glossary. Returns the response of the whole line.
fn term_ui(ui: &mut Ui, term: &Term, is_marked: bool) -> eframe::egui::Response {
    let dim = Theme::of(ui).palette.dim;
    let button = Button::selectable(is_marked, term.name)
        .min_size(vec2(ui.available_width(), space(7)))
        .right_text(RichText::new("Glossary").color(dim));
    let button = ui.add(button);
    let label = format!("{} in the glossary", term.name);
    button.widget_info(|| WidgetInfo::labeled(Role::Button, true, &label));
    button.on_hover_text(term.hint)
}

/// The terms in whose names the words of `typed` occur; none while nothing is typed.
fn terms(typed: &str) -> Vec<Term> {
    let words: Vec<_> = typed.split_whitespace().map(str::to_lowercase).collect();
    let all = glossary::groups().into_iter().flat_map(|group| group.terms);
    let is_called_so = |term: &Term| {
        let name = term.name.to_lowercase();
        !words.is_empty() && words.iter().all(|word| name.contains(word))
    };
    all.filter(is_called_so).collect()
}

/// The actions in whose names the words of `typed` occur in any order, those that can be done first.
fn matching<'a>(actions: &'a [Action], typed: &str) -> Vec<&'a Action> {
    let words: Vec<_> = typed.split_whitespace().map(str::to_lowercase).collect();
    let mut found: Vec<_> = actions
        .iter()
        .filter(|action| {
            let name = action.name.to_lowercase();
            words.iter().all(|word| name.contains(word))
        })
        .collect();
    found.sort_by_key(|action| !action.is_possible);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_in_any_order_find_an_action_and_possible_ones_come_first() {
        let action = |name: &str, is_possible| Action {
            name: name.to_owned(),
            keys: None,
            is_possible,
        };
        let actions = [
            action("Stop training", false),
            action("Train", true),
            action("Show Trade-off", true),
        ];
        let names = |typed| {
            matching(&actions, typed)
                .iter()
                .map(|found| found.name.as_str())
                .collect::<Vec<_>>()
        };
        assert_eq!(names(""), ["Train", "Show Trade-off", "Stop training"]);
        assert_eq!(names("off show"), ["Show Trade-off"]);
        assert_eq!(names("TRAIN"), ["Train", "Stop training"]);
        assert_eq!(names("press"), [""; 0]);
    }
}
