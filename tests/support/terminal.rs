//! Runs the program from the command line.

use std::{
    path::Path,
    process::{Command, Output},
};

/// Options that only `inspect` has; other commands take them in a recipe.
const OF_RECIPES: [&str; 19] = [
    "--lags",
    "--differences",
    "--join-time",
    "--join-limit",
    "--derive",
    "--missing",
    "--unit",
    "--positions",
    "--test-fraction",
    "--validation-fraction",
    "--test-join",
    "--separator",
    "--decimal",
    "--header",
    "--encoding",
    "--skip-lines",
    "--skip-damaged",
    "--truncate",
    "--recipe-out",
];

/// Other options of an import.
const OF_IMPORTS: [&str; 11] = [
    "--data",
    "--join",
    "--inputs",
    "--targets",
    "--time",
    "--group",
    "--row-wire",
    "--where",
    "--history",
    "--split",
    "--test-data",
];

/// Returns the output of the program for these arguments, separated by spaces, run in this folder. Files of earlier calls are
/// replaced. Options of an import that `train` and `trade` do not have reach them through a recipe.
pub(crate) fn decoupler(arguments: &str, folder: &Path) -> Output {
    let words = Vec::from_iter(arguments.split_whitespace());
    let needs_recipe = words.iter().any(|word| OF_RECIPES.contains(word));
    if !needs_recipe || !["train", "trade"].contains(&words[0]) {
        return run(&words, folder);
    }
    let (mut inspect, mut rest) = (vec!["inspect"], Vec::new());
    let mut is_of_import = false;
    for word in &words[1..] {
        if word.starts_with("--") {
            is_of_import = OF_RECIPES.contains(word) || OF_IMPORTS.contains(word);
        }
        if is_of_import { &mut inspect } else { &mut rest }.push(*word);
    }
    // The share that is otherwise held out for these methods.
    let method = rest.iter().position(|word| *word == "--method");
    if method.is_some_and(|place| !rest[place + 1].contains("br")) && !inspect.contains(&"--validation-fraction") {
        inspect.extend(["--validation-fraction", "0.2"]);
    }
    let recipe = match inspect.iter().position(|word| *word == "--recipe-out") {
        Some(place) => inspect[place + 1],
        None => {
            inspect.extend(["--recipe-out", "through.recipe.json"]);
            "through.recipe.json"
        }
    };
    let written = run(&inspect, folder);
    if !written.status.success() {
        return written;
    }
    run(&[&[words[0], "--recipe", recipe], &rest[..]].concat(), folder)
}

fn run(words: &[&str], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command.args(words).current_dir(folder);
    if words.first().is_some_and(|word| !word.starts_with('-')) {
        command.arg("--force");
    }
    command.output().unwrap()
}
