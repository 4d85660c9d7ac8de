//! Table of the columns of all files with their meanings.

use eframe::egui::{Align, ComboBox, Label, Layout, RichText, Sense, Ui, WidgetInfo, accesskit::Role, vec2};
use egui_extras::{Column, TableBuilder, TableRow};

use super::{
    column_cells::{figure_ui, meaning_ui, missing_texts, range_texts, remark, unit_ui},
    draft::{Draft, file_name},
    editor::RecordingEditor,
    histogram::paint_histogram,
};
use crate::{
    app::theme::{Palette, Theme, semibold, space, type_size},
    import::{InspectedFile, Meaning},
};

const ROW_HEIGHT: f32 = space(7);
const HEADINGS: [(&str, f32); 6] = [
    ("column", 0.0),
    ("meaning", space(26)),
    ("unit", space(15)),
    ("values", space(22)),
    ("from – to", space(48)),
    ("missing", space(15)),
];
/// Headings of figures, which stand at the right.
const FIGURES: [&str; 2] = ["from – to", "missing"];
/// Least widths of the name and of the remarks, which share what the others leave.
const LEAST_NAME: f32 = space(28);
const LEAST_NOTE: f32 = space(26);
/// Width of the strip of the scroll bar.
const SCROLL_BAR: f32 = space(3);

/// A line of the table.
#[derive(Clone, Copy)]
enum Line {
    File(usize),
    Column(usize, usize),
}

/// A wish of the user.
enum Change {
    Meaning(usize, usize, Meaning),
    All(usize, Meaning),
    Unit(usize, usize, String),
}

impl RecordingEditor {
    /// Shows the columns of all files; changes their meanings and units.
    pub(super) fn columns_table_ui(&mut self, ui: &mut Ui, is_busy: bool) {
        let Some(draft) = &mut self.draft else { return };
        let mut change = None;
        ui.add_enabled_ui(!is_busy, |ui| change = table_ui(ui, draft));
        match change {
            None => return,
            Some(Change::Meaning(file, column, meaning)) => draft.choose(file, column, meaning),
            Some(Change::All(file, meaning)) => draft.choose_all(file, meaning),
            Some(Change::Unit(file, column, unit)) => draft.set_unit(file, column, &unit),
        }
        ui.request_repaint();
    }
}

fn table_ui(ui: &mut Ui, draft: &Draft) -> Option<Change> {
    let of_file = |(file, inspected): (usize, &InspectedFile)| {
        let columns = (0..inspected.meanings.len()).map(move |column| Line::Column(file, column));
        std::iter::once(Line::File(file)).chain(columns)
    };
    let lines: Vec<Line> = draft.files.iter().enumerate().flat_map(of_file).collect();
    let fixed: f32 = HEADINGS.iter().map(|(_, width)| width).sum();
    let rest = ui.available_width() - SCROLL_BAR - fixed;
    let name = (0.5 * rest).max(LEAST_NAME).min((rest - LEAST_NOTE).max(LEAST_NAME));
    let note = (rest - name).max(LEAST_NOTE);
    let palette = Theme::of(ui).palette;
    let mut change = None;
    ui.spacing_mut().item_spacing.x = 0.0;
    let mut table = TableBuilder::new(ui)
        .id_salt("columns")
        .striped(false)
        .auto_shrink(false)
        .min_scrolled_height(0.0)
        .cell_layout(Layout::left_to_right(Align::Center))
        .column(Column::exact(name).clip(true));
    for (_, width) in &HEADINGS[1..] {
        table = table.column(Column::exact(*width).clip(true));
    }
    let table = table.column(Column::exact(note).clip(true));
    let table = table.header(ROW_HEIGHT, |mut heading| {
        for text in HEADINGS.iter().map(|(text, _)| *text).chain(["remarks"]) {
            heading.col(|ui| {
                let text = RichText::new(text).size(type_size().small).color(palette.dim);
                if FIGURES.contains(&text.text()) {
                    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                        ui.add_space(space(1));
                        ui.label(text);
                    });
                    return;
                }
                // Remarks keep clear of the figures before them.
                ui.add_space(if text.text() == "remarks" { space(2) } else { 0.0 });
                ui.label(text);
            });
        }
    });
    table.body(|body| {
        body.rows(ROW_HEIGHT, lines.len(), |mut row| {
            let found = match lines[row.index()] {
                Line::File(file) => file_ui(&mut row, draft, file, &palette),
                Line::Column(file, column) => column_ui(&mut row, draft, (file, column), &palette),
            };
            change = change.take().or(found);
        });
    });
    change
}

/// The heading of a file, with a choice for all of its columns.
fn file_ui(row: &mut TableRow<'_, '_>, draft: &Draft, file: usize, palette: &Palette) -> Option<Change> {
    let inspected = &draft.files[file];
    let mut change = None;
    row.col(|ui| {
        let text = RichText::new(file_name(&inspected.path)).font(semibold(type_size().body));
        ui.add(Label::new(text).truncate());
    });
    row.col(|ui| {
        let label = format!("Meaning of all columns of {}", file_name(&inspected.path));
        let combo = ComboBox::from_id_salt(("all", file))
            .selected_text("set all…")
            .width(HEADINGS[1].1 - space(3));
        let shown = combo.show_ui(ui, |ui| {
            for meaning in [Meaning::Input, Meaning::Target, Meaning::Unused] {
                if ui.selectable_label(false, format!("all {meaning}")).clicked() {
                    change = Some(Change::All(file, meaning));
                }
            }
        });
        shown
            .response
            .widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, &label));
    });
    for _ in 0..4 {
        row.col(|_| {});
    }
    row.col(|ui| {
        let text = format!("{} rows", inspected.inspection.rows);
        ui.add_space(space(2));
        ui.label(RichText::new(text).size(type_size().note).color(palette.dim));
    });
    change
}

fn column_ui(
    row: &mut TableRow<'_, '_>,
    draft: &Draft,
    (file, column): (usize, usize),
    palette: &Palette,
) -> Option<Change> {
    let inspected = &draft.files[file];
    let summary = &inspected.inspection.columns[column];
    let name = inspected.full_name(column);
    let meaning = inspected.meanings[column];
    let colour = if meaning == Meaning::Unused {
        palette.dim
    } else {
        palette.text
    };
    let mut change = None;
    row.col(|ui| {
        ui.add_space(space(2));
        ui.add(Label::new(RichText::new(&name).color(colour)).truncate());
    });
    row.col(|ui| {
        change = meaning_ui(ui, &name, meaning, HEADINGS[1].1 - space(3))
            .map(|meaning| Change::Meaning(file, column, meaning));
    });
    row.col(|ui| {
        if matches!(meaning, Meaning::Input | Meaning::Target) {
            let unit = unit_ui(ui, &name, &draft.unit(file, column), HEADINGS[2].1 - space(4));
            change = change.take().or(unit.map(|unit| Change::Unit(file, column, unit)));
        }
    });
    row.col(|ui| {
        let rect = ui.max_rect().shrink2(vec2(space(1), space(1)));
        let bars = if meaning == Meaning::Unused {
            palette.line
        } else {
            palette.dim
        };
        paint_histogram(ui, rect, &summary.histogram, bars);
        let response = ui.interact(rect, ui.scope_id().with("histogram"), Sense::hover());
        let label = format!("Histogram of {name}");
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &label));
        response.on_hover_text("Number of rows in each sixteenth of the range.");
    });
    row.col(|ui| {
        let ends = summary.min.zip(summary.max);
        let texts = ends.map_or_else(|| vec!["–".to_owned()], |(min, max)| range_texts(min, max));
        let exact = ends.map(|(min, max)| format!("{min} to {max}"));
        let response = figure_ui(ui, &texts, &format!("Range of {name}"), colour);
        if let Some(exact) = exact {
            response.on_hover_text(exact);
        }
    });
    row.col(|ui| {
        let texts = missing_texts(summary.missing, inspected.inspection.rows);
        let response = figure_ui(ui, &texts, &format!("Missing in {name}"), colour);
        response.on_hover_text(format!("{} of {} rows", summary.missing, inspected.inspection.rows));
    });
    row.col(|ui| {
        if let Some((text, is_bad)) = remark(summary, column) {
            let colour = if is_bad && meaning != Meaning::Unused {
                palette.warning
            } else {
                palette.dim
            };
            ui.add_space(space(2));
            ui.add(Label::new(RichText::new(text).size(type_size().note).color(colour)).truncate());
        }
    });
    change
}
