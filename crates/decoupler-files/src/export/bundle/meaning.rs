use decoupler_core::{problem::Channel, sensor::ArrayScale, text::is_unprintable};

use crate::export::format_number;

/// Meaning of the readings and outputs of an exported network, and the words for them in its files.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Meaning {
    /// Resistances of a row-wire of an array in ohm, and the coordinates of its nodes in mm.
    Array(ArrayScale),
    /// Columns of own data, in the user's units.
    Own {
        inputs: Vec<Channel>,
        targets: Vec<Channel>,
        /// The inputs are features of a memory, not readings.
        has_memory: bool,
        /// Row-wires that have a network each, from 0, in their order; empty if one network serves all.
        row_wires: Vec<usize>,
        /// Half-width of the 90 % prediction interval of each target that has one; empty if none has.
        half_widths: Vec<Option<f64>>,
    },
}

impl Meaning {
    /// Identifier of the readings in code and graphs.
    pub(super) fn readings(&self) -> &'static str {
        match self {
            Self::Own { has_memory: true, .. } => "features",
            _ => self.either("resistances_ohm", "readings"),
        }
    }

    /// Identifier of the outputs.
    pub(super) fn outputs(&self) -> &'static str {
        self.either("coordinates_mm", "targets")
    }

    /// Word for one output.
    pub(super) fn output(&self) -> &'static str {
        self.either("coordinate", "target")
    }

    /// The unit of decoding.
    pub(super) fn sample(&self) -> &'static str {
        self.either("one row-wire", "one sample")
    }

    /// Identifier of the centres of the channels.
    pub(super) fn centre(&self) -> &'static str {
        self.either("centre_ohm", "centre")
    }

    /// Identifiers of the limits beyond which a reading is outside.
    pub(super) fn limits(&self) -> [&'static str; 2] {
        [
            self.either("lowest_ohm", "lowest"),
            self.either("highest_ohm", "highest"),
        ]
    }

    /// Name of the range to which deviations are relative.
    pub(super) fn scale(&self) -> &'static str {
        self.either(
            "the widest range of a coordinate in training",
            "the range of the target in training",
        )
    }

    /// A way to train a network with smaller weights, which amplifies less.
    pub(super) fn smaller_weights(&self) -> &'static str {
        self.either("train with noise (--noise)", "train with fewer hidden nodes or epochs")
    }

    fn either(&self, array: &'static str, own: &'static str) -> &'static str {
        match self {
            Self::Array(_) => array,
            Self::Own { .. } => own,
        }
    }

    /// Names and units of the readings: r_1, r_2, … in ohm, or those of the columns.
    pub(super) fn inputs(&self) -> Vec<Channel> {
        match self {
            Self::Array(scale) => (1..=scale.columns())
                .map(|channel| Channel::new(format!("r_{channel}"), Some("ohm")))
                .collect(),
            Self::Own { inputs, .. } => inputs.clone(),
        }
    }

    /// Names and units of the outputs: x_1, y_1, z_1, x_2, … in mm, or those of the columns.
    pub(super) fn targets(&self) -> Vec<Channel> {
        match self {
            Self::Array(scale) => (0..scale.coordinates_per_row())
                .map(|output| {
                    Channel::new(
                        format!("{}_{}", ["x", "y", "z"][output % 3], output / 3 + 1),
                        Some("mm"),
                    )
                })
                .collect(),
            Self::Own { targets, .. } => targets.clone(),
        }
    }

    /// Returns values of the outputs with their names and units: the largest over all coordinates, or one per target.
    pub(super) fn named(&self, figures: &[f64]) -> Vec<(Channel, f64)> {
        match self {
            Self::Array(_) => {
                let largest = figures.iter().fold(0.0_f64, |largest, &figure| largest.max(figure));
                vec![(Channel::new("any coordinate", Some("mm")), largest)]
            }
            Self::Own { targets, .. } => targets.iter().cloned().zip(figures.iter().copied()).collect(),
        }
    }

    /// Half-widths of the 90 % prediction intervals, if every target has one.
    pub(super) fn half_widths(&self) -> Option<Vec<f64>> {
        match self {
            Self::Own { half_widths, .. } if !half_widths.is_empty() => half_widths.iter().copied().collect(),
            _ => None,
        }
    }

    /// Sentences with the names and units of own data, in lines of at most 100 characters that fit into a comment of
    /// any language; none for an array.
    pub(super) fn legend(&self) -> Vec<String> {
        let Self::Own {
            inputs,
            targets,
            has_memory,
            row_wires,
            half_widths,
        } = self
        else {
            return Vec::new();
        };
        let list = |what: &str, channels: &[Channel]| {
            let titles: Vec<String> = channels.iter().map(|channel| comment(&channel.title())).collect();
            format!("{what}, in this order: {}.", titles.join(", "))
        };
        let mut sentences = vec![
            list(if *has_memory { "Features" } else { "Readings" }, inputs),
            list("Targets", targets),
        ];
        // The usual numbering is not mentioned.
        if row_wires.iter().enumerate().any(|(index, &row_wire)| index != row_wire) {
            let rows = row_wires.iter().enumerate();
            let rows: Vec<String> = rows
                .map(|(index, row_wire)| format!("{} is row-wire {}", index + 1, row_wire + 1))
                .collect();
            sentences.push(format!("Rows: {}.", rows.join(", ")));
        }
        let half_widths = targets.iter().zip(half_widths);
        let half_widths: Vec<String> = half_widths
            .filter_map(|(target, half_width)| {
                let half_width = format_number((*half_width)?);
                Some(format!("{} +/- {half_width}", comment(&target.title())))
            })
            .collect();
        if !half_widths.is_empty() {
            sentences.push(format!(
                "90 % prediction intervals, valid for all answers together: {}.",
                half_widths.join(", ")
            ));
        }
        sentences.iter().flat_map(|sentence| wrapped(sentence)).collect()
    }
}

/// Replaces everything in a user's text that would end a comment or cause a compiler warning in one.
pub(super) fn comment(text: &str) -> String {
    let plain = text.replace(is_unprintable, " ");
    plain
        .replace("*/", "* /")
        .replace("/*", "/ *")
        .replace("??", "? ?")
        .replace("??", "? ?")
}

/// Breaks the words into lines of at most 100 characters.
pub(super) fn wrapped(text: &str) -> Vec<String> {
    const WIDTH: usize = 100;
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ').filter(|word| !word.is_empty()) {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= WIDTH => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn user_defined_names_do_not_end_comments() {
        let odd = ["a */ b", "/* c", "d\n*/", "e\u{202e}f", "??/", "**/", "*\n/", "/\u{7}*"];
        let channel = |name: &&str| Channel::new(*name, Some("µT*/"));
        let meaning = Meaning::Own {
            inputs: odd.iter().map(channel).collect(),
            targets: vec![channel(&"x")],
            has_memory: false,
            row_wires: vec![0, 4],
            half_widths: vec![Some(1.5)],
        };
        let text = meaning.legend().join("\n");
        for forbidden in ["*/", "/*", "??", "\u{202e}", "\u{7}"] {
            assert!(!text.contains(forbidden), "{forbidden}: {text}");
        }
        assert!(
            text.contains("µT") && text.contains("Rows: 1 is row-wire 1, 2 is row-wire 5."),
            "{text}"
        );
        assert!(text.ends_with("+/- 1.50."), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    }

    #[test]
    fn an_array_has_the_names_of_the_paper() {
        let meaning = Meaning::Array("3x2_2x6".parse().unwrap());
        let titles = |channels: Vec<Channel>| channels.iter().map(Channel::title).collect::<Vec<_>>();
        assert_eq!(titles(meaning.inputs())[5], "r_6 (ohm)");
        assert_eq!(titles(meaning.targets())[4], "y_2 (mm)");
        assert_eq!(meaning.legend(), [""; 0]);
    }
}
