//! Frames decoded as they arrive: from the simulated source, a recording, and a socket.

use std::{
    cell::RefCell,
    collections::BTreeMap,
    fs,
    io::Write,
    net::TcpListener,
    path::{Path, PathBuf},
};

use decoupler::window::Phase;
use decoupler_core::{
    dataset::Seed,
    decoupling::Decoder,
    job::Job,
    scene::{Noise, Scene},
};
use decoupler_files::{
    export::NetworkFile,
    live::{Recording, Simulated, Tally},
};
use eframe::egui::{Key, Modifiers, accesskit::Role, vec2};
use egui_kittest::kittest::{By, Queryable as _};
use glam::DVec3;

use crate::{
    driver::Driver,
    sources::{probe, with_epochs},
    typing::double_click_slider,
};

/// The window with a small network in its run list, at the Live view.
fn open(folder: &Path) -> Driver {
    let mut driver = Driver::open_keeping(&folder.join("runs"));
    driver.configure_small();
    train(&mut driver, 1);
    driver.click_button("Live");
    driver
}

fn train(driver: &mut Driver, runs: usize) {
    driver.train();
    driver.wait("the run in the list", |driver| {
        driver.state().runs.workspace.runs.len() == runs
    });
}

fn start(driver: &mut Driver) {
    driver.click("▶ Start");
    driver.wait("the first frame", |driver| driver.has("Live decoupled surface"));
}

fn decoded(driver: &Driver) -> u64 {
    driver.views().live.shown.counts.decoded
}

/// Waits until this many more frames are decoded.
fn wait_for_frames(driver: &mut Driver, more: u64) {
    let wanted = decoded(driver) + more;
    driver.wait("more frames", |driver| decoded(driver) >= wanted);
}

/// Time and nodes of the displayed frame.
fn displayed(driver: &Driver) -> Option<(f64, Vec<DVec3>)> {
    let frame = driver.views().live.shown.frame.as_ref()?;
    Some((frame.time_s, frame.decoupled.nodes_mm.to_vec()))
}

/// The frame decoded by the library.
fn by_library(file: &NetworkFile, frame_ohm: &[f64]) -> Vec<DVec3> {
    let scale = file.settings.simulation().unwrap().sensor.scale;
    let mut decoder = file.network.decoder();
    let mut answer_mm = vec![0.0; scale.rows() * scale.coordinates_per_row()];
    decoder.decode(frame_ohm, &mut answer_mm).unwrap();
    answer_mm.chunks_exact(3).map(DVec3::from_slice).collect()
}

/// Picks from a list that opens.
fn pick(driver: &mut Driver, list: &str, choice: &str) {
    driver.click(list);
    let choices = By::new().label(choice).predicate(|node| node.role() != Role::ComboBox);
    driver.harness().get(choices).click();
    driver.harness().run_steps(3);
}

#[test]
fn without_a_network_one_click_trains_one_and_another_decodes_live() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.click_button("Live");
    assert!(driver.has("No network yet") && !driver.is_enabled("▶ Start"));
    driver.click("Train a network now");
    assert_eq!(driver.shown(), "Train");
    driver.wait("the run", |driver| {
        matches!(driver.state().phase, Phase::Ended(_)) && !driver.state().runs.workspace.runs.is_empty()
    });
    driver.click_button("Live");
    driver.enter("Relative noise", "0");
    driver.click("Start the simulated source");
    driver.wait("surfaces and readings", |driver| {
        ["Live decoupled surface", "Live actual surface", "Live readings"]
            .iter()
            .all(|label| driver.has(label))
    });
    wait_for_frames(&mut driver, 3);

    let file = driver.kept(0);
    let (time_s, nodes) = displayed(&driver).unwrap();
    let scene = Scene {
        noise: Noise::default(),
        ..file.settings.simulation().unwrap().scene
    };
    let mut source = Simulated::new(&file.settings.simulation().unwrap().sensor, &scene, Seed(0), 50.0).unwrap();
    let mut ohm = vec![0.0; source.readings()];
    while source.next_frame(&mut ohm).unwrap() < time_s {}
    assert_eq!(nodes, by_library(&file, &ohm), "at {time_s} s");
    let actual = driver
        .views()
        .live
        .shown
        .frame
        .as_ref()
        .unwrap()
        .actual
        .clone()
        .unwrap();
    let truth = (0..10).flat_map(|row| source.deformation().row_mm(row).to_vec());
    assert!(actual.nodes_mm.iter().zip(truth).all(|(node, u)| node.z == 5.0 - u.z));

    driver.click("■ Stop");
    assert!(
        driver.becomes_idle() && driver.has("Live decoupled surface"),
        "the last frame stays"
    );
    assert!(driver.says("Stopped after") && driver.is_enabled("▶ Start"));
}

#[test]
fn a_broken_wire_is_reported_left_out_and_cleared_once_it_is_repaired() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = open(folder.path());
    start(&mut driver);
    assert!(driver.has("Fault: none"));
    pick(&mut driver, "Wire fault", "Broken column-wire");
    driver.enter("Column-wire", "7");
    driver.wait("the name of the wire", |driver| driver.has("Fault: column-wire 7"));
    assert!(driver.says("Column-wire 7: open") && driver.says("Its readings are left out"));
    wait_for_frames(&mut driver, 20);
    let frame = driver.views().live.shown.frame.clone().unwrap();
    let residual = frame.residual;
    assert!(residual < 5e-3, "{residual}: the broken wire's readings do not count");
    pick(&mut driver, "Wire fault", "None");
    driver.wait("recovery", |driver| driver.has("Fault: none"));
    assert!(!driver.says("Its readings are left out"));
}

#[test]
fn re_zero_removes_a_drift() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = open(folder.path());
    driver.enter("Frames per second", "0.1");
    start(&mut driver);
    driver.click_button("Re-zero");
    driver.wait("the reason", |driver| {
        driver.says("Not re-zeroed: ") && driver.says("of 25 frames have been received")
    });
    driver.click("■ Stop");
    driver.enter("Frames per second", "50");
    start(&mut driver);
    driver.click_button("Lift");
    pick(&mut driver, "Wire fault", "Gain drift");
    driver.wait("the drift", |driver| driver.has("Fault: column-wire 3"));
    wait_for_frames(&mut driver, 30);
    driver.click_button("Re-zero");
    driver.wait("the gains", |driver| driver.has("Rows in contact: 0 of 10"));
    driver.wait("readings without a fault", |driver| driver.has("Fault: none"));
    let zero = driver.views().live.zero.clone().unwrap();
    for (index, gain) in zero.gains.iter().enumerate() {
        let expected = if index % 18 == 2 { 1.05 } else { 1.0 };
        assert!((gain / expected - 1.0).abs() < 2e-3, "{index}: {gain}");
    }
    driver.click("Clear zero");
    assert!(driver.views().live.zero.is_none() && !driver.says("Rows in contact"));
}

/// Draws frames until `ends`; returns all that were shown, by the bits of their times.
fn collect(driver: &mut Driver, what: &str, ends: impl Fn(&Driver) -> bool) -> BTreeMap<u64, Vec<DVec3>> {
    let shown = RefCell::new(BTreeMap::new());
    driver.wait(what, |driver| {
        if let Some((time_s, nodes)) = displayed(driver) {
            shown.borrow_mut().insert(time_s.to_bits(), nodes);
        }
        ends(driver)
    });
    shown.into_inner()
}

fn recordings(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.join("recordings")).unwrap();
    entries.map(|entry| entry.unwrap().path()).collect()
}

fn read(path: &Path, file: &NetworkFile) -> Recording {
    Recording::read(path, file, &mut Tally::default(), &Job::UNINTERRUPTED).unwrap()
}

#[test]
fn a_recording_is_replayed_with_the_same_answers_and_by_any_network() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open_keeping(&folder.path().join("runs"));
    driver.configure_small();
    train(&mut driver, 1);
    driver.enter("Hidden nodes", "4");
    train(&mut driver, 2);
    driver.click_button("Live");
    assert!(!driver.is_enabled("● Record"));
    start(&mut driver);
    driver.press_with(Modifiers::COMMAND, Key::R);
    let live = collect(&mut driver, "a recording", |driver| {
        driver
            .views()
            .live
            .shown
            .recording
            .as_ref()
            .is_some_and(|recorded| recorded.frames >= 40)
    });
    driver.press_with(Modifiers::COMMAND, Key::R);
    driver.wait("its end", |driver| driver.says("Recorded "));
    let recording = read(&recordings(folder.path())[0], &driver.kept(1));

    driver.click("Replay recording");
    let ended = |driver: &Driver| {
        let replay = driver.views().live.shown.replay;
        replay.is_some_and(|replay| !replay.is_playing)
    };
    let replayed = collect(&mut driver, "the end of the replay", ended);
    assert!(driver.becomes_idle(), "a replay that is paused");
    let file = driver.kept(1);
    let answers = recording
        .times_s()
        .iter()
        .enumerate()
        .map(|(frame, time_s)| (time_s.to_bits(), by_library(&file, recording.frame(frame))));
    let answers: BTreeMap<_, _> = answers.collect();
    for (shown, least) in [(&live, 1), (&replayed, 2)] {
        let recorded: Vec<_> = shown.iter().filter(|(time, _)| answers.contains_key(time)).collect();
        assert!(recorded.len() >= least, "{} of {}", recorded.len(), shown.len());
        assert!(recorded.iter().all(|(time, nodes)| answers[time] == **nodes));
    }
    let check = |driver: &Driver, place: usize| {
        let (time_s, nodes) = displayed(driver).unwrap();
        let frame = recording.frame_at(time_s);
        assert_eq!(nodes, by_library(&driver.kept(place), recording.frame(frame)));
        (frame, recording.times_s().len() - 1)
    };
    let (frame, last) = check(&driver, 1);
    assert_eq!(frame, last);

    driver.get("Replay speed").set_value_accesskit(4.0);
    driver.harness().run_steps(2);
    assert!(driver.has("4.0×"), "{:#?}", driver.texts());
    double_click_slider(&mut driver, "Replay speed");
    assert!(driver.has("1.0×"), "{:#?}", driver.texts());
    double_click_slider(&mut driver, "Replay position");
    driver.wait("the first frame", |driver| {
        driver
            .views()
            .live
            .shown
            .replay
            .is_some_and(|replay| replay.at_s == 0.0)
    });
    assert_eq!(check(&driver, 1).0, 0);
    let name = driver.state().runs.workspace.runs[0].name.clone();
    pick(&mut driver, "Decode with", &name);
    driver.wait("the other network's answer", |driver| {
        let running = driver.views().live.running.as_ref();
        running.is_some_and(|running| running.network == name) && decoded(driver) == 1
    });
    assert_eq!(check(&driver, 0).0, 0);
    driver.click("■ Stop");
    driver.settle();
    let copy = folder.path().join("copy.csv");
    driver.save("Save recording…", &copy);
    assert_eq!(read(&copy, &file), recording);
}

#[test]
fn a_run_whose_file_is_damaged_is_not_decoded_with() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open_keeping(&folder.path().join("runs"));
    driver.configure_small();
    for runs in 1..=2 {
        train(&mut driver, runs);
    }
    let run = driver.state().runs.workspace.runs[0].clone();
    assert_eq!(run.file, None, "it is only in its file");
    let damaged = folder.path().join("runs").join(format!("run-{}.json", run.id));
    fs::write(&damaged, "{").unwrap();
    driver.click_button("Live");
    pick(&mut driver, "Decode with", &run.name);
    driver.wait("the reason", |driver| driver.says("is cut off"));
    driver.click("▶ Start");
    driver.wait("the newest network", |driver| {
        let running = driver.views().live.running.as_ref();
        running.is_some_and(|running| running.network == driver.state().runs.newest().unwrap().name)
    });
    assert_eq!(fs::read_to_string(&damaged).unwrap(), "{");
}

#[test]
fn closing_the_window_while_it_records_ends_at_once_and_loses_no_frame() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = open(folder.path());
    start(&mut driver);
    driver.click("● Record");
    driver.wait("a few frames", |driver| {
        driver
            .views()
            .live
            .shown
            .recording
            .as_ref()
            .is_some_and(|recorded| recorded.frames >= 5)
    });
    assert!(driver.close());
    let frames = driver.views().live.shown.recording.as_ref().unwrap().frames;
    let file = driver.kept(0);
    drop(driver);
    let recording = read(&recordings(folder.path())[0], &file);
    assert!(recording.times_s().len() >= frames as usize);
}

/// Returns the frame of the array at rest, and its line.
fn at_rest(file: &NetworkFile) -> (Vec<f64>, String) {
    let sensor = file.settings.simulation().unwrap().sensor;
    let at_rest = vec![DVec3::ZERO; sensor.scale.nodes_per_row()];
    let rows = (0..10).map(|row| sensor.row_resistances(row, &at_rest).unwrap());
    let frame_ohm: Vec<f64> = rows.flatten().collect();
    let numbers = frame_ohm.iter().map(|ohm| format!("{ohm:?}"));
    let line = Vec::from_iter(numbers).join(",");
    (frame_ohm, line)
}

#[test]
fn a_socket_is_decoded_and_its_bad_lines_and_end_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = open(folder.path());
    let file = driver.kept(0);
    let (frame_ohm, line) = at_rest(&file);

    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    driver.click_button("TCP");
    driver.enter("Address", "nowhere");
    assert!(driver.says("tcp:HOST:PORT") && !driver.is_enabled("▶ Start"));
    driver.enter("Address", &listener.local_addr().unwrap().to_string());
    driver.click("▶ Start");
    let (mut sender, _) = listener.accept().unwrap();
    // One by one: frames that wait too long are dropped.
    writeln!(sender, "{line}").unwrap();
    driver.wait("a frame", |driver| driver.has("Decoded: 1"));
    writeln!(sender, "#!?").unwrap();
    driver.wait("the bad line", |driver| {
        driver.has("Bad: 1") && driver.says("Last: line 2")
    });
    writeln!(sender, "{line}").unwrap();
    driver.wait("both frames", |driver| driver.has("Decoded: 2"));
    assert_eq!(displayed(&driver).unwrap().1, by_library(&file, &frame_ohm));
    assert!(!driver.has("Live actual surface"), "the actual surface is unknown");
    driver.wait("silence", |driver| driver.has("No frame for two seconds"));
    assert!(driver.becomes_idle(), "nothing comes");
    drop(sender);
    driver.wait("the end", |driver| driver.says("The source has ended."));
    assert!(driver.is_enabled("▶ Start"));

    driver.click("▶ Start");
    drop(listener);
    driver.wait("the end of the source", |driver| driver.views().live.running.is_none());
}

#[test]
fn a_stream_that_has_ended_or_is_lost_is_connected_again_with_one_click() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = open(folder.path());
    let file = driver.kept(0);
    let (_, line) = at_rest(&file);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    driver.click_button("TCP");
    driver.enter("Address", &address.to_string());
    driver.click("▶ Start");
    let (mut sender, _) = listener.accept().unwrap();
    writeln!(sender, "{line}").unwrap();
    driver.wait("a frame", |driver| driver.has("Decoded: 1"));
    assert!(!driver.has("Try again"), "it has not ended");
    drop((sender, listener));
    driver.wait("the end", |driver| driver.says("The source has ended."));

    driver.click("Try again");
    driver.wait("the failure", |driver| driver.says("cannot connect"));
    let listener = TcpListener::bind(address).unwrap();
    driver.click("Try again");
    let (mut sender, _) = listener.accept().unwrap();
    assert!(!driver.says("cannot connect"), "the notice goes with the retry");
    writeln!(sender, "{line}").unwrap();
    driver.wait("a frame", |driver| driver.has("Decoded: 1"));
    drop(sender);
    driver.wait("the end", |driver| driver.has("Try again"));
    driver.enter("Address", "localhost:1");
    assert!(!driver.has("Try again"), "another source is not a retry");
}

#[test]
fn everything_fits_in_a_narrow_window() {
    let folder = tempfile::tempdir().unwrap();
    for size in [vec2(1440.0, 900.0), vec2(1024.0, 700.0), vec2(960.0, 640.0)] {
        let mut driver = open(&folder.path().join(format!("{}", size.x)));
        driver.harness().set_size(size);
        start(&mut driver);
        driver.harness().run_steps(3);
        let tools = ["Live", "Re-zero", "● Record", "▶ Start", "■ Stop"];
        let places = tools.map(|label| driver.harness().get(By::new().role(Role::Button).label(label)).rect());
        assert!(
            places.windows(2).all(|pair| pair[0].right() <= pair[1].left()),
            "{size}: {places:?}"
        );
        for label in ["Live decoupled surface", "Live actual surface", "Live readings"] {
            let rect = driver.get(label).rect();
            assert!(
                rect.right() <= size.x && rect.bottom() <= size.y,
                "{label} at {size}: {rect}"
            );
            assert!(
                rect.width() > 120.0 && rect.height() > 90.0,
                "{label} at {size}: {rect}"
            );
        }
    }
}

#[test]
fn a_network_of_a_recording_decodes_a_file_by_the_names_of_its_columns() {
    let folder = tempfile::tempdir().unwrap();
    let setup = with_epochs(&probe(folder.path()), 3);
    let mut driver = Driver::open_keeping(&folder.path().join("runs"));
    driver.take_recording(&setup);
    train(&mut driver, 1);
    driver.click_button("Live");
    assert!(
        !driver.has("Re-zero") && !driver.has("● Record"),
        "they need a sensor model"
    );
    assert!(!driver.has("Simulated") && !driver.is_enabled("▶ Start"));
    driver.click_button("Replay");
    // The same samples with their columns in another order.
    let text = fs::read_to_string(&setup.plan().unwrap().import.data).unwrap();
    let reordered = Vec::from_iter(text.lines().map(|line| {
        let cells = Vec::from_iter(line.split(','));
        format!("{},{}", cells[2], cells[1])
    }));
    let path = folder.path().join("live.csv");
    fs::write(&path, reordered.join("\n")).unwrap();
    driver.type_into("Frames", &path.display().to_string());
    driver.settle();
    driver.click("▶ Start");
    driver.wait("the first sample", |driver| driver.views().live.shown.targets.is_some());
    let targets = driver.views().live.shown.targets.as_ref().unwrap();
    let (time_s, values) = &targets.history[0];
    let first = Vec::from_iter(reordered[1].split(',').map(|cell| cell.parse::<f64>().unwrap()));
    let mut expected = [0.0; 2];
    let file = driver.kept(0);
    let mut compiled = file.network.decoder();
    compiled.decode_row(0, &[first[1], first[0]], &mut expected).unwrap();
    assert_eq!((*time_s, &values[..]), (0.0, &expected[..]));
    driver.wait("more of them", |driver| decoded(driver) > 5);
    for shown in ["Decoded values", "x (mm)", "y (mm)", "Outside training"] {
        assert!(driver.says(shown), "{shown}: {:#?}", driver.texts());
    }
    driver.click("■ Stop");
    let table = folder.path().join("values.csv");
    driver.save("Decoded values, CSV", &table);
    assert!(
        fs::read_to_string(table)
            .unwrap()
            .starts_with("time_s,x (mm),y (mm)\n0.0,")
    );
}
