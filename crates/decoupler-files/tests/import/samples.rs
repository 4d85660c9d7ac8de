//! The files in `assets/samples` have the contents described in their documentation.

use std::path::PathBuf;

use decoupler_core::{dataset::Seed, decoupling::Decoder, glam::DVec3, job::Job};
use decoupler_files::{
    export::NetworkFile,
    live::{Recording, Simulated, Tally},
};

fn sample(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../assets/samples")
        .join(name)
}

/// The network finds the ball that made the recording.
#[test]
fn the_network_decodes_the_recording() {
    let file = NetworkFile::load(&sample("network.json")).unwrap();
    let source = *file.settings.simulation().unwrap();
    let (sensor, scale) = (source.sensor, source.sensor.scale);
    let rows = Vec::from_iter(0..scale.rows());
    let recording = Recording::read(
        &sample("recording.csv"),
        &file,
        &mut Tally::default(),
        &Job::UNINTERRUPTED,
    )
    .unwrap();
    let mut decoder = file.network.decoder();
    let mut truth = Simulated::new(&sensor, &source.scene, Seed(0), 15.0).unwrap();
    let mut frame_ohm = vec![0.0; truth.readings()];
    let mut coordinates_mm = vec![0.0; rows.len() * decoder.outputs()];
    let (mut errors_mm, mut depths_mm, mut count) = (0.0, 0.0, 0.0);
    for (index, time_s) in recording.times_s().iter().enumerate() {
        assert!((truth.next_frame(&mut frame_ohm).unwrap() - time_s).abs() < 1e-5);
        decoder.decode(recording.frame(index), &mut coordinates_mm).unwrap();
        for (row, coordinates_mm) in rows.iter().zip(coordinates_mm.chunks_exact(decoder.outputs())) {
            for (node, depth) in truth.deformation().row_mm(*row).iter().enumerate() {
                let height_mm = sensor.geometry.height_mm - depth.z;
                errors_mm += (coordinates_mm[3 * node + 2] - height_mm).abs();
                depths_mm += depth.z;
                count += 1.0;
            }
        }
    }
    assert!(recording.times_s().len() == 60 && depths_mm / count > 0.03);
    assert!(
        errors_mm < 0.15 * depths_mm,
        "{} of {} mm",
        errors_mm / count,
        depths_mm / count
    );
}

/// Eq. (2) gives the readings of every line for the depths in the same line.
#[test]
fn the_table_contains_the_readings_of_its_deformation() {
    let file = NetworkFile::load(&sample("network.json")).unwrap();
    let sensor = file.settings.simulation().unwrap().sensor;
    let mut table = csv::Reader::from_path(sample("simulated_row.csv")).unwrap();
    let columns = sensor.scale.columns();
    assert_eq!(table.headers().unwrap().len(), 1 + columns + 6);
    let mut deepest_mm: f64 = 0.0;
    for line in table.records() {
        let line: Vec<f64> = line.unwrap().iter().map(|field| field.parse().unwrap()).collect();
        let depths: Vec<DVec3> = line[1 + columns..].iter().map(|depth| DVec3::Z * *depth).collect();
        let expected_ohm = sensor.row_resistances(2, &depths).unwrap();
        for (found, expected) in line[1..].iter().zip(&expected_ohm) {
            // Five standard deviations of the noise, and the rounding of the depths.
            assert!((found / expected - 1.0).abs() < 1.5e-4, "{found} {expected}");
        }
        deepest_mm = depths.iter().fold(deepest_mm, |deepest, depth| deepest.max(depth.z));
    }
    assert!(deepest_mm > 0.5, "{deepest_mm} mm");
}
