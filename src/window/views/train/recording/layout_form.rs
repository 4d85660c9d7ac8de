//! The join of files, and the layout of those of text.

use eframe::egui::{Ui, WidgetInfo, accesskit::Role};

use super::draft::{Draft, file_name};
use crate::window::widgets::{
    dim_ui,
    fields::{count_ui, input_text, list_ui, quantity_ui},
};
use decoupler_files::import::{Decimal, DialectChoice, Encoding, Format, Meaning, Separator};

/// Largest number of lines before a table.
const MAX_LINES: usize = 1_000_000;

/// The join of the files in words.
pub(super) fn joined_summary(draft: &Draft) -> String {
    let is_by_time = draft.files.iter().all(|file| file.meanings.contains(&Meaning::Time));
    if is_by_time {
        "by time".to_owned()
    } else {
        "row by row".to_owned()
    }
}

/// The limits of the joins; changes `draft`.
pub(super) fn joined_ui(ui: &mut Ui, draft: &mut Draft) {
    let is_by_time = joined_summary(draft) == "by time";
    if !is_by_time {
        dim_ui(
            ui,
            "Rows belong together by their number. To join by time, make a column of each file “time” in the table.",
        );
        return;
    }
    let intervals: Vec<Option<f64>> = draft.files[1..]
        .iter()
        .map(|file| file.inspection.time.as_ref().and_then(|time| time.median_interval))
        .collect();
    let names: Vec<String> = draft.files[1..].iter().map(|file| file_name(&file.path)).collect();
    for ((joined, interval), name) in draft.joined().iter_mut().zip(intervals).zip(names) {
        ui.label(&name);
        let mut has_limit = joined.limit.is_some();
        let hint = "Largest time between a row and its partner. Otherwise half the median interval of the joined file.";
        let response = ui.checkbox(&mut has_limit, "Own limit");
        response.widget_info(|| WidgetInfo::selected(Role::CheckBox, true, has_limit, format!("Own limit for {name}")));
        response.on_hover_text(hint);
        let usual = interval.map_or(1.0, |interval| interval / 2.0);
        match (has_limit, &mut joined.limit) {
            (true, Some(limit)) => {
                quantity_ui(ui, "Limit", hint, limit, 1e-12..=1e12, "");
            }
            (true, limit @ None) => *limit = Some(usual),
            (false, limit) => {
                *limit = None;
                dim_ui(
                    ui,
                    &format!(
                        "Within {} of the time of a row.",
                        input_text((1e6 * usual).round() / 1e6)
                    ),
                );
            }
        }
    }
}

/// Tells whether the layout is as found.
pub(super) fn layout_summary(draft: &Draft) -> String {
    if draft.plan.import.dialect == DialectChoice::default() {
        "found".to_owned()
    } else {
        "yours".to_owned()
    }
}

/// The layout of files of text; changes `draft`. Returns true if the files are to be looked at again.
pub(super) fn layout_ui(ui: &mut Ui, draft: &mut Draft) -> bool {
    for file in &draft.files {
        if let Format::Text(dialect) = &file.format {
            dim_ui(ui, &format!("{}: {dialect}.", file_name(&file.path)));
        }
    }
    let dialect = &mut draft.plan.import.dialect;
    let before = *dialect;
    let found = (None, "found", "As found at the beginning of each file.");
    let separators = [
        found,
        (Some(Separator::Comma), "comma", ","),
        (Some(Separator::Semicolon), "semicolon", ";"),
        (Some(Separator::Tab), "tab", "Tabulator"),
        (Some(Separator::Bar), "bar", "|"),
        (Some(Separator::Space), "space", "Any number of spaces or tabulators"),
    ];
    if let Some(picked) = list_ui(
        ui,
        "Separator",
        "Character between cells.",
        &separators,
        dialect.separator,
    ) {
        dialect.separator = picked;
    }
    let found = (None, "found", "As found at the beginning of each file.");
    let decimals = [
        found,
        (Some(Decimal::Point), "point", "1.5"),
        (Some(Decimal::Comma), "comma", "1,5"),
    ];
    if let Some(picked) = list_ui(
        ui,
        "Decimal",
        "Character before the decimal places.",
        &decimals,
        dialect.decimal,
    ) {
        dialect.decimal = picked;
    }
    let found = (None, "found", "As found at the beginning of each file.");
    let headers = [
        found,
        (Some(true), "yes", "The first row has the names of the columns."),
        (
            Some(false),
            "no",
            "The first row has numbers; columns are called c1, c2, …",
        ),
    ];
    if let Some(picked) = list_ui(ui, "Header", "Names in the first row.", &headers, dialect.header) {
        dialect.header = picked;
    }
    let found = (None, "found", "As found at the beginning of each file.");
    let encodings = [
        found,
        (Some(Encoding::Utf8), "utf-8", "With or without a byte-order mark"),
        (Some(Encoding::Latin1), "latin-1", "ISO 8859-1"),
        (Some(Encoding::Utf16Le), "utf-16le", "Little-endian"),
        (Some(Encoding::Utf16Be), "utf-16be", "Big-endian"),
    ];
    if let Some(picked) = list_ui(ui, "Encoding", "Encoding of the text.", &encodings, dialect.encoding) {
        dialect.encoding = picked;
    }
    let mut lines = dialect.skip_lines.unwrap_or(0);
    count_ui(
        ui,
        "Lines before",
        "Lines before the table, which are skipped.",
        &mut lines,
        0..=MAX_LINES,
    );
    dialect.skip_lines = (lines > 0).then_some(lines);
    *dialect != before
}
