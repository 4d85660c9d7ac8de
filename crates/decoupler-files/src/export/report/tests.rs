use std::{collections::HashSet, path::Path};

use resvg::usvg::roxmltree::{Document, ParsingOptions};

use super::*;
use crate::{
    export::{NetworkFile, format_number},
    import::{Joined, Plan, Recipe, Setup},
};
use decoupler_core::{
    dataset::SplitBy,
    decoupling::{DecoderKind, Precision},
    evaluation::{DecoderSet, Run, RunSets, RunSettings},
    job::Job,
    machine::MemoryBudget,
    scene::{Indenter, Loading, RowModel},
    training::Method,
};

fn run() -> Run {
    let mut settings = RunSettings::default();
    settings.simulation_mut().unwrap().sensor.scale = "4x4_2x12".parse().unwrap();
    (
        settings.hidden,
        settings.simulation_mut().unwrap().samples,
        settings.starts,
    ) = (3, 60, 2);
    settings.training.stopping.epochs = 5;
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    run
}

/// The report under `name`, as a program reads it.
fn report(name: &str, file: &NetworkFile, run: &Run) -> String {
    let sets = RunSets::draw(&file.settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
    let set = DecoderSet::new(file.settings, sets.split.training, Some(file.network.clone()));
    let ridge = set.measure(DecoderKind::Ridge, Precision::Double, run.test()).unwrap();
    let (defect, decoders) = (run.defect(), [ridge.unwrap()]);
    let report = RunReport {
        name: Some(name),
        file,
        defect: defect.as_deref(),
        decoders: &decoders,
        test: run.test(),
    };
    report.html(Path::new(""))
}

fn parsed(html: &str) -> Document<'_> {
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(html, options).unwrap()
}

#[test]
fn a_report_is_one_well_formed_file_without_external_references() {
    let run = run();
    let file = NetworkFile::from_run(&run, None).unwrap();
    let name = "</title><script>alert(1)</script> & \"50 %\" 'ü' \u{7}";
    let html = report(name, &file, &run);
    let document = parsed(&html);
    let elements = || document.descendants().filter(|node| node.is_element());
    let names: HashSet<&str> = elements().map(|node| node.tag_name().name()).collect();
    assert!(
        ["script", "link", "img", "iframe", "object", "image"]
            .iter()
            .all(|name| !names.contains(name))
    );
    for node in elements() {
        for attribute in node.attributes() {
            assert!(!["src", "href", "style"].contains(&attribute.name()), "{attribute:?}");
            assert!(!attribute.name().starts_with("on"), "{attribute:?}");
        }
    }
    assert!(
        !html.contains("http") && !html.contains("@import"),
        "an external reference"
    );
    let heading = document.descendants().find(|node| node.has_tag_name("h1")).unwrap();
    let plain = name.replace('\u{7}', "");
    assert!(heading.text().unwrap().starts_with(&plain), "{heading:?}");
    // Every id is unique, and every reference has its target.
    let ids: Vec<&str> = elements().filter_map(|node| node.attribute("id")).collect();
    assert_eq!(ids.iter().collect::<HashSet<_>>().len(), ids.len(), "{ids:?}");
    for used in elements().filter_map(|node| node.attribute("clip-path")) {
        let id = used.trim_start_matches("url(#").trim_end_matches(')');
        assert!(ids.contains(&id), "{used}");
    }
    assert!(elements().filter(|node| node.has_tag_name("svg")).count() >= 5);
    assert!(html.contains("prefers-color-scheme: dark") && html.contains("@media print"));
    assert!(!html.contains("NaN"));
}

#[test]
fn a_report_contains_the_figures_of_its_run() {
    let run = run();
    let file = NetworkFile::from_run(&run, None).unwrap();
    let html = report("a run", &file, &run);
    let document = parsed(&html);
    let rows = document.descendants().filter(|node| node.has_tag_name("tr"));
    let rows: Vec<Vec<String>> = rows
        .map(|row| {
            row.children()
                .filter_map(|cell| cell.text().map(str::to_owned))
                .collect()
        })
        .collect();
    for row in &file.error_table()[0].rows {
        let mut expected = vec![row.name.to_owned()];
        expected.extend(row.errors.iter().map(|error| format_number(*error)));
        assert!(rows.contains(&expected), "{expected:?} is not among {rows:#?}");
    }
    for (number, start) in run.starts().iter().enumerate() {
        let expected = [(number + 1).to_string(), format_number(start.train_mse)];
        assert!(rows.iter().any(|row| row.starts_with(&expected)), "{expected:?}");
    }
    for expected in [
        ["Array", "4x4_2x12"],
        ["Hidden", "3"],
        ["Starts", "2"],
        ["Method", &file.settings.training.method.to_string()],
        ["Weights", &file.network.weights().to_string()],
        ["Geometry height mm", "5.0"],
        ["Loading", "random"],
    ] {
        assert!(rows.contains(&expected.map(str::to_owned).to_vec()), "{expected:?}");
    }
    let command = document.descendants().find(|node| node.has_tag_name("pre")).unwrap();
    assert_eq!(
        command.text(),
        Some("decoupler train --array 4x4_2x12 --samples 60 --hidden 3 --starts 2 --epochs 5")
    );
    assert!(html.contains(crate::export::document::PROGRAM));
}

#[test]
fn settings_without_an_option_are_named_instead_of_a_wrong_command() {
    let mut settings = RunSettings::default();
    settings.simulation_mut().unwrap().sensor.geometry.height_mm = 6.0;
    settings.simulation_mut().unwrap().scene.largest_compression = 0.1;
    let gap = train_command(&settings.into(), None).unwrap_err().to_string();
    assert!(gap.contains("geometry") && gap.contains("compression"), "{gap}");
    let mut indenter = Indenter::default();
    indenter.spread_mm *= 2.0;
    let mut settings = RunSettings::default();
    settings.simulation_mut().unwrap().scene.loading = Loading::Indenter(indenter);
    let gap = train_command(&settings.into(), None).unwrap_err().to_string();
    assert!(gap.contains("indenter"), "{gap}");
}

/// A run on a recording in `folder` of two readings and four deformations with positions on a grid.
fn recorded_run(folder: &Path) -> (Run, NetworkFile) {
    let lines = (0..60).map(|row| {
        let (a, b) = ((0.31 * f64::from(row)).sin(), (0.17 * f64::from(row)).cos());
        format!("{a},{b},{},{},{},{}\n", a + b, a - b, a * b, a * a)
    });
    let text = "a,b,d1 (mm),d2 (mm),d3 (mm),d4 (mm)\n".to_owned() + &String::from_iter(lines);
    std::fs::write(folder.join("press.csv"), text).unwrap();
    std::fs::write(
        folder.join("taxels.csv"),
        "target,x,y\nd1,0,0\nd2,1,0\nd3,0,1\nd4,1,1\n",
    )
    .unwrap();
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let plan = Plan {
        import: Recipe {
            data: "press.csv".into(),
            inputs: names(&["a", "b"]),
            targets: names(&["d1..d4"]),
            positions: Some("taxels.csv".into()),
            ..Recipe::default()
        },
        ..Plan::default()
    };
    let mut settings = RunSettings::measured(RowModel::Shared);
    (settings.hidden, settings.training.stopping.epochs) = (2, 5);
    let setup = Setup::recording(settings, plan);
    let sets = setup.sets(folder, &Job::UNINTERRUPTED, &mut |_| ()).unwrap();
    let mut run = sets.run(&setup, None, &Job::UNINTERRUPTED).unwrap();
    while run.step().is_none() {}
    let file = NetworkFile::from_run(&run, sets.recorded()).unwrap();
    (run, file)
}

#[test]
fn a_report_of_a_recording_has_its_errors_figures_and_command() {
    let root = tempfile::tempdir().unwrap();
    let (run, file) = recorded_run(root.path());
    let set = DecoderSet::new(file.settings, run.test().as_ref().clone(), Some(file.network.clone()));
    let ridge = set.measure(DecoderKind::Ridge, Precision::Double, run.test()).unwrap();
    let decoders = [ridge.unwrap()];
    let report = RunReport {
        name: None,
        file: &file,
        defect: None,
        decoders: &decoders,
        test: run.test(),
    };
    let html = report.html(root.path());
    let document = parsed(&html);
    let count = |name: &str| document.descendants().filter(|node| node.has_tag_name(name)).count();
    assert_eq!(count("figure"), 1 + 2 + 4 * 2, "surfaces, training, two of each target");
    let rows = document.descendants().filter(|node| node.has_tag_name("tr"));
    let rows = Vec::from_iter(rows.map(|row| {
        let cells = row.children().filter_map(|cell| cell.text().map(str::to_owned));
        Vec::from_iter(cells)
    }));
    for block in &file.error_table() {
        for row in &block.rows {
            let mut expected = vec![block.target.as_ref().unwrap().title(), row.name.to_owned()];
            expected.extend(row.errors.iter().map(|error| format_number(*error)));
            assert!(rows.contains(&expected), "{expected:?} is not among {rows:#?}");
        }
    }
    for (target, errors) in file.problem.targets.iter().zip(decoders[0].errors.targets()) {
        let expected = ["Ridge".to_owned(), target.title(), format_number(errors.rmse)];
        assert!(rows.iter().any(|row| row.starts_with(&expected)), "{expected:?}");
    }
    for expected in [
        ["Data", "press.csv"],
        ["Targets", "d1..d4"],
        ["Answers", "d1 (mm), d2 (mm), d3 (mm), d4 (mm)"],
        ["Split", "time"],
        ["Hidden", "2"],
    ] {
        assert!(rows.contains(&expected.map(str::to_owned).to_vec()), "{expected:?}");
    }
    let heading = document.descendants().find(|node| node.has_tag_name("h1")).unwrap();
    assert_eq!(heading.text(), Some("press, 2 hidden nodes, seed 0"));
    let command = document.descendants().find(|node| node.has_tag_name("pre")).unwrap();
    assert_eq!(
        command.text(),
        Some(
            "decoupler inspect --data press.csv --inputs a,b --targets d1..d4 --positions taxels.csv --recipe-out recipe.json && \
             decoupler train --recipe recipe.json --hidden 2 --epochs 5"
        )
    );
    // In a report in another folder, the path of the recording is relative to that folder.
    let folder = root.path().join("reports");
    std::fs::create_dir(&folder).unwrap();
    report.save(&folder.join("report.html")).unwrap();
    let saved = std::fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(saved.contains("--data ../press.csv") && !saved.contains(&*root.path().to_string_lossy()));
}

#[test]
fn the_command_of_a_recording_names_files_columns_and_division() {
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let joined = Joined {
        file: "my states.csv".into(),
        time: Some("t2".to_owned()),
        limit: Some(0.5),
        ..Joined::default()
    };
    let mut plan = Plan {
        import: Recipe {
            data: "press.csv".into(),
            join: vec![joined],
            inputs: names(&["c2..c5"]),
            targets: names(&["force"]),
            time: Some("t".to_owned()),
            group: Some("session".to_owned()),
            conditions: vec!["t>0".parse().unwrap()],
            missing: vec!["-1".parse().unwrap()],
            ..Recipe::default()
        },
        ..Plan::default()
    };
    plan.division.by = SplitBy::Group;
    let settings = RunSettings::measured(RowModel::Shared);
    let command = |plan: &Plan, settings, recipe: Option<&str>| {
        let setup = Setup::recording(settings, plan.clone());
        train_command(&setup, recipe.map(Path::new)).map_err(|gap| gap.to_string())
    };
    assert_eq!(
        command(&plan, settings, None).unwrap(),
        "decoupler inspect --data press.csv --join 'my states.csv' --inputs c2..c5 --targets force --time t --group session \
         --where 't>0' --split group --join-time t2 --join-limit 0.5 --missing=-1 --recipe-out recipe.json && decoupler \
         train --recipe recipe.json --hidden 12"
    );
    // The default method has different settings for recordings; with other methods, a part of the samples is held out
    // for validation.
    let mut other = settings;
    other.training.method = Method::default();
    plan.division.by = SplitBy::Random;
    plan.division.validation_fraction = Some(0.0);
    let text = command(&plan, other, None).unwrap();
    assert!(
        text.ends_with("--validation-fraction 0 --recipe-out recipe.json && decoupler train --recipe recipe.json --hidden 12 --method lm"),
        "{text}"
    );
    assert_eq!(
        command(&plan, settings, Some("recipe.json")).unwrap(),
        "decoupler train --recipe recipe.json --split random --hidden 12"
    );
    plan.import.join[0].stem = Some("other".to_owned());
    assert!(command(&plan, settings, None).unwrap_err().contains("joined files"));
}

#[test]
fn every_field_of_a_recipe_is_in_the_command() {
    let recipe = serde_json::json!({
        "data": "press.csv",
        "join": [{"file": "states.csv", "time": "joined_time", "limit": 0.75}],
        "append": [{"data": "second.csv", "join": ["second_states.csv"]}],
        "dialect": {"encoding": "latin-1", "separator": "bar", "decimal": "comma", "header": true, "skip_lines": 17},
        "inputs": ["c2..c5"],
        "targets": ["force"],
        "time": "clock",
        "group": "session",
        "row_wire": "wire",
        "memory": {"lags": ["3"], "averages": ["0.25s"], "differences": true},
        "where": ["t>4.5"],
        "derive": ["power=force-speed"],
        "missing": ["-99"],
        "skip_damaged": true,
        "truncate": true,
        "units": {"depth": "mm"},
        "positions": "taxels.csv",
    });
    let import: Recipe = serde_json::from_value(recipe.clone()).unwrap();
    // A field that is added has to be added above.
    let fields = |value: &serde_json::Value| Vec::from_iter(value.as_object().unwrap().keys().cloned());
    assert_eq!(fields(&serde_json::json!(import)), fields(&recipe));
    let plan = Plan {
        import,
        ..Plan::default()
    };
    let setup = Setup::recording(RunSettings::measured(RowModel::Shared), plan);
    let command = train_command(&setup, None).unwrap();
    for expected in [
        "--data press.csv --join states.csv --data second.csv --join second_states.csv",
        "--join-time joined_time --join-limit 0.75",
        "--inputs c2..c5 --targets force --time clock --group session --row-wire wire --history 0.25s --where 't>4.5'",
        "--lags 3 --differences --skip-damaged --truncate",
        "--missing=-99 --unit depth=mm --positions taxels.csv --separator bar --decimal comma --header yes --encoding latin-1 \
         --skip-lines 17",
    ] {
        assert!(command.contains(expected), "{expected}: {command}");
    }
    assert!(command.contains("--derive") && command.contains("power"), "{command}");
}
