//! The Live view: frames of an array, or samples for a network of a recording, decoded as they come, from a simulated source,
//! a file, a serial port or a socket.
//!
//! `engine` decodes on a thread of its own; `state` starts it, takes its events and tells it what the user wants; the other
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
