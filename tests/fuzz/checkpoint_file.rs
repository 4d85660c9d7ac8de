use std::fs;

use decoupler_core::job::Job;
use decoupler_files::export::CheckpointFile;

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
    sealing::{mutated_and_sealed, resealed},
    trained::trained,
};

#[test]
fn damage_is_detected_and_impossible_states_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    for run in trained() {
        let file = CheckpointFile::from_run(&run, None).unwrap();
        file.save(&path).unwrap();
        let valid = fs::read(&path).unwrap();
        for_each_seed(200, |rng| {
            let damaged = mutated(&valid, rng);
            fs::write(&path, &damaged).unwrap();
            if let Ok(mut read) = CheckpointFile::load(&path) {
                read.program.clone_from(&file.program);
                assert_eq!(read, file, "{}", String::from_utf8_lossy(&damaged));
            }
            let Some(sealed) = mutated_and_sealed(&valid, rng) else {
                return;
            };
            fs::write(&path, sealed).unwrap();
            // Other settings may ask for other samples, as many as a million.
            if let Ok(read) = CheckpointFile::load(&path)
                && read.settings.source == file.settings.source
                && let Ok((mut resumed, _)) = read.resume(&Job::UNINTERRUPTED, &mut |_| ())
            {
                resumed.step();
                assert!(resumed.scores().is_some());
            }
        });
    }
}

#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    let small = trained().map(|run| run.settings().source);
    replay!(0, |bytes: &[u8]| {
        for bytes in [Some(bytes.to_vec()), resealed(bytes)].into_iter().flatten() {
            fs::write(&path, bytes).unwrap();
            match CheckpointFile::load(&path) {
                // Others may ask for a million samples.
                Ok(file) if small.contains(&file.settings.source) => {
                    if let Ok((mut resumed, _)) = file.resume(&Job::UNINTERRUPTED, &mut |_| ()) {
                        resumed.step();
                        assert!(resumed.scores().is_some());
                    }
                }
                Ok(_) => {}
                Err(error) => {
                    let message = error.to_string();
                    assert!(message.len() < 2000 && !message.contains('\n'), "{message}");
                }
            }
        }
        0
    });
}
