//! The Study view: many trainings or measurements at once, and what they show together.
//!
//! Every topic works alike. Its form is checked into a [`Task`], a background job carries the task out and sends
//! [`StudyEvent`]s, an [`Outcome`] collects them, and a [`Report`] of tables, figures and notes shows the outcome. A new topic
//! is a file with these four and a variant of [`Topic`] and of the enums of `topic`.

mod experiment;
mod readings;
mod report;
mod speed;
mod state;
mod sweep_folder;
mod topic;
mod value_list;
mod view;

use experiment::{ExperimentForm, ExperimentOutcome};
use report::{Note, Page, Point, Report, Row, Tone};
use speed::{SpeedForm, SpeedOutcome};
pub use speed::{PlannedRun, SpeedPlan};
pub use state::StudyView;
use topic::{Form, Outcome, Reporter, StudyEvent, Task, Topic};
use value_list::ValueList;
