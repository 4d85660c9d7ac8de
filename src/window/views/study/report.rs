//! Reports: tables, figures and notes, shown in the same way for every topic.

use decoupler_files::{
    export::{Cell, Table},
    figure::{Figure, Ink, SequentialMap},
};
use eframe::egui::{
    Color32, CursorIcon, Label, Pos2, Rect, Response, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, accesskit::Role,
};

use crate::window::{
    plotting::{CellPointed, Pointer, colour, heat_map_ui, plots_ui},
    theme::{Palette, Theme, semibold, type_size},
    widgets::{
        ColumnWidth, SortBy, TableCell, TableClick, TableColumn, TableRow, TableView, dim_ui, placeholder_ui,
        section_heading_ui,
    },
};

/// Results of a study, ready to be shown.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Title.
    pub headline: String,
    /// Conditions of the work, and what the figures are.
    pub conditions: String,
    /// One page, or one for each level of noise.
    pub pages: Vec<Page>,
}

/// Table, figure and notes that are shown together.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// Name among the pages.
    pub name: String,
    /// What the rows of the table are: "Cell".
    pub what: &'static str,
    /// The table; without columns if there is none.
    pub table: Table,
    /// What each row of the table is about.
    pub rows: Vec<Row>,
    /// The figure, if there is one. The cells of a map are items, row by row.
    pub figure: Option<Figure>,
    /// Everything else.
    pub notes: Vec<Note>,
}

/// Appearance of a row of a table.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// Item that is marked by a click.
    pub item: usize,
    /// Name, which distinguishes it from other rows.
    pub name: String,
    /// Meaning of its coloured cells, as a tooltip.
    pub meaning: &'static str,
    /// Hue of the item in the figure.
    pub dot: Option<Ink>,
    /// Tone of each cell.
    pub tones: Vec<Tone>,
    /// What is known about it besides the cells.
    pub facts: Vec<String>,
    /// For each plot of the figure in which it answers to the pointer, the name of the quantity and its place.
    pub places: Vec<(&'static str, [f64; 2])>,
}

/// Tone of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// As other text.
    Usual,
    /// A name.
    Strong,
    /// The network's own result, or a best one.
    Own,
    /// For comparison.
    Dim,
    /// A baseline that is better than the network; a remark.
    Warning,
    /// A failure.
    Bad,
}

impl Tone {
    fn colour(self, palette: &Palette) -> Color32 {
        match self {
            Self::Usual | Self::Strong => palette.text,
            Self::Own => palette.accent,
            Self::Dim => palette.dim,
            Self::Warning => palette.warning,
            Self::Bad => palette.bad,
        }
    }
}

/// A line next to the figure.
#[derive(Clone, Debug)]
pub enum Note {
    /// Heading of the following lines.
    Heading(&'static str),
    /// A sentence.
    Line(Tone, String),
    /// An item that is marked by a click.
    Pick(usize, String),
}

/// What is shown of a report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Look {
    /// The displayed page.
    pub page: usize,
    /// The item marked in table and figure.
    pub marked: Option<usize>,
    /// The order of the table.
    pub sort: SortBy,
}

/// Shows the table. A click marks a row; returns the one opened by a double click.
pub fn table_ui(ui: &mut Ui, page: &Page, look: &mut Look) -> Option<usize> {
    let palette = &Theme::of(ui).palette;
    let table = &page.table;
    let titles = Vec::from_iter(table.columns.iter().map(|column| column.title()));
    let rounded = |row: &Vec<Cell>| Vec::from_iter(row.iter().map(Cell::rounded));
    let texts = Vec::from_iter(table.rows.iter().map(rounded));
    let column = |(place, title)| {
        let column = if table.is_numeric(place) {
            TableColumn::figure(title)
        } else {
            TableColumn::text(title)
        };
        let texts = texts.iter().map(|row| row[place].as_str());
        column
            .meaning(table.columns[place].meaning)
            .width(ColumnWidth::of_longest(texts))
    };
    let columns = Vec::from_iter(titles.iter().map(String::as_str).enumerate().map(column));
    // Texts are sorted by their places in the list of values.
    let figure = |row: usize, column: usize| {
        let text = texts[row][column].as_str();
        let first = || texts.iter().position(|row| row[column] == text);
        let figure = match &table.rows[row][column] {
            Cell::Text(_) => first().map(|place| place as f64),
            cell => cell.number(),
        };
        (figure, text)
    };
    let order = look.sort.order(table.rows.len(), figure);
    let row = |place: usize| {
        let (row, texts) = (&page.rows[order[place]], &texts[order[place]]);
        let cells = row.tones.iter().zip(texts).map(|(tone, text)| {
            let meaning = match tone {
                Tone::Own | Tone::Warning => row.meaning,
                _ => "",
            };
            let cell = TableCell::new(text).colour(tone.colour(palette)).meaning(meaning);
            cell.strong(matches!(tone, Tone::Strong | Tone::Own))
        });
        TableRow::new(cells)
            .labelled(format!("{} {}", page.what, row.name))
            .named(row.name.as_str())
            .selected(look.marked == Some(row.item))
            .dot(row.dot.map(|ink| colour(ink, palette)))
    };
    let view = TableView::new("study table", &columns).sorted(look.sort).clickable();
    let (place, is_opened) = match view.show(ui, order.len(), row)? {
        TableClick::Select(place) => (place, false),
        TableClick::Open(place) => (place, true),
        TableClick::Sort(sort) => {
            look.sort = sort;
            return None;
        }
    };
    let item = page.rows[order[place]].item;
    look.marked = Some(item);
    is_opened.then_some(item)
}

/// Shows the figure. A click on a cell of a map marks it and a double click opens it; a click on a point opens it.
pub fn figure_ui(ui: &mut Ui, page: &Page, look: &mut Look, colours: SequentialMap) -> Option<usize> {
    if page.rows.is_empty() {
        placeholder_ui(ui, "The points appear here as they are measured.");
        return None;
    }
    match page.figure.as_ref()? {
        Figure::HeatMap(map) => {
            let columns = map.columns.len();
            let marked = look.marked.map(|cell| [cell / columns, cell % columns]);
            let map = (**map).clone().coloured(colours);
            let ([row, column], pointed) = heat_map_ui(ui, &map, marked)?;
            let cell = row * columns + column;
            look.marked = Some(cell);
            (pointed == CellPointed::Twice).then_some(cell)
        }
        Figure::Plots(plots) => {
            let answers = page.rows.iter().any(|row| !row.places.is_empty());
            let pointer = if answers { Pointer::Picks } else { Pointer::Moves };
            let mut opened = None;
            for (number, drawn) in plots_ui(ui, page.what, plots, pointer).iter().enumerate() {
                let placed = page.rows.iter().filter_map(|row| {
                    let (quantity, [x, y]) = *row.places.get(number)?;
                    Some((row, quantity, drawn.position(x, y)?))
                });
                for (row, quantity, at) in placed {
                    if point_ui(ui, row, quantity, at, look.marked == Some(row.item)).clicked() {
                        (look.marked, opened) = (Some(row.item), Some(row.item));
                    }
                }
            }
            opened
        }
        // Studies have no surfaces.
        Figure::Surfaces(_) => None,
    }
}

/// Shows the name and the facts of a point under the pointer, and a ring around it there and while it is marked.
fn point_ui(ui: &mut Ui, point: &Row, quantity: &str, at: Pos2, is_marked: bool) -> Response {
    let name = format!("{quantity}: {}", point.name);
    let rect = Rect::from_center_size(at, Vec2::splat(14.0));
    let response = ui.interact(rect, ui.scope_id().with(&name), Sense::click());
    response.widget_info(|| WidgetInfo::selected(Role::Button, true, is_marked, &name));
    if is_marked || response.hovered() {
        let ring = Stroke::new(1.6, Theme::of(ui).palette.text);
        ui.painter().circle_stroke(at, 8.0, ring);
    }
    response.on_hover_cursor(CursorIcon::PointingHand).on_hover_ui(|ui| {
        ui.spacing_mut().item_spacing.y = 1.0;
        ui.label(RichText::new(&point.name).font(semibold(type_size().note)));
        for fact in &point.facts {
            ui.label(RichText::new(fact).size(type_size().note));
        }
        dim_ui(ui, "Click to open it in the Train view");
    })
}

/// Shows the notes, and the facts of the marked item.
pub fn notes_ui(ui: &mut Ui, page: &Page, look: &mut Look) {
    let palette = Theme::of(ui).palette;
    for note in &page.notes {
        match note {
            Note::Heading(text) => drop(section_heading_ui(ui, text)),
            Note::Line(tone, text) => {
                ui.label(RichText::new(text).size(type_size().note).color(tone.colour(&palette)));
            }
            Note::Pick(item, text) => {
                let shown = RichText::new(text).size(type_size().note).color(palette.accent);
                let pick = ui.selectable_label(look.marked == Some(*item), shown);
                if pick
                    .on_hover_text("Click to mark it in the figure and the table.")
                    .clicked()
                {
                    look.marked = Some(*item);
                }
            }
        }
    }
    let mut described = page.rows.iter().filter(|row| !row.facts.is_empty());
    if let Some(point) = described.find(|row| look.marked == Some(row.item)) {
        section_heading_ui(ui, "Marked point");
        ui.add(Label::new(RichText::new(&point.name).font(semibold(type_size().note))).truncate());
        dim_ui(ui, &format!("{}.", point.facts.join("; ")));
    }
}
