use std::sync::{
    Arc,
    mpsc::{Sender, channel},
};

use super::{Command, Task, TrainingEvent, training_loop::run};
use crate::app::{
    job::{Job, Wake},
    shared::Contents,
};

/// The view's end of the thread.
#[derive(Debug)]
pub struct Trainer {
    job: Job<TrainingEvent>,
    /// To the thread, while it lives. It ends when nobody else can command it.
    commands: Option<Arc<Sender<Command>>>,
}

impl Trainer {
    /// Nothing under way. `wake` is called after each event.
    pub fn new(wake: Wake) -> Self {
        Self {
            job: Job::new("own data training", wake),
            commands: None,
        }
    }

    /// Starts a task; an older one is heard no more.
    pub fn start(&mut self, task: Task) {
        let (commands, incoming) = channel();
        // The thread before ends when nobody commands it.
        self.commands = Some(Arc::new(commands));
        self.job.start(
            move |report| run(task, &incoming, report),
            |ended| TrainingEvent::Ended(ended.unwrap_or_else(|error| Err(error.to_string()))),
        );
    }

    /// Tells the thread.
    pub fn command(&self, command: Command) {
        if let Some(commands) = &self.commands {
            // A thread that has ended says so itself.
            let _ = commands.send(command);
        }
    }

    /// Returns true if there is a thread to command.
    pub fn is_there(&self) -> bool {
        self.commands.is_some()
    }

    /// The checkpoint of the training under way, taken at the moment it is written.
    pub fn checkpoint(&self) -> Option<Contents> {
        // A file still to be written keeps no thread alive.
        let commands = Arc::downgrade(self.commands.as_ref()?);
        Some(Contents::new(move |path| {
            let (send, taken) = channel();
            let is_asked = commands
                .upgrade()
                .is_some_and(|to| to.send(Command::Save(send)).is_ok());
            let taken = taken.recv().ok().filter(|_| is_asked);
            let file = taken.ok_or(
                "the checkpoint was not written, for its training is gone; ended trainings are in the list of runs",
            )??;
            file.save(path).map_err(|error| error.to_string())
        }))
    }

    /// Forgets the thread, which has ended.
    pub fn forget(&mut self) {
        self.commands = None;
    }

    /// Lets go of what is under way.
    pub fn cancel(&mut self) {
        self.job.abandon();
        self.commands = None;
    }

    /// The next event, if one has come.
    pub fn next_event(&self) -> Option<TrainingEvent> {
        self.job.next_event()
    }
}
