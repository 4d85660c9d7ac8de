use std::path::{Path, PathBuf};

use decoupler_files::export::is_same;
use eframe::egui::{Context, Key, KeyboardShortcut, Modifiers};

/// An action of the user, as shown in the list of all actions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Action {
    /// Its name, a verb first.
    pub name: String,
    /// Its keyboard shortcut.
    pub keys: Option<KeyboardShortcut>,
    /// False if it is not available now.
    pub is_possible: bool,
}

/// The actions of this frame. The caller that offers an action carries it out when [`Self::offer`] returns true: its keys
/// were pressed, or it was picked from the list.
#[derive(Debug)]
pub struct Offers<'a> {
    ctx: &'a Context,
    picked: Option<String>,
    hears_keys: bool,
    actions: Vec<Action>,
}

impl<'a> Offers<'a> {
    /// Nothing offered yet; `picked` is the name of the action picked from the list. While a question is open, actions
    /// ignore their keys (`hears_keys` is false).
    pub fn new(ctx: &'a Context, picked: Option<String>, hears_keys: bool) -> Self {
        Self {
            ctx,
            picked,
            hears_keys,
            actions: Vec::new(),
        }
    }

    /// Offers an action without a shortcut. Returns true if the user invoked it.
    pub fn offer(&mut self, name: impl Into<String>, is_possible: bool) -> bool {
        self.add(name.into(), None, is_possible)
    }

    /// Offers an action with this shortcut. Returns true if the user invoked it.
    pub fn offer_keys(&mut self, name: impl Into<String>, modifiers: Modifiers, key: Key, is_possible: bool) -> bool {
        self.add(name.into(), Some(KeyboardShortcut::new(modifiers, key)), is_possible)
    }

    fn add(&mut self, name: String, keys: Option<KeyboardShortcut>, is_possible: bool) -> bool {
        let is_picked = self.picked.take_if(|picked| *picked == name).is_some();
        // Text being typed keeps its own keys.
        let may_hear = |keys: &KeyboardShortcut| {
            self.hears_keys && is_possible && !(self.ctx.text_edit_focused() && is_for_typing(keys))
        };
        let keys_pressed = keys
            .filter(may_hear)
            .is_some_and(|keys| self.ctx.input_mut(|input| input.consume_shortcut(&keys)));
        self.actions.push(Action {
            name,
            keys,
            is_possible,
        });
        is_possible && (is_picked || keys_pressed)
    }

    /// Returns all actions in the order in which they were offered.
    pub fn into_actions(self) -> Vec<Action> {
        self.actions
    }
}

/// Returns true for keys that type or edit text.
fn is_for_typing(keys: &KeyboardShortcut) -> bool {
    keys.modifiers.is_none() || matches!(keys.logical_key, Key::Z | Key::Y)
}

/// A file in use, which must not be overwritten.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileInUse {
    /// A recording or another file that is read again.
    Recording(PathBuf),
    /// The checkpoint that a training was resumed from. The same training may be saved over it.
    Checkpoint(PathBuf),
    /// The folder in which the program keeps networks from session to session.
    Kept(PathBuf),
    /// A file that is being written at this moment.
    Recorded(PathBuf),
}

impl FileInUse {
    /// Returns the reason why the file at `path` must not be overwritten, if it is this file.
    fn reason(&self, path: &Path) -> Option<&'static str> {
        let (is_this, reason) = match self {
            Self::Recording(used) => (is_same(used, path), "it is a recording that is open"),
            Self::Checkpoint(used) => (
                is_same(used, path),
                "the current training was resumed from this checkpoint",
            ),
            Self::Kept(folder) => (
                path.parent().is_some_and(|parent| is_same_folder(parent, folder)) && path.exists(),
                "it is kept by this program from session to session",
            ),
            Self::Recorded(used) => (is_same(used, path), "frames are being recorded to it"),
        };
        is_this.then_some(reason)
    }
}

/// Checks that the file at `path` is not one of `used` under any name. Asks the file system, which may be slow.
///
/// # Errors
/// If it is one of them; the message says what to do.
pub fn refuse_in_use(path: &Path, used: &[FileInUse]) -> Result<(), String> {
    match used.iter().find_map(|used| used.reason(path)) {
        Some(reason) => Err(format!("'{}' is in use: {reason}; give another name", path.display())),
        None => Ok(()),
    }
}

fn is_same_folder(one: &Path, other: &Path) -> bool {
    let real = |path: &Path| path.canonicalize().ok();
    real(one).is_some() && real(one) == real(other)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use eframe::egui::{Event, RawInput};

    use super::*;

    /// Returns what was offered and done in a frame in which these keys were pressed.
    fn frame(picked: Option<&str>, keys: Option<(Modifiers, Key)>, hears_keys: bool) -> (Vec<Action>, [bool; 3]) {
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
            let mut offers = Offers::new(ui.ctx(), picked.map(str::to_owned), hears_keys);
            let done = [
                offers.offer_keys("Train", Modifiers::COMMAND, Key::Enter, true),
                offers.offer_keys("Stop", Modifiers::COMMAND, Key::Period, false),
                offers.offer("Dark theme", true),
            ];
            found.get_or_insert((offers.into_actions(), done));
        });
        // Nothing is drawn.
        output.textures_delta.clear();
        found.unwrap()
    }

    #[test]
    fn keys_and_the_list_do_an_action_once_and_only_that_one() {
        let enter = Some((Modifiers::COMMAND, Key::Enter));
        assert_eq!(frame(None, None, true).1, [false; 3]);
        assert_eq!(frame(None, enter, true).1, [true, false, false]);
        assert_eq!(frame(Some("Dark theme"), None, true).1, [false, false, true]);
        assert_eq!(frame(Some("Dark theme"), None, false).1, [false, false, true]);
    }

    #[test]
    fn an_unavailable_action_is_listed_and_not_done() {
        let stop = Some((Modifiers::COMMAND, Key::Period));
        let (actions, done) = frame(Some("Stop"), stop, true);
        assert_eq!(done, [false; 3]);
        assert_eq!(
            actions.iter().map(|action| action.is_possible).collect::<Vec<_>>(),
            [true, false, true]
        );
    }

    #[test]
    fn actions_ignore_keys_while_a_question_is_open() {
        let enter = Some((Modifiers::COMMAND, Key::Enter));
        assert_eq!(frame(None, enter, false).1, [false; 3]);
    }

    #[test]
    fn a_file_in_use_is_refused_under_any_name_and_others_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("kept")).unwrap();
        for name in ["a.csv", "b.csv", "kept/run-1.json"] {
            fs::write(at(name), "").unwrap();
        }
        let used = [FileInUse::Recording(at("a.csv")), FileInUse::Kept(at("kept"))];
        for (name, is_refused) in [
            ("a.csv", true),
            ("kept/../a.csv", true),
            ("b.csv", false),
            ("none.csv", false),
            ("none/a.csv", false),
            ("kept/run-1.json", true),
            ("kept/new.json", false),
        ] {
            assert_eq!(refuse_in_use(&at(name), &used).is_err(), is_refused, "{name}");
        }
    }
}
