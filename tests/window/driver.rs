//! The window without a display, operated through its labels.

use std::{
    cell::RefCell,
    path::Path,
    rc::Rc,
    sync::{
        Arc,
        mpsc::{Receiver, channel},
    },
    time::{Duration, Instant},
};

use decoupler::window::{DecouplerWindow, Desktop, Notice, Shared, SourceKind, Views, WindowFile};
use decoupler_core::{
    dataset::Simulation,
    evaluation::{ErrorTable, Run, RunSettings},
};
use decoupler_files::{
    export::{KeptRun, NetworkFile, format_number},
    import::Plan,
};
use eframe::egui::{
    Context, Key, Modifiers, OutputCommand, Rect, Ui, UiBuilder, Vec2, ViewportCommand, ViewportEvent, ViewportId,
    accesskit::Role, vec2,
};
use egui_kittest::{
    Harness, Node,
    kittest::{By, NodeT as _, Queryable as _},
};

use crate::rasterise::Rasteriser;

/// The limit of every wait, for hangs alone: a busy machine may take long.
pub(crate) const PATIENCE: Duration = Duration::from_secs(600);

/// Parts of the configuration that are folded away at first.
const FOLDED: [&str; 6] = [
    "Scene",
    "Other noise",
    "Samples",
    "Advanced",
    "Stopping and method",
    "Geometry",
];

/// Label of the button that closes a notice.
const DISMISS: &str = "Dismiss";

/// Number of frames until scrolling has finished.
const SCROLLING: usize = 5;

/// Number of frames after which a window that still asks for more counts as never idle.
const MAX_FRAMES: u64 = 100;

/// The window with simulated input.
pub(crate) struct Driver {
    harness: Harness<'static, Option<DecouplerWindow>>,
    /// The delay of each frame that the window asked for.
    asked: Receiver<Duration>,
}

impl Driver {
    /// Opens the window at its default size.
    pub(crate) fn open() -> Self {
        Self::open_sized(vec2(1440.0, 900.0))
    }

    /// Opens the window of `size` points on the paper's scene, with the first surface drawn and everything unfolded.
    pub(crate) fn open_sized(size: Vec2) -> Self {
        Self::open_as(size, None, |window| window).on_the_papers_scene()
    }

    /// Opens the window of `size` points as for the first time.
    pub(crate) fn open_first(size: Vec2) -> Self {
        Self::open_as(size, None, |window| window)
    }

    /// Opens the window on the paper's scene, with its runs kept at `path`.
    pub(crate) fn open_keeping(path: &Path) -> Self {
        let path = path.to_owned();
        Self::open_as(vec2(1440.0, 900.0), None, |window| window.keeping_runs(path)).on_the_papers_scene()
    }

    /// Opens the window on the paper's scene, with running trainings saved in `folder` as often as possible.
    pub(crate) fn open_keeping_trainings(folder: &Path) -> Self {
        let folder = folder.to_owned();
        let keeping = |window: DecouplerWindow| window.keeping_trainings(folder, Duration::ZERO);
        Self::open_as(vec2(1440.0, 900.0), None, keeping).on_the_papers_scene()
    }

    /// Opens the window with its state remembered in a file.
    pub(crate) fn open_remembering(path: &Path) -> Self {
        let file = WindowFile::read(path.to_owned());
        let mut driver = Self::open_as(vec2(1440.0, 900.0), Some(file), |window| window);
        if driver.shown() == "Train" && driver.state().source == SourceKind::Array {
            driver.unfold();
        }
        driver
    }

    /// Opens the window with its state remembered in a file, and its runs kept in a folder.
    pub(crate) fn open_again(file: &Path, runs: &Path) -> Self {
        let (file, runs) = (WindowFile::read(file.to_owned()), runs.to_owned());
        let keeping = |window: DecouplerWindow| window.keeping_runs(runs);
        let mut driver = Self::open_as(vec2(1440.0, 900.0), Some(file), keeping);
        driver.unfold();
        driver
    }

    fn open_as(
        size: Vec2,
        file: Option<WindowFile>,
        set_out: impl FnOnce(DecouplerWindow) -> DecouplerWindow + 'static,
    ) -> Self {
        let made: Rc<RefCell<Option<DecouplerWindow>>> = Rc::default();
        let place = Rc::clone(&made);
        let (asks, asked) = channel();
        // Before the first frame, as in the real window, so that its fonts are available.
        let set_up = move |ctx: &Context| {
            // At the end of a test the window outlives the driver.
            ctx.set_request_repaint_callback(move |info| {
                let _ = asks.send(info.delay);
            });
            let window = DecouplerWindow::new(ctx, Desktop::None, file);
            *place.borrow_mut() = Some(set_out(window));
        };
        let frame = move |ui: &mut Ui, window: &mut Option<DecouplerWindow>| {
            let window = window.get_or_insert_with(|| made.take().unwrap());
            window.take_events();
            // The harness leaves a margin, which a real window does not have.
            let whole = ui.content_rect();
            let mut root = ui.new_child(UiBuilder::new().max_rect(whole));
            root.set_clip_rect(whole);
            window.show_ui(&mut root);
        };
        let builder = Harness::builder().with_size(size).with_context_setup(set_up);
        let builder = builder.renderer(Rasteriser::default()).with_render_cursor(false);
        // Events of running threads may ask for some more frames.
        let builder = builder.with_max_steps(MAX_FRAMES);
        let harness = builder.build_ui_state(frame, None);
        let mut driver = Self { harness, asked };
        driver.wait("the first surface", |driver| {
            driver.state().test().is_some() || driver.state().source == SourceKind::Recording
        });
        driver
    }

    fn on_the_papers_scene(mut self) -> Self {
        self.unfold();
        self.choose_papers_scene();
        self
    }

    /// Chooses the paper's scene and waits for its surface.
    pub(crate) fn choose_papers_scene(&mut self) {
        self.choose("Preset", "Paper");
        self.get("Hidden nodes").scroll_to_me();
        self.wait("the paper's surface", |driver| {
            let preview = driver.state().preview.as_ref();
            preview.is_some_and(|preview| {
                preview.settings.simulation().unwrap().scene == driver.state().draft.simulation().unwrap().scene
            })
        });
    }

    /// Unfolds every part of the configuration.
    fn unfold(&mut self) {
        for name in FOLDED {
            self.click(name);
        }
        self.get("Hidden nodes").scroll_to_me();
        self.harness.run_steps(SCROLLING);
    }

    /// Returns the shared state of the window.
    pub(crate) fn state(&self) -> &Shared {
        self.window().shared()
    }

    /// Returns the simulated array of the next training.
    pub(crate) fn simulation(&self) -> Simulation {
        *self.state().draft.simulation().unwrap()
    }

    /// Returns the import of the next training.
    pub(crate) fn plan(&self) -> Plan {
        self.state().setup().unwrap().plan().unwrap().clone()
    }

    /// Returns the list of runs.
    pub(crate) fn runs(&self) -> &[KeptRun] {
        &self.state().runs.workspace.runs
    }

    /// Returns a run of the list, from memory or its file.
    pub(crate) fn kept(&self, index: usize) -> Arc<NetworkFile> {
        let runs = &self.state().runs;
        let folder = runs.path.as_deref().unwrap_or(Path::new(""));
        runs.workspace.runs[index].load(folder).unwrap()
    }

    /// Returns the views with their private state.
    pub(crate) fn views(&self) -> &Views {
        self.window().views()
    }

    /// Returns the displayed notice.
    pub(crate) fn notice(&self) -> Option<&Notice> {
        self.window().notice()
    }

    /// Returns the name of the current view.
    pub(crate) fn shown(&self) -> &'static str {
        self.window().shown()
    }

    fn window(&self) -> &DecouplerWindow {
        self.harness.state().as_ref().unwrap()
    }

    /// Returns the window itself, for actions that no user could do fast enough.
    pub(crate) fn window_mut(&mut self) -> &mut DecouplerWindow {
        self.harness.state_mut().as_mut().unwrap()
    }

    /// Returns the harness, for everything without a method here.
    pub(crate) fn harness(&mut self) -> &mut Harness<'static, Option<DecouplerWindow>> {
        &mut self.harness
    }

    /// Draws the frames that the window asks for until `holds`.
    #[track_caller]
    pub(crate) fn wait(&mut self, what: &str, holds: impl Fn(&Self) -> bool) {
        let latest = Instant::now() + PATIENCE;
        loop {
            if holds(self) {
                // The results of the last frame are drawn in the next one.
                self.harness.step();
                return;
            }
            assert!(
                Instant::now() < latest,
                "{what} never came; the window shows {:#?}",
                self.texts()
            );
            self.wait_for_frame(what);
        }
    }

    /// Draws the next frame that the window asks for.
    #[track_caller]
    pub(crate) fn wait_for_frame(&mut self, what: &str) {
        if self.asked.recv_timeout(PATIENCE).is_err() {
            panic!("{what} never came; the window shows {:#?}", self.texts());
        }
        // One frame answers all earlier requests.
        self.asked.try_iter().for_each(drop);
        self.harness.step();
    }

    /// Returns true if the window becomes idle, that is, asks for no more frames. A thread with events may ask for one
    /// meanwhile; a busy window asks in every frame.
    pub(crate) fn becomes_idle(&mut self) -> bool {
        const MAX_EVENTS: usize = 20;
        self.harness.run();
        (0..MAX_EVENTS).any(|_| {
            self.asked.try_iter().for_each(drop);
            self.harness.step();
            self.asked.try_iter().next().is_none()
        })
    }

    /// Draws frames until the window asks for none. Panics if it never stops asking.
    #[track_caller]
    pub(crate) fn settle(&mut self) {
        self.harness.run();
    }

    /// Returns the node with this label.
    #[track_caller]
    pub(crate) fn get<'a>(&'a self, label: &'a str) -> Node<'a> {
        self.harness.get_by_label(label)
    }

    /// Returns true if a node has exactly this label.
    pub(crate) fn has(&self, label: &str) -> bool {
        self.harness.query_all_by_label(label).next().is_some()
    }

    /// Returns true if any text contains this.
    pub(crate) fn says(&self, text: &str) -> bool {
        self.texts().iter().any(|shown| shown.contains(text))
    }

    /// Asserts that a node has exactly this label.
    #[track_caller]
    pub(crate) fn assert_has(&self, label: &str) {
        assert!(self.has(label), "{label} is not among {:#?}", self.texts());
    }

    /// Asserts that a text contains this.
    #[track_caller]
    pub(crate) fn assert_says(&self, text: &str) {
        assert!(self.says(text), "{text} is in none of {:#?}", self.texts());
    }

    /// Returns true if the control with this label is enabled.
    #[track_caller]
    pub(crate) fn is_enabled(&self, label: &str) -> bool {
        !self.get(label).accesskit_node().is_disabled()
    }

    /// Returns every label and value, as read by assistive technology.
    pub(crate) fn texts(&self) -> Vec<String> {
        let nodes = self.harness.root().children_recursive();
        let texts = nodes.flat_map(|node| {
            let node = node.accesskit_node();
            [node.label(), node.value()].into_iter().flatten().collect::<Vec<_>>()
        });
        texts.collect()
    }

    /// Returns the label and place of every control and text.
    pub(crate) fn places(&self) -> Vec<(String, Rect)> {
        let nodes = self.harness.root().children_recursive();
        let named = nodes.filter_map(|node| {
            let inner = node.accesskit_node();
            inner.bounding_box()?;
            let text = inner.label().or(inner.value())?;
            Some((text, node.rect()))
        });
        named.collect()
    }

    /// Clicks the node with this label after scrolling to it.
    #[track_caller]
    pub(crate) fn click(&mut self, label: &str) {
        self.click_by(&By::new().label(label));
    }

    /// Clicks the button with this label, where a text has the same label.
    #[track_caller]
    pub(crate) fn click_button(&mut self, label: &str) {
        self.click_by(&By::new().role(Role::Button).label(label));
    }

    /// Picks an option of a list, the leftmost button with its label, which in the Train view is the one of the
    /// configuration. The list is clicked until it is open: events from the worker may move it away from the pointer.
    #[track_caller]
    pub(crate) fn choose(&mut self, list: &str, option: &str) {
        let by = By::new().role(Role::Button).label(option);
        let closed = self.harness.query_all(by.clone()).count();
        for _ in 0..5 {
            self.click(list);
            let options = self.harness.query_all(by.clone());
            if options.count() > closed {
                break;
            }
        }
        let options = self.harness.get_all(by);
        let leftmost = options.min_by(|one, other| one.rect().left().total_cmp(&other.rect().left()));
        leftmost.expect("`get_all` returns at least one").click();
        self.harness.run_steps(2);
        self.harness.remove_cursor();
        self.harness.step();
    }

    /// Shows a chart of the Train view: a tab, or one of the list next to the tabs.
    #[track_caller]
    pub(crate) fn show_chart(&mut self, name: &str) {
        let tab = By::new().role(Role::Tab).label(name);
        let is_tab = self.harness.query_all(tab).next().is_some();
        match is_tab {
            true => self.click(name),
            false => self.choose("More charts", name),
        }
    }

    #[track_caller]
    fn click_by(&mut self, by: &By<'_>) {
        self.harness.get(by.clone()).scroll_to_me();
        self.harness.run_steps(SCROLLING);
        self.harness.get(by.clone()).click();
        self.harness.run_steps(2);
        self.harness.remove_cursor();
        self.harness.step();
    }

    /// Clicks the button that asks for a path until the form is open: events from the worker may move the button away
    /// from the pointer.
    #[track_caller]
    pub(crate) fn open_form(&mut self, button: &str) {
        for _ in 0..5 {
            self.click(button);
            self.harness.run_steps(SCROLLING);
            if self.has("File") {
                return;
            }
        }
        panic!("no form came; the window shows {:#?}", self.texts());
    }

    /// Opens the Export menu. It stays open while others read it.
    #[track_caller]
    pub(crate) fn open_menu(&mut self) {
        if !self.has("Figure…") {
            self.click_button("Export");
            self.harness.run_steps(2);
        }
    }

    /// Chooses an export in its dialog: "Error table, CSV", "ONNX, f32", "A: Report, HTML", "Recipe, JSON".
    #[track_caller]
    pub(crate) fn choose_export(&mut self, name: &str) {
        let (thing, form) = name.rsplit_once(", ").unwrap_or_else(|| panic!("{name} has no form"));
        let (letter, thing) = thing
            .split_once(": ")
            .map_or(("", thing), |(letter, thing)| (letter, thing));
        let (line, title, choices) = match (thing, form) {
            ("Report", "HTML") => ("Report…", "Export report", vec![("Report", letter)]),
            (thing, "f64" | "f32" | "fixed16") => {
                let choices = vec![("Network", letter), ("Format", thing), ("Precision", form)];
                ("Network…", "Export network", choices)
            }
            (thing, _) if thing.starts_with("Network file") => {
                let past = thing.split_once(" of ").map_or("", |_| "Displayed network");
                let network = if letter.is_empty() { past } else { letter };
                let choices = vec![("Network", network), ("Format", "Network file")];
                ("Network…", "Export network", choices)
            }
            (thing, "SVG" | "PNG" | "Copy") => ("Figure…", "Export figure", vec![("Figure", thing), ("Format", form)]),
            (thing, form) => ("Data…", "Export data", vec![("Data", thing), ("Format", form)]),
        };
        self.open_menu();
        self.click_button(line);
        self.harness.run_steps(SCROLLING);
        if self.has(title) {
            choices
                .into_iter()
                .for_each(|(list, option)| self.choose_in_dialog(list, option));
        }
    }

    /// Chooses the option that begins with this text, if the dialog has the list.
    #[track_caller]
    pub(crate) fn choose_in_dialog(&mut self, list: &str, option: &str) {
        let by = By::new().role(Role::ComboBox).label(list);
        let lists: Vec<_> = self.harness.query_all(by).collect();
        let Some(list) = lists.first().filter(|_| !option.is_empty()) else {
            return;
        };
        list.click();
        self.harness.run_steps(SCROLLING);
        let begins = |node: &Node<'_>| {
            node.accesskit_node()
                .label()
                .is_some_and(|label| label.starts_with(option))
        };
        let options: Vec<_> = self
            .harness
            .query_all(By::new().role(Role::Button))
            .filter(begins)
            .collect();
        let newest = options.last();
        newest
            .unwrap_or_else(|| panic!("no {option} among {:#?}", self.texts()))
            .click();
        self.harness.run_steps(SCROLLING);
    }

    /// Asks for an export until the form for its path is open: events may move the items of the menu away from the pointer.
    #[track_caller]
    pub(crate) fn export(&mut self, name: &str) {
        for _ in 0..5 {
            match name.strip_suffix('…') {
                Some(_) => self.click_button(name),
                None => self.choose_export(name),
            }
            if self.has("Save…") {
                self.click_button("Save…");
            }
            self.harness.run_steps(SCROLLING);
            if self.has("File") {
                return;
            }
            self.press(Key::Escape);
        }
        panic!("no form came; the window shows {:#?}", self.texts());
    }

    /// Copies a thing in this form: "Error table, Copy as Markdown". Returns the text on the clipboard.
    #[track_caller]
    pub(crate) fn copy(&mut self, name: &str) -> String {
        self.choose_export(name);
        self.click_and_copy("Copy")
    }

    /// Types `path` into the form of the export of this name and saves; waits for the answer.
    #[track_caller]
    pub(crate) fn save(&mut self, name: &str, path: &Path) {
        // A notice about an earlier file is not the answer.
        for _ in 0..5 {
            let buttons = self.harness.query_all_by_label(DISMISS);
            let Some(newest) = buttons.last() else { break };
            newest.click();
            self.harness.run_steps(2);
        }
        self.export(name);
        self.type_into("File", &path.display().to_string());
        self.click_button("Save");
        self.wait("the answer", |driver| driver.notice().is_some());
        self.settle();
    }

    /// Replaces the contents of the field with this label by `text`, and confirms with Enter.
    #[track_caller]
    pub(crate) fn enter(&mut self, label: &str, text: &str) {
        self.type_into(label, text);
        self.harness.key_press(Key::Enter);
        self.harness.run_steps(3);
    }

    /// Replaces the contents of the field with this label by `text`.
    #[track_caller]
    pub(crate) fn type_into(&mut self, label: &str, text: &str) {
        self.get(label).scroll_to_me();
        self.harness.run_steps(SCROLLING);
        self.get(label).focus();
        self.harness.run_steps(2);
        self.press_with(Modifiers::COMMAND, Key::A);
        self.harness.event(eframe::egui::Event::Text(text.to_owned()));
        self.harness.run_steps(2);
    }

    /// Clicks the node with this label with the secondary button.
    #[track_caller]
    pub(crate) fn right_click(&mut self, label: &str) {
        self.get(label).scroll_to_me();
        self.harness.run_steps(SCROLLING);
        self.get(label).click_secondary();
        self.harness.run_steps(3);
    }

    /// Clicks the button with this label. Returns the text that it put on the clipboard.
    #[track_caller]
    pub(crate) fn click_and_copy(&mut self, label: &str) -> String {
        self.get(label).click();
        self.harness.step();
        // It is copied in the background.
        loop {
            let commands = &self.harness.output().platform_output.commands;
            let copied = commands.iter().find_map(|command| match command {
                OutputCommand::CopyText(text) => Some(text.clone()),
                _ => None,
            });
            if let Some(text) = copied {
                self.harness.run_steps(2);
                return text;
            }
            self.wait_for_frame("the copied text");
        }
    }

    /// Presses a key.
    pub(crate) fn press(&mut self, key: Key) {
        self.press_with(Modifiers::NONE, key);
    }

    /// Presses a key with others held.
    pub(crate) fn press_with(&mut self, modifiers: Modifiers, key: Key) {
        self.harness.key_press_modifiers(modifiers, key);
        self.harness.run_steps(2);
    }

    /// Runs the action of this name through the list of all actions.
    pub(crate) fn act(&mut self, action: &str) {
        self.press_with(Modifiers::COMMAND, Key::K);
        self.type_into("Action", action);
        self.press(Key::Enter);
        self.settle();
    }

    /// Configures a small network on the smallest array of the paper, which is trained quickly.
    pub(crate) fn configure_small(&mut self) {
        self.choose("Preset", "Paper");
        self.choose("Paper's array", "10×6_3×18");
        self.enter("Hidden nodes", "6");
        self.enter("Training samples", "200");
        self.enter("Epochs", "15");
        let (small, wanted) = (self.state().draft, small());
        assert_eq!(small, wanted, "typing the settings gives the settings");
        self.wait("the small array's surface", |driver| {
            driver
                .state()
                .skin()
                .is_some_and(|skin| skin.sensor == wanted.simulation().unwrap().sensor)
        });
    }

    /// Returns true if the window sent this command in the last frame.
    pub(crate) fn sent(&self, command: &ViewportCommand) -> bool {
        let output = self.harness.output();
        output.viewport_output[&ViewportId::ROOT].commands.contains(command)
    }

    /// Clicks the button of the title bar; returns whether the window closes at once.
    pub(crate) fn close(&mut self) -> bool {
        let input = self.harness.input_mut();
        let events = &mut input.viewports.get_mut(&ViewportId::ROOT).unwrap().events;
        events.push(ViewportEvent::Close);
        self.harness.step();
        !self.sent(&ViewportCommand::CancelClose)
    }

    /// Waits until the window closes by itself.
    #[track_caller]
    pub(crate) fn wait_for_closing(&mut self) {
        while !self.sent(&ViewportCommand::Close) {
            self.wait_for_frame("closing");
        }
        assert!(self.close(), "the close that the window asked for is let through");
    }

    /// Presses Train and waits for the end.
    #[track_caller]
    pub(crate) fn train(&mut self) {
        self.click("▶ Train");
        self.wait_for_end();
    }

    /// Waits for the end of the training.
    #[track_caller]
    pub(crate) fn wait_for_end(&mut self) {
        self.wait("the end of the training", Self::has_ended);
    }

    /// Returns true once the training has ended, for whatever reason.
    pub(crate) fn has_ended(&self) -> bool {
        ["Finished: ", "Stopped at epoch ", "Ended: "]
            .into_iter()
            .any(|ended| self.says(ended))
    }

    /// Returns the displayed snapshot of the test set, counted from 0.
    #[track_caller]
    pub(crate) fn snapshot(&self) -> usize {
        let labels = ["Test snapshot", "Test sample"].into_iter();
        let mut nodes = labels.flat_map(|label| self.harness.query_all_by_label(label));
        let shown = nodes.find_map(|node| node.accesskit_node().numeric_value());
        shown.expect("it is displayed") as usize - 1
    }

    /// Unfolds the details of the result.
    #[track_caller]
    pub(crate) fn details(&mut self) {
        if !self.has("COST") {
            self.click("Details");
            self.settle();
        }
    }

    /// Waits until the ended training is among the kept runs: its folder is written in the background.
    #[track_caller]
    pub(crate) fn wait_for_kept_run(&mut self) {
        self.wait("the kept run", |driver| !driver.state().runs.workspace.runs.is_empty());
    }

    /// Waits until the paused or ended training shows its last epoch: the time per frame is measured only then.
    #[track_caller]
    pub(crate) fn wait_for_last_epoch(&mut self) {
        self.wait("the last epoch", |driver| {
            let result = driver.state().result();
            result.is_some_and(|result| result.frame_time.is_some())
        });
    }

    /// Waits until this many more epochs are shown.
    #[track_caller]
    pub(crate) fn wait_for_epochs(&mut self, more: usize) {
        let wanted = self.epochs() + more;
        self.wait("more epochs", |driver| driver.epochs() >= wanted);
    }

    /// Returns the epochs of the current training.
    pub(crate) fn epochs(&self) -> usize {
        let latest = self.state().run.as_ref().and_then(|run| run.latest());
        latest.map_or(0, |latest| latest.epoch)
    }

    /// Returns the cells of the displayed error table: `network, Z %: 2.28`.
    pub(crate) fn table(&self) -> Vec<String> {
        let is_cell = |text: &String| ROWS.iter().any(|row| text.starts_with(&format!("{row}, ")));
        self.texts().into_iter().filter(is_cell).collect()
    }
}

const ROWS: [&str; 5] = ["training mean", "linear map", "network", "model-based", "published"];

/// Returns the settings of [`Driver::configure_small`].
pub(crate) fn small() -> RunSettings {
    let mut settings = RunSettings {
        source: Simulation {
            samples: 200,
            ..Simulation::default()
        }
        .into(),
        hidden: 6,
        ..RunSettings::default()
    };
    settings.simulation_mut().unwrap().sensor.scale = "10×6_3×18".parse().unwrap();
    settings.training.stopping.epochs = 15;
    settings
}

/// Returns the run of the library with `settings`, trained to the end.
pub(crate) fn trained(settings: RunSettings) -> Run {
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    run
}

/// Returns the error table computed by the library for `run`, formatted as in the window.
pub(crate) fn table_of(run: &Run) -> Vec<String> {
    let columns = ["Z %", "X %", "Y %", "mm", "stroke %"];
    let tables = ErrorTable::of_scores(run.problem(), &run.scores().unwrap(), None);
    // Coordinates that do not vary have no column.
    let is_shown = |place: usize| place == 0 || tables[0].rows.iter().any(|row| row.errors[place] >= Some(1e-3));
    let cells = tables[0].rows.iter().flat_map(|row| {
        let named = columns.iter().zip(&row.errors).enumerate();
        let named = named.filter(|(place, _)| is_shown(*place)).map(|(_, named)| named);
        named.map(|(column, value)| format!("{}, {column}: {}", row.name, format_number(*value)))
    });
    cells.collect()
}
