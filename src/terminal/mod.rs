//! The work in a terminal: `decoupler train`, `inspect`, `decode`, `export`, `calibrate`, `fine-tune`, `simulate`,
//! `reproduce`, `trade` and `sweep`.
//!
//! A command ends with status 0 when its work is done, 1 when it failed, 2 when its arguments were wrong; the last two
//! with one line on standard error. Ctrl-C ends it with status 130; `train` first saves what it has.

mod arguments;
mod calibrate;
mod cross_validation;
mod decode;
mod errors_report;
mod export;
mod failure;
mod findings;
mod follow;
mod follow_report;
mod import_arguments;
mod inspect;
mod interruption;
mod output;
mod outside_training;
mod recording_report;
mod reproduce;
mod reproduce_report;
mod samples;
mod scene_arguments;
mod spread_plot;
mod sweep;
mod trade;
mod trade_report;
mod train;
mod train_report;
mod training_arguments;

pub use arguments::{Window, run};
