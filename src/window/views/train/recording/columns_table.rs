//! Table of the columns of all files with their meanings.
//!
//! It shows the range, the histogram and remarks of each column, and edits its meaning and unit.

use std::{cell::Cell, ops::Range};

use decoupler_core::text::counted;
use decoupler_files::{
    export::format_number,
    figure::tick_text,
    import::{ColumnKind, ColumnSummary, InspectedFile, Meaning, Variable},
};
use eframe::egui::{
    Align, Color32, ComboBox, Label, Layout, Rect, RichText, Sense, TextEdit, Ui, WidgetInfo, accesskit::Role, pos2,
    vec2,
};

use super::{
    editor::RecordingEditor,
    import::{Import, file_name},
};
use crate::window::{
    theme::{Palette, Theme, space, type_size},
    widgets::{ColumnWidth, TableCell, TableColumn, TableRow, TableView},
};

const ROW_HEIGHT: f32 = space(7);
const MEANING_WIDTH: f32 = space(23);
const UNIT_WIDTH: f32 = space(13);
const COLUMNS: [TableColumn<'_>; 7] = [
    TableColumn::text("column").width(ColumnWidth::Rest),
    TableColumn::text("meaning").width(ColumnWidth::Points(MEANING_WIDTH)),
    TableColumn::text("unit").width(ColumnWidth::Points(UNIT_WIDTH)),
    TableColumn::text("values").width(ColumnWidth::Points(space(16))),
    TableColumn::figure("from – to").width(ColumnWidth::Points(space(46))),
    TableColumn::figure("missing").width(ColumnWidth::Points(space(12))),
    TableColumn::text("remarks").width(ColumnWidth::Rest),
];

/// A line of the table: a file and its place in the list of files, a variable or a column in it.
#[derive(Clone, Copy)]
enum Line<'a> {
    File(usize, &'a InspectedFile),
    Variable(usize, &'a Variable),
    Column(usize, usize),
}

/// A change made by the user.
enum Change {
    Meaning(usize, Range<usize>, Meaning),
    /// The rows of a variable become the samples, and its columns get a meaning.
    Variable(usize, String, Meaning),
    Unit(usize, usize, String),
}

impl RecordingEditor {
    /// Shows the columns of all files; changes their meanings and units.
    pub(super) fn columns_table_ui(&mut self, ui: &mut Ui, is_busy: bool) {
        let Some(import) = &mut self.import else { return };
        let change = Cell::new(None);
        ui.add_enabled_ui(!is_busy, |ui| table_ui(ui, import, &change));
        match change.take() {
            None => return,
            Some(Change::Meaning(file, columns, meaning)) => import.set_meanings(file, columns, meaning),
            Some(Change::Variable(file, name, meaning)) => self.take_variable(file, name, meaning),
            Some(Change::Unit(file, column, unit)) => import.set_unit(file, column, &unit),
        }
        ui.request_repaint();
    }
}

fn table_ui(ui: &mut Ui, import: &Import, change: &Cell<Option<Change>>) {
    let files = import.files.iter().enumerate();
    let lines = Vec::from_iter(files.flat_map(|(number, file)| lines_of(number, file)));
    let palette = Theme::of(ui).palette;
    let row = |place: usize| match lines[place] {
        Line::File(number, file) => {
            let name = file_name(&file.path);
            let of = format!("all columns of {name}");
            let change_to = move |meaning| Change::Meaning(number, 0..file.meanings.len(), meaning);
            let size = counted(file.rows, "row");
            heading(TableCell::new(name).strong(true), (of, "set all…", ""), size, &palette, change, change_to)
        }
        Line::Variable(number, variable) => {
            let Variable { name, shape, columns } = variable;
            let is_left_out = columns.is_empty();
            let change_to = move |meaning| match is_left_out {
                true => Change::Variable(number, name.clone(), meaning),
                false => Change::Meaning(number, columns.clone(), meaning),
            };
            let (text, hint, colour) = if is_left_out {
                let hint = "Left out, because its rows are not the samples. Choose its meaning to make its rows the samples.";
                ("left out", hint, palette.dim)
            } else {
                ("set all…", "", palette.text)
            };
            let cell = TableCell::new(name.clone()).colour(colour);
            let of = format!("variable {name}");
            heading(cell, (of, text, hint), shape.clone(), &palette, change, change_to)
        }
        Line::Column(file, column) => column_row(import, (file, column), palette, change),
    };
    let table = TableView::new("columns", &COLUMNS).row_height(ROW_HEIGHT);
    table.show(ui, lines.len(), row);
}

/// Lines of a file; those of a variable follow its heading, which a variable with one column does not need.
fn lines_of(number: usize, file: &InspectedFile) -> Vec<Line<'_>> {
    let mut lines = vec![Line::File(number, file)];
    for column in 0..file.meanings.len() {
        let starts = |variable: &&Variable| variable.columns.start == column && variable.columns.len() > 1;
        let variable = file.variables.iter().find(starts);
        lines.extend(variable.map(|variable| Line::Variable(number, variable)));
        lines.push(Line::Column(number, column));
    }
    let left_out = file.variables.iter().filter(|variable| variable.columns.is_empty());
    lines.extend(left_out.map(|variable| Line::Variable(number, variable)));
    lines
}

/// The heading of a file or a variable, with its size and a choice for all of its columns.
fn heading<'a>(
    name: TableCell<'a>,
    (of, text, hint): (String, &'static str, &'static str),
    size: String,
    palette: &Palette,
    change: &'a Cell<Option<Change>>,
    change_to: impl Fn(Meaning) -> Change + 'a,
) -> TableRow<'a> {
    let of_all = move |ui: &mut Ui| {
        let options = [Meaning::Input, Meaning::Target, Meaning::Unused].map(|meaning| (meaning, format!("all {meaning}")));
        // Choosing nothing does not make the rows of a variable the samples.
        let offered = if hint.is_empty() { &options[..] } else { &options[..2] };
        if let Some(meaning) = combo_ui(ui, &of, RichText::new(text), offered, None, hint) {
            change.set(Some(change_to(meaning)));
        }
    };
    let mut cells = vec![name, TableCell::controls(of_all)];
    cells.extend((0..4).map(|_| TableCell::default()));
    cells.push(TableCell::new(size).colour(palette.dim));
    TableRow::new(cells)
}

fn column_row<'a>(
    import: &'a Import,
    (file, column): (usize, usize),
    palette: Palette,
    change: &'a Cell<Option<Change>>,
) -> TableRow<'a> {
    let inspected = &import.files[file];
    let (summary, meaning) = (&inspected.columns[column], inspected.meanings[column]);
    let name = inspected.full_name(column);
    let (colour, bars) = if meaning == Meaning::Unused {
        (palette.dim, palette.line)
    } else {
        (palette.text, palette.dim)
    };
    let of = |what: &str| format!("{what} {name}");
    let (of_unit, of_histogram) = (of("Unit of"), of("Histogram of"));
    let of_meaning = name.clone();
    let range = summary.min.zip(summary.max);
    let exact = range.map_or_else(String::new, |(min, max)| format!("{min} to {max}"));
    let range = range.map_or_else(|| "–".to_owned(), |(min, max)| range_text(min, max));
    let range = figure(range, of("Range of"), exact, colour);
    let missing = missing_text(summary.missing, inspected.rows);
    let rows = format!("{} of {} rows", summary.missing, inspected.rows);
    let missing = figure(missing, of("Missing in"), rows, colour);
    let name_cell = move |ui: &mut Ui| {
        ui.add_space(space(2));
        ui.add(Label::new(RichText::new(name).color(colour)).truncate());
    };
    let meaning_cell = move |ui: &mut Ui| {
        let text = RichText::new(meaning.to_string()).color(colour);
        let options = Vec::from_iter(Meaning::ALL.iter().map(|&option| (option, option.to_string())));
        if let Some(picked) = combo_ui(ui, &of_meaning, text, &options, Some(meaning), "") {
            change.set(Some(Change::Meaning(file, column..column + 1, picked)));
        }
    };
    let unit_cell = move |ui: &mut Ui| {
        if matches!(meaning, Meaning::Input | Meaning::Target)
            && let Some(unit) = unit_ui(ui, of_unit, &import.unit(file, column))
        {
            change.set(Some(Change::Unit(file, column, unit)));
        }
    };
    let histogram_cell = move |ui: &mut Ui| {
        let rect = ui.max_rect().shrink2(vec2(0.0, space(1)));
        paint_histogram(ui, rect, &summary.histogram, bars);
        let response = ui.interact(rect, ui.scope_id().with("histogram"), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &of_histogram));
        response.on_hover_text("Number of rows in each sixteenth of the range.");
    };
    let remark_cell = move |ui: &mut Ui| {
        let mut variables = inspected.variables.iter();
        let single = variables.find(|variable| variable.columns == (column..column + 1));
        let (remark, shape) = (remark(summary, column), single.map(|variable| variable.shape.clone()));
        let is_bad = remark.is_some() && meaning != Meaning::Unused;
        if let Some(text) = remark.or(shape) {
            let colour = if is_bad { palette.warning } else { palette.dim };
            ui.add(Label::new(RichText::new(text).size(type_size().note).color(colour)).truncate());
        }
    };
    TableRow::new([
        TableCell::controls(name_cell),
        TableCell::controls(meaning_cell),
        TableCell::controls(unit_cell),
        TableCell::controls(histogram_cell),
        TableCell::controls(range),
        TableCell::controls(missing),
        TableCell::controls(remark_cell),
    ])
}

/// A choice of the meaning `of` something. Returns the one newly picked.
fn combo_ui(
    ui: &mut Ui,
    of: &str,
    text: RichText,
    options: &[(Meaning, String)],
    shown: Option<Meaning>,
    hint: &str,
) -> Option<Meaning> {
    let mut picked = None;
    let value = text.text().to_owned();
    let combo = ComboBox::from_id_salt(of).selected_text(text).width(MEANING_WIDTH);
    let combo = combo.show_ui(ui, |ui| {
        for (option, text) in options {
            let choice = ui.selectable_label(Some(*option) == shown, text);
            if choice.on_hover_text(explanation(*option)).clicked() && Some(*option) != shown {
                picked = Some(*option);
            }
        }
    });
    let response = combo.response;
    response.widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, format!("Meaning of {of}")));
    ui.ctx().accesskit_node_builder(response.id, |node| node.set_value(value));
    if !hint.is_empty() {
        response.on_hover_text(hint);
    }
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
fn unit_ui(ui: &mut Ui, label: String, unit: &str) -> Option<String> {
    let id = ui.scope_id().with(&label);
    // As typed, including trailing spaces, which are not part of the unit.
    let kept: Option<String> = ui.data(|data| data.get_temp(id));
    let mut typed = kept.clone().unwrap_or_else(|| unit.to_owned());
    let edit = ui.add(TextEdit::singleline(&mut typed).id(id).desired_width(UNIT_WIDTH - space(2)));
    ui.ctx().accesskit_node_builder(edit.id, |node| node.set_label(label));
    if !edit.has_focus() && kept.is_some() {
        ui.data_mut(|data| data.remove::<String>(id));
    } else if edit.changed() {
        ui.data_mut(|data| data.insert_temp(id, typed.clone()));
    }
    (edit.changed() && typed.trim() != unit).then_some(typed)
}

/// A figure at the right of its cell, named by `label`.
fn figure(text: String, label: String, hint: String, colour: Color32) -> impl FnOnce(&mut Ui) {
    move |ui| {
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let shown = ui.label(RichText::new(&text).size(type_size().note).color(colour));
            shown.widget_info(|| WidgetInfo::labeled(Role::Label, true, format!("{label}: {text}")));
            shown.on_hover_text(hint);
        });
    }
}

/// Maximum number of characters of a figure, because a truncated one would be wrong.
const MAX_CHARACTERS: [usize; 2] = [26, 6];

/// Returns the ends of a range: with enough decimals to distinguish them or, if that is too long, with fewer, or rounded, with the
/// width if they would look the same.
fn range_text(min: f64, max: f64) -> String {
    let span = max - min;
    let number = |value: f64| format_number(value).replace('-', "−");
    if min == max {
        return number(min);
    }
    if (1e-6..1e12).contains(&span) && min.abs().max(max.abs()) < 1e12 {
        for step in [span / 100.0, span / 10.0] {
            let text = format!("{} – {}", tick_text(min, step), tick_text(max, step));
            if text.chars().count() <= MAX_CHARACTERS[0] {
                return text;
            }
        }
    }
    match [min, max].map(number) {
        [min, max] if min == max => format!("{min}, width {}", number(span)),
        ends => ends.join(" – "),
    }
}

/// Returns the number of rows with a missing cell or, if that is too long, its share.
fn missing_text(missing: usize, rows: usize) -> String {
    let count = missing.to_string();
    if missing == 0 {
        "–".to_owned()
    } else if count.len() <= MAX_CHARACTERS[1] {
        count
    } else {
        format!("{} %", format_number(100.0 * missing as f64 / rows.max(1) as f64))
    }
}

/// Returns a remark on a column that cannot be used as it is.
fn remark(summary: &ColumnSummary, column: usize) -> Option<String> {
    if let Some((line, text)) = &summary.first_text {
        let others = match summary.texts {
            1 => String::new(),
            texts => format!(", and {} other cells", texts - 1),
        };
        let place = format!("line {line}, column {}", column + 1);
        return Some(format!("{place}: '{text}' is not a number{others}"));
    }
    if summary.kind == ColumnKind::Empty {
        return Some("empty".to_owned());
    }
    if summary.is_constant {
        return Some("constant: carries no information".to_owned());
    }
    let other = summary.duplicate_of.as_ref();
    other.map(|other| format!("same as {other}"))
}

/// Paints a small histogram over `rect`, as high as its fullest bar.
fn paint_histogram(ui: &Ui, rect: Rect, bars: &[usize], colour: Color32) {
    let most = bars.iter().copied().max().unwrap_or(0).max(1);
    let width = rect.width() / bars.len() as f32;
    for (place, &count) in bars.iter().enumerate().filter(|(_, count)| **count > 0) {
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
    fn the_ends_of_a_range_differ_where_its_numbers_do_and_fit_their_column() {
        for (min, max, text) in [
            (-108.0, 288.4, "−108 – 288"),
            (142.95, 143.0, "142.9500 – 143.0000"),
            (1_742_233_313.2, 1_742_253_720.9, "1742233313 – 1742253721"),
            (-1.0, 1.0, "−1.00 – 1.00"),
            (4.0, 4.0, "4.00"),
            (0.0, 1e-9, "0 – 1.00e−9"),
            (-1e300, 1e300, "−1.00e300 – 1.00e300"),
            (1e11, 1e11 + 1.0 / 1024.0, "1.00e11, width 9.77e−4"),
            (0.0, f64::MIN_POSITIVE, "0 – 2.23e−308"),
            (-f64::MAX, f64::MAX, "−1.80e308 – 1.80e308"),
        ] {
            assert_eq!(range_text(min, max), text);
        }
        assert_eq!(missing_text(0, 10), "–");
        assert_eq!(missing_text(123_456, 200_000_000), "123456");
        assert_eq!(missing_text(123_456_789, 200_000_000), "61.7 %");
    }
}
