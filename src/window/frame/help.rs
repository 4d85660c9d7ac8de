use eframe::egui::{FontId, Label, RichText, ScrollArea, TextEdit, TextStyle, Ui, WidgetInfo, accesskit::Role, vec2};

use super::modal::{Reply, card_ui, take_focus};
use crate::window::{
    glossary::{self, Term},
    shared::Offer,
    theme::{Theme, semibold, space, type_size},
    widgets::{ColumnWidth, TableCell, TableColumn, TableRow, TableView, dim_ui, section_heading_ui, tabs_ui},
};

/// Keys handled by the focused part of the window.
const IN_FOCUS: [(&str, &str); 8] = [
    ("Turn a surface", "Arrows"),
    ("Zoom a surface", "+ and −"),
    ("Reset the camera", "Home"),
    ("Reset a field to its default", "Double-click"),
    ("Copy or export a table or a picture", "Right click"),
    ("Next control", "Tab"),
    ("Previous control", "Shift+Tab"),
    ("Close a dialog", "Escape"),
];

/// Page of the help.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Page {
    /// The list of all keys.
    Keys,
    /// The list of all terms.
    Glossary,
    /// Version and licences.
    About,
}

/// Licences of the libraries in the program; `.ci/notices` makes the file.
const NOTICES: &str = include_str!("../../../assets/NOTICES.txt");

/// The open help.
#[derive(Debug)]
pub(super) struct Help {
    page: Page,
    /// Search text: only terms that contain it are displayed.
    typed: String,
}

impl Help {
    /// Opens it on this page.
    pub(super) fn open(page: Page, typed: &str) -> Self {
        let typed = typed.to_owned();
        Self { page, typed }
    }
}

/// Shows the pages of the help over the window.
pub(super) fn help_ui(ui: &Ui, help: &mut Help, offers: &[Offer]) -> Option<Reply> {
    card_ui(ui, "help", space(120), |ui| {
        let pages = [
            (Page::Keys, "Keys"),
            (Page::Glossary, "Glossary"),
            (Page::About, "About"),
        ];
        help.page = tabs_ui(ui, "Help", &pages, help.page).unwrap_or(help.page);
        ui.add_space(space(2));
        match help.page {
            Page::Keys => keys_ui(ui, offers),
            Page::Glossary => glossary_ui(ui, &mut help.typed),
            Page::About => about_ui(ui),
        }
        None
    })
}

fn keys_ui(ui: &mut Ui, offers: &[Offer]) {
    let scroll = ScrollArea::vertical()
        .max_height(space(120))
        .min_scrolled_height(space(120));
    scroll.auto_shrink([false, true]).show(ui, |ui| {
        let dim = Theme::of(ui).palette.dim;
        let row = |name: &str, keys: &str| TableRow::new([TableCell::new(name), TableCell::new(keys).colour(dim)]);
        let of_commands = offers.iter().filter_map(|offer| {
            let about = offer.command.about();
            let keys = ui.ctx().format_shortcut(&about.keys?);
            Some(row(&about.name, &keys))
        });
        let in_focus = IN_FOCUS.map(|(name, keys)| row(name, keys));
        let rows = of_commands.chain(in_focus).collect();
        let columns = [
            TableColumn::text("Action"),
            TableColumn::text("Keys").width(ColumnWidth::Rest),
        ];
        TableView::new("keys", &columns).show_all(ui, rows);
    });
}

/// Shows the terms that contain the search text, under the headings of their groups.
fn glossary_ui(ui: &mut Ui, typed: &mut String) {
    let field = TextEdit::singleline(typed)
        .hint_text("Search terms")
        .margin(vec2(space(2), space(2)))
        .desired_width(f32::INFINITY);
    let field = ui.add(field);
    field.widget_info(|| WidgetInfo::labeled(Role::SearchInput, true, "Term"));
    take_focus(ui, &field);
    ui.add_space(space(1));
    let scroll = ScrollArea::vertical()
        .max_height(space(112))
        .min_scrolled_height(space(112));
    scroll.auto_shrink([false, true]).show(ui, |ui| {
        let mut is_any = false;
        for (heading, mut terms) in glossary::groups() {
            terms.retain(|term| term.matches(typed));
            if !terms.is_empty() {
                is_any = true;
                section_heading_ui(ui, heading);
            }
            terms.iter().for_each(|term| term_ui(ui, term));
        }
        if !is_any {
            dim_ui(ui, "No matches");
        }
    });
}

/// Shows the version, and the licences of the program and its libraries.
fn about_ui(ui: &mut Ui) {
    let version = format!("Decoupler {}", env!("CARGO_PKG_VERSION"));
    ui.label(RichText::new(version).font(semibold(type_size().body)));
    dim_ui(ui, env!("CARGO_PKG_DESCRIPTION"));
    dim_ui(ui, "Licensed under MIT or Apache-2.0, at your choice.");
    ui.add_space(space(2));
    let font = FontId::monospace(type_size().small);
    let height = ui.text_style_height(&TextStyle::Monospace).max(font.size);
    let lines = Vec::from_iter(NOTICES.lines());
    let scroll = ScrollArea::both()
        .max_height(space(104))
        .min_scrolled_height(space(104))
        .auto_shrink([false, true]);
    // Of thousands of lines only those in view are laid out.
    scroll.show_rows(ui, height, lines.len(), |ui, rows| {
        for line in &lines[rows] {
            ui.add(Label::new(RichText::new(*line).font(font.clone())).extend());
        }
    });
}

fn term_ui(ui: &mut Ui, term: &Term) {
    let palette = Theme::of(ui).palette;
    ui.label(RichText::new(term.name).font(semibold(type_size().body)));
    ui.label(RichText::new(term.definition).size(type_size().note).color(palette.dim));
    if !term.equation.is_empty() {
        ui.label(RichText::new(term.equation).size(type_size().note));
    }
    ui.add_space(space(2));
}
