use std::{fs, ops::ControlFlow, path::Path};

use decoupler_core::dataset::Seed;
use decoupler_files::{export::RecipeFile, machine::limit_memory};

use crate::{
    corpus::replay,
    mutation::{accepted, mutated_document},
};

/// Recordings to which the recipes of the corpus refer.
const RECORDINGS: [(&str, &str); 4] = [
    (
        "press.csv",
        "t (s),a (V),b (V),row,trial,force (N)\n\
         0,1.5,2.5,1,x,0\n0.1,1.6,2.4,1,x,0.5\n0.2,1.7,2.2,2,x,1\n0.3,1.9,-1,2,y,1.5\n0.4,2.1,1.9,1,y,1.25\n0.5,2,2,1,y,0.75\n",
    ),
    ("states.csv", "t (s),z,w\n0,0,1\n0.05,1,1\n0.2,2,0\n0.41,4,1\n"),
    (
        "second.csv",
        "t (s),a (V),b (V),row,trial,force (N)\n5,1,2,1,z,1\n5.1,1.1,2,1,z,2\n5.2,1.3,2.1,2,z,2\n",
    ),
    ("positions.csv", "target,x,y\nforce,0,0\nstates.z,1,0\n"),
];

fn folder_with_recordings() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in RECORDINGS {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

/// Returns true if the recipe is accepted and gives samples. It is unchanged after saving and loading, and its samples are
/// finite.
fn check(path: &Path, bytes: &[u8]) -> bool {
    limit_memory(0.25);
    fs::write(path, bytes).unwrap();
    let source = match RecipeFile::load(path) {
        Ok(source) => source,
        Err(error) => {
            let message = error.to_string();
            assert!(message.len() < 2000 && !message.contains('\n'), "{message}");
            return false;
        }
    };
    let text = || String::from_utf8_lossy(bytes);
    source.save(path).unwrap();
    let again = RecipeFile::load(path).unwrap();
    let RecipeFile::Recording(plan) = source else {
        assert_eq!(again, source, "{}", text());
        return true;
    };
    // The files of the recipe are named from another folder, but are the same.
    let RecipeFile::Recording(again) = again else {
        panic!("{}", text())
    };
    assert_eq!(again.absolute(), plan.absolute(), "{}", text());
    // Devices and other files of this machine are no recordings of a corpus.
    let folder = path.parent().unwrap();
    let is_ours = |file: std::path::PathBuf| {
        file.parent() == Some(folder) && RECORDINGS.iter().any(|(name, _)| file.ends_with(name))
    };
    if !plan.files().into_iter().all(is_ours) {
        return false;
    }
    let recordings = plan.recordings(Path::new(""), &mut |_| ControlFlow::Continue(()));
    let divided = recordings.and_then(|(recording, test)| {
        let (split, test) = plan.divide(&recording, test.as_ref(), Seed(1))?;
        Ok((recording, split, test))
    });
    match divided {
        Ok((recording, split, test)) => {
            for set in [&recording.set, &test, &split.training] {
                let is_finite = |number: &f64| number.is_finite();
                assert!(set.readings().iter().all(is_finite), "{}", text());
                assert!(set.targets().iter().all(is_finite), "{}", text());
            }
            let dropped: usize = recording.dropped.iter().map(|dropped| dropped.rows).sum();
            assert_eq!(recording.set.samples() + dropped, recording.rows, "{}", text());
            true
        }
        Err(error) => {
            let message = error.to_string();
            assert!(message.len() < 3000 && !message.contains('\n'), "{message}");
            false
        }
    }
}

#[test]
fn any_input() {
    let folder = folder_with_recordings();
    let path = folder.path().join("recipe.json");
    replay!(50, |bytes: &[u8]| {
        usize::from(check(&path, bytes)) + accepted(60, |rng| check(&path, &mutated_document(bytes, rng)))
    });
}
