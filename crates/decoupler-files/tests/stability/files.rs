//! Files: damaged networks and checkpoints, valid and invalid tables of readings.

use std::{fmt::Display, fs, path::Path};

use decoupler_core::{
    evaluation::{Run, RunSettings},
    scene::Rows,
    sensor::SensorModel,
};
use decoupler_files::{
    export::{CheckpointFile, NetworkFile},
    import::{LineParser, ReadingsFile},
};

use crate::{
    judge::{Job, Verdict, refused, wrong},
    situations,
};

const ROOM: &str = "file";
/// Number of places at which a file is damaged.
const PLACES: usize = 100;

fn small() -> RunSettings {
    let mut settings = situations::ordinary();
    settings.simulation_mut().unwrap().sensor = SensorModel::new("2x2_2x6".parse().unwrap());
    settings.simulation_mut().unwrap().test_samples = 20;
    settings.hidden = 3;
    settings.training.stopping.epochs = 8;
    settings
}

fn trained() -> Run {
    let mut run = Run::prepare(small()).unwrap();
    while run.step().is_none() {}
    run
}

/// A way to damage a file at a place from 0 to 1.
type Damage = fn(&mut Vec<u8>, f64);

const DAMAGES: [(&str, Damage); 5] = [
    ("cut off", |bytes, place| {
        bytes.truncate((place * bytes.len() as f64) as usize);
    }),
    ("a bit flipped", |bytes, place| {
        let at = (place * bytes.len() as f64) as usize;
        bytes[at] ^= 1 << (at % 8);
    }),
    ("a byte left out", |bytes, place| {
        bytes.remove((place * bytes.len() as f64) as usize);
    }),
    ("a digit changed", |bytes, place| {
        let from = (place * bytes.len() as f64) as usize;
        if let Some(at) = (from..bytes.len()).find(|&at| bytes[at].is_ascii_digit()) {
            bytes[at] = if bytes[at] == b'9' { b'1' } else { bytes[at] + 1 };
        }
    }),
    ("a block of zeros", |bytes, place| {
        let from = (place * bytes.len() as f64) as usize;
        let to = (from + 64).min(bytes.len());
        bytes[from..to].fill(0);
    }),
];

/// A network that is read back answers as the written one.
fn judge_network(damage: Damage, place: f64) -> Verdict {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.json");
    let run = trained();
    let mut file = NetworkFile::from_run(&run, None).unwrap();
    // Times are removed to keep the places in the file the same.
    file.training.seconds = 0.0;
    file.save(&path).unwrap();
    rewrite(&path, damage, place);
    match NetworkFile::load(&path) {
        Err(error) => refused_in(folder.path(), &error),
        Ok(read) => {
            if read.network.decouple(run.test()) != run.decouple_test() {
                wrong("a damaged network is read and answers differently")
            } else if read.settings != small() || read.scores.network != run.errors() {
                wrong("a damaged network is read with other settings or errors")
            } else {
                Verdict::Right
            }
        }
    }
}

/// A training that is read back continues as the saved one.
fn judge_checkpoint(damage: Damage, place: f64) -> Verdict {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    let mut run = Run::prepare(small()).unwrap();
    for _ in 0..4 {
        run.step();
    }
    CheckpointFile::from_run(&run, None).unwrap().save(&path).unwrap();
    rewrite(&path, damage, place);
    let resumed = match CheckpointFile::load(&path) {
        Err(error) => return refused_in(folder.path(), &error),
        Ok(file) => file.resume(&decoupler_core::job::Job::UNINTERRUPTED, &mut |_| ()),
    };
    match resumed {
        Err(error) => refused(&error),
        Ok((mut resumed, _)) => {
            while resumed.step().is_none() {}
            while run.step().is_none() {}
            if resumed.decouple_test() == run.decouple_test() {
                Verdict::Right
            } else {
                wrong("a damaged training is read and continues differently")
            }
        }
    }
}

/// Returns the refusal without the name of the temporary folder.
fn refused_in(folder: &Path, error: &impl Display) -> Verdict {
    refused(&error.to_string().replace(&folder.display().to_string(), ""))
}

fn rewrite(path: &Path, damage: Damage, place: f64) {
    let mut bytes = fs::read(path).unwrap();
    damage(&mut bytes, place);
    fs::write(path, bytes).unwrap();
}

/// Judges a table of three resistances per line, given its values, or `None` if it must be refused.
fn judge_table(text: &str, expected: Option<&[[f64; 3]]>) -> Verdict {
    let read = || {
        let parser = LineParser::of_array("2x1_1x3".parse().unwrap(), Rows::All, true).unwrap();
        let mut reader = ReadingsFile::new(text.as_bytes(), parser);
        let mut values = Vec::new();
        while let Some(readings) = reader.read(2)? {
            values.extend(readings.values_ohm);
        }
        Ok::<_, decoupler_files::import::TableError>(values)
    };
    match (read(), expected) {
        (Err(error), None) => refused(&error),
        (Err(error), Some(_)) => wrong(format!("a valid table is refused: {error}")),
        (Ok(values), Some(expected)) if values == expected.concat() => Verdict::Right,
        (Ok(values), _) => wrong(format!("the table is read as {values:?}")),
    }
}

/// Description, text, and expected lines; `None` if it must be refused.
type Text = (&'static str, String, Option<Vec<[f64; 3]>>);

fn tables() -> Vec<Text> {
    let one = Some(vec![[1.0, 2.0, 3.0]]);
    let mut tables = vec![
        ("plain", "1,2,3\n".to_owned(), one.clone()),
        (
            "named, in another order",
            "r_3,r_1,r_2\n3,1,2\n".to_owned(),
            one.clone(),
        ),
        (
            "other columns besides",
            "t,r_1,r_2,r_3\nnoon,1,2,3\n".to_owned(),
            one.clone(),
        ),
        (
            "a byte order mark and CR LF",
            "\u{feff}r_1,r_2,r_3\r\n1,2,3\r\n".to_owned(),
            one.clone(),
        ),
        ("no end of the last line", "1,2,3".to_owned(), one.clone()),
        ("empty lines", "\n1,2,3\n\n".to_owned(), one),
        (
            "the largest and smallest numbers",
            "1e308,1e-308,5e-324\n".to_owned(),
            Some(vec![[1e308, 1e-308, 5e-324]]),
        ),
        ("nothing", String::new(), None),
        ("only names", "r_1,r_2,r_3\n".to_owned(), None),
        ("a column missing", "r_1,r_2\n1,2\n".to_owned(), None),
        ("a column twice", "r_1,r_1,r_2,r_3\n1,1,2,3\n".to_owned(), None),
        ("a value missing", "1,2,3\n1,2\n".to_owned(), None),
        ("a value too many", "1,2,3\n1,2,3,4\n".to_owned(), None),
        ("semicolons", "1;2;3\n".to_owned(), None),
        ("a line break within quotes", "1,2,\"3\n\"\n".to_owned(), None),
        ("bytes that are not text", "1,2,\0\n".to_owned(), None),
    ];
    for value in [
        "0", "-1", "NaN", "inf", "-inf", "1e309", "1e-400", "", "one", "0x10", "1,5",
    ] {
        tables.push((
            "a value that is not a resistance",
            format!("1,2,3\n1,2,{value}\n"),
            None,
        ));
    }
    tables
}

pub(crate) fn jobs() -> Vec<Job> {
    let mut jobs = Vec::new();
    for (name, damage) in DAMAGES {
        for index in 0..PLACES {
            let place = (index as f64 + 0.5) / PLACES as f64;
            let sentence = format!("{name} at {:.1} %", 100.0 * place);
            jobs.push(Job::one(ROOM, "damaged networks", sentence.clone(), move || {
                judge_network(damage, place)
            }));
            jobs.push(Job::one(ROOM, "damaged checkpoints", sentence, move || {
                judge_checkpoint(damage, place)
            }));
        }
    }
    for (sentence, text, expected) in tables() {
        let case = format!("{sentence}: {text:?}");
        jobs.push(Job::one(ROOM, "tables of readings", case, move || {
            judge_table(&text, expected.as_deref())
        }));
    }
    jobs
}
