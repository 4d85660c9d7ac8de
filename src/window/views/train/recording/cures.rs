//! What is wrong with a recording that a change of its plan fixes.

use std::collections::BTreeMap;

use decoupler_core::dataset::SplitBy;
use decoupler_files::import::{Plan, Setup, is_group_name};

use super::{RecordingEditor, options::bias};
use crate::window::shared::{Command, Effect, Shared};

/// What is wrong, the text of the button that fixes it, and what that does.
pub type Cure = (String, String, Vec<Effect>);

impl RecordingEditor {
    /// Returns what is wrong with the recording, the most urgent first.
    pub fn cures(&self, shared: &Shared) -> Vec<Cure> {
        let (Some(import), Ok(open)) = (&self.import, &shared.recording.plan) else {
            return Vec::new();
        };
        // Asked for in every frame: a plan is copied only where there is something to change.
        let plan: &Plan = open;
        let fixed = |plan: Plan| {
            let setup = Setup::recording(shared.recording.settings, plan);
            let is_auto = shared.recording.is_auto;
            vec![
                Effect::TakeSetup(Box::new(setup)),
                Effect::ChooseAutomatically(is_auto),
                Effect::Do(Command::Train),
            ]
        };
        let mut cures = Vec::new();
        let is_used = |name: &String| plan.import.inputs.contains(name) || plan.import.targets.contains(name);
        let columns = import
            .files
            .iter()
            .flat_map(|file| (0..file.columns.len()).map(move |column| (file, column)));
        // The columns with each number that may mean that there is none.
        let mut missing = BTreeMap::<String, Vec<String>>::new();
        for (file, column) in columns {
            let (name, found) = (file.full_name(column), file.columns[column].sentinel);
            if let Some(found) = found.filter(|_| is_used(&name)) {
                missing.entry(found.value.to_string()).or_default().push(name);
            }
        }
        for (value, names) in missing {
            let shown = value.replace('-', "−");
            let text = format!(
                "{} has {shown} where other values are far away: if {shown} means that there is no value, it spoils the \
                 training and the errors.",
                names.join(", ")
            );
            let mut plan = plan.clone();
            let markers = names.iter().filter_map(|name| format!("{name}={value}").parse().ok());
            plan.import.missing.extend(markers);
            cures.push((text, format!("Treat {shown} as missing"), fixed(plan)));
        }
        let mut own = import.files.first().into_iter().flat_map(|file| &file.columns);
        let group = own.find(|column| is_group_name(&column.name) && !is_used(&column.name));
        if let (Some(column), false) = (group, plan.import.has_groups()) {
            let text = format!(
                "The rows of one {0} belong together, and training and test may share them: the errors are optimistic.",
                column.name
            );
            let mut plan = plan.clone();
            (plan.import.group, plan.division.by) = (Some(column.name.clone()), SplitBy::Group);
            cures.push((text, format!("Group by {}", column.name), fixed(plan)));
        } else if plan.division.by == SplitBy::Random && plan.test.is_none() {
            let mut plan = plan.clone();
            let has_groups = plan.import.has_groups();
            plan.division.by = if has_groups { SplitBy::Group } else { SplitBy::Time };
            let button = if has_groups { "Split by group" } else { "Split by time" };
            cures.push((bias(SplitBy::Random).to_owned(), button.to_owned(), fixed(plan)));
        }
        cures
    }
}
