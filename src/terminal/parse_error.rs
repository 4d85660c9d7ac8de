use std::borrow::Cow;

/// The parser's message in one line, without its usage text.
pub(super) fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let paragraphs = text.split("\n\n").map(|paragraph| {
        let lines: Vec<_> = paragraph.lines().map(str::trim).collect();
        lines.join(" ")
    });
    let said = paragraphs.filter(|paragraph| {
        let aside = ["Usage:", "For more information"];
        !paragraph.is_empty() && !aside.iter().any(|start| paragraph.starts_with(start))
    });
    let line = said.collect::<Vec<_>>().join("; ");
    let line = line.strip_prefix("error: ").unwrap_or(&line);
    line.split(' ').map(shortened).collect::<Vec<_>>().join(" ")
}

/// A word as given, unless it is too long to be read.
fn shortened(word: &str) -> Cow<'_, str> {
    const LONGEST: usize = 200;
    const BEGINNING: usize = 40;
    if word.chars().count() <= LONGEST {
        return Cow::Borrowed(word);
    }
    let beginning: String = word.chars().take(BEGINNING).collect();
    Cow::Owned(format!("{beginning}…"))
}
