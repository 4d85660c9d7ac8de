//! The one place that changes the run list: at once what is shown, and the folder as soon as the thread can.

use super::{
    RunList, RunsWorker,
    worker::{Listed, RunsEvent, RunsRequest},
};
use crate::window::shared::Notice;

impl RunList {
    /// Takes the list from the thread; returns what the user is to be predicted.
    pub fn take_events(&mut self, worker: &RunsWorker) -> Option<Notice> {
        let mut notice = None;
        while let Some(event) = worker.next_event() {
            match event {
                RunsEvent::Listed(Listed { runs, path, problems }) => {
                    self.path = path;
                    // A list from before the last change would undo it: a run removed meanwhile would be back.
                    if worker.is_up_to_date() {
                        self.workspace = runs;
                    }
                    if !problems.is_empty() {
                        notice = Some(Notice::Failed(problems.join(". ")));
                    }
                }
                RunsEvent::Died(reason) => {
                    self.path = None;
                    let reason = reason.map(|error| format!(" ({error})")).unwrap_or_default();
                    let text = format!("New runs are no longer kept{reason}. Restart the program.");
                    notice = Some(Notice::Failed(text));
                }
            }
        }
        notice
    }

    /// Gives the run with this number another name, unless that is empty.
    pub fn rename(&mut self, id: u64, name: &str, worker: &RunsWorker) {
        let (name, run) = (name.trim(), self.workspace.runs.iter_mut().find(|run| run.id == id));
        if let Some(run) = run.filter(|_| !name.is_empty()) {
            name.clone_into(&mut run.name);
            worker.ask(RunsRequest::Rename(id, name.to_owned()));
        }
    }

    /// Shows a run in one of the two places, or nothing.
    pub fn pin(&mut self, place: usize, id: Option<u64>, worker: &RunsWorker) {
        self.workspace.pinned[place] = id;
        worker.ask(RunsRequest::Pin(place, id));
    }

    /// Removes the run with this number for good.
    pub fn remove(&mut self, id: u64, worker: &RunsWorker) {
        self.workspace.runs.retain(|run| run.id != id);
        worker.ask(RunsRequest::Remove(id));
    }
}

#[cfg(test)]
mod tests {
    use std::{
        sync::{
            Arc,
            mpsc::{Receiver, channel},
        },
        time::Duration,
    };

    use super::*;
    use decoupler_core::evaluation::{Run, SimulatedSettings};
    use decoupler_files::export::NetworkFile;

    fn small_run() -> NetworkFile {
        let mut settings = SimulatedSettings {
            hidden: 2,
            ..SimulatedSettings::default()
        };
        settings.source.sensor.scale = "4x4_2x12".parse().unwrap();
        (settings.source.samples, settings.source.test_samples) = (40, 8);
        settings.training.stopping.epochs = 2;
        let mut run = Run::prepare(settings).unwrap();
        while run.step().is_none() {}
        NetworkFile::from_run(&run, None).unwrap()
    }

    fn wait(woken: &Receiver<()>) {
        woken.recv_timeout(Duration::from_secs(60)).unwrap();
    }

    #[test]
    fn a_run_removed_or_renamed_is_not_brought_back_by_an_older_list() {
        let folder = tempfile::tempdir().unwrap();
        let (wake, woken) = channel();
        let worker = RunsWorker::start(Arc::new(move || wake.send(()).unwrap_or(())));
        let mut list = RunList::default();
        worker.open(folder.path().to_owned());
        for _ in 0..2 {
            worker.keep(small_run());
        }
        (0..3).for_each(|_| wait(&woken));
        assert!(list.take_events(&worker).is_none());
        let [first, second] = [0, 1].map(|place: usize| list.workspace.runs[place].id);
        // A list is on its way when the user removes one run and renames the other.
        worker.look();
        wait(&woken);
        list.remove(first, &worker);
        list.rename(second, "mine", &worker);
        assert!(list.take_events(&worker).is_none());
        let names = |list: &RunList| Vec::from_iter(list.workspace.runs.iter().map(|run| run.name.clone()));
        assert_eq!(names(&list), ["mine"]);
        (0..2).for_each(|_| wait(&woken));
        assert!(list.take_events(&worker).is_none());
        assert_eq!(names(&list), ["mine"]);
        assert!(list.path.is_some());
    }
}
