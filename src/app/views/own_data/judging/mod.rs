//! Findings on a recording, and decoders beside the network: both measured on a thread of their own, once they are asked for.

mod decoders_card;
mod findings_card;
mod measuring;
mod tables;
mod thread;

pub(super) use decoders_card::{decoders_ui, shown_decoders_figure};
pub(super) use findings_card::{findings_ui, shown_curve_figure};
pub(super) use measuring::Measuring;
pub(super) use tables::{channel_table, decoders_table};
