//! Tables in LaTeX, with the rules of `booktabs` and the numeric columns of `siunitx`.

use super::{Cell, Table};
use decoupler_core::text::begins_formula;

pub(super) fn latex(table: &Table) -> String {
    let columns = 0..table.columns.len();
    let alignments: Vec<String> = columns.map(|column| alignment(table, column)).collect();
    let line = |cells: Vec<String>| format!("{} \\\\\n", cells.join(" & "));
    let headings = table.columns.iter().enumerate().map(|(number, column)| {
        let title = escaped(&column.title());
        // Braces keep siunitx from reading it as a number.
        if table.is_numeric(number) {
            format!("{{{title}}}")
        } else {
            title
        }
    });
    let mut text = "% \\usepackage{booktabs, siunitx}\n".to_owned();
    text += &format!("\\begin{{tabular}}{{{}}}\n\\toprule\n", alignments.join(" "));
    text += &line(headings.collect());
    text += "\\midrule\n";
    for row in &table.rows {
        let cells = row.iter().enumerate().map(|(column, cell)| match cell {
            Cell::Number(number) | Cell::Decimals(number, _)
                if table.is_numeric(column) && !number.is_some_and(f64::is_finite) =>
            {
                format!("{{{}}}", cell.rounded())
            }
            _ => escaped(&cell.rounded()),
        });
        text += &line(cells.collect());
    }
    text + "\\bottomrule\n\\end{tabular}\n"
}

/// Column type: names at the left, numbers at their decimal points, mixed columns at the right.
fn alignment(table: &Table, column: usize) -> String {
    if !table.is_numeric(column) {
        return if column == 0 { "l" } else { "r" }.to_owned();
    }
    let cells = table.rows.iter().filter_map(|row| row.get(column));
    let numbers = cells
        .map(Cell::rounded)
        .filter(|text| text.ends_with(|end: char| end.is_ascii_digit()));
    let mut widest = NumberWidth::default();
    for number in numbers {
        widest.take(&number);
    }
    format!("S[table-format={}]", widest.format())
}

/// Places that the widest number of a column takes before and after its point, and in its exponent.
#[derive(Default)]
struct NumberWidth {
    has_sign: bool,
    whole: usize,
    decimals: usize,
    exponent: usize,
    has_exponent_sign: bool,
}

impl NumberWidth {
    fn take(&mut self, number: &str) {
        let (mantissa, exponent) = number.split_once('e').unwrap_or((number, ""));
        let (whole, decimals) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        self.has_sign |= whole.starts_with('-');
        self.whole = self.whole.max(whole.trim_start_matches('-').len());
        self.decimals = self.decimals.max(decimals.len());
        self.has_exponent_sign |= exponent.starts_with('-');
        self.exponent = self.exponent.max(exponent.trim_start_matches('-').len());
    }

    /// The `table-format` of siunitx.
    fn format(&self) -> String {
        let sign = |has_sign| if has_sign { "-" } else { "" };
        let mut format = format!("{}{}.{}", sign(self.has_sign), self.whole.max(1), self.decimals);
        if self.exponent > 0 {
            format += &format!("e{}{}", sign(self.has_exponent_sign), self.exponent);
        }
        format
    }
}

/// Escapes what LaTeX would take for a command.
fn escaped(text: &str) -> String {
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
