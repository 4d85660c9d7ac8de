//! The work in a terminal: `decoupler train`, `inspect`, `decode`, `export`, `calibrate`, `fine-tune`, `simulate`,
//! `reproduce`, `trade` and `sweep`.
//!
//! A command ends with status 0 when its work is done, 1 when it failed, 2 when its arguments were wrong; the last two
//! with one line on standard error. Ctrl-C ends it with status 130; `train` first saves what it has.

mod answers;
mod arguments;
mod calibrate;
mod checkpointing;
mod cross_validation;
mod decode;
mod errors_report;
mod export;
mod export_report;
mod failure;
mod findings;
mod findings_report;
mod fine_tune;
mod follow;
mod follow_answers;
mod follow_faults;
mod follow_lines;
mod follow_report;
mod frames;
mod import_arguments;
mod inspect;
mod interruption;
mod output;
mod outside_training;
mod parse_error;
mod parsers;
mod readings;
mod recording_report;
mod reproduce;
mod reproduce_report;
mod samples;
mod scene_arguments;
mod simulate;
mod specification_error;
mod spread_plot;
mod sweep;
mod trade;
mod trade_command;
mod trade_report;
mod train;
mod train_report;
mod training_arguments;

pub use arguments::{Window, run};
