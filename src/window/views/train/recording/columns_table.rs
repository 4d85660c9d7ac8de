//! Table of the columns of all files with their meanings.
//!
//! It shows the range, the histogram and remarks of each column, and edits its meaning and unit. Columns selected by their
//! names get a meaning together.

use std::cell::Cell;

use decoupler_core::text::counted;
use decoupler_files::{
    export::format_number,
    figure::tick_text,
    import::{ColumnKind, ColumnSummary, InspectedFile, Meaning, Variable},
};
use eframe::egui::{
    Button, Color32, Modifiers, Rect, RichText, Sense, TextEdit, Ui, WidgetInfo, accesskit::Role, pos2, vec2,
};

use super::{
    editor::RecordingEditor,
    import::{Import, file_name},
};
use crate::window::{
    theme::{Palette, Theme, semibold, space, type_size},
    widgets::{ColumnWidth, TableCell, TableColumn, TableRow, TableView, fields::combo_ui},
};

const MEANING_WIDTH: f32 = space(23);
const UNIT_WIDTH: f32 = space(20);
const COLUMNS: [TableColumn<'_>; 7] = [
    TableColumn::text("column").width(ColumnWidth::Rest),
    TableColumn::text("meaning").width(ColumnWidth::Points(MEANING_WIDTH)),
    TableColumn::text("unit").width(ColumnWidth::Points(UNIT_WIDTH)),
    TableColumn::text("values").width(ColumnWidth::Points(space(16))),
    TableColumn::figure("from – to").width(ColumnWidth::Points(space(46))),
    TableColumn::figure("missing").width(ColumnWidth::Points(space(12))),
    TableColumn::text("remarks").width(ColumnWidth::Rest),
];

/// Where a row of the table leaves a change made by the user.
type Changed = Cell<Option<Box<dyn FnOnce(&mut Import)>>>;

/// A row of the table: a file, or a variable or column of one.
#[derive(Clone, Copy)]
enum Line<'a> {
    File,
    Variable(&'a Variable),
    Column(usize),
}

impl RecordingEditor {
    /// Shows the columns of all files; changes their meanings and units.
    pub(super) fn columns_table_ui(&mut self, ui: &mut Ui, is_busy: bool) {
        let Some(import) = &mut self.import else { return };
        let files = import.files.iter().enumerate();
        let lines = Vec::from_iter(files.flat_map(|(number, file)| lines_of(file).map(move |line| (number, line))));
        let (palette, changed) = (Theme::of(ui).palette, Changed::default());
        ui.add_enabled_ui(!is_busy, |ui| {
            let table = TableView::new("columns", &COLUMNS).row_height(space(7));
            table.show(ui, lines.len(), |place| match lines[place] {
                (file, Line::Column(column)) => column_row(import, (file, column), palette, &changed),
                (file, heading) => heading_row(&import.files[file], (file, heading), palette, &changed),
            });
        });
        let Some(change) = changed.take() else { return };
        change(import);
        if import.wanted.is_some() {
            self.read_again();
        }
        ui.request_repaint();
    }
}

/// Lines of a file. The columns of a variable follow its heading, which a variable with one column does not need.
fn lines_of(file: &InspectedFile) -> impl Iterator<Item = Line<'_>> {
    let columns = (0..file.meanings.len()).flat_map(|column| {
        let starts = move |variable: &&Variable| variable.columns.start == column && variable.columns.len() > 1;
        let variable = file.variables.iter().find(starts).map(Line::Variable);
        variable.into_iter().chain([Line::Column(column)])
    });
    let left_out = file.variables.iter().filter(|variable| variable.columns.is_empty());
    std::iter::once(Line::File)
        .chain(columns)
        .chain(left_out.map(Line::Variable))
}

/// The heading of a file or a variable, with its size.
fn heading_row<'a>(
    of: &'a InspectedFile,
    (file, line): (usize, Line<'a>),
    palette: Palette,
    changed: &'a Changed,
) -> TableRow<'a> {
    let (name, size, columns) = match line {
        Line::Variable(Variable { name, shape, columns }) => (name.clone(), shape.clone(), columns.clone()),
        _ => (file_name(&of.path), counted(of.rows, "row"), 0..of.meanings.len()),
    };
    let mut cells = if columns.is_empty() {
        let name_cell = TableCell::new(name.clone()).colour(palette.dim);
        let controls = move |ui: &mut Ui| {
            let button = ui.small_button("Use its rows").on_hover_text(LEFT_OUT);
            button.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Use the rows of {name}")));
            if button.clicked() {
                changed.set(Some(Box::new(move |import| import.wanted = Some((file, name)))));
            }
        };
        vec![name_cell, TableCell::controls(controls)]
    } else {
        let text = RichText::new(&name).font(semibold(type_size().note));
        let name_cell = move |ui: &mut Ui| {
            if let Some(held) = name_ui(ui, &format!("all of {name}"), text, false) {
                changed.set(Some(Box::new(move |import| import.select_all(file, columns, held))));
            }
        };
        vec![TableCell::controls(name_cell), TableCell::default()]
    };
    cells.extend((0..4).map(|_| TableCell::default()));
    cells.push(TableCell::new(size).colour(palette.dim));
    TableRow::new(cells)
}

/// The name of a column, or of all of a file or variable, which a click selects with the keys held.
fn name_ui(ui: &mut Ui, name: &str, text: RichText, is_selected: bool) -> Option<Modifiers> {
    let button = ui.add(Button::selectable(is_selected, text).truncate());
    let label = format!("Select {name}");
    button.widget_info(|| WidgetInfo::selected(Role::Button, true, is_selected, &label));
    let is_clicked = button.on_hover_text(&label).clicked();
    is_clicked.then(|| ui.input(|input| input.modifiers))
}

const LEFT_OUT: &str = "Left out, because its rows are not the samples. Makes its rows the samples.";

fn column_row<'a>(
    import: &'a Import,
    (file, column): (usize, usize),
    palette: Palette,
    changed: &'a Changed,
) -> TableRow<'a> {
    let inspected = &import.files[file];
    let (summary, meaning) = (&inspected.columns[column], inspected.meanings[column]);
    let is_unused = meaning == Meaning::Unused;
    let (colour, bars) = if is_unused {
        (palette.dim, palette.line)
    } else {
        (palette.text, palette.dim)
    };
    let name = inspected.full_name(column);
    let names = [name.clone(), format!("Unit of {name}"), format!("Histogram of {name}")];
    let [of_meaning, of_unit, of_histogram] = names;
    let (of_name, is_selected) = (name.clone(), import.selected.contains(&name));
    let name_cell = move |ui: &mut Ui| {
        let text = RichText::new(&of_name).size(type_size().note).color(colour);
        if let Some(held) = name_ui(ui, &of_name, text, is_selected) {
            changed.set(Some(Box::new(move |import| import.select(of_name, held))));
        }
    };
    let meaning_cell = move |ui: &mut Ui| {
        if let Some(picked) = meaning_ui(ui, format!("Meaning of {of_meaning}"), meaning) {
            changed.set(Some(Box::new(move |import| import.set_meaning((file, column), picked))));
        }
    };
    let unit_cell = move |ui: &mut Ui| {
        if matches!(meaning, Meaning::Input | Meaning::Target)
            && let Some(unit) = unit_ui(ui, of_unit, import.unit(file, column))
        {
            changed.set(Some(Box::new(move |import| import.set_unit(file, column, unit))));
        }
    };
    let histogram_cell = move |ui: &mut Ui| {
        let rect = ui.max_rect().shrink2(vec2(0.0, space(1)));
        paint_histogram(ui, rect, &summary.histogram, bars);
        let response = ui.interact(rect, ui.scope_id().with("histogram"), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &of_histogram));
        response.on_hover_text("Number of rows in each sixteenth of the range.");
    };
    let range = summary.min.zip(summary.max);
    let range = range.map_or_else(|| "–".to_owned(), |(min, max)| range_text(min, max));
    let missing = match summary.missing {
        0 => "–".to_owned(),
        missing => missing.to_string(),
    };
    // The values of a group may be texts.
    let remark = remark(summary, column).filter(|_| meaning != Meaning::Group);
    let is_bad = remark.is_some() && !is_unused;
    let remark_colour = if is_bad { palette.warning } else { palette.dim };
    let row = TableRow::new([
        TableCell::controls(name_cell),
        TableCell::controls(meaning_cell),
        TableCell::controls(unit_cell),
        TableCell::controls(histogram_cell),
        TableCell::new(range).colour(colour),
        TableCell::new(missing).colour(colour),
        TableCell::new(remark.unwrap_or_default()).colour(remark_colour),
    ]);
    row.named(name)
}

/// The choice of a meaning. Returns the one newly picked.
fn meaning_ui(ui: &mut Ui, label: String, shown: Meaning) -> Option<Meaning> {
    let names = Vec::from_iter(Meaning::ALL.iter().map(Meaning::to_string));
    let options = Meaning::ALL.iter().zip(&names);
    let options = Vec::from_iter(options.map(|(&option, name)| (option, name.as_str(), explanation(option))));
    let mut picked = None;
    let button = combo_ui(ui, &label, MEANING_WIDTH, &options, shown, &mut picked);
    ui.ctx().accesskit_node_builder(button.id, |node| node.set_label(label));
    picked
}

fn explanation(meaning: Meaning) -> &'static str {
    match meaning {
        Meaning::Input => "Reading of the sensor: an input of the network.",
        Meaning::Target => "Decoded by the network from the inputs.",
        Meaning::Time => "Time of the row, by which files are joined and samples are put in order.",
        Meaning::Group => "Samples of equal value, such as one press or one session, stay together in one set.",
        Meaning::RowWire => "Number of the row-wire that was read, from 1.",
        Meaning::Unused => "Not used.",
    }
}

/// The unit, editable in place. Typing takes effect at once, because a row that scrolls out of view does not report the end
/// of editing. Returns the unit if it has changed.
fn unit_ui(ui: &mut Ui, label: String, unit: &str) -> Option<String> {
    let id = ui.scope_id().with(&label);
    // As typed, with trailing spaces, and empty where the unit of the header applies again.
    let kept = ui.data(|data| data.get_temp(id));
    let mut typed = kept.unwrap_or_else(|| unit.to_owned());
    let edit = TextEdit::singleline(&mut typed).desired_width(UNIT_WIDTH - space(2));
    let edit = ui.add(edit.id(id));
    ui.ctx().accesskit_node_builder(edit.id, |node| node.set_label(label));
    let picked = typed.trim().to_owned();
    if edit.has_focus() {
        ui.data_mut(|data| data.insert_temp(id, typed));
    } else {
        ui.data_mut(|data| data.remove::<String>(id));
    }
    (edit.changed() && picked != unit).then_some(picked)
}

/// Returns the ends of a range: with enough decimals to distinguish them or, if that is too long, rounded, with the width if they
/// would look the same.
fn range_text(min: f64, max: f64) -> String {
    /// Because a truncated figure would be wrong.
    const MAX_CHARACTERS: usize = 26;
    let ends = [min, max].map(|end| format_number(end).replace('-', "−"));
    let exact = [min, max].map(|end| tick_text(end, (max - min) / 100.0)).join(" – ");
    match ends {
        [end, _] if min == max => end,
        _ if (1e-6..=f64::MAX).contains(&(max - min)) && exact.chars().count() <= MAX_CHARACTERS => exact,
        [one, other] if one == other => format!("{one}, width {}", format_number(max - min).replace('-', "−")),
        ends => ends.join(" – "),
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
    }
}
