//! The plan of a draft, made once for each change: the window asks for it several times a frame.

use std::{collections::BTreeMap, path::PathBuf, sync::Arc};

use super::draft::{ColumnKey, Draft};
use crate::import::{Meaning, Plan};

/// A plan, and the same with paths that do not depend on the working folder.
#[derive(Clone, Debug)]
pub(super) struct Planned {
    pub(super) plan: Plan,
    pub(super) absolute: Plan,
}

/// Everything of a draft that its plan is made of and that can change.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MadeOf {
    pub(super) plan: Plan,
    pub(super) texts: [String; 2],
    pub(super) units: BTreeMap<ColumnKey, String>,
    pub(super) tests: BTreeMap<PathBuf, PathBuf>,
    /// Those of the columns of each file.
    pub(super) meanings: Vec<Vec<Meaning>>,
}

/// The plan made last, or why there is none, and what it was made of.
#[derive(Clone, Debug, Default)]
pub(super) struct PlanCache(Option<(MadeOf, Result<Arc<Planned>, String>)>);

impl PlanCache {
    /// The plan of `draft`, made anew only if the draft has changed.
    pub(super) fn planned(&mut self, draft: &Draft) -> Result<Arc<Planned>, String> {
        if let Some((of, made)) = &self.0
            && draft.is_made_of(of)
        {
            return made.clone();
        }
        let made = draft.made_plan().map(|plan| {
            let absolute = plan.absolute();
            Arc::new(Planned { plan, absolute })
        });
        self.0 = Some((draft.made_of(), made.clone()));
        made
    }
}
