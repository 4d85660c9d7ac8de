use super::{Cell, Table};
use decoupler_core::text::{begins_formula, inert};

/// Form in which a table is copied into other documents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, strum::Display)]
pub enum TableForm {
    /// GitHub-flavoured Markdown, numbers rounded for readers.
    Markdown,
    /// LaTeX for the packages `booktabs` and `siunitx`, numbers rounded for readers and aligned at the decimal point.
    #[strum(to_string = "LaTeX")]
    Latex,
    /// Columns separated by tabs, numbers with every digit: for spreadsheets.
    #[strum(to_string = "tab-separated")]
    TabSeparated,
    /// An array of objects by the names of the fields, numbers with every digit: for programs.
    #[strum(to_string = "JSON")]
    Json,
}

impl TableForm {
    /// All forms, in the order offered to the user.
    pub const ALL: [Self; 4] = [Self::Markdown, Self::Latex, Self::TabSeparated, Self::Json];
}

impl Table {
    /// Returns the table in `form`.
    pub fn text(&self, form: TableForm) -> String {
        match form {
            TableForm::Markdown => self.markdown(),
            TableForm::Latex => self.latex(),
            TableForm::TabSeparated => self.tab_separated(),
            TableForm::Json => self.json(),
        }
    }

    /// Headings and rows, as texts that `heading` and `cell` return.
    fn lines(
        &self,
        heading: impl Fn(usize, String) -> String,
        cell: impl Fn(usize, &Cell) -> String,
    ) -> Vec<Vec<String>> {
        let headings = self.columns.iter().enumerate();
        let headings = headings.map(|(place, column)| heading(place, column.title())).collect();
        let rows = self.rows.iter().map(|row| {
            let cells = row.iter().enumerate();
            cells.map(|(place, of_row)| cell(place, of_row)).collect()
        });
        std::iter::once(headings).chain(rows).collect()
    }

    /// Returns the table for a terminal: numbers rounded for readers, columns apart by two spaces. Figures are aligned on the
    /// right, also those with a unit or an interval; other texts on the left.
    pub fn aligned(&self) -> String {
        let lines = self.lines(|_, title| title, |_, cell| cell.rounded());
        let width = |column: usize| {
            let cells = lines.iter().filter_map(|line| line.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let is_figure =
            |text: &String| text.is_empty() || text.starts_with(|c: char| c.is_ascii_digit() || "-–".contains(c));
        let is_right = |column: usize| lines[1..].iter().filter_map(|line| line.get(column)).all(is_figure);
        let layout = Vec::from_iter((0..self.columns.len()).map(|column| (width(column), is_right(column))));
        let line = |cells: &Vec<String>| {
            let padded = cells.iter().zip(&layout).map(|(cell, (width, is_right))| {
                // A width in a format string panics above 65 535.
                let spaces = " ".repeat(width - cell.chars().count());
                if *is_right {
                    spaces + cell
                } else {
                    cell.clone() + &spaces
                }
            });
            padded.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
        };
        lines.iter().map(line).collect()
    }

    fn json(&self) -> String {
        // Texts and finite numbers can always be written.
        let json = serde_json::to_string_pretty(self);
        json.unwrap_or_default() + "\n"
    }

    fn markdown(&self) -> String {
        let mut lines = self.lines(|_, title| escaped(&title), |_, cell| escaped(&cell.rounded()));
        let rule = |column| if self.is_numeric(column) { "---:" } else { "---" }.to_owned();
        lines.insert(1, (0..self.columns.len()).map(rule).collect());
        let lines = lines.iter().map(|cells| format!("| {} |\n", cells.join(" | ")));
        lines.collect()
    }

    fn tab_separated(&self) -> String {
        // A tab or line break inside a cell would start a new cell.
        let plain = |text: String| text.replace(['\t', '\n', '\r'], " ");
        let lines = self.lines(|_, title| plain(inert(&title)), |_, cell| plain(cell.for_spreadsheet()));
        lines.iter().map(|cells| cells.join("\t") + "\n").collect()
    }

    /// Returns the table as HTML, numbers rounded for readers; rows with the name `own` in their first or second column are
    /// highlighted.
    pub(in crate::export) fn html(&self, own: &str) -> String {
        let is_text = self.columns.len() > 1 && !self.is_numeric(self.columns.len() - 1);
        let class = if is_text { " class=\"text\"" } else { "" };
        let headings = self.columns.iter();
        let headings = headings.map(|column| format!("<th scope=\"col\">{}</th>", escaped_html(&column.title())));
        let rows = self.rows.iter().map(|row| {
            let cells: Vec<String> = row.iter().map(Cell::rounded).collect();
            let is_own = cells.iter().take(2).any(|name| name == own);
            let class = if is_own { " class=\"own\"" } else { "" };
            let cells = cells.iter().map(|cell| format!("<td>{}</td>", escaped_html(cell)));
            format!("<tr{class}>{}</tr>\n", String::from_iter(cells))
        });
        format!(
            "<table{class}>\n<thead><tr>{}</tr></thead>\n<tbody>\n{}</tbody></table>",
            String::from_iter(headings),
            String::from_iter(rows)
        )
    }

    fn latex(&self) -> String {
        let alignments: Vec<String> = (0..self.columns.len()).map(|column| self.alignment(column)).collect();
        // Braces keep siunitx from reading a text as a number.
        let in_column = |column: usize, is_number: bool, text: &str| match self.is_numeric(column) && !is_number {
            true => format!("{{{}}}", escaped_latex(text)),
            false => escaped_latex(text),
        };
        let lines = self.lines(
            |column, title| in_column(column, false, &title),
            |column, cell| in_column(column, !cell.exact().is_empty(), &cell.rounded()),
        );
        let lines = Vec::from_iter(lines.iter().map(|cells| format!("{} \\\\\n", cells.join(" & "))));
        format!(
            "% \\usepackage{{booktabs, siunitx}}\n\\begin{{tabular}}{{{}}}\n\\toprule\n{}\\midrule\n{}\\bottomrule\n\
             \\end{{tabular}}\n",
            alignments.join(" "),
            lines[0],
            lines[1..].concat()
        )
    }

    /// Column type of LaTeX: names at the left, numbers at their decimal points, mixed columns at the right.
    fn alignment(&self, column: usize) -> String {
        if !self.is_numeric(column) {
            return if column == 0 { "l" } else { "r" }.to_owned();
        }
        let cells = self.rows.iter().filter_map(|row| row.get(column));
        let numbers = cells.filter(|cell| !cell.exact().is_empty());
        let widest = numbers.fold([0, 1, 0, 0, 0], |widest: [usize; 5], cell| {
            let of_cell = number_widths(&cell.rounded());
            std::array::from_fn(|part| widest[part].max(of_cell[part]))
        });
        let [sign, whole, decimals, exponent_sign, exponent] = widest;
        let [sign, exponent_sign] = [sign, exponent_sign].map(|signs| "-".repeat(signs));
        let exponent = match exponent {
            0 => String::new(),
            digits => format!("e{exponent_sign}{digits}"),
        };
        format!("S[table-format={sign}{whole}.{decimals}{exponent}]")
    }
}

/// Widths of sign, whole digits and decimals of a number, and of sign and digits of its exponent.
fn number_widths(number: &str) -> [usize; 5] {
    let (mantissa, exponent) = number.split_once('e').unwrap_or((number, ""));
    let (whole, decimals) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let signed = |digits: &str| {
        let sign = usize::from(digits.starts_with('-'));
        [sign, digits.len() - sign]
    };
    let ([sign, whole], [exponent_sign, exponent]) = (signed(whole), signed(exponent));
    [sign, whole, decimals.len(), exponent_sign, exponent]
}

/// Escapes the special characters of LaTeX.
fn escaped_latex(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    // After the end of a row, LaTeX takes [ and * for arguments of \\, and a number stays one for siunitx.
    if text.starts_with(['[', '*']) || begins_formula(text) {
        escaped += "{}";
    }
    for letter in text.chars() {
        match letter {
            '\\' => escaped += "\\textbackslash{}",
            '~' => escaped += "\\textasciitilde{}",
            '^' => escaped += "\\textasciicircum{}",
            '\n' | '\r' => escaped.push(' '),
            '{' | '}' | '$' | '&' | '#' | '%' | '_' => escaped.extend(['\\', letter]),
            _ => escaped.push(letter),
        }
    }
    escaped
}

/// Escapes the special characters of HTML and leaves out control characters, which it does not allow.
pub(in crate::export) fn escaped_html(text: &str) -> String {
    let text = text.replace(|letter: char| letter.is_control() && !"\n\t".contains(letter), "");
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    text.replace('"', "&quot;")
}

/// Escapes the special characters of Markdown.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    let mut before = ' ';
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        // Inside a word, Markdown treats an underscore as a plain character.
        let is_inside = before.is_alphanumeric() && letters.peek().is_some_and(|next| next.is_alphanumeric());
        match letter {
            '\n' | '\r' => escaped.push(' '),
            '_' if is_inside => escaped.push(letter),
            '\\' | '|' | '*' | '_' | '`' | '[' | '<' | '~' => escaped.extend(['\\', letter]),
            _ => escaped.push(letter),
        }
        before = letter;
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::{super::TableColumn, *};

    fn table() -> Table {
        Table {
            columns: vec![
                TableColumn::new("decoder", "Decoder", ""),
                TableColumn::new("z_percent", "Z", "%"),
                TableColumn::new("epochs", "epochs", ""),
            ],
            rows: vec![
                vec!["a|b_c 10×6_3×18\n*".into(), (1.0 / 3.0).into(), 1000_usize.into()],
                vec!["R&D 50 % #1 \\x{y}~^".into(), (-6.13e-5).into(), 7_usize.into()],
                vec!["none".into(), Cell::Number(None), 20_usize.into()],
            ],
        }
    }

    #[test]
    fn markdown_lines_have_the_same_number_of_cells_for_any_names() {
        let text = table().text(TableForm::Markdown);
        let expected = "| Decoder | Z (%) | epochs |\n\
                        | --- | ---: | ---: |\n\
                        | a\\|b_c 10×6_3×18 \\* | 0.333 | 1000 |\n\
                        | R&D 50 % #1 \\\\x{y}\\~^ | -6.13e-5 | 7 |\n\
                        | none | – | 20 |\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn spreadsheets_get_every_digit_and_one_line_per_row() {
        let text = table().text(TableForm::TabSeparated);
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split('\t').collect()).collect();
        assert_eq!(lines[0], ["Decoder", "Z (%)", "epochs"]);
        assert_eq!(lines[1], ["a|b_c 10×6_3×18 *", "0.3333333333333333", "1000"]);
        assert_eq!(lines[3], ["none", "", "20"]);
        assert_eq!(lines.len(), 4);
    }

    #[test]
    fn a_terminal_gets_columns_as_wide_as_their_widest_cell() {
        let mut table = table();
        table.rows.truncate(2);
        table.rows[0][0] = "a".into();
        table.rows[1][0] = "long name".into();
        let expected = "Decoder       Z (%)  epochs\n\
                        a             0.333    1000\n\
                        long name  -6.13e-5       7\n";
        assert_eq!(table.aligned(), expected);
        let times = Table::of_headings(
            ["decoder", "training", "note"],
            [
                vec!["ridge".into(), "3 ms".into(), "".into()],
                vec!["network".into(), "12.3 s".into(), "*".into()],
            ],
        );
        let expected = "decoder  training  note\n\
                        ridge        3 ms\n\
                        network    12.3 s  *\n";
        assert_eq!(times.aligned(), expected);
    }

    #[test]
    fn latex_escapes_names_and_aligns_numbers_at_the_decimal_point() {
        let expected = "% \\usepackage{booktabs, siunitx}\n\
                        \\begin{tabular}{l S[table-format=-1.3e-1] S[table-format=4.0]}\n\
                        \\toprule\n\
                        Decoder & {Z (\\%)} & {epochs} \\\\\n\
                        \\midrule\n\
                        a|b\\_c 10×6\\_3×18 * & 0.333 & 1000 \\\\\n\
                        R\\&D 50 \\% \\#1 \\textbackslash{}x\\{y\\}\\textasciitilde{}\\textasciicircum{} & -6.13e-5 & 7 \\\\\n\
                        none & {–} & 20 \\\\\n\
                        \\bottomrule\n\
                        \\end{tabular}\n";
        assert_eq!(table().text(TableForm::Latex), expected);
    }

    /// Read back as a spreadsheet reads them.
    #[test]
    fn names_are_not_formulas_and_numbers_stay_numbers() {
        let names = ["=1+2", "+a", "-b", "@c", "-0.5", "plain"];
        let table = Table {
            columns: vec![TableColumn::new("=x", "=x", ""), TableColumn::new("z", "Z", "")],
            rows: names.iter().map(|&name| vec![name.into(), Cell::from(-0.5)]).collect(),
        };
        let mut written = Vec::new();
        table.write_csv(&mut written).unwrap();
        let tabbed = table.text(TableForm::TabSeparated);
        for (separator, text) in [(b',', written.as_slice()), (b'\t', tabbed.as_bytes())] {
            let mut reader = csv::ReaderBuilder::new().delimiter(separator).from_reader(text);
            assert_eq!(&reader.headers().unwrap()[0], "'=x");
            let read: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
            for (record, name) in read.iter().zip(names) {
                let is_plain = matches!(name, "plain" | "-0.5");
                let expected = if is_plain { name.to_owned() } else { format!("'{name}") };
                assert_eq!((&record[0], &record[1]), (expected.as_str(), "-0.5"));
            }
        }
        let latex = table.text(TableForm::Latex);
        assert!(latex.contains("\n{}=1+2 & ") && latex.contains("& -0.5"), "{latex}");
    }
}
