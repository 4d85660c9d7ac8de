//! The networks trained and opened.

use std::{path::PathBuf, sync::Arc};

use super::model::Trained;
use crate::export::MeasuredNetworkFile;

/// Networks trained or opened, in this order.
#[derive(Debug, Default)]
pub(super) struct Runs {
    pub(super) runs: Vec<Kept>,
    /// The one that is compared with the network on show.
    pub(super) marked: Option<usize>,
    /// True while the user is asked about removing it.
    pub(super) is_removing: bool,
}

/// A network of the list.
#[derive(Debug)]
pub(super) struct Kept {
    pub(super) trained: Trained,
    /// Its file among the networks that are kept, once it is there.
    path: Option<PathBuf>,
}

impl Runs {
    /// Adds a network; false if it is there already.
    pub(super) fn add(&mut self, trained: &Trained) -> bool {
        let is_new = self.place(&trained.file).is_none();
        if is_new {
            self.runs.push(Kept {
                trained: trained.clone(),
                path: None,
            });
        }
        is_new
    }

    /// Adds a network found in the file `path`.
    pub(super) fn note_found(&mut self, path: PathBuf, file: Arc<MeasuredNetworkFile>) {
        let place = self.place(&file).unwrap_or_else(|| {
            let mut trained = Trained::of_file(Arc::clone(&file));
            trained.name = self.name_of(&trained);
            self.runs.push(Kept { trained, path: None });
            self.runs.len() - 1
        });
        let run = &mut self.runs[place];
        // From here on it is known by this one, also to the thread that keeps it.
        run.trained.file = file;
        run.path = Some(path);
    }

    /// Notes that a network of the list is kept in the file `path` now; one that was removed meanwhile stays removed.
    pub(super) fn note_kept(&mut self, path: PathBuf, file: &Arc<MeasuredNetworkFile>) {
        let run = self.runs.iter_mut().find(|run| Arc::ptr_eq(&run.trained.file, file));
        if let Some(run) = run {
            run.path = Some(path);
        }
    }

    fn place(&self, file: &MeasuredNetworkFile) -> Option<usize> {
        self.runs.iter().position(|run| *run.trained.file == *file)
    }

    /// The network in this place, and the file in which it is kept.
    pub(super) fn get(&self, place: usize) -> Option<(&Trained, Option<&PathBuf>)> {
        self.runs.get(place).map(|run| (&run.trained, run.path.as_ref()))
    }

    /// Name of a network: that in the list, or one that no other has.
    pub(super) fn name_of(&self, trained: &Trained) -> String {
        if let Some(place) = self.place(&trained.file) {
            return self.runs[place].trained.name.clone();
        }
        let MeasuredNetworkFile { settings, plan, .. } = &*trained.file;
        let stem = plan.import.data.file_stem().unwrap_or_default().to_string_lossy();
        let name = format!("{stem} h{} {}", settings.hidden, settings.training.method.short_name());
        let numbered = (2..).map(|number| format!("{name} ({number})"));
        let mut names = std::iter::once(name.clone()).chain(numbered);
        let is_taken = |name: &String| self.runs.iter().any(|run| run.trained.name == *name);
        names.find(|name| !is_taken(name)).unwrap_or(name)
    }

    /// Removes the marked network from the list, and returns it.
    pub(super) fn remove_marked(&mut self) -> Option<Arc<MeasuredNetworkFile>> {
        self.is_removing = false;
        let place = self.marked.take().filter(|place| *place < self.runs.len())?;
        Some(self.runs.remove(place).trained.file)
    }
}
