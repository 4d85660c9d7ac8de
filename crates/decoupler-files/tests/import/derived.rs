//! Derived columns of a stream of lines, compared with those of a file with the same lines.

use std::fmt::Write as _;

use decoupler_core::{
    dataset::{Memory, Span},
    problem::{Channel, Problem},
};
use decoupler_files::import::{LineParser, ParsedLine, Recipe};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use crate::support::{folder, go_on, import, recipe};

/// A recipe with these derived columns as inputs.
fn deriving(derive: &[&str], inputs: &str) -> Recipe {
    Recipe {
        derive: derive.iter().map(|text| text.parse().unwrap()).collect(),
        time: Some("t".to_owned()),
        ..recipe(inputs, "y")
    }
}

/// Rows at 50 Hz with times in milliseconds.
fn text(rows: usize) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut text = "t (ms),a (V),b (V),y\n".to_owned();
    for row in 0..rows {
        let [a, b, y]: [f64; 3] = std::array::from_fn(|_| rng.random_range(1.0..3.0));
        writeln!(text, "{},{a},{b},{y}", 20 * row).unwrap();
    }
    text
}

fn lines(recipe: &Recipe, problem: &Problem) -> LineParser {
    LineParser::of_recording(problem, recipe, None).unwrap()
}

#[test]
fn a_stream_has_the_derived_columns_of_a_file_bit_for_bit_once_the_start_is_over() {
    let derive = ["d=a-b", "q=a/b", "r=a/start(7)", "p=r-start(0.3s)"];
    let memory = Memory {
        lags: vec![Span::Samples(20.0)],
        averages: vec![Span::Seconds(1.0)],
        ..Memory::default()
    };
    // Rows of the start: one of the columns needs the first 0.3 s, which are over after 16 rows.
    for (derive, memory, start) in [
        (&derive[..2], None, 0),
        (&derive[..3], None, 6),
        (&derive[..], None, 16),
        (&derive[..], Some(memory), 16),
    ] {
        let text = text(60);
        let folder = folder(&[("data.csv", &text)]);
        let mut recipe = deriving(derive, &format!("{} b", &"d q r p"[..2 * derive.len() - 1]));
        recipe.memory = memory;
        let problem = import(&recipe, folder.path()).unwrap().problem;
        let path = folder.path().join("data.csv");
        let expected = recipe.read_inputs(&path, &problem, false, &mut go_on).unwrap().readings;
        let mut lines = lines(&recipe, &problem);
        let mut found = Vec::new();
        for (number, line) in (1..).zip(text.lines()) {
            match lines.parse(number, line.as_bytes()).unwrap() {
                ParsedLine::NoReadings => assert_eq!(number, 1),
                ParsedLine::Start { .. } => found.push(None),
                ParsedLine::Row { readings, .. } => found.push(Some(readings.to_vec())),
                ParsedLine::Snapshot(_) => panic!("no array"),
            }
        }
        assert_eq!(found.len(), 60);
        for (row, (found, expected)) in found.iter().zip(expected.outer_iter()).enumerate() {
            match found {
                None => assert!(row < start, "row {row} of {start}"),
                Some(found) => assert!(row >= start && *found == expected.to_vec(), "row {row}: {found:?}"),
            }
        }
    }
}

#[test]
fn lines_without_a_derived_value_or_a_column_are_refused_with_the_reason() {
    let folder = folder(&[("data.csv", &text(20))]);
    let recipe = deriving(&["q=a/b", "r=a-start(0.1s)"], "q r");
    let problem = import(&recipe, folder.path()).unwrap().problem;
    let parsed = |texts: &[&str]| {
        let mut lines = lines(&recipe, &problem);
        let parse = |(number, text): (u64, &&str)| match lines.parse(number, text.as_bytes()) {
            Ok(ParsedLine::Row { readings, .. }) => Ok(readings.to_vec()),
            Ok(_) => Ok(Vec::new()),
            Err(error) => Err((error.is_final(), error.to_string())),
        };
        (1..).zip(texts).map(parse).last().unwrap()
    };
    let header = "a,b,t (s)";
    assert_eq!(parsed(&[header, "4,2,0", "6,2,0.1", "9,3,0.2"]), Ok(vec![3.0, 4.0]));
    // A header in the middle, of a device that starts again, does not begin another start.
    assert_eq!(
        parsed(&[header, "4,2,0", "9,3,0.2", header, "9,3,0.3"]),
        Ok(vec![3.0, 5.0])
    );
    for (texts, is_final, reason) in [
        (&[header, "4,2,0", "9,3,0.2", "9,0,0.3"][..], false, "'q' has no value"),
        (
            &[header, "4,x,0"][..],
            false,
            "line 2, column 2: 'x' is not a finite number",
        ),
        (&["a,t (s)", "4,0"][..1], true, "q=a / b"),
        (&["a,b", "4,2"][..1], true, "seconds need the time column"),
        (&["a,b,t (V)"][..], true, "'t' has no unit of time"),
        (&["4,2,0"][..], false, "there is no column 'q'"),
    ] {
        let (found_final, found) = parsed(texts).unwrap_err();
        assert!(
            found_final == is_final && found.contains(reason),
            "{texts:?}: {found_final} {found}"
        );
    }
}

#[test]
fn a_stream_waits_for_its_start_only_as_long_as_that_fits_into_memory() {
    let recipe = deriving(&["r=c1-start(1000000)"], "r");
    let problem = Problem {
        inputs: vec![Channel::new("r", None)],
        targets: vec![Channel::new("y", None)],
        memory: None,
        positions: Vec::new(),
        sensor: None,
    };
    let mut lines = lines(&recipe, &problem);
    let line = vec!["1"; 100_000].join(",");
    let last = (1..10_000).find_map(|number| Some((number, lines.parse(number, line.as_bytes()).err()?)));
    let (number, error) = last.unwrap();
    assert!(number < 200 && error.is_final(), "{number}: {error}");
    assert!(
        error.to_string().contains("start(1000000)") && error.to_string().contains("give fewer"),
        "{error}"
    );
}
