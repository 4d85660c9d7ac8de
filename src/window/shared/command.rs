//! Everything that the user can do by a key or by name.

use decoupler_files::figure::SequentialMap;
use eframe::egui::{Context, Key, KeyboardShortcut, Modifiers, Ui, Widget, WidgetInfo, accesskit::Role};

use super::{Effect, Phase, Shared, ViewKind};
use crate::window::widgets::neighbours;

/// Something that the user can do by a key, or by picking it from the list of all commands.
#[derive(Clone, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "`about` has the name and the explanation of each")]
pub enum Command {
    // Of the Train view.
    Train,
    TrainLonger,
    PauseTraining,
    StopTraining,
    OpenFiles,
    DecodeFile,
    PressMiddle,
    NextSample,
    PreviousSample,
    Chart(&'static str),
    NextSection,
    PreviousSection,
    TurnSection,
    // Of other views, which name their work: "Run experiment".
    Begin(&'static str),
    Cancel(&'static str),
    Record,
    ReZero,
    PlayReplay,
    // Of the window.
    Export(String),
    Undo,
    Redo,
    Show(ViewKind),
    Dark,
    Light,
    Colours(SequentialMap),
    Larger,
    Smaller,
    UsualSize,
    Form,
    Search,
    Keys,
    Glossary,
    About,
}

/// Name, keys and explanation of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct About {
    /// Its name, a verb first.
    pub name: String,
    /// Its keyboard shortcut.
    pub keys: Option<KeyboardShortcut>,
    /// What it does, if its name does not say it; other words by which it is found.
    pub hint: &'static str,
}

impl Command {
    /// Returns its name, keys and explanation.
    pub fn about(&self) -> About {
        let plain = |key| Some(KeyboardShortcut::new(Modifiers::NONE, key));
        let ctrl = |key| Some(KeyboardShortcut::new(Modifiers::COMMAND, key));
        let shift = Modifiers::COMMAND | Modifiers::SHIFT;
        let (name, keys, hint) = match self {
            Self::Train => (
                "Train",
                ctrl(Key::Enter),
                "Start training a network from random weights.",
            ),
            Self::TrainLonger => (
                "Train longer",
                None,
                "Continue from the current weights with the method and the epochs on the left, counted from here.",
            ),
            Self::PauseTraining => ("Pause or resume training", ctrl(Key::P), ""),
            Self::StopTraining => ("Stop training", ctrl(Key::Period), "End it and keep the best network."),
            Self::OpenFiles => ("Open files", None, "A recording, recipe, network or checkpoint."),
            Self::DecodeFile => ("Decode file", None, "Decodes all samples of another file, to CSV."),
            Self::PressMiddle => ("Press the middle of the surface", None, "Touch the sensor."),
            Self::NextSample => ("Next test sample", plain(Key::PageDown), ""),
            Self::PreviousSample => ("Previous test sample", plain(Key::PageUp), ""),
            Self::Chart(name) => (*name, None, "Show this chart."),
            Self::NextSection => ("Next section", plain(Key::CloseBracket), ""),
            Self::PreviousSection => ("Previous section", plain(Key::OpenBracket), ""),
            Self::TurnSection => ("Section along the other wire", plain(Key::Backslash), ""),
            Self::Begin(name) => (*name, ctrl(Key::Enter), "Start."),
            Self::Cancel(name) => (*name, ctrl(Key::Period), "Stop; what has finished is kept."),
            Self::Record => ("Start or end recording", ctrl(Key::R), "Write each frame to a file."),
            Self::ReZero => ("Re-zero", None, "Take the current readings as those at rest."),
            Self::PlayReplay => ("Pause or resume replay", ctrl(Key::P), ""),
            Self::Export(name) => (name.as_str(), None, ""),
            Self::Undo => ("Undo change of settings", ctrl(Key::Z), ""),
            Self::Redo => (
                "Redo change of settings",
                Some(KeyboardShortcut::new(shift, Key::Z)),
                "",
            ),
            Self::Show(view) => (view.name(), ctrl(view.key()), "Show this view."),
            Self::Dark => ("Dark theme", None, ""),
            Self::Light => ("Light theme", None, ""),
            Self::Colours(map) => (map.name(), None, map.meaning()),
            Self::Larger => ("Larger interface", ctrl(Key::Plus), "Zoom in."),
            Self::Smaller => ("Smaller interface", ctrl(Key::Minus), "Zoom out."),
            Self::UsualSize => ("Reset the interface size", ctrl(Key::Num0), "Zoom to 100 %."),
            Self::Form => (
                "Show or hide the settings",
                None,
                "In a narrow window they are hidden at first.",
            ),
            Self::Search => ("Search actions", ctrl(Key::K), ""),
            Self::Keys => ("Keys", plain(Key::Questionmark), "Help: every shortcut."),
            Self::Glossary => ("Glossary", None, "Help: every term."),
            Self::About => ("About Decoupler", None, "Version and licences."),
        };
        let before = match self {
            Self::Chart(_) => "Chart: ",
            Self::Colours(_) => "Colours: ",
            Self::Show(_) => "Show ",
            _ => "",
        };
        About {
            name: format!("{before}{name}"),
            keys,
            hint,
        }
    }

    /// Returns the reason why it is not available now, if the shared state has one. What only a view or the frame knows, such
    /// as the displayed sample or the size of the window, it adds where it offers the command.
    pub fn obstacle<'s>(&self, shared: &'s Shared) -> Option<&'s str> {
        const RUNNING: &str = "A training is running: stop it first.";
        let phase = shared.phase;
        let has_trained = || shared.shown_run().is_some_and(|run| run.stop_reason.is_some());
        let (is_met, obstacle) = match self {
            Self::Train if !phase.is_busy() => return shared.missing_recording(),
            Self::Train | Self::OpenFiles | Self::Undo | Self::Redo => (!phase.is_busy(), RUNNING),
            Self::TrainLonger => (shared.can_continue(), "No training of these samples has ended."),
            Self::PauseTraining => (
                matches!(phase, Phase::Training | Phase::Paused),
                "No training is running.",
            ),
            Self::StopTraining => (phase.is_busy(), "No training is running."),
            Self::DecodeFile => (has_trained(), "Train a network first."),
            Self::Show(view) => (*view != shared.shown, "It is the current view."),
            Self::Colours(map) => (*map != shared.look.colours, "They are in use."),
            _ => return None,
        };
        (!is_met).then_some(obstacle)
    }
}

impl About {
    /// Returns the tooltip of its button: "Stop training (Ctrl+.)", with the Command key on macOS.
    pub fn tooltip(&self, ctx: &Context) -> String {
        let Self { name, keys, hint } = self;
        let keys = keys.map_or(String::new(), |keys| format!(" ({})", ctx.format_shortcut(&keys)));
        let gap = if hint.is_empty() { "" } else { "\n" };
        format!("{name}{keys}{gap}{hint}")
    }
}

/// A command that is listed now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Offer {
    /// The command.
    pub command: Command,
    /// Reason why it is not available now.
    pub obstacle: Option<String>,
    /// The view that must be shown first, if it is another one.
    pub of: Option<ViewKind>,
}

/// The commands of this frame. The caller that offers a command carries it out when [`Self::offer`] returns true: its keys were
/// pressed, or it was picked.
#[derive(Debug)]
pub struct Offers<'a> {
    /// Keys and pointer of the frame.
    pub ctx: &'a Context,
    /// False while a modal is open, which hears the keys.
    pub is_heard: bool,
    shared: &'a Shared,
    picked: Option<Command>,
    list: Vec<Offer>,
}

impl<'a> Offers<'a> {
    /// Nothing offered yet; `picked` is the command picked from the list or by a button.
    pub fn new(ctx: &'a Context, shared: &'a Shared, picked: Option<Command>, is_heard: bool) -> Self {
        Self {
            ctx,
            is_heard,
            shared,
            picked,
            list: Vec::new(),
        }
    }

    /// Offers a command. Returns true if the user invoked it.
    pub fn offer(&mut self, command: Command) -> bool {
        self.offer_unless(command, None::<String>)
    }

    /// As [`Self::offer`], unless the caller has an obstacle that [`Command::obstacle`] cannot know.
    pub fn offer_unless(&mut self, command: Command, obstacle: Option<impl Into<String>>) -> bool {
        let of_all = command.obstacle(self.shared).map(str::to_owned);
        let obstacle = of_all.or_else(|| obstacle.map(Into::into));
        let is_possible = obstacle.is_none();
        let is_picked = self.picked.take_if(|picked| *picked == command).is_some();
        // Text being typed keeps its own keys.
        let may_hear = |keys: &KeyboardShortcut| {
            let is_for_typing = keys.modifiers.is_none() || matches!(keys.logical_key, Key::Z | Key::Y);
            self.is_heard && is_possible && !(is_for_typing && self.ctx.text_edit_focused())
        };
        let keys = command.about().keys.filter(may_hear);
        let is_pressed = keys.is_some_and(|keys| self.ctx.input_mut(|input| input.consume_shortcut(&keys)));
        let of = None;
        self.list.push(Offer { command, obstacle, of });
        is_possible && (is_picked || is_pressed)
    }

    /// Offers the steps to the samples before and after the displayed one. Returns the sample to show.
    pub fn offer_samples(&mut self, shown: usize, samples: usize) -> Option<usize> {
        let steps = [Command::PreviousSample, Command::NextSample].into_iter();
        let steps = steps.zip(neighbours(shown, samples));
        let asked = steps.filter(|(step, to)| {
            self.offer_unless(step.clone(), to.is_none().then_some("There is none in this direction."))
        });
        asked.last()?.1
    }

    /// Returns the commands in the order in which they were offered.
    pub fn into_list(self) -> Vec<Offer> {
        self.list
    }
}

/// Shows the button of a command, with its name and its keys under the pointer, or why it is not available now. Its accessible
/// name is `label`, if the button does not show it.
pub fn command_button_ui(
    ui: &mut Ui,
    shared: &Shared,
    command: Command,
    button: impl Widget,
    label: Option<&str>,
    effects: &mut Vec<Effect>,
) {
    let obstacle = shared.obstacle(&command);
    let hint = command.about().tooltip(ui.ctx());
    let button = ui.add_enabled(obstacle.is_none(), button).on_hover_text(&hint);
    if let Some(label) = label {
        button.widget_info(|| WidgetInfo::labeled(Role::Button, obstacle.is_none(), label));
    }
    let why_not = format!("{hint}\n{}", obstacle.unwrap_or_default());
    if button.on_disabled_hover_text(why_not).clicked() {
        effects.push(Effect::Do(command));
    }
}

#[cfg(test)]
mod tests {
    use eframe::egui::{Event, RawInput};

    use super::*;

    /// Returns what was offered and done in a frame in which these keys were pressed.
    fn frame(picked: Option<Command>, keys: Option<(Modifiers, Key)>, is_heard: bool) -> (Vec<Offer>, [bool; 3]) {
        let ctx = Context::default();
        let press = |(modifiers, key)| Event::Key {
            key,
            physical_key: None,
            pressed: true,
            repeat: false,
            modifiers,
        };
        let input = RawInput {
            events: keys.map(press).into_iter().collect(),
            ..RawInput::default()
        };
        let mut found = None;
        let mut output = ctx.run_ui(input, |ui| {
            let shared = Shared::new(true);
            let mut offers = Offers::new(ui.ctx(), &shared, picked.clone(), is_heard);
            let done = [Command::Train, Command::StopTraining, Command::Dark].map(|command| offers.offer(command));
            found.get_or_insert((offers.into_list(), done));
        });
        // Nothing is drawn.
        output.textures_delta.clear();
        found.unwrap()
    }

    #[test]
    fn keys_and_the_list_do_a_command_once_and_only_that_one() {
        let enter = Some((Modifiers::COMMAND, Key::Enter));
        assert_eq!(frame(None, None, true).1, [false; 3]);
        assert_eq!(frame(None, enter, true).1, [true, false, false]);
        assert_eq!(frame(Some(Command::Dark), None, true).1, [false, false, true]);
        assert_eq!(frame(Some(Command::Dark), None, false).1, [false, false, true]);
        assert_eq!(frame(None, enter, false).1, [false; 3], "a modal hears the keys");
    }

    #[test]
    fn an_unavailable_command_is_listed_and_not_done() {
        let stop = Some((Modifiers::COMMAND, Key::Period));
        let (offers, done) = frame(Some(Command::StopTraining), stop, true);
        assert_eq!(done, [false; 3]);
        let obstacles = offers.iter().map(|offer| offer.obstacle.as_deref());
        let obstacles = Vec::from_iter(obstacles);
        assert_eq!(obstacles, [None, Some("No training is running."), None]);
    }
}
