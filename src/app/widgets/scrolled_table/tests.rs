use std::cell::{Cell, RefCell};

use eframe::egui::{Event, Modifiers, MouseWheelSource, MouseWheelUnit, TouchPhase};
use egui_kittest::{Harness, kittest::Queryable as _};

use super::*;
use crate::app::theme;

const COLUMNS: [TableColumn<'_>; 2] = [
    TableColumn {
        heading: "Decoder",
        is_figure: false,
        width: ColumnWidth::Rest,
    },
    TableColumn {
        heading: "Z %",
        is_figure: true,
        width: ColumnWidth::Fits("10000"),
    },
];

fn row(place: usize) -> TableRow {
    let cell = |text: String, label: Option<String>| TableCell {
        text,
        colour: Color32::WHITE,
        is_strong: false,
        label,
        meaning: "",
    };
    TableRow {
        label: format!("Row {place}"),
        is_marked: false,
        meaning: "",
        dot: None,
        cells: vec![
            cell(place.to_string(), None),
            cell("1".to_owned(), Some(format!("{place}, Z %"))),
        ],
    }
}

#[test]
fn only_the_rows_in_view_are_laid_out_and_the_head_stays() {
    let made = Cell::new(0);
    let mut harness = Harness::builder()
        .with_size(vec2(400.0, 300.0))
        .with_context_setup(|ctx| theme::install(ctx, true))
        .build_ui(|ui| {
            made.set(0);
            scrolled_table_ui(ui, "table", &COLUMNS, Some(SortBy::default()), 10_000, |place| {
                made.set(made.get() + 1);
                row(place)
            });
        });
    harness.run();
    assert!((8..=14).contains(&made.get()), "{} rows", made.get());
    let head = harness.get_by_label("Sort by Z %").rect();
    harness.get_by_label("Row 3").hover();
    harness.run();
    let scrolled = Event::MouseWheel {
        unit: MouseWheelUnit::Point,
        source: MouseWheelSource::Unknown,
        delta: vec2(0.0, -24_000.0),
        phase: TouchPhase::Move,
        modifiers: Modifiers::NONE,
    };
    harness.event(scrolled);
    harness.run_steps(60);
    assert!(harness.query_by_label("Row 3").is_none());
    assert!((8..=14).contains(&made.get()), "{} rows", made.get());
    assert_eq!(harness.get_by_label("Sort by Z %").rect(), head);
}

#[test]
fn headings_sort_and_rows_are_marked_wherever_they_are_clicked() {
    let clicks = RefCell::new(Vec::new());
    let sort = Cell::new(SortBy::default());
    let mut harness = Harness::builder()
        .with_size(vec2(400.0, 300.0))
        .with_context_setup(|ctx| theme::install(ctx, true))
        .build_ui(|ui| {
            let click = scrolled_table_ui(ui, "table", &COLUMNS, Some(sort.get()), 3, row);
            if let Some(TableClick::Sort(by)) = click {
                sort.set(by);
            }
            // The pointer points at a row all the while.
            let click = click.filter(|click| !matches!(click, TableClick::Point(_)));
            clicks.borrow_mut().extend(click);
        });
    for label in ["Sort by Z %", "Sort by Z %", "Row 2", "1, Z %"] {
        harness.get_by_label(label).click();
        harness.run();
    }
    let by = |is_descending| {
        TableClick::Sort(SortBy {
            column: Some(1),
            is_descending,
        })
    };
    let expected = [by(false), by(true), TableClick::Mark(2), TableClick::Mark(1)];
    assert_eq!(*clicks.borrow(), expected);
}
