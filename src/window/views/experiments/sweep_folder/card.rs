use decoupler_core::text::counted;
use decoupler_files::export::atomic_write;
use eframe::egui::{Align, Label, Layout, RichText, Ui, vec2};
use serde_json::Value;

use super::{SweepFolder, state::OpenFolder, table::SweepTable};
use crate::window::{
    shared::{Contents, Effect, FileTask, FileWords},
    theme::{Theme, semibold, space, type_size},
    widgets::{
        ColumnWidth, SortBy, TableCell, TableClick, TableColumn, TableRow, TableView, dim_ui, ghost_button, note_ui,
        placeholder_ui, progress_bar_ui, section_heading_ui,
    },
};

/// Most problems that are spelled out.
const MAX_PROBLEMS: usize = 3;

/// Shows the folder: how far it is filled, and the table of its trials.
pub(in crate::window::views::experiments) fn folder_card_ui(ui: &mut Ui, folder: &mut SweepFolder) {
    let Some(open) = &mut folder.open else { return };
    let mut is_closed = false;
    ui.horizontal(|ui| {
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            is_closed = ui.add(ghost_button("Close folder")).clicked();
            let heading = RichText::new(format!("Sweep folder {}", open.name())).font(semibold(type_size().title));
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                let heading = ui.add(Label::new(heading).truncate());
                heading.on_hover_text(open.path.display().to_string());
            });
        });
    });
    let OpenFolder { table, sort, .. } = open;
    match table {
        None => placeholder_ui(ui, "Reading the folder …"),
        Some(Err(reason)) => {
            note_ui(ui, reason);
        }
        Some(Ok(table)) => trials_ui(ui, table, sort),
    }
    if is_closed {
        folder.close();
    }
}

fn trials_ui(ui: &mut Ui, table: &SweepTable, sort: &mut SortBy) {
    let (finished, trials) = (table.finished(), table.trials);
    let how_far = format!("{finished} of {} finished", counted(trials, "trial"));
    progress_bar_ui(ui, "Sweep folder", finished as f32 / trials.max(1) as f32, &how_far);
    if finished < trials {
        dim_ui(ui, "New trials appear here by themselves.");
    }
    ui.add_space(space(1));
    for problem in table.problems.iter().take(MAX_PROBLEMS) {
        note_ui(ui, problem);
    }
    if table.problems.len() > MAX_PROBLEMS {
        let rest = table.problems.len() - MAX_PROBLEMS;
        note_ui(ui, &format!("and {} more", counted(rest, "problem")));
    }
    if finished == 0 {
        return placeholder_ui(ui, "No trial has finished yet.");
    }
    ui.allocate_ui(vec2(ui.available_width(), ui.available_height()), |ui| {
        table_ui(ui, table, sort);
    });
}

fn table_ui<'a>(ui: &mut Ui, table: &'a SweepTable, sort: &mut SortBy) {
    let palette = &Theme::of(ui).palette;
    let column = |(place, heading): (usize, &'a String)| {
        let is_figure = table.rows.iter().any(|row| row[place].value.is_some());
        let column = if is_figure {
            TableColumn::figure(heading)
        } else {
            TableColumn::text(heading)
        };
        column.width(ColumnWidth::of_longest(
            table.rows.iter().map(|row| row[place].text.as_str()),
        ))
    };
    let columns: Vec<TableColumn<'_>> = table.headings.iter().enumerate().map(column).collect();
    let cell = |row: usize, column: usize| {
        let cell = &table.rows[row][column];
        (cell.value, cell.text.as_str())
    };
    let order = sort.order(table.rows.len(), cell);
    let row = |place: usize| {
        let cells = &table.rows[order[place]];
        let options: Vec<String> = (cells[..table.options].iter().zip(&table.headings))
            .map(|(cell, option)| format!("{option} {}", cell.text))
            .collect();
        let name = options.join(", ");
        let cells = cells.iter().enumerate().map(|(column, cell)| {
            let colour = if column == table.options {
                palette.accent
            } else {
                palette.text
            };
            TableCell::new(&cell.text)
                .colour(colour)
                .strong(column <= table.options)
        });
        TableRow::new(cells).labelled(format!("Trial {name}")).named(name)
    };
    let view = TableView::new("sweep folder", &columns).sorted(*sort);
    if let Some(TableClick::Sort(chosen)) = view.show(ui, order.len(), row) {
        *sort = chosen;
    }
}

/// The specification of a sweep.
const SPECIFICATION: FileWords = FileWords {
    kind: "specification",
    description: "This sweep for the terminal, on one machine or many: decoupler sweep --spec FILE --out FOLDER trains it, \
                  and --engine writes the job script of a cluster.",
    extensions: &["json"],
};

/// The file of a specification.
fn specification_task(specification: Value) -> FileTask {
    let contents = Contents::new(move |path| {
        atomic_write(path, |writer| {
            serde_json::to_writer_pretty(&mut *writer, &specification)?;
            writeln!(writer)
        })
    });
    FileTask::save(SPECIFICATION, "sweep", contents)
}

/// Sweeps on other machines: saves the sweep of the form as a specification, opens a folder that is being filled.
pub(in crate::window::views::experiments) fn folder_form_ui(
    ui: &mut Ui,
    folder: &SweepFolder,
    specification: &Result<Value, String>,
    effects: &mut Vec<Effect>,
) {
    section_heading_ui(ui, "On many machines");
    dim_ui(
        ui,
        "The command decoupler sweep trains a specification on any number of machines and fills a folder, which is shown here.",
    );
    let refusal = specification.as_ref().err().map_or("", String::as_str);
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.y = space(1);
        let save = ui.add_enabled(refusal.is_empty(), ghost_button("Save specification…"));
        let save = save
            .on_hover_text(SPECIFICATION.description)
            .on_disabled_hover_text(refusal);
        if let (true, Ok(specification)) = (save.clicked(), specification) {
            effects.push(Effect::ChooseFile(specification_task(specification.clone())));
        }
        let open = ui.add(ghost_button("Open sweep folder…"));
        let open = open.on_hover_text("Shows the trials of a folder that decoupler sweep fills, as they finish.");
        if open.clicked() {
            effects.push(Effect::ChooseFile(folder.choose()));
        }
    });
}
