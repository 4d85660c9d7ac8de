use crate::export::Table;

/// HTML in the making. Its elements are closed as in XML, so that programs can read it too.
#[derive(Default)]
pub(super) struct Html {
    text: String,
}

impl Html {
    /// Adds an element with nothing but text in it.
    pub fn element(&mut self, name: &str, class: &str, text: &str) {
        let class = attribute("class", class);
        self.text += &format!("<{name}{class}>{}</{name}>\n", escaped(text));
    }

    /// Adds a section with this heading.
    pub fn section(&mut self, heading: &str, fill: impl FnOnce(&mut Self)) {
        self.text += "<section>\n";
        self.element("h2", "", heading);
        fill(self);
        self.text += "</section>\n";
    }

    /// Adds a table. Rows with the name `own` in the first or second column are highlighted.
    pub fn table(&mut self, table: &Table, own: &str) {
        self.text += "<div class=\"scrolled\"><table>\n<thead><tr>";
        for column in &table.columns {
            self.text += &format!("<th scope=\"col\">{}</th>", escaped(&column.title()));
        }
        self.text += "</tr></thead>\n<tbody>\n";
        for row in &table.rows {
            let cells: Vec<String> = row.iter().map(|cell| cell.rounded()).collect();
            self.row(
                &cells,
                if cells.iter().take(2).any(|name| name == own) {
                    "own"
                } else {
                    ""
                },
            );
        }
        self.text += "</tbody></table></div>\n";
    }

    /// Adds a table of names and values.
    pub fn facts(&mut self, facts: &[(&str, String)]) {
        self.text += "<div class=\"scrolled\"><table class=\"settings\"><tbody>\n";
        for (name, value) in facts {
            self.row(&[(*name).to_owned(), value.clone()], "");
        }
        self.text += "</tbody></table></div>\n";
    }

    fn row(&mut self, cells: &[String], class: &str) {
        self.text += &format!("<tr{}>", attribute("class", class));
        for cell in cells {
            self.text += &format!("<td>{}</td>", escaped(cell));
        }
        self.text += "</tr>\n";
    }

    /// Adds a picture; `svg` is put in as it is.
    pub fn figure(&mut self, caption: &str, svg: &str) {
        self.text += &format!(
            "<figure>\n{svg}<figcaption>{}</figcaption></figure>\n",
            escaped(caption)
        );
    }

    /// The whole document.
    pub fn finish(self, title: &str, style: &str) -> String {
        let (title, body) = (escaped(title), self.text);
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>{title}</title>\n\
             <style>\n{style}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n"
        )
    }
}

fn attribute(name: &str, value: &str) -> String {
    if value.is_empty() {
        String::new()
    } else {
        format!(" {name}=\"{}\"", escaped(value))
    }
}

/// Escapes what HTML would take for markup, and leaves out control characters, which it does not allow.
pub(super) fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\n' | '\t' => escaped.push(letter),
            letter if letter.is_control() => {}
            letter => escaped.push(letter),
        }
    }
    escaped
}
