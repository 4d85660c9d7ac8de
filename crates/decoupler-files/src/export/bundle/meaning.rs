use decoupler_core::{
    problem::Channel,
    sensor::ArrayScale,
    text::{counted, is_unprintable},
};

/// Meaning of the readings and outputs of an exported network, and the words for them in its files.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Meaning {
    /// Resistances of a row-wire of an array in ohm, and the coordinates of its nodes in mm.
    Array(ArrayScale),
    /// Columns of own data, in the user's units.
    Own {
        inputs: Vec<Channel>,
        targets: Vec<Channel>,
        /// Row-wires that have a network each, from 0, in their order; empty if one network serves all.
        row_wires: Vec<usize>,
    },
}

impl Meaning {
    /// Identifier of the readings in code and graphs.
    pub(super) fn readings(&self) -> &'static str {
        self.either("resistances_ohm", "readings")
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

    /// `true` for an array.
    pub(super) fn is_array(&self) -> bool {
        matches!(self, Self::Array(_))
    }

    /// A sentence on what the decoder does.
    pub(super) fn purpose(&self) -> &'static str {
        self.either(
            "Decodes the readings of one row-wire of a tactile array in ohm into the coordinates of its nodes in mm.",
            "Decodes readings into targets.",
        )
    }

    /// [`Self::purpose`] without its full stop.
    pub(super) fn purpose_without_stop(&self) -> &'static str {
        self.purpose().trim_end_matches('.')
    }

    /// The outputs with their number.
    pub(super) fn outputs_in_words(&self, count: usize) -> String {
        counted(count, self.output())
    }

    pub(super) fn either(&self, array: &'static str, own: &'static str) -> &'static str {
        match self {
            Self::Array(_) => array,
            Self::Own { .. } => own,
        }
    }

    /// Names and units of the readings: r_1, r_2, … in ohm, or those of the columns.
    pub(super) fn inputs(&self, count: usize) -> Vec<Channel> {
        match self {
            Self::Array(_) => (1..=count)
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

    /// Sentences with the names and units of the channels, in lines of at most 100 characters that fit into a comment of any
    /// language.
    pub(super) fn legend(&self, channels: usize) -> Vec<String> {
        let Self::Own {
            inputs,
            targets,
            row_wires,
        } = self
        else {
            let last = self
                .targets()
                .last()
                .map_or(String::new(), |target| target.name.clone());
            return wrapped(&format!(
                "Readings are r_1 to r_{channels}; coordinates are x_1, y_1, z_1, x_2, ... {last}."
            ));
        };
        let list = |what: &str, channels: &[Channel]| {
            let titles: Vec<String> = channels.iter().map(|channel| comment(&channel.title())).collect();
            format!("{what}, in this order: {}.", titles.join(", "))
        };
        let mut sentences = vec![list("Readings", inputs), list("Targets", targets)];
        // The usual numbering is not mentioned.
        if row_wires.iter().enumerate().any(|(index, &row_wire)| index != row_wire) {
            let rows = row_wires.iter().enumerate();
            let rows: Vec<String> = rows
                .map(|(index, row_wire)| format!("{} is row-wire {}", index + 1, row_wire + 1))
                .collect();
            sentences.push(format!("Rows: {}.", rows.join(", ")));
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
            row_wires: vec![0, 4],
        };
        let text = meaning.legend(8).join("\n");
        for forbidden in ["*/", "/*", "??", "\u{202e}", "\u{7}"] {
            assert!(!text.contains(forbidden), "{forbidden}: {text}");
        }
        assert!(
            text.contains("µT") && text.contains("Rows: 1 is row-wire 1, 2 is row-wire 5."),
            "{text}"
        );
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    }

    #[test]
    fn an_array_has_the_names_of_the_paper() {
        let meaning = Meaning::Array("3x2_2x6".parse().unwrap());
        let titles = |channels: Vec<Channel>| channels.iter().map(Channel::title).collect::<Vec<_>>();
        assert_eq!(titles(meaning.inputs(6))[5], "r_6 (ohm)");
        assert_eq!(titles(meaning.targets())[4], "y_2 (mm)");
    }
}
