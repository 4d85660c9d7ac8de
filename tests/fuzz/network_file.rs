use std::{fs, path::Path};

use decoupler_core::network::DecouplingNetwork;
use decoupler_files::export::NetworkFile;
use rand::RngExt;

use crate::{
    corpus::replay,
    mutation::{accepted, for_each_seed, mutated},
    sealing::{mutated_and_sealed, resealed},
    trained::trained,
};

fn loaded(path: &Path, bytes: &[u8]) -> Option<NetworkFile> {
    fs::write(path, bytes).unwrap();
    match NetworkFile::load(path) {
        Ok(file) => Some(file),
        Err(error) => {
            let message = error.to_string();
            assert!(message.len() < 2000 && !message.contains('\n'), "{message}");
            None
        }
    }
}

/// Files damaged by a failing disk.
#[test]
fn no_damage_changes_a_number() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.json");
    for run in trained() {
        let file = NetworkFile::from_run(&run, None).unwrap();
        file.save(&path).unwrap();
        let valid = fs::read(&path).unwrap();
        for_each_seed(400, |rng| {
            let damaged = mutated(&valid, rng);
            if let Some(mut read) = loaded(&path, &damaged) {
                read.program.clone_from(&file.program);
                assert_eq!(read, file, "{}", String::from_utf8_lossy(&damaged));
            }
        });
    }
}

/// Crafted files, or files damaged before there were checksums.
#[test]
fn accepted_files_give_finite_answers_or_are_flagged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.json");
    let mut count = 0;
    for run in trained() {
        NetworkFile::from_run(&run, None).unwrap().save(&path).unwrap();
        let valid = fs::read(&path).unwrap();
        count += accepted(300, |rng| {
            let damaged = mutated_and_sealed(&valid, rng);
            damaged.is_some_and(|damaged| check(&path, &damaged, rng))
        });
    }
    assert!(count > 20, "only {count} files reach the network");
}

/// Returns true if the file is accepted; then its answers are checked, and it must be unchanged after saving and
/// loading.
fn check(path: &Path, bytes: &[u8], rng: &mut impl RngExt) -> bool {
    let Some(file) = loaded(path, bytes) else { return false };
    let Some(simulation) = file.settings.simulation() else {
        return true;
    };
    let height_mm = simulation.sensor.geometry.height_mm;
    for network in file.network.values() {
        let readings: Vec<f64> = (0..network.inputs().channels())
            .map(|_| 10_f64.powf(rng.random_range(-3.0..4.0)))
            .collect();
        check_answer(network, &readings, height_mm);
    }
    file.save(path).unwrap();
    let again = NetworkFile::load(path).unwrap();
    assert_eq!((again.settings, again.network), (file.settings, file.network));
    true
}

#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.json");
    replay!(0, |bytes: &[u8]| {
        accepted(1, |rng| {
            let is_accepted = check(&path, bytes, rng);
            resealed(bytes).is_some_and(|sealed| check(&path, &sealed, rng)) || is_accepted
        })
    });
}

/// Checks that an answer is flagged, refused as not finite, or within a stroke of the possible positions of nodes.
fn check_answer(network: &DecouplingNetwork, readings_ohm: &[f64], height_mm: f64) {
    let readings = ndarray::ArrayView2::from_shape((1, readings_ohm.len()), readings_ohm).unwrap();
    let answer = network.decouple(readings);
    let answer = answer.as_slice().unwrap();
    let is_flagged = network.outputs().far_outside(answer).next().is_some();
    let is_refused = answer.iter().any(|coordinate| !coordinate.is_finite());
    let is_near = || {
        answer
            .iter()
            .skip(2)
            .step_by(3)
            .all(|z_mm| z_mm.abs() <= 5.0 * height_mm)
    };
    assert!(is_flagged || is_refused || is_near(), "{answer:?}");
}
