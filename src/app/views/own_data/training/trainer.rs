use std::sync::mpsc::{Sender, channel};

use super::{Command, Task, TrainingEvent, training_loop::run};
use crate::app::job::{Job, Wake};

/// The view's end of the thread.
#[derive(Debug)]
pub struct Trainer {
    job: Job<TrainingEvent>,
    commands: Option<Sender<Command>>,
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
        self.commands = Some(commands);
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
