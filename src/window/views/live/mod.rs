//! The Live view: frames of an array, or samples for a network of a recording, decoded as they arrive from a simulated
//! source, a file, a serial port or a socket.
//!
//! `engine` decodes in the background; `state` starts it, takes its events and sends it the user's commands; the other
//! files show the form on the left and the cards in the middle.

mod cards;
mod engine;
mod figures_card;
mod source_form;
mod state;
mod targets_card;
mod tools;
mod view;

pub use state::LiveView;
