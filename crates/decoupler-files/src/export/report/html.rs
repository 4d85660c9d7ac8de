//! Blocks of which a report consists, and their rendering as HTML.

use std::fmt::Write as _;

use crate::{
    export::{Table, figures::dark_style},
    figure::Figure,
};

/// A block of a report.
pub(super) enum Block {
    /// Heading of a section, which ends at the next heading.
    Heading(&'static str),
    /// A paragraph.
    Text(Tone, String),
    /// A command to copy.
    Command(String),
    /// A table; rows with this name in the first or second column are highlighted.
    Table(Table, &'static str),
    /// Names and values.
    Facts(Vec<(&'static str, String)>),
    /// A figure with its caption.
    Figure(String, Box<Figure>),
}

/// Tone of a paragraph.
#[derive(Clone, Copy)]
pub(super) enum Tone {
    Plain,
    Dim,
    Warning,
}

impl Block {
    pub fn dim(text: impl Into<String>) -> Self {
        Self::Text(Tone::Dim, text.into())
    }
}

/// Returns the blocks as text for a terminal; figures are left out.
pub(super) fn text(blocks: &[Block]) -> String {
    let written = |block: &Block| match block {
        Block::Heading(heading) => format!("\n{heading}\n"),
        Block::Text(_, text) | Block::Command(text) => format!("{text}\n"),
        Block::Table(table, _) => table.aligned(),
        Block::Facts(facts) => facts.iter().map(|(name, value)| format!("{name}: {value}\n")).collect(),
        Block::Figure(..) => String::new(),
    };
    blocks.iter().map(written).collect()
}

/// Returns the report as one self-contained document. Elements are closed as in XML, which lets XML parsers read it too.
pub(super) fn document(title: &str, blocks: &[Block]) -> String {
    let mut body = format!("<h1>{}</h1>\n", escaped(title));
    let mut is_in_section = false;
    for (place, block) in blocks.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = match block {
            Block::Heading(heading) => {
                let end = if is_in_section { "</section>\n" } else { "" };
                is_in_section = true;
                writeln!(body, "{end}<section>\n<h2>{}</h2>", escaped(heading))
            }
            Block::Text(tone, text) => {
                let class = match tone {
                    Tone::Plain => "",
                    Tone::Dim => " class=\"dim\"",
                    Tone::Warning => " class=\"warning\"",
                };
                writeln!(body, "<p{class}>{}</p>", escaped(text))
            }
            Block::Command(command) => writeln!(body, "<pre>{}</pre>", escaped(command)),
            Block::Table(table, own) => {
                let headings = table.columns.iter();
                let headings = headings.map(|column| format!("<th scope=\"col\">{}</th>", escaped(&column.title())));
                let rows = table.rows.iter().map(|row| {
                    let cells: Vec<String> = row.iter().map(|cell| cell.rounded()).collect();
                    let is_own = cells.iter().take(2).any(|name| name == own);
                    row_of(&cells, if is_own { " class=\"own\"" } else { "" })
                });
                writeln!(
                    body,
                    "<div class=\"scrolled\"><table>\n<thead><tr>{}</tr></thead>\n<tbody>\n{}</tbody></table></div>",
                    headings.collect::<String>(),
                    rows.collect::<String>()
                )
            }
            Block::Facts(facts) => {
                let rows = facts.iter().map(|(name, value)| row_of(&[*name, value], ""));
                writeln!(
                    body,
                    "<div class=\"scrolled\"><table class=\"settings\"><tbody>\n{}</tbody></table></div>",
                    rows.collect::<String>()
                )
            }
            Block::Figure(caption, figure) => {
                let svg = figure.draw().inline_svg(place, caption);
                let caption = escaped(caption);
                writeln!(body, "<figure>\n{svg}<figcaption>{caption}</figcaption></figure>")
            }
        };
    }
    if is_in_section {
        body += "</section>\n";
    }
    let (title, style) = (escaped(title), include_str!("style.css"));
    let dark = dark_style();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>{title}</title>\n\
         <style>\n{style}{dark}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n"
    )
}

fn row_of(cells: &[impl AsRef<str>], class: &str) -> String {
    let cells = cells.iter().map(|cell| format!("<td>{}</td>", escaped(cell.as_ref())));
    format!("<tr{class}>{}</tr>\n", cells.collect::<String>())
}

/// Escapes the special characters of HTML and leaves out control characters, which it does not allow.
fn escaped(text: &str) -> String {
    let text = text.replace(|letter: char| letter.is_control() && !"\n\t".contains(letter), "");
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    text.replace('"', "&quot;")
}
