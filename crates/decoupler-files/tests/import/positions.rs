//! Positions of targets on the skin: reading their file, matching them to the targets, and errors with line and cause.

use std::{fs, path::Path};

use decoupler_core::problem::TargetPosition;
use decoupler_files::{
    export::RecipeFile,
    import::{ImportError, Plan, Recipe, Recording, holds_positions},
};
use tempfile::TempDir;

use crate::support::{folder, go_on, recipe};

/// A recording of one reading and four deformations, a force and a temperature.
fn recording() -> TempDir {
    let row = |row| format!("{row},{},{},{},{},{},0\n", row + 1, row + 2, row * 2, row % 5, row % 3);
    let rows: String = (0..12).map(row).collect();
    let text = format!("u (V),d1 (mm),d2 (mm),d3 (mm),d4 (mm),force (N),spare\n{rows}");
    folder(&[("data.csv", &text)])
}

fn imported(folder: &TempDir, positions: &str) -> Result<Recording, ImportError> {
    fs::write(folder.path().join("taxels.csv"), positions).unwrap();
    plan().import.import(folder.path(), &mut go_on)
}

fn plan() -> Plan {
    Plan {
        import: Recipe {
            positions: Some("taxels.csv".into()),
            ..recipe("u", "d1..force")
        },
        ..Plan::default()
    }
}

#[test]
fn positions_are_matched_to_their_targets_in_any_order_and_layout() {
    let folder = recording();
    let at = |target, x_mm, y_mm| TargetPosition { target, x_mm, y_mm };
    let expected = [at(3, 2.5, 0.0), at(0, 0.0, 0.0), at(2, 2.5, -1.0), at(1, 0.0, -1.0)];
    for text in [
        "target,x,y\nd4,2.5,0\nd1,0,0\nd3,2.5,-1\nd2,0,-1\n",
        "\u{feff}target;x (mm);y [mm]\r\nd4;2,5;0\r\nd1;0;0\r\nd3;2,5;-1\r\nd2;0;-1\r\n",
        "y\ttarget\tx\n0\t d4 \t2.5\n0\td1\t0\n-1\td3\t2.5\n-1\td2\t0\n",
    ] {
        let found = imported(&folder, text).unwrap().problem.positions;
        assert_eq!(found, expected, "{text}");
        let (lines_mm, order) = TargetPosition::lattice(&found).unwrap();
        assert_eq!(lines_mm, [[0.0, 2.5], [-1.0, 0.0]]);
        assert_eq!(order, [3, 1, 2, 0]);
    }
    // A force alone also has one unit.
    let alone = imported(&folder, "target,x,y\nforce,1,2\n").unwrap().problem.positions;
    assert_eq!(alone, [at(4, 1.0, 2.0)]);
}

#[test]
fn invalid_files_are_refused_with_line_and_cause() {
    let folder = recording();
    let cases = [
        ("target,x\nd1,0\n", "no column 'y'"),
        ("d1,0,0\nd2,0,1\n", "no column 'target'"),
        ("target,x (cm),y\nd1,0,0\n", "column 'x' is in cm; give millimetres"),
        (
            "target,x,y\nd1,0,0\nd2,one,0\n",
            "line 3: x is 'one', which is not a finite number",
        ),
        ("target,x,y\nd1,0,0\nd2,0,\n", "line 3: y is missing"),
        ("target,x,y\nd1,0,0\nd2,inf,0\n", "line 3: x is 'inf'"),
        ("target,x,y\nd1,0,0\n,1,0\n", "line 3: target is missing"),
        (
            "target,x,y\nd1,0,0\nd7,1,0\n",
            "line 3: there is no target 'd7'; the targets are d1, d2, d3, d4, force",
        ),
        ("target,x,y\nd1,0,0\nspare,1,0\n", "line 3: there is no target 'spare'"),
        (
            "target,x,y\nd1,0,0\nd2,1,0\nd1,2,0\n",
            "lines 2 and 4: both are the position of 'd1'",
        ),
        (
            "target,x,y\nd1,0,-0\nd2,0,0\n",
            "lines 2 and 3: two targets have the same position",
        ),
        (
            "target,x,y\nd1,0,0\nd2,1,0,5\n",
            "line 3: the row has more cells than there are columns",
        ),
        (
            "target,x,y\nd1,0,0\nforce,1,0\n",
            "d1 (mm) and force (N) have positions but different units",
        ),
        ("target,x,y\n", "it has no rows"),
        ("", "it has no rows"),
    ];
    for (text, expected) in cases {
        let message = imported(&folder, text).unwrap_err().to_string();
        assert!(
            message.contains("taxels.csv") && message.contains(expected),
            "{text:?}: {message}"
        );
    }
    let error = imported(&folder, "target,x,y\nd1,0,0\nd7,1,0\n").unwrap_err();
    assert!(matches!(error, ImportError::File { .. }), "{error:?}");
    fs::remove_file(folder.path().join("taxels.csv")).unwrap();
    let gone = plan().import.import(folder.path(), &mut go_on).unwrap_err();
    assert!(gone.to_string().starts_with("cannot read '"), "{gone}");
}

#[test]
fn a_recipe_keeps_the_file_relative_to_its_folder() {
    let folder = recording();
    imported(&folder, "target,x,y\nd1,0,0\nd2,1,0\n").unwrap();
    let recipe = folder.path().join("recipe.json");
    RecipeFile::Recording(plan().within(folder.path()))
        .save(&recipe)
        .unwrap();
    assert!(
        fs::read_to_string(&recipe)
            .unwrap()
            .contains("\"positions\": \"taxels.csv\"")
    );
    let moved = tempfile::tempdir().unwrap();
    for name in ["data.csv", "taxels.csv", "recipe.json"] {
        fs::rename(folder.path().join(name), moved.path().join(name)).unwrap();
    }
    let loaded = RecipeFile::load_recording(&moved.path().join("recipe.json")).unwrap();
    let again = loaded.recording(Path::new(""), &mut go_on).unwrap();
    assert_eq!(again.problem.positions.len(), 2);
}

#[test]
fn files_of_positions_are_distinguished_from_recordings() {
    let folder = recording();
    let holds = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        holds_positions(&path)
    };
    assert!(holds("a.csv", "target,x,y\nd1,0,0\n") && holds("b.csv", "target;x (mm);y (mm)\nd1;0;0\n"));
    assert!(!holds("c.csv", "target,x,y,z\nd1,0,0,0\n") && !holds("d.csv", "time,x,y\n0,0,0\n"));
    assert!(
        !holds("e.csv", "") && !holds_positions(&folder.path().join("data.csv")) && !holds_positions(folder.path())
    );
}
