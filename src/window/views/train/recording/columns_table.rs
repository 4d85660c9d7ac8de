//! Table of the columns of all files with their meanings.
//!
//! It shows the range, the histogram and remarks of each column, and edits its meaning and unit.

use std::{cell::Cell, rc::Rc};

use decoupler_core::text::counted;
use decoupler_files::{
    export::format_number,
    figure::tick_text,
    import::{ColumnKind, ColumnSummary, InspectedFile, Meaning, Variable},
};
use eframe::egui::{
    Color32, ComboBox, FontId, Label, Rect, Response, RichText, Sense, TextEdit, Ui, WidgetInfo, accesskit::Role, pos2,
    vec2,
};

use super::{
    draft::{Draft, file_name},
    editor::RecordingEditor,
};
use crate::window::{
    theme::{Palette, Theme, space, type_size},
    widgets::{ColumnWidth, TableCell, TableColumn, TableRow, TableView},
};

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
    Variable(usize, usize),
    Column(usize, usize),
}

/// A change made by the user.
enum Change {
    Meaning(usize, usize, Meaning),
    All(usize, Meaning),
    Variable(usize, usize, Meaning),
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
            Some(Change::Variable(file, variable, meaning)) => {
                if draft.choose_variable(file, variable, meaning) {
                    self.read_again();
                }
            }
            Some(Change::Unit(file, column, unit)) => draft.set_unit(file, column, &unit),
        }
        ui.request_repaint();
    }
}

fn table_ui(ui: &mut Ui, draft: &Draft) -> Option<Change> {
    let of_file =
        |(file, inspected): (usize, &InspectedFile)| std::iter::once(Line::File(file)).chain(lines_of(file, inspected));
    let lines: Vec<Line> = draft.files.iter().enumerate().flat_map(of_file).collect();
    let palette = Theme::of(ui).palette;
    let change = Cell::new(None);
    let request = |found: Option<Change>| {
        if found.is_some() {
            change.set(found);
        }
    };
    let row = |place: usize| match lines[place] {
        Line::File(file) => file_row(draft, file, &palette, &request),
        Line::Variable(file, variable) => variable_row(draft, (file, variable), &palette, &request),
        Line::Column(file, column) => column_row(draft, (file, column), &palette, &request),
    };
    let table = TableView::new("columns", &COLUMNS).row_height(ROW_HEIGHT);
    table.show(ui, lines.len(), row);
    change.take()
}

/// Lines of the columns of a file; those of a variable follow its heading, which a variable with one column does not need.
fn lines_of(file: usize, inspected: &InspectedFile) -> Vec<Line> {
    let variables = &inspected.variables;
    let mut lines = Vec::new();
    for column in 0..inspected.meanings.len() {
        let starts =
            |(_, variable): &(usize, &Variable)| variable.columns.start == column && variable.columns.len() > 1;
        lines.extend(
            variables
                .iter()
                .enumerate()
                .find(starts)
                .map(|(place, _)| Line::Variable(file, place)),
        );
        lines.push(Line::Column(file, column));
    }
    let left_out = variables
        .iter()
        .enumerate()
        .filter(|(_, variable)| variable.columns.is_empty());
    lines.extend(left_out.map(|(place, _)| Line::Variable(file, place)));
    lines
}

/// The heading of a variable with its shape and a choice for all of its columns. Choosing one that is left out makes its rows
/// the samples.
fn variable_row<'a>(
    draft: &'a Draft,
    (file, variable): (usize, usize),
    palette: &Palette,
    request: &'a dyn Fn(Option<Change>),
) -> TableRow<'a> {
    let inspected = &draft.files[file];
    let Variable { name, shape, columns } = &inspected.variables[variable];
    let is_left_out = columns.is_empty();
    let of_all = move |ui: &mut Ui| {
        let label = format!("Meaning of variable {name}");
        let combo = ComboBox::from_id_salt(("variable", file, variable))
            .selected_text(if is_left_out { "left out" } else { "set all…" })
            .width(MEANING_WIDTH - space(3));
        let shown = combo.show_ui(ui, |ui| {
            for meaning in [Meaning::Input, Meaning::Target, Meaning::Unused] {
                let is_offered = meaning != Meaning::Unused || !is_left_out;
                if is_offered && ui.selectable_label(false, format!("all {meaning}")).clicked() {
                    request(Some(Change::Variable(file, variable, meaning)));
                }
            }
        });
        let response = shown.response;
        response.widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, &label));
        if is_left_out {
            let rows = inspected.rows;
            response.on_hover_text(format!(
                "Left out, because a sample is one of {rows} rows. Choose its meaning to make its rows the samples."
            ));
        }
    };
    let colour = if is_left_out { palette.dim } else { palette.text };
    let mut cells = vec![TableCell::new(name.clone()).colour(colour), TableCell::controls(of_all)];
    cells.extend((0..4).map(|_| TableCell::default()));
    cells.push(TableCell::new(shape.clone()).colour(palette.dim));
    TableRow::new(cells)
}

/// The heading of a file, with a choice for all of its columns.
fn file_row<'a>(draft: &'a Draft, file: usize, palette: &Palette, request: &'a dyn Fn(Option<Change>)) -> TableRow<'a> {
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
                    request(Some(Change::All(file, meaning)));
                }
            }
        });
        shown
            .response
            .widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, &label));
    };
    let rows = counted(inspected.rows, "row");
    let mut cells = vec![TableCell::new(name).strong(true), TableCell::controls(of_all)];
    cells.extend((0..4).map(|_| TableCell::default()));
    cells.push(TableCell::new(rows).colour(palette.dim));
    TableRow::new(cells)
}

fn column_row<'a>(
    draft: &'a Draft,
    (file, column): (usize, usize),
    palette: &Palette,
    request: &'a dyn Fn(Option<Change>),
) -> TableRow<'a> {
    let palette = *palette;
    let inspected = &draft.files[file];
    let summary = &inspected.columns[column];
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
            request(picked.map(|meaning| Change::Meaning(file, column, meaning)));
        }
    };
    let unit_cell = {
        let name = of();
        move |ui: &mut Ui| {
            if matches!(meaning, Meaning::Input | Meaning::Target) {
                let unit = unit_ui(ui, &name, &draft.unit(file, column), UNIT_WIDTH - space(4));
                request(unit.map(|unit| Change::Unit(file, column, unit)));
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
            let texts = missing_texts(summary.missing, inspected.rows);
            let response = figure_ui(ui, &texts, &format!("Missing in {name}"), colour);
            response.on_hover_text(format!("{} of {} rows", summary.missing, inspected.rows));
        }
    };
    let remark_cell = move |ui: &mut Ui| {
        let shape = || {
            let mut variables = inspected.variables.iter();
            let single = variables.find(|variable| variable.columns == (column..column + 1))?;
            Some((single.shape.clone(), false))
        };
        if let Some((text, is_bad)) = remark(summary, column).or_else(shape) {
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

/// The choice of a meaning. Returns the one newly picked.
pub(super) fn meaning_ui(ui: &mut Ui, name: &str, meaning: Meaning, width: f32) -> Option<Meaning> {
    let mut picked = None;
    let palette = Theme::of(ui).palette;
    let text = RichText::new(meaning.to_string()).color(if meaning == Meaning::Unused {
        palette.dim
    } else {
        palette.text
    });
    let combo = ComboBox::from_id_salt(name).selected_text(text).width(width);
    let shown = combo.show_ui(ui, |ui| {
        for &option in Meaning::ALL {
            let choice = ui.selectable_label(option == meaning, option.to_string());
            if choice.on_hover_text(explanation(option)).clicked() && option != meaning {
                picked = Some(option);
            }
        }
    });
    let label = format!("Meaning of {name}");
    let value = meaning.to_string();
    shown
        .response
        .widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, &label));
    ui.ctx()
        .accesskit_node_builder(shown.response.id, |node| node.set_value(value));
    picked
}

fn explanation(meaning: Meaning) -> &'static str {
    match meaning {
        Meaning::Input => "Reading of the sensor: an input of the network.",
        Meaning::Target => "Predicted by the network from the inputs.",
        Meaning::Time => "Time of the row, by which files are joined and samples are put in order.",
        Meaning::Group => "Rows of equal value, such as one press or one session, stay together in one set.",
        Meaning::RowWire => "Number of the row-wire that was read, from 1.",
        Meaning::Unused => "Not used.",
    }
}

/// The unit, editable in place. Typing takes effect at once, because a row that scrolls out of view does not report the end
/// of editing. Returns the unit if it has changed.
pub(super) fn unit_ui(ui: &mut Ui, name: &str, unit: &str, width: f32) -> Option<String> {
    let id = ui.scope_id().with(("unit", name));
    // As typed, including trailing spaces, which are not part of the unit.
    let kept: Option<String> = ui.data(|data| data.get_temp(id));
    let mut typed = kept.clone().unwrap_or_else(|| unit.to_owned());
    let edit = ui.add(TextEdit::singleline(&mut typed).id(id).desired_width(width));
    let label = format!("Unit of {name}");
    ui.ctx().accesskit_node_builder(edit.id, |node| node.set_label(label));
    if !edit.has_focus() && kept.is_some() {
        ui.data_mut(|data| data.remove::<String>(id));
    } else if edit.changed() {
        ui.data_mut(|data| data.insert_temp(id, typed.clone()));
    }
    (edit.changed() && typed.trim() != unit).then_some(typed)
}

/// A figure at the right of its cell: the first of `texts` that fits, because a truncated figure would be wrong.
/// `label` names it.
pub(super) fn figure_ui(ui: &mut Ui, texts: &[String], label: &str, colour: Color32) -> Response {
    let rect: Rect = ui.max_rect();
    let room = rect.width() - space(2);
    let mut shown = None;
    for text in texts {
        let galley = ui
            .painter()
            .layout_no_wrap(text.clone(), FontId::proportional(type_size().note), colour);
        let has_room = galley.size().x <= room;
        shown = Some((galley, text));
        if has_room {
            break;
        }
    }
    let response = ui.interact(rect, ui.scope_id().with("figure"), Sense::hover());
    if let Some((galley, text)) = shown {
        response.widget_info(|| WidgetInfo::labeled(Role::Label, true, format!("{label}: {text}")));
        let at = rect.right_center() - vec2(space(1) + galley.size().x, 0.5 * galley.size().y);
        ui.painter().galley(at, galley, colour);
    }
    response
}

/// Returns texts of the ends of a range, the most exact first: with enough decimals to distinguish them, with fewer, and
/// rounded, with the width if they would look the same.
pub(super) fn range_texts(min: f64, max: f64) -> Vec<String> {
    let span = max - min;
    let largest = min.abs().max(max.abs());
    let number = |value: f64| format_number(value).replace('-', "−");
    let has_decimals = (1e-6..1e12).contains(&span) && largest < 1e12;
    if min == max {
        return vec![number(min)];
    }
    let mut texts = Vec::new();
    if has_decimals {
        for step in [span / 100.0, span / 10.0] {
            texts.push(format!("{} – {}", tick_text(min, step), tick_text(max, step)));
        }
    }
    let ends = [number(min), number(max)];
    texts.push(if ends[0] == ends[1] {
        format!("{}, width {}", ends[0], number(span))
    } else {
        ends.join(" – ")
    });
    texts
}

/// Returns texts of the number of rows with a missing cell: the number, and its share for narrow cells.
pub(super) fn missing_texts(missing: usize, rows: usize) -> Vec<String> {
    if missing == 0 {
        return vec!["–".to_owned()];
    }
    let percent = 100.0 * missing as f64 / rows.max(1) as f64;
    vec![missing.to_string(), format!("{} %", format_number(percent))]
}

/// Returns a remark on an unusual column, and true if the column cannot be used as it is.
pub(super) fn remark(summary: &ColumnSummary, column: usize) -> Option<(String, bool)> {
    if let Some((line, text)) = &summary.first_text {
        let others = match summary.texts {
            1 => String::new(),
            texts => format!(", and {} other cells", texts - 1),
        };
        return Some((
            format!("line {line}, column {}: '{text}' is not a number{others}", column + 1),
            true,
        ));
    }
    if summary.kind == ColumnKind::Empty {
        return Some(("empty".to_owned(), true));
    }
    if summary.is_constant {
        return Some(("constant: carries no information".to_owned(), true));
    }
    summary
        .duplicate_of
        .as_ref()
        .map(|other| (format!("same as {other}"), true))
}

/// Paints a small histogram over `rect`, as high as its fullest bar.
pub(super) fn paint_histogram(ui: &Ui, rect: Rect, bars: &[usize], colour: Color32) {
    let Some(most) = bars.iter().copied().max().filter(|most| *most > 0) else {
        return;
    };
    let width = rect.width() / bars.len() as f32;
    for (place, &count) in bars.iter().enumerate() {
        if count == 0 {
            continue;
        }
        let left = rect.left() + width * place as f32;
        // One sample among thousands is still visible.
        let height = (rect.height() * count as f32 / most as f32).max(1.0);
        let top_left = pos2(left, rect.bottom() - height);
        let bar = Rect::from_min_max(top_left, pos2(left + width - 1.0, rect.bottom()));
        ui.painter().rect_filled(bar, 0.0, colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_a_range_differ_where_its_numbers_do() {
        for (min, max, text) in [
            (-108.0, 288.4, "−108 – 288"),
            (142.95, 143.0, "142.9500 – 143.0000"),
            (1_742_233_313.2, 1_742_253_720.9, "1742233313 – 1742253721"),
            (-1.0, 1.0, "−1.00 – 1.00"),
            (4.0, 4.0, "4.00"),
            (0.0, 1e-9, "0 – 1.00e−9"),
            (-1e300, 1e300, "−1.00e300 – 1.00e300"),
        ] {
            assert_eq!(range_texts(min, max)[0], text);
        }
    }

    #[test]
    fn every_range_has_a_short_text_that_is_right() {
        for (min, max, last) in [
            (314.999_969, 315.0, "315, width 3.10e−5"),
            (-314.999_969, -314.9, "−315, width 0.100"),
            (1e11, 1e11 + 1.0 / 1024.0, "1.00e11, width 9.77e−4"),
            (0.0, f64::MIN_POSITIVE, "0 – 2.23e−308"),
            (-f64::MAX, f64::MAX, "−1.80e308 – 1.80e308"),
        ] {
            let texts = range_texts(min, max);
            assert_eq!(texts.last().unwrap(), last);
        }
        assert_eq!(missing_texts(0, 10), ["–"]);
        assert_eq!(missing_texts(123_456_789, 200_000_000), ["123456789", "61.7 %"]);
    }
}
