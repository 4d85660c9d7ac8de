use decoupler_core::{problem::Channel, text::is_unprintable};

/// Meaning of the readings and outputs of an exported network, and the words for them in its files.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Meaning {
    /// `true` for resistances of a row-wire of an array in ohm, and the coordinates of its nodes in mm; `false` for columns of
    /// own data, in the user's units.
    pub(super) is_array: bool,
    /// Names and units of the readings: r_1, r_2, … in ohm, or those of the columns.
    pub(super) inputs: Vec<Channel>,
    /// Names and units of the outputs: x_1, y_1, z_1, x_2, … in mm, or those of the columns.
    pub(super) targets: Vec<Channel>,
    /// Row-wires of own data that have a network each, from 0, in their order; empty if one network serves all.
    pub(super) row_wires: Vec<usize>,
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

    /// Name of the range to which deviations are relative.
    pub(super) fn scale(&self) -> &'static str {
        self.either(
            "the widest range of a coordinate in training",
            "the range of the target in training",
        )
    }

    /// A way to train a network with smaller weights, which amplifies less.
    pub(super) fn smaller_weights(&self) -> &'static str {
        self.either("train with noise", "train with fewer hidden nodes or epochs")
    }

    /// A sentence on what the decoder does, without its full stop.
    pub(super) fn purpose(&self) -> &'static str {
        self.either(
            "Decodes the readings of one row-wire of a tactile array in ohm into the coordinates of its nodes in mm",
            "Decodes readings into targets",
        )
    }

    pub(super) fn either(&self, array: &'static str, own: &'static str) -> &'static str {
        if self.is_array { array } else { own }
    }

    /// Returns values of the outputs with their names and units: the largest over all coordinates, or one per target.
    pub(super) fn named(&self, figures: &[f64]) -> Vec<(Channel, f64)> {
        if self.is_array {
            let largest = figures.iter().copied().fold(0.0, f64::max);
            return vec![(Channel::new("any coordinate", Some("mm")), largest)];
        }
        self.targets.iter().cloned().zip(figures.iter().copied()).collect()
    }

    /// Sentences with the names and units of the channels, in lines of at most 100 characters that fit into a comment of any
    /// language.
    pub(super) fn legend(&self) -> Vec<String> {
        let Self { inputs, targets, .. } = self;
        if self.is_array {
            let (last, channels) = (targets.last().map_or("", |target| &target.name), inputs.len());
            return wrapped(&format!(
                "Readings are r_1 to r_{channels}; coordinates are x_1, y_1, z_1, x_2, ... {last}."
            ));
        }
        let list = |what: &str, channels: &[Channel]| {
            let titles: Vec<String> = channels.iter().map(|channel| comment(&channel.title())).collect();
            format!("{what}, in this order: {}.", titles.join(", "))
        };
        let mut sentences = vec![list("Readings", inputs), list("Targets", targets)];
        // The usual numbering is not mentioned.
        let rows = || self.row_wires.iter().enumerate();
        if rows().any(|(index, &row_wire)| index != row_wire) {
            let is_row_wire = |(index, row_wire)| format!("{} is row-wire {}", index + 1, row_wire + 1);
            sentences.push(format!("Rows: {}.", Vec::from_iter(rows().map(is_row_wire)).join(", ")));
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
        let meaning = Meaning {
            is_array: false,
            inputs: odd.iter().map(channel).collect(),
            targets: vec![channel(&"x")],
            row_wires: vec![0, 4],
        };
        let text = meaning.legend().join("\n");
        for forbidden in ["*/", "/*", "??", "\u{202e}", "\u{7}"] {
            assert!(!text.contains(forbidden), "{forbidden}: {text}");
        }
        assert!(
            text.contains("µT") && text.contains("Rows: 1 is row-wire 1, 2 is row-wire 5."),
            "{text}"
        );
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    }
}
