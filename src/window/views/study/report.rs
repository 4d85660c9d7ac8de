//! Reports: tables, figures and notes, shown in the same way for every topic.

use decoupler_files::{
    export::{Cell, Table},
    figure::{Figure, Ink, SequentialMap},
};
use eframe::egui::{Color32, CursorIcon, RichText, Stroke, Ui};

use crate::window::{
    plotting::{cells_ui, colour, plots_ui},
    theme::{Palette, Theme, type_size},
    widgets::{ColumnWidth, SortBy, TableCell, TableClick, TableColumn, TableRow, TableView, section_heading_ui},
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

/// Shows the table, whose rows are marked by a click.
pub fn table_ui(ui: &mut Ui, page: &Page, look: &mut Look) {
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
        let column = column.meaning(table.columns[place].meaning);
        match place {
            // Its dots take room, too.
            0 => column,
            _ => column.width(ColumnWidth::of_longest(texts)),
        }
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
    match view.show(ui, order.len(), row) {
        Some(TableClick::Select(place)) => look.marked = Some(page.rows[order[place]].item),
        Some(TableClick::Sort(sort)) => look.sort = sort,
        None => {}
    }
}

/// Shows the figure. A click on a point or on a cell of a map marks it.
pub fn figure_ui(ui: &mut Ui, page: &Page, look: &mut Look, colours: SequentialMap) {
    match &page.figure {
        Some(Figure::HeatMap(map)) => {
            let (map, columns) = ((**map).clone().coloured(colours), map.columns.len());
            let marked = look.marked.map(|cell| ([cell / columns], [cell % columns]));
            let marked = marked
                .as_ref()
                .map_or((&[][..], &[][..]), |(row, column)| (&row[..], &column[..]));
            let marked = (marked.0, marked.1, Theme::of(ui).palette.text);
            if let Some(([row, column], pointed)) = cells_ui(ui, "Map of the cells", &map, marked) {
                if pointed.clicked() {
                    look.marked = Some(row * columns + column);
                }
                let note = &map.notes[[row, column]];
                pointed
                    .on_hover_cursor(CursorIcon::PointingHand)
                    .on_hover_text_at_pointer(note);
            }
        }
        Some(Figure::Plots(plots)) => {
            for drawn in plots_ui(ui, page.what, plots) {
                look.marked = drawn.clicked.or(look.marked);
                let points = drawn.plot.series.iter().flat_map(|series| &series.points);
                let marked = points.filter(|point| point.item.is_some() && point.item == look.marked);
                for at in marked.filter_map(|point| drawn.position(point.x, point.y)) {
                    let ring = Stroke::new(1.6, Theme::of(ui).palette.text);
                    ui.painter().circle_stroke(at, 8.0, ring);
                }
            }
        }
        // Studies have no surfaces.
        Some(Figure::Surfaces(_)) | None => {}
    }
}

/// Shows the notes.
pub fn notes_ui(ui: &mut Ui, page: &Page) {
    let palette = Theme::of(ui).palette;
    for note in &page.notes {
        match note {
            Note::Heading(text) => drop(section_heading_ui(ui, text)),
            Note::Line(tone, text) => {
                ui.label(RichText::new(text).size(type_size().note).color(tone.colour(&palette)));
            }
        }
    }
}
