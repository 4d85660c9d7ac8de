//! The thread that trains on recordings. Tasks and commands go in, events come out.

mod message;
mod trainer;
mod training_loop;

pub(super) use message::{Command, Task, TrainingEvent, ValidationChoice};
pub(super) use trainer::Trainer;
