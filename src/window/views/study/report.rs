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
        ColumnWidth, SortBy, TableCell, TableClick, TableColumn, TableRow, TableView, dim_ui, note_ui, placeholder_ui,
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
    /// The items in the plots of the figure that answer to the pointer.
    pub points: Vec<Point>,
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

/// An item in the plots of a figure.
#[derive(Clone, Debug)]
pub struct Point {
    /// Name.
    pub name: String,
    /// Errors and times.
    pub facts: Vec<String>,
    /// Name of the quantity of each plot, and the place of the item in it.
    pub places: [(&'static str, [f64; 2]); 2],
}

/// A line beside the figure.
#[derive(Clone, Debug)]
pub enum Note {
    /// Heading of the following lines.
    Heading(&'static str),
    /// A sentence.
    Line(Tone, String),
    /// A warning.
    Warning(String),
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

/// What the user asks for.
#[derive(Clone, Copy, Debug)]
pub enum Wish {
    /// Begin the task.
    Begin,
    /// Open this item of the page in the Train view.
    Open(usize),
    /// Export the decoder of this item.
    Export(usize),
}

/// Shows the table. A click marks a row; returns the one opened by a double click.
pub fn table_ui(ui: &mut Ui, page: &Page, look: &mut Look) -> Option<Wish> {
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
    let (place, wish) = match view.show(ui, order.len(), row)? {
        TableClick::Select(place) => (place, None),
        TableClick::Open(place) => (place, Some(Wish::Open(page.rows[order[place]].item))),
        TableClick::Sort(sort) => {
            look.sort = sort;
            return None;
        }
    };
    look.marked = Some(page.rows[order[place]].item);
    wish
}

/// Shows the figure. A click on a cell of a map marks it and a double click opens it; a click on a point opens it.
pub fn figure_ui(ui: &mut Ui, page: &Page, look: &mut Look, colours: SequentialMap) -> Option<Wish> {
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
            (pointed == CellPointed::Twice).then_some(Wish::Open(cell))
        }
        Figure::Plots(plots) => {
            let pointer = if page.points.is_empty() {
                Pointer::Moves
            } else {
                Pointer::Picks
            };
            let mut wish = None;
            for (number, drawn) in plots_ui(ui, page.what, plots, pointer).iter().enumerate() {
                for (item, point) in page.points.iter().enumerate() {
                    let Some(&(quantity, [x, y])) = point.places.get(number) else {
                        continue;
                    };
                    let Some(at) = drawn.position(x, y) else { continue };
                    if point_ui(ui, point, quantity, at, look.marked == Some(item)).clicked() {
                        look.marked = Some(item);
                        wish = Some(Wish::Open(item));
                    }
                }
            }
            wish
        }
        // Studies have no surfaces.
        Figure::Surfaces(_) => None,
    }
}

/// Shows the name and the facts of a point under the pointer, and a ring around it there and while it is marked.
fn point_ui(ui: &mut Ui, point: &Point, quantity: &str, at: Pos2, is_marked: bool) -> Response {
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
            Note::Warning(text) => drop(note_ui(ui, text)),
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
    if let Some(point) = look.marked.and_then(|item| page.points.get(item)) {
        section_heading_ui(ui, "Marked point");
        ui.add(Label::new(RichText::new(&point.name).font(semibold(type_size().note))).truncate());
        dim_ui(ui, &format!("{}.", point.facts.join("; ")));
    }
}
