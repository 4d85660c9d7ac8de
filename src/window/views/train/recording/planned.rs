//! The plan of a draft, made once per change: the window asks for it several times per frame.

use std::{collections::BTreeMap, path::PathBuf, sync::Arc};

use super::draft::{ColumnKey, Draft};
use decoupler_files::import::{Meaning, Plan};

/// Parts of a draft that its plan is made of and that can change.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MadeOf {
    pub(super) plan: Plan,
    pub(super) texts: [String; 2],
    pub(super) units: BTreeMap<ColumnKey, String>,
    pub(super) tests: BTreeMap<PathBuf, PathBuf>,
    /// Those of the columns of each file.
    pub(super) meanings: Vec<Vec<Meaning>>,
}

/// Last plan or the reason for which there is none, and what it was made of.
#[derive(Clone, Debug, Default)]
pub(super) struct PlanCache(Option<(MadeOf, Result<Arc<Plan>, String>)>);

impl PlanCache {
    /// Returns the plan of `draft` with absolute paths, made again only if the draft has changed.
    pub(super) fn planned(&mut self, draft: &Draft) -> Result<Arc<Plan>, String> {
        if let Some((of, made)) = &self.0
            && draft.is_made_of(of)
        {
            return made.clone();
        }
        let made = draft.made_plan().map(|plan| Arc::new(plan.absolute()));
        self.0 = Some((draft.made_of(), made.clone()));
        made
    }
}
