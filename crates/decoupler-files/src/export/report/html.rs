//! Blocks of which a report consists, and their rendering as HTML.

use crate::{
    export::{Table, figures::dark_style, table::escaped_html},
    figure::Figure,
};

/// A block of a report.
pub(super) enum Block {
    /// Heading of a section, which ends at the next heading.
    Heading(&'static str),
    /// A paragraph.
    Text(String),
    /// A paragraph that explains what is above it.
    Note(String),
    /// A paragraph that warns.
    Warning(String),
    /// A command to copy.
    Command(String),
    /// A table; rows with this name in the first or second column are highlighted.
    Table(Table, &'static str),
    /// A figure with its caption.
    Figure(String, Box<Figure>),
}

impl Block {
    fn html(&self, place: usize) -> String {
        let paragraph = |class: &str, text: &str| format!("<p{class}>{}</p>\n", escaped_html(text));
        match self {
            Self::Heading(heading) => format!("</section>\n<section>\n<h2>{}</h2>\n", escaped_html(heading)),
            Self::Text(text) => paragraph("", text),
            Self::Note(text) => paragraph(" class=\"dim\"", text),
            Self::Warning(text) => paragraph(" class=\"warning\"", text),
            Self::Command(command) => format!("<pre>{}</pre>\n", escaped_html(command)),
            Self::Table(table, own) => format!("<div class=\"scrolled\">{}</div>\n", table.html(own)),
            Self::Figure(caption, figure) => {
                let svg = figure.draw().inline_svg(place, caption);
                let caption = escaped_html(caption);
                format!("<figure>\n{svg}<figcaption>{caption}</figcaption></figure>\n")
            }
        }
    }
}

/// Returns the blocks as text for a terminal; figures are left out.
pub(super) fn text(blocks: &[Block]) -> String {
    let written = |block: &Block| match block {
        Block::Heading(heading) => format!("\n{heading}\n"),
        Block::Text(text) | Block::Note(text) | Block::Warning(text) | Block::Command(text) => format!("{text}\n"),
        Block::Table(table, _) => table.aligned(),
        Block::Figure(..) => String::new(),
    };
    blocks.iter().map(written).collect()
}

/// Returns the report as one self-contained document. Elements are closed as in XML, which lets XML parsers read it too.
pub(super) fn document(title: &str, blocks: &[Block]) -> String {
    let title = escaped_html(title);
    let mut body = format!("<section class=\"head\">\n<h1>{title}</h1>\n");
    body.extend(blocks.iter().enumerate().map(|(place, block)| block.html(place)));
    let (style, dark) = (include_str!("style.css"), dark_style());
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>{title}</title>\n\
         <style>\n{style}{dark}</style>\n</head>\n<body>\n<main>\n{body}</section>\n</main>\n</body>\n</html>\n"
    )
}
