//! The modules of the window depend only on earlier modules, and views do not depend on each other.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    fs,
    path::{Path, PathBuf},
};

/// The modules of `src/window`; each uses only those before it.
const ORDER: [&str; 14] = [
    "theme",
    "glossary",
    "widgets",
    "plotting",
    "surface_view",
    "job",
    "timeline",
    "test_view",
    "preview",
    "training_worker",
    "shared",
    "forms",
    "views",
    "frame",
];

#[test]
fn modules_use_only_earlier_modules_and_views_no_other_view() {
    let window = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/window");
    let mut faults = Vec::new();
    for file in sources(&window) {
        let path: Vec<&str> = file
            .strip_prefix(&window)
            .unwrap()
            .iter()
            .map(|part| part.to_str().unwrap())
            .collect();
        let Some(module) = place_of(path[0]) else {
            assert_eq!(path, ["mod.rs"], "the module '{}' is not in the order", path[0]);
            continue;
        };
        for used in uses(&fs::read_to_string(&file).unwrap(), &path) {
            let is_above = place_of(&used[0]).is_some_and(|place| place > module);
            let is_other_view = path[0] == "views"
                && path.len() > 2
                && used[0] == "views"
                && used.get(1).is_some_and(|view| view != path[1]);
            // Names re-exported for users of the library hide their module.
            let is_hidden = used[0].starts_with(char::is_uppercase);
            if is_above || is_other_view || is_hidden {
                faults.push(format!("{} uses {}", path.join("/"), used.join("::")));
            }
        }
    }
    assert_eq!(faults, Vec::<String>::new());
}

/// There a panic becomes an event, which the window shows.
#[test]
fn threads_are_started_in_one_place() {
    let window = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/window");
    let starts = sources(&window).into_iter().filter(|file| {
        let text = fs::read_to_string(file).unwrap();
        ["thread::spawn", "thread::Builder", "rayon::spawn", ".spawn("]
            .iter()
            .any(|start| text.contains(start))
    });
    assert_eq!(Vec::from_iter(starts), [window.join("job/mod.rs")]);
}

fn place_of(module: &str) -> Option<usize> {
    ORDER.iter().position(|place| module.trim_end_matches(".rs") == *place)
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let files = entries.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] });
    files.collect()
}

/// Returns the paths in the window that a file of the window uses, relative to `src/window`.
fn uses(text: &str, file: &[&str]) -> Vec<Vec<String>> {
    let mut home: Vec<String> = ["crate", "window"]
        .into_iter()
        .chain(file.iter().copied())
        .map(String::from)
        .collect();
    // A file may be used as `super` by its tests; one that is no `mod.rs` has a name of its own.
    home.pop();
    let mut found = Vec::new();
    for part in text.split("use ").skip(1) {
        let (tree, _) = part.split_once(';').unwrap_or_default();
        let tree: String = tree.split_whitespace().collect();
        spread(&tree, &mut Vec::new(), &mut found);
    }
    let absolute = found.into_iter().filter_map(|mut path: Vec<String>| {
        if path[0] == "super" {
            let rise = path.iter().take_while(|part| *part == "super").count();
            // In a file, the first `super` is its folder.
            let up = if file.ends_with(&["mod.rs"]) { rise } else { rise - 1 };
            path = home[..home.len().checked_sub(up)?]
                .iter()
                .cloned()
                .chain(path.split_off(rise))
                .collect();
        }
        let is_ours = path.len() > 2 && path[..2] == ["crate", "window"];
        is_ours.then(|| path.split_off(2))
    });
    absolute.collect()
}

/// Expands the braces of a `use` tree.
fn spread(tree: &str, before: &mut Vec<String>, found: &mut Vec<Vec<String>>) {
    let mut depth = 0;
    let parts = tree.split(|letter| {
        depth += i32::from(letter == '{') - i32::from(letter == '}');
        depth == 0 && letter == ','
    });
    for part in parts.filter(|part| !part.is_empty()) {
        let (path, inner) = match part.split_once('{') {
            Some((path, inner)) => (path, inner.strip_suffix('}')),
            None => (part, None),
        };
        let length = before.len();
        before.extend(path.split("::").filter(|name| !name.is_empty()).map(String::from));
        match inner {
            Some(inner) => spread(inner, before, found),
            None => found.push(before.clone()),
        }
        before.truncate(length);
    }
}
