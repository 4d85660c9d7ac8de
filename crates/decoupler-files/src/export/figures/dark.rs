//! Figures inside an HTML page that follows the reader's dark theme.

use super::{
    canvas::number,
    colours::{DIM, GRID, INK, MISSING, Rgb, rgb},
    picture::Picture,
    plot_figure::PAGE_WIDTH,
};
use crate::figure::Hue;

/// Colours of print, and those that take their place on a dark ground.
fn pairs() -> [(Rgb, Rgb); 11] {
    [
        ([0xff; 3], [0x1b, 0x1e, 0x24]),
        (INK, [0xe7, 0xea, 0xf0]),
        (DIM, [0x98, 0xa2, 0xb3]),
        (GRID, [0x2c, 0x32, 0x3c]),
        (MISSING, [0x24, 0x29, 0x32]),
        (rgb(Hue::Blue), [0x5b, 0x9d, 0xff]),
        (rgb(Hue::Red), [0xf0, 0x6a, 0x6a]),
        (rgb(Hue::Green), [0x4c, 0xc3, 0x8a]),
        (rgb(Hue::Orange), [0xf0, 0xa8, 0x3c]),
        (rgb(Hue::Violet), [0xb5, 0x8a, 0xe6]),
        (rgb(Hue::Cyan), [0x4f, 0xc3, 0xd9]),
    ]
}

/// Style rules that show figures inside a page on a dark ground where the reader prefers that.
pub(crate) fn dark_style() -> String {
    let hex = |[red, green, blue]: Rgb| format!("#{red:02x}{green:02x}{blue:02x}");
    let rules = pairs().map(|(print, dark)| {
        let (print, dark) = (hex(print), hex(dark));
        // White dots mark nodes on any ground.
        let of_circles = if print == "#ffffff" { ":not(circle)" } else { "" };
        format!(
            "  svg [fill=\"{print}\"]{of_circles} {{ fill: {dark}; }}\n  svg [stroke=\"{print}\"] {{ stroke: {dark}; }}\n"
        )
    });
    format!(
        "@media screen and (prefers-color-scheme: dark) {{\n{}}}\n",
        rules.concat()
    )
}

impl Picture {
    /// The figure as part of an HTML page, as wide in proportion as on a printed one: without outside references, and with
    /// names that no figure in another `place` has. `label` is read aloud in its place.
    pub(crate) fn inline_svg(&self, place: usize, label: &str) -> String {
        let label = super::canvas::escaped(label).replace('"', "&quot;");
        let [width, height] = self.size();
        let share = number(100.0 * width / PAGE_WIDTH);
        let [width, height] = [width, height].map(number);
        let own = format!("xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}pt\" height=\"{height}pt\"");
        let here = format!("role=\"img\" aria-label=\"{label}\" width=\"{share}%\"");
        self.svg()
            .replacen(&own, &here, 1)
            .replace("id=\"c", &format!("id=\"f{place}c"))
            .replace("url(#c", &format!("url(#f{place}c"))
    }
}
