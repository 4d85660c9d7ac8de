use std::{collections::HashSet, path::Path};

use resvg::usvg::roxmltree::{Document, ParsingOptions};

use super::*;
use crate::{
    decoupling::{DecoderKind, Precision},
    evaluation::{DecoderSet, Run, SimulatedSettings},
    export::{NetworkFile, format_number},
    scene::{Indenter, Loading},
};

fn run() -> Run {
    let mut settings = SimulatedSettings::default();
    settings.source.sensor.scale = "4x4_2x12".parse().unwrap();
    (settings.hidden, settings.source.samples, settings.starts) = (3, 60, 2);
    settings.training.stopping.epochs = 5;
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    run
}

/// The report under `name`, as a program reads it.
fn report(name: &str, file: &NetworkFile, run: &Run) -> String {
    let set = DecoderSet::new(&file.settings.simulated().unwrap(), Some(file.network.clone())).unwrap();
    let ridge = set.measure(DecoderKind::Ridge, Precision::Double, run.test()).unwrap();
    let (flaw, decoders) = (run.flaw(), [ridge.unwrap()]);
    let report = RunReport {
        name: Some(name),
        file,
        flaw: flaw.as_ref(),
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
fn a_report_is_one_well_formed_file_that_asks_nobody_for_anything() {
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
        "a reference to the outside"
    );
    let heading = document.descendants().find(|node| node.has_tag_name("h1")).unwrap();
    let plain = name.replace('\u{7}', "");
    assert!(heading.text().unwrap().starts_with(&plain), "{heading:?}");
    // Every name is there once, and every use finds its own.
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
fn a_report_holds_the_figures_of_its_run() {
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
    for row in &file.error_table().blocks[0].rows {
        let mut expected = vec![row.name.to_owned()];
        expected.extend(row.errors.iter().map(|error| format_number(*error)));
        assert!(rows.contains(&expected), "{expected:?} is not among {rows:#?}");
    }
    for (number, start) in run.starts().iter().enumerate() {
        let expected = [(number + 1).to_string(), format_number(start.train_mse)];
        assert!(rows.iter().any(|row| row.starts_with(&expected)), "{expected:?}");
    }
    let command = document.descendants().find(|node| node.has_tag_name("pre")).unwrap();
    assert_eq!(
        command.text(),
        Some("decoupler train --array 4x4_2x12 --samples 60 --hidden 3 --starts 2 --epochs 5")
    );
    assert!(html.contains(crate::export::document::PROGRAM));
}

#[test]
fn settings_that_the_terminal_lacks_are_named_instead_of_a_command_that_trains_something_else() {
    let mut settings = SimulatedSettings::default();
    settings.source.sensor.geometry.height_mm = 6.0;
    settings.source.scene.largest_compression = 0.1;
    let gap = train_command(&settings.into(), None).unwrap_err().to_string();
    assert!(gap.contains("geometry") && gap.contains("compression"), "{gap}");
    let mut indenter = Indenter::default();
    indenter.spread_mm *= 2.0;
    let mut settings = SimulatedSettings::default();
    settings.source.scene.loading = Loading::Indenter(indenter);
    let gap = train_command(&settings.into(), None).unwrap_err().to_string();
    assert!(gap.contains("indenter"), "{gap}");
}
