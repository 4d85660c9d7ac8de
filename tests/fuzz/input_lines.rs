//! Lines with the inputs of a network that was trained on a recording, as `decode --follow` reads them, and files with the
//! same lines, as `decode` reads them.

use std::{fs, ops::ControlFlow, path::Path};

use decoupler_core::{
    dataset::{Memory, Span},
    problem::{Channel, Problem},
};
use decoupler_files::{
    import::{DialectChoice, Encoding, LineParser, ParsedLine, Recipe, Separator},
    machine::limit_memory,
};

use crate::{
    corpus::replay,
    mutation::{accepted, mutated},
};

/// A recipe and the problem of its network.
fn problem(inputs: &[&str], derive: &[&str], memory: Option<Memory>) -> (Recipe, Problem) {
    let channel = |name: &&str| Channel::new(*name, None);
    let problem = Problem {
        inputs: inputs.iter().map(channel).collect(),
        targets: vec![channel(&"force")],
        memory: memory.clone(),
        positions: Vec::new(),
        sensor: None,
    };
    let recipe = Recipe {
        dialect: DialectChoice {
            encoding: Some(Encoding::Utf8),
            separator: Some(Separator::Comma),
            ..DialectChoice::default()
        },
        inputs: inputs.iter().map(|name| (*name).to_owned()).collect(),
        derive: derive.iter().map(|text| text.parse().unwrap()).collect(),
        time: Some("t".to_owned()),
        row_wire: Some("row".to_owned()),
        memory,
        ..Recipe::default()
    };
    (recipe, problem)
}

/// Row-wires of the networks, from 0.
const ROW_WIRES: [usize; 2] = [0, 2];

/// Reads the lines, and then the file; returns the number of readings.
fn check(bytes: &[u8], recipe: &Recipe, problem: &Problem, has_rows: bool, path: &Path) -> usize {
    limit_memory(0.25);
    let networks = if has_rows { ROW_WIRES.len() } else { 1 };
    let row_wires = has_rows.then(|| ROW_WIRES.to_vec());
    let mut lines = LineParser::of_recording(problem, recipe, row_wires).unwrap();
    let text = || String::from_utf8_lossy(bytes);
    let mut found: Vec<Vec<f64>> = Vec::new();
    let mut is_faultless = true;
    for (line, number) in bytes.split(|&byte| byte == b'\n').zip(1..) {
        match lines.parse(number, line) {
            Ok(ParsedLine::NoReadings) => {}
            Ok(ParsedLine::Start { .. }) => is_faultless = false,
            Ok(ParsedLine::Snapshot(_)) => panic!("no array"),
            Ok(ParsedLine::Row {
                row_index, readings, ..
            }) => {
                assert!(row_index.unwrap() < networks);
                assert_eq!(readings.len(), problem.feature_count());
                assert!(
                    readings.iter().all(|reading| reading.is_finite()),
                    "{readings:?}: {}",
                    text()
                );
                found.push(readings.to_vec());
            }
            Err(error) => {
                is_faultless = false;
                let message = error.to_string();
                assert!(
                    message.len() < 20_000 && message.contains(&format!("line {number}")),
                    "{message}"
                );
                if error.is_final() {
                    break;
                }
            }
        }
    }
    fs::write(path, bytes).unwrap();
    let read = recipe.read_inputs(path, problem, has_rows, &mut |_| ControlFlow::Continue(()));
    if let Ok(table) = read {
        assert!(table.readings.iter().all(|reading| reading.is_finite()), "{}", text());
        assert_eq!(table.lines.len(), table.readings.nrows());
        // The last line of a file may be cut off, and a file may begin with other lines than a stream.
        if is_faultless && table.torn_line.is_none() && table.readings.nrows() == found.len() && !has_rows {
            for (row, expected) in table.readings.rows().into_iter().zip(&found) {
                assert_eq!(row.to_vec(), *expected, "{}", text());
            }
        }
    }
    found.len()
}

#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data.csv");
    let memory = Memory {
        lags: vec![Span::Samples(1.0)],
        interval_s: Some(0.1),
        averages: vec![Span::Seconds(0.3)],
        ..Memory::default()
    };
    let problems = [
        (problem(&["a", "b"], &[], None), false),
        (problem(&["a", "b"], &[], Some(memory.clone())), true),
        (
            problem(&["d", "b", "r"], &["d=a-b", "r=a/start(2)"], Some(memory)),
            false,
        ),
        (problem(&["q", "s"], &["q=a/b", "s=b-start(0.2s)"], None), false),
    ];
    let all = |bytes: &[u8]| -> usize {
        let of_problem =
            |((recipe, problem), has_rows): &((Recipe, Problem), bool)| check(bytes, recipe, problem, *has_rows, &path);
        problems.iter().map(of_problem).sum()
    };
    replay!(100, |bytes: &[u8]| all(bytes)
        + accepted(40, |rng| all(&mutated(bytes, rng)) > 0));
}
