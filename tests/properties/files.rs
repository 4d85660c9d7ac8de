//! Samples written to a file and read back.

use decoupler::{
    dataset::{Dataset, ResistanceReader},
    export::{write_samples, write_samples_header},
};
use ndarray::Array2;
use proptest::prelude::*;

use crate::cases;

/// Readings of every magnitude, row-wires and snapshots of an array of three row-wires, two nodes and six columns.
fn sets() -> impl Strategy<Value = Dataset> {
    let sample = (prop::collection::vec(-30.0..30.0_f64, 6), 0..3_usize, 0..5_usize);
    prop::collection::vec(sample, 1..20).prop_map(|samples| {
        let readings = |(sample, column): (usize, usize)| 10_f64.powf(samples[sample].0[column]);
        let row_wires: Vec<usize> = samples.iter().map(|sample| sample.1).collect();
        let groups = samples.iter().map(|sample| sample.2).collect();
        let targets = Array2::zeros((samples.len(), 6));
        Dataset::new(
            Array2::from_shape_fn((samples.len(), 6), readings),
            targets,
            Some(&row_wires),
            groups,
        )
        .unwrap()
    })
}

proptest! {
    #![proptest_config(cases(64))]

    #[test]
    fn samples_are_read_as_they_were_written(set in sets(), most in 1..25_usize) {
        let mut file = Vec::new();
        write_samples_header("3x2_2x6".parse().unwrap(), false, &mut file).unwrap();
        write_samples(&set, None, 1, &mut file).unwrap();
        let mut reader = ResistanceReader::new(file.as_slice(), 6).unwrap().with_row_wires(3);
        let mut sample = 0;
        while let Some(reading) = reader.read(most).unwrap() {
            for (index, resistances_ohm) in reading.resistances_ohm.outer_iter().enumerate() {
                prop_assert_eq!(resistances_ohm.to_vec(), set.sample_readings(sample));
                let row_wires = reading.row_wires.as_ref().unwrap();
                prop_assert_eq!(Some(row_wires[index]), set.row_wire(sample));
                sample += 1;
            }
        }
        prop_assert_eq!(sample, set.samples());
    }
}
