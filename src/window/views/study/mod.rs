//! The Study view: many trainings or measurements at once, and what they show together.
//!
//! Every topic works alike. Its [`Form`] makes a [`Task`], a background job carries the task out and sends [`StudyEvent`]s, an
//! [`Outcome`] collects them, and its [`Report`] of tables, figures and notes is shown. A new topic is a variant of [`Topic`]
//! and of [`Form`], and a file with its form, its work and its outcome.

mod experiment;
mod readings;
mod report;
mod speed;
mod state;
mod sweep_folder;
mod topic;
mod value_list;
mod view;

use report::{Note, Page, Point, Report, Row, Tone};
pub use state::StudyView;
use topic::{Form, Outcome, Reporter, StudyEvent, Task, Topic};
use value_list::ValueList;
