//! What is wrong with a recording that a change of its plan fixes.

use std::collections::BTreeMap;

use decoupler_core::dataset::SplitBy;
use decoupler_files::import::{Plan, Setup, is_group_name};

use super::{import::Import, options::bias};
use crate::window::shared::{Effect, Shared};

/// A problem of a recording, and a change of its plan that fixes it.
#[derive(Debug)]
pub struct Fix {
    pub problem: String,
    /// Text of the button.
    pub button: String,
    plan: Plan,
}

impl Fix {
    /// Takes the changed plan.
    pub fn effects(&self, shared: &Shared) -> Vec<Effect> {
        let setup = Setup::recording(shared.recording.settings, self.plan.clone());
        let is_auto = shared.recording.is_auto;
        vec![Effect::TakeSetup(Box::new(setup)), Effect::ChooseAutomatically(is_auto)]
    }

    /// Returns the problems of an import, the most urgent first.
    pub(super) fn all(import: &Import) -> Vec<Self> {
        let plan: &Plan = &import.plan;
        let mut fixes = Vec::new();
        let mut add = |problem, button, plan| fixes.push(Self { problem, button, plan });
        let is_used = |name: &String| plan.import.inputs.contains(name) || plan.import.targets.contains(name);
        // The columns with each number that may mean that there is none.
        let mut missing = BTreeMap::<String, Vec<String>>::new();
        for (file, column) in import.columns() {
            let file = &import.files[file];
            let (name, found) = (file.full_name(column), file.columns[column].sentinel);
            if let Some(found) = found.filter(|_| is_used(&name)) {
                missing.entry(found.value.to_string()).or_default().push(name);
            }
        }
        for (value, names) in missing {
            let shown = value.replace('-', "−");
            let problem = format!(
                "{} has {shown} where other values are far away: if {shown} means that there is no value, it spoils the \
                 training and the errors.",
                names.join(", ")
            );
            let mut plan = plan.clone();
            let markers = names.iter().filter_map(|name| format!("{name}={value}").parse().ok());
            plan.import.missing.extend(markers);
            add(problem, format!("Treat {shown} as missing"), plan);
        }
        let mut own = import.files.first().into_iter().flat_map(|file| &file.columns);
        let group = own.find(|column| is_group_name(&column.name) && !is_used(&column.name));
        if let (Some(column), false) = (group, plan.import.has_groups()) {
            let problem = format!(
                "The samples of one {0} belong together, and training and test may share them: the errors are optimistic.",
                column.name
            );
            let mut plan = plan.clone();
            (plan.import.group, plan.division.by) = (Some(column.name.clone()), SplitBy::Group);
            add(problem, format!("Group by {}", column.name), plan);
        } else if plan.division.by == SplitBy::Random && plan.test.is_none() {
            let mut plan = plan.clone();
            let has_groups = plan.import.has_groups();
            plan.division.by = if has_groups { SplitBy::Group } else { SplitBy::Time };
            let button = if has_groups { "Split by group" } else { "Split by time" };
            add(bias(SplitBy::Random).to_owned(), button.to_owned(), plan);
        }
        fixes
    }
}
