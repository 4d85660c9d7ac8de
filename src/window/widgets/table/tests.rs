use std::cell::{Cell, RefCell};

use eframe::egui::{Event, Modifiers, MouseWheelSource, MouseWheelUnit, TouchPhase, vec2};
use egui_kittest::{Harness, kittest::Queryable as _};

use super::*;
use crate::window::theme;

const COLUMNS: [TableColumn<'_>; 2] = [
    TableColumn::text("Decoder").width(ColumnWidth::Rest),
    TableColumn::figure("Z %").width(ColumnWidth::Fits("10000")),
];

fn row(place: usize) -> TableRow<'static> {
    TableRow::figures(place.to_string(), ["1".to_owned()]).labelled(format!("Row {place}"))
}

#[test]
fn only_visible_rows_are_laid_out_and_the_header_stays() {
    let made = Cell::new(0);
    let mut harness = Harness::builder()
        .with_size(vec2(400.0, 300.0))
        .with_context_setup(|ctx| theme::install(ctx, true))
        .build_ui(|ui| {
            made.set(0);
            let table = TableView::new("table", &COLUMNS).sorted(SortBy::default());
            table.clickable().show(ui, 10_000, |place| {
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
fn headings_sort_and_rows_are_selected_by_a_click_anywhere() {
    let clicks = RefCell::new(Vec::new());
    let sort = Cell::new(SortBy::default());
    let mut harness = Harness::builder()
        .with_size(vec2(400.0, 300.0))
        .with_context_setup(|ctx| theme::install(ctx, true))
        .build_ui(|ui| {
            let click = TableView::new("table", &COLUMNS)
                .sorted(sort.get())
                .clickable()
                .show(ui, 3, row);
            if let Some(TableClick::Sort(by)) = click {
                sort.set(by);
            }
            clicks.borrow_mut().extend(click);
        });
    for label in ["Sort by Z %", "Sort by Z %", "Row 2", "1, Z %: 1"] {
        harness.get_by_label(label).click();
        harness.run();
    }
    let by = |is_descending| {
        TableClick::Sort(SortBy {
            column: Some(1),
            is_descending,
        })
    };
    let expected = [by(false), by(true), TableClick::Select(2), TableClick::Select(1)];
    assert_eq!(*clicks.borrow(), expected);
}

/// Returns a table with one text column and many columns of figures, in this width.
fn wide(width: f32, figures: usize) -> Harness<'static> {
    let headings: Vec<String> = (0..figures).map(|place| format!("figure {place}")).collect();
    let harness = Harness::builder()
        .with_size(vec2(width, 300.0))
        .with_context_setup(|ctx| theme::install(ctx, true));
    harness.build_ui(move |ui| {
        let columns: Vec<TableColumn<'_>> = std::iter::once(TableColumn::text("name"))
            .chain(headings.iter().map(|heading| TableColumn::figure(heading)))
            .collect();
        let row = |place: usize| TableRow::figures(format!("row {place}"), vec!["1.23".to_owned(); figures]);
        ui.label("above the table");
        TableView::new("wide", &columns).show(ui, 3, row);
    })
}

fn scroll_sideways(harness: &mut Harness<'_>, label: &str, points: f32) {
    harness.get_by_label(label).hover();
    harness.run();
    harness.event(Event::MouseWheel {
        unit: MouseWheelUnit::Point,
        source: MouseWheelSource::Unknown,
        delta: vec2(-points, 0.0),
        phase: TouchPhase::Move,
        modifiers: Modifiers::NONE,
    });
    harness.run_steps(60);
}

#[test]
fn a_table_without_room_scrolls_sideways_as_a_whole() {
    let mut harness = wide(400.0, 12);
    harness.run();
    let labels = ["Row 1", "row 1, figure 3: 1.23", "figure 3"];
    let places = |harness: &Harness<'_>| labels.map(|label| harness.get_by_label(label).rect());
    let before = places(&harness);
    scroll_sideways(&mut harness, "row 1, figure 3: 1.23", 60.0);
    assert_eq!(places(&harness), before.map(|place| place.translate(vec2(-60.0, 0.0))));
}

#[test]
fn a_table_with_room_does_not_scroll() {
    let mut harness = wide(400.0, 3);
    harness.run();
    let before = harness.get_by_label("row 1, figure 2: 1.23").rect();
    scroll_sideways(&mut harness, "Row 1", 60.0);
    assert_eq!(harness.get_by_label("row 1, figure 2: 1.23").rect(), before);
    assert!(before.right() <= 400.0);
}

#[test]
fn a_described_table_shows_all_rows_rounded_below_the_widgets_above() {
    let table = export::Table {
        columns: vec![
            export::TableColumn::new("decoder", "Decoder", ""),
            export::TableColumn::new("z_percent", "Z", "%"),
        ],
        rows: vec![
            vec!["ridge".into(), (1.0 / 3.0).into()],
            vec!["none".into(), export::Cell::Number(None)],
        ],
    };
    let mut harness = Harness::new_ui(move |ui| {
        theme::install(ui.ctx(), true);
        ui.label("above the table");
        described_table_ui(ui, "described", &table);
        ui.label("below the table");
    });
    harness.run_steps(2);
    let top = |label: &str| harness.get_by_label(label).rect().top();
    let order = [
        "above the table",
        "Decoder",
        "ridge, Z (%): 0.333",
        "none, Z (%): –",
        "below the table",
    ];
    assert!(
        order.windows(2).all(|pair| top(pair[0]) < top(pair[1])),
        "{:?}",
        order.map(top)
    );
}

#[test]
fn controls_in_a_cell_can_be_clicked() {
    const COLUMNS: [TableColumn<'_>; 2] = [
        TableColumn::text("name"),
        TableColumn::text("choice").width(ColumnWidth::Points(80.0)),
    ];
    let clicked = Cell::new(None);
    let mut harness = Harness::new_ui(|ui| {
        let row = |place: usize| {
            let clicked = &clicked;
            let button = move |ui: &mut eframe::egui::Ui| {
                if ui.button(format!("button {place}")).clicked() {
                    clicked.set(Some(place));
                }
            };
            TableRow::new([TableCell::new(format!("name {place}")), TableCell::controls(button)])
        };
        TableView::new("controls", &COLUMNS).show(ui, 3, row);
    });
    harness.get_by_label("button 2").click();
    harness.run();
    drop(harness);
    assert_eq!(clicked.get(), Some(2));
}
