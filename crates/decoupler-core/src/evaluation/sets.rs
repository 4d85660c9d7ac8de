use super::{RunError, RunSettings, Source};
use crate::{
    dataset::{Dataset, Split},
    network::Networks,
    scene::RowModel,
};

/// Checks that the sets of a run belong together and meet its settings.
pub(super) fn check_sets(settings: &RunSettings, split: &Split, test: &Dataset) -> Result<(), RunError> {
    let training = &split.training;
    if matches!(settings.source, Source::Simulated(_)) && training.row_wires_read().is_none() {
        return Err(RunError::NoRowWires);
    }
    let sets = [("validation", split.validation.as_ref()), ("test", Some(test))];
    let sets = sets.into_iter().filter_map(|(name, set)| Some((name, set?)));
    for (name, set) in sets.clone() {
        let sizes = [
            ("channels", set.channels(), training.channels()),
            ("targets", set.outputs(), training.outputs()),
        ];
        let mut differences = sizes
            .into_iter()
            .filter(|(_, found, expected)| found != expected)
            .map(|(what, found, expected)| (format!("{found} {what}"), expected.to_string()));
        let rows = || (describe_rows(set), describe_rows(training));
        let rows_differ = set.row_wires_read() != training.row_wires_read();
        if let Some((found, expected)) = differences.next().or_else(|| rows_differ.then(rows)) {
            return Err(RunError::Sets {
                set: name,
                found,
                expected,
            });
        }
    }
    if settings.source.row_model() == RowModel::Each {
        // A test set may lack a row, but not the sets that fit a network and select its weights.
        for (name, set) in [("training", training)].into_iter().chain(sets) {
            let mut has_samples = vec![name == "test"; set.row_count()];
            (0..set.samples()).for_each(|sample| has_samples[set.row_index(sample)] = true);
            if let Some(row_index) = has_samples.iter().position(|has_samples| !has_samples) {
                let row_wire = set.row_wires_read().map_or(0, |read| read[row_index]);
                return Err(RunError::RowWithoutSamples { row_wire, set: name });
            }
        }
    }
    Ok(())
}

/// Checks that the sets of a split are such as `networks` decode.
pub(super) fn check_networks(networks: &Networks, split: &Split) -> Result<(), RunError> {
    let network = networks.at(0);
    let sets = [
        ("training", Some(&split.training)),
        ("validation", split.validation.as_ref()),
    ];
    for (set, samples) in sets.into_iter().filter_map(|(name, set)| Some((name, set?))) {
        let count = networks.values().len();
        let sizes = [
            ("channels", samples.channels(), network.inputs().channels()),
            ("targets", samples.outputs(), network.outputs().channels()),
            ("row-wires", if count == 1 { 1 } else { samples.row_count() }, count),
        ];
        if let Some((what, found, expected)) = sizes.into_iter().find(|(_, found, expected)| found != expected) {
            return Err(RunError::Networks {
                set,
                found: format!("{found} {what}"),
                expected,
            });
        }
        let row_without = (0..count).find(|&row| count > 1 && samples.of_row(row).samples() == 0);
        if let Some(row) = row_without {
            let row_wire = samples.row_wires_read().map_or(0, |read| read[row]);
            return Err(RunError::RowWithoutSamples { row_wire, set });
        }
    }
    Ok(())
}

/// Lists the row-wires of a set, counted from 1.
fn describe_rows(set: &Dataset) -> String {
    match set.row_wires_read() {
        None => "no row-wires".to_owned(),
        Some(read) => {
            let numbers: Vec<String> = read.iter().map(|row_wire| (row_wire + 1).to_string()).collect();
            format!("the row-wires {}", numbers.join(", "))
        }
    }
}
