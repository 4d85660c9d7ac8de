//! Table of the columns of all files with their meanings.

use std::{cell::Cell, rc::Rc};

use eframe::egui::{ComboBox, Label, RichText, Sense, Ui, WidgetInfo, accesskit::Role, vec2};

use super::{
    column_cells::{figure_ui, meaning_ui, missing_texts, range_texts, remark, unit_ui},
    draft::{Draft, file_name},
    editor::RecordingEditor,
    histogram::paint_histogram,
};
use crate::window::{
    theme::{Palette, Theme, space, type_size},
    widgets::{ColumnWidth, TableCell, TableColumn, TableRow, TableView},
};
use decoupler_files::import::{InspectedFile, Meaning};

const ROW_HEIGHT: f32 = space(7);
const MEANING_WIDTH: f32 = space(26);
const UNIT_WIDTH: f32 = space(15);
const COLUMNS: [TableColumn<'_>; 7] = [
    TableColumn::text("column").width(ColumnWidth::Rest),
    TableColumn::text("meaning").width(ColumnWidth::Points(MEANING_WIDTH - space(3))),
    TableColumn::text("unit").width(ColumnWidth::Points(UNIT_WIDTH - space(2))),
    TableColumn::text("values").width(ColumnWidth::Points(space(16))),
    TableColumn::figure("from – to").width(ColumnWidth::Points(space(46))),
    TableColumn::figure("missing").width(ColumnWidth::Points(space(12))),
    TableColumn::text("remarks").width(ColumnWidth::Rest),
];

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
    let palette = Theme::of(ui).palette;
    let change = Cell::new(None);
    let wish = |found: Option<Change>| {
        if found.is_some() {
            change.set(found);
        }
    };
    let row = |place: usize| match lines[place] {
        Line::File(file) => file_row(draft, file, &palette, &wish),
        Line::Column(file, column) => column_row(draft, (file, column), &palette, &wish),
    };
    let table = TableView::new("columns", &COLUMNS).row_height(ROW_HEIGHT);
    table.show(ui, lines.len(), row);
    change.take()
}

/// The heading of a file, with a choice for all of its columns.
fn file_row<'a>(draft: &'a Draft, file: usize, palette: &Palette, wish: &'a dyn Fn(Option<Change>)) -> TableRow<'a> {
    let inspected = &draft.files[file];
    let name = file_name(&inspected.path);
    let of_all = move |ui: &mut Ui| {
        let label = format!("Meaning of all columns of {}", file_name(&inspected.path));
        let combo = ComboBox::from_id_salt(("all", file))
            .selected_text("set all…")
            .width(MEANING_WIDTH - space(3));
        let shown = combo.show_ui(ui, |ui| {
            for meaning in [Meaning::Input, Meaning::Target, Meaning::Unused] {
                if ui.selectable_label(false, format!("all {meaning}")).clicked() {
                    wish(Some(Change::All(file, meaning)));
                }
            }
        });
        shown
            .response
            .widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, &label));
    };
    let rows = format!("{} rows", inspected.inspection.rows);
    let mut cells = vec![TableCell::new(name).strong(true), TableCell::controls(of_all)];
    cells.extend((0..4).map(|_| TableCell::default()));
    cells.push(TableCell::new(rows).colour(palette.dim));
    TableRow::new(cells)
}

fn column_row<'a>(
    draft: &'a Draft,
    (file, column): (usize, usize),
    palette: &Palette,
    wish: &'a dyn Fn(Option<Change>),
) -> TableRow<'a> {
    let palette = *palette;
    let inspected = &draft.files[file];
    let summary = &inspected.inspection.columns[column];
    let name = Rc::new(inspected.full_name(column));
    let meaning = inspected.meanings[column];
    let colour = if meaning == Meaning::Unused {
        palette.dim
    } else {
        palette.text
    };
    let of = || Rc::clone(&name);
    let name_cell = {
        let name = of();
        move |ui: &mut Ui| {
            ui.add_space(space(2));
            ui.add(Label::new(RichText::new(&*name).color(colour)).truncate());
        }
    };
    let meaning_cell = {
        let name = of();
        move |ui: &mut Ui| {
            let picked = meaning_ui(ui, &name, meaning, MEANING_WIDTH - space(3));
            wish(picked.map(|meaning| Change::Meaning(file, column, meaning)));
        }
    };
    let unit_cell = {
        let name = of();
        move |ui: &mut Ui| {
            if matches!(meaning, Meaning::Input | Meaning::Target) {
                let unit = unit_ui(ui, &name, &draft.unit(file, column), UNIT_WIDTH - space(4));
                wish(unit.map(|unit| Change::Unit(file, column, unit)));
            }
        }
    };
    let histogram_cell = {
        let name = of();
        move |ui: &mut Ui| {
            let rect = ui.max_rect().shrink2(vec2(0.0, space(1)));
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
        }
    };
    let range_cell = {
        let name = of();
        move |ui: &mut Ui| {
            let ends = summary.min.zip(summary.max);
            let texts = ends.map_or_else(|| vec!["–".to_owned()], |(min, max)| range_texts(min, max));
            let exact = ends.map(|(min, max)| format!("{min} to {max}"));
            let response = figure_ui(ui, &texts, &format!("Range of {name}"), colour);
            if let Some(exact) = exact {
                response.on_hover_text(exact);
            }
        }
    };
    let missing_cell = {
        let name = of();
        move |ui: &mut Ui| {
            let texts = missing_texts(summary.missing, inspected.inspection.rows);
            let response = figure_ui(ui, &texts, &format!("Missing in {name}"), colour);
            response.on_hover_text(format!("{} of {} rows", summary.missing, inspected.inspection.rows));
        }
    };
    let remark_cell = move |ui: &mut Ui| {
        if let Some((text, is_bad)) = remark(summary, column) {
            let colour = if is_bad && meaning != Meaning::Unused {
                palette.warning
            } else {
                palette.dim
            };
            ui.add(Label::new(RichText::new(text).size(type_size().note).color(colour)).truncate());
        }
    };
    TableRow::new([
        TableCell::controls(name_cell),
        TableCell::controls(meaning_cell),
        TableCell::controls(unit_cell),
        TableCell::controls(histogram_cell),
        TableCell::controls(range_cell),
        TableCell::controls(missing_cell),
        TableCell::controls(remark_cell),
    ])
}
