//! Frames decoded as they arrive: from the simulated source, a recording, and a socket.

use std::{
    cell::RefCell,
    collections::BTreeMap,
    fs,
    io::Write,
    net::TcpListener,
    path::{Path, PathBuf},
};

use decoupler_core::{
    dataset::Seed,
    decoupling::Decoder,
    job::Job,
    scene::{Noise, Scene},
};
use decoupler_files::{
    export::NetworkFile,
    live::{Motion, Recorder, Recording, Simulated, Tally},
};
use eframe::egui::{Key, Modifiers, accesskit::Role};
use egui_kittest::kittest::{By, Queryable as _};
use glam::DVec3;

use crate::{
    driver::Driver,
    sources::{probe, with_epochs},
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
    driver.wait("the run in the list", |driver| driver.runs().len() == runs);
}

fn start(driver: &mut Driver) {
    driver.click("▶ Start");
    driver.wait("the first frame", |driver| driver.has("Live decoded surface"));
}

/// The number at the beginning of what a text says after `name`; 0 if there is no such text.
pub(crate) fn number(driver: &Driver, name: &str) -> f64 {
    let texts = driver.texts();
    let number = texts
        .iter()
        .find_map(|text| text.strip_prefix(name)?.split(' ').next()?.parse().ok());
    number.unwrap_or(0.0)
}

/// Waits until this many more frames are decoded.
fn wait_for_frames(driver: &mut Driver, more: f64) {
    let wanted = number(driver, "Decoded: ") + more;
    driver.wait("more frames", |driver| number(driver, "Decoded: ") >= wanted);
}

/// Waits until this many frames are recorded.
fn wait_for_recorded(driver: &mut Driver, frames: f64) {
    driver.wait("recorded frames", |driver| number(driver, "● Recording: ") >= frames);
}

/// Time and nodes of the displayed frame.
fn displayed(driver: &Driver) -> Option<(f64, Vec<DVec3>)> {
    let answer = driver.views().live.shown.answer.as_ref()?;
    Some((answer.time_s, answer.surfaces[0].nodes.to_vec()))
}

/// Records frames of the array at 50 per second, with the fault that the wires have at each.
fn record(path: &Path, file: &NetworkFile, motion: Motion, faults: impl IntoIterator<Item = Option<&'static str>>) {
    let simulation = *file.settings.simulation().unwrap();
    let scene = Scene {
        noise: Noise::relative(1e-5),
        ..simulation.scene
    };
    let mut source = Simulated::new(&simulation.sensor, &scene, Seed(0), 50.0).unwrap();
    source.motion = motion;
    let columns = simulation.sensor.scale.columns();
    let mut recorder = Recorder::new(fs::File::create(path).unwrap(), source.rows(), columns).unwrap();
    let mut ohm = vec![0.0; source.readings()];
    for fault in faults {
        source.set_fault(fault.map(|text| text.parse().unwrap())).unwrap();
        let time_s = source.next_frame(&mut ohm).unwrap();
        recorder.record(time_s, &ohm).unwrap();
    }
}

/// Replays a file.
fn replay(driver: &mut Driver, path: &Path) {
    driver.click_button("Replay");
    driver.type_into("File to replay", &path.display().to_string());
    driver.settle();
    start(driver);
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
fn the_newest_network_decodes_a_simulated_array() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.click_button("Live");
    assert!(driver.says("needs a trained network") && !driver.is_enabled("▶ Start"));
    driver.click_button("Train");
    train(&mut driver, 1);
    driver.click_button("Live");
    driver.enter("Relative noise", "0");
    driver.click("▶ Start");
    driver.wait("surfaces and readings", |driver| {
        ["Live decoded surface", "Live actual surface", "Live readings"]
            .iter()
            .all(|label| driver.has(label))
    });
    wait_for_frames(&mut driver, 3.0);

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
    let shown = &driver.views().live.shown;
    let actual = &shown.answer.as_ref().unwrap().surfaces[1];
    let truth = (0..10).flat_map(|row| source.deformation().row_mm(row).to_vec());
    assert!(actual.nodes.iter().zip(truth).all(|(node, u)| node.z == 5.0 - u.z));

    driver.click("■ Stop");
    assert!(
        driver.becomes_idle() && driver.has("Live decoded surface"),
        "the last frame stays"
    );
    assert!(driver.says("Stopped after") && driver.is_enabled("▶ Start"));
}

#[test]
fn a_broken_wire_is_reported_left_out_and_cleared_once_it_is_repaired() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = open(folder.path());
    let path = folder.path().join("broken.csv");
    let faults = (0..150).map(|frame| (frame >= 100).then_some("open-column:7"));
    record(&path, &driver.kept(0), Motion::Wandering, faults);
    replay(&mut driver, &path);
    assert!(driver.has("Fault: none"));
    driver.wait("the name of the wire", |driver| driver.has("Fault: column-wire 7"));
    assert!(driver.says("Column-wire 7: open") && driver.says("Its readings are left out"));
    driver.wait("the end", |driver| driver.has("▶ Play"));
    let residual_percent = number(&driver, "Residual of Eq. (2): ");
    assert!(
        residual_percent < 0.5,
        "{residual_percent}: the broken wire's readings do not count"
    );
    driver.click("▶ Play");
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
    let path = folder.path().join("drift.csv");
    record(&path, &driver.kept(0), Motion::Lifted, [Some("gain:3=0.05"); 250]);
    replay(&mut driver, &path);
    driver.wait("the drift", |driver| driver.has("Fault: column-wire 3"));
    wait_for_frames(&mut driver, 30.0);
    driver.click_button("Re-zero");
    driver.wait("the gains", |driver| driver.has("Rows in contact: 0 of 10"));
    let texts = driver.texts();
    let gains = texts.iter().find_map(|text| text.strip_prefix("Gains: ")).unwrap();
    for (gain, expected) in gains.split(" to ").zip([1.0, 1.05]) {
        assert!((gain.parse::<f64>().unwrap() / expected - 1.0).abs() < 2e-3, "{gains}");
    }
    if driver.has("▶ Play") {
        driver.click("▶ Play");
    }
    driver.wait("readings without a fault", |driver| driver.has("Fault: none"));
    driver.click("Clear zero");
    driver.wait("the end of the zero", |driver| !driver.says("Rows in contact"));
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
        number(driver, "● Recording: ") >= 40.0
    });
    driver.press_with(Modifiers::COMMAND, Key::R);
    driver.wait("its end", |driver| driver.says("Recorded "));
    let recording = read(&recordings(folder.path())[0], &driver.kept(1));

    driver.click("Replay recording");
    let ended = |driver: &Driver| driver.has("Replay ended: press Play to see it again");
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

    driver.click("4×");
    driver.get("Replay position").set_value_accesskit(0.0);
    driver.harness().run_steps(2);
    driver.wait("the first frame", |driver| driver.says("0.00 of "));
    assert_eq!(check(&driver, 1).0, 0);
    let [name, other] = [0, 1].map(|run: usize| driver.runs()[run].name.clone());
    driver.click("Decode with");
    driver.type_into("Search runs", &name.to_uppercase());
    assert!(!driver.has(&other), "it is not among those that were searched");
    driver.click(&name);
    driver.wait("the other network's answer", |driver| {
        driver.says(&format!("{name}, '")) && driver.has("Decoded: 1")
    });
    assert_eq!(check(&driver, 0).0, 0);
    driver.click("■ Stop");
    driver.settle();
    assert!(driver.has("Live decoded surface"));
    pick(&mut driver, "Decode with", &format!("Newest run: {other}"));
    driver.settle();
    assert!(!driver.has("Live decoded surface"), "it is of another network");
    let copy = folder.path().join("copy.csv");
    driver.save("Recording, CSV", &copy);
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
    let run = driver.runs()[0].clone();
    assert_eq!(run.file, None, "it is only in its file");
    let damaged = folder.path().join("runs").join(format!("run-{}.json", run.id));
    fs::write(&damaged, "{").unwrap();
    driver.click_button("Live");
    pick(&mut driver, "Decode with", &run.name);
    driver.wait("the reason", |driver| driver.says("is cut off"));
    driver.click("▶ Start");
    let newest = driver.state().runs.newest().unwrap().name.to_owned();
    driver.wait("the newest network", |driver| {
        driver.says(&format!("{newest}, the simulated source"))
    });
    assert_eq!(fs::read_to_string(&damaged).unwrap(), "{");
}

#[test]
fn closing_the_window_while_it_records_ends_at_once_and_loses_no_frame() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = open(folder.path());
    start(&mut driver);
    driver.click("● Record");
    wait_for_recorded(&mut driver, 5.0);
    assert!(driver.close());
    let frames = driver.views().live.shown.recorded.as_ref().unwrap().frames;
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
    driver.click("■ Stop");
    drop((sender, listener));
    driver.click("▶ Start");
    driver.wait("the failure", |driver| driver.says("cannot connect"));
    assert!(
        driver.is_enabled("▶ Start"),
        "a source that never sent is not tried again"
    );
}

#[test]
fn a_lost_connection_is_a_warning_and_is_tried_again() {
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
    driver.click("● Record");
    driver.wait("the recording", |driver| driver.says("● Recording: 0 frames"));
    writeln!(sender, "{line}").unwrap();
    wait_for_recorded(&mut driver, 1.0);
    drop((sender, listener));
    driver.wait("the warning", |driver| driver.says("Connection lost"));
    driver.wait("an attempt", |driver| driver.says("cannot connect"));
    assert!(driver.has("Live decoded surface") && driver.is_enabled("■ Stop"));

    let listener = TcpListener::bind(address).unwrap();
    let (mut sender, _) = listener.accept().unwrap();
    writeln!(sender, "{line}").unwrap();
    wait_for_recorded(&mut driver, 2.0);
    assert!(driver.has("Decoded: 3") && !driver.says("Connection lost"));
    driver.click("■ Stop");
    driver.settle();
    let recording = read(&recordings(folder.path())[0], &file);
    let [first_s, second_s] = recording.times_s().try_into().unwrap();
    assert!(second_s - first_s >= 1.0, "the time that was lost is a gap");
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
    driver.type_into("File to replay", &path.display().to_string());
    driver.settle();
    driver.click("▶ Start");
    driver.wait("the first sample", |driver| driver.says("Outside training"));
    let shown = &driver.views().live.shown;
    let (time_s, values) = &shown.answer.as_ref().unwrap().history.all()[0];
    let first = Vec::from_iter(reordered[1].split(',').map(|cell| cell.parse::<f64>().unwrap()));
    let mut expected = [0.0; 2];
    let file = driver.kept(0);
    let mut compiled = file.network.decoder();
    compiled.decode_row(0, &[first[1], first[0]], &mut expected).unwrap();
    assert_eq!((*time_s, &values[..]), (0.0, &expected[..]));
    driver.wait("more of them", |driver| number(driver, "Decoded: ") > 5.0);
    for shown in ["x (mm)", "y (mm)", "Outside training"] {
        driver.assert_says(shown);
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
