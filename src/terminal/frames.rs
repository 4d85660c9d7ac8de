//! Frames of known presses, in the terminal.

use clap::Args;
use glam::DVec3;
use ndarray::Array2;

use super::{
    failure::Failure,
    import_arguments::ImportArguments,
    samples::{with_bar, working_folder},
};
use decoupler_core::{
    dataset::Dataset,
    evaluation::pressed_rows,
    sensor::{PressLimits, SensorModel},
};

// Readings of a real sensor with what pressed it.
#[derive(Args)]
pub(super) struct FrameArguments {
    #[command(flatten)]
    import: ImportArguments,
    /// Columns of the resistances of a row-wire in ohm, one for each column-wire
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    inputs: Vec<String>,
    /// Columns of how far each node of the row-wire is pressed down, in mm; instead of --targets, which are then the
    /// coordinates of its nodes (x, y, z of each) where the nominal sensor has them
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',', conflicts_with = "targets")]
    depths: Vec<String>,
}

impl FrameArguments {
    /// Reads the frames of presses within `limits`: a sample is a row-wire, its targets are the coordinates of its nodes as
    /// `sensor` places them.
    pub(super) fn read(&self, sensor: &SensorModel, limits: PressLimits, is_json: bool) -> Result<Dataset, Failure> {
        let has_depths = !self.depths.is_empty();
        let plan = if has_depths {
            self.import.plan_of(&self.inputs, &self.depths)?
        } else {
            self.import.plan(&self.inputs)?
        };
        let Some(column) = &plan.import.row_wire else {
            let message = "--row-wire: name the column with the number of the row-wire of each line, from 1";
            return Err(Failure::Arguments(message.to_owned()));
        };
        let recording = with_bar(is_json, |watch| plan.recording(working_folder(), watch))?;
        self.import.save_recipe(&plan)?;
        let (set, lines, scale) = (recording.set, recording.lines, sensor.scale);
        let (argument, targets) = if has_depths {
            ("--depths", scale.nodes_per_row())
        } else {
            ("--targets", scale.coordinates_per_row())
        };
        let counts = [
            ("--inputs", set.channels(), scale.columns()),
            (argument, set.outputs(), targets),
        ];
        if let Some((argument, found, expected)) = counts.into_iter().find(|(_, found, expected)| found != expected) {
            return Err(Failure::Arguments(format!(
                "{argument}: {found} columns, where a row-wire of the array {scale} needs {expected}"
            )));
        }
        let row_wires: Option<Vec<usize>> = (0..set.samples()).map(|sample| set.row_wire(sample)).collect();
        let row_wires = row_wires.unwrap_or_default();
        if let Some(row) = row_wires.iter().find(|row| **row >= scale.rows()) {
            return Err(Failure::Arguments(format!(
                "--row-wire: '{column}' has row {}, and the array {scale} has {}",
                row + 1,
                scale.rows()
            )));
        }
        let frames = if has_depths {
            coordinates_of_depths(set, &row_wires, sensor)
        } else {
            set
        };
        let checked = limits.check(sensor, &pressed_rows(&frames, sensor)?);
        checked.map_err(|source| match source.sample() {
            Some(sample) => Failure::Press {
                path: plan.import.data.clone(),
                line: lines[sample],
                source,
            },
            None => source.into(),
        })?;
        Ok(frames)
    }
}

/// Returns `set`, whose targets are how far each node is pressed, with the coordinates of the nodes instead.
fn coordinates_of_depths(set: Dataset, row_wires: &[usize], sensor: &SensorModel) -> Dataset {
    let outputs = sensor.scale.coordinates_per_row();
    let coordinates = Array2::from_shape_fn((set.samples(), outputs), |(sample, output)| {
        let (node, axis) = (output / 3, output % 3);
        let pressed = DVec3::new(0.0, 0.0, set.targets()[[sample, node]]);
        sensor.displaced_mm(row_wires[sample], node, pressed)[axis]
    });
    let (readings, groups) = (set.readings().to_owned(), set.groups().to_vec());
    Dataset::new(readings, coordinates, Some(row_wires), groups).expect("the parts are those of a set")
}
