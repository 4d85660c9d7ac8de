//! The Live view: frames of an array, or samples for a network of a recording, decoded as they arrive from a simulated
//! source, a file, a serial port or a socket.
//!
//! `engine` is the thread around the session that decodes. `view` starts it, displays its latest snapshot and sends it the
//! user's changes; the other files show the form and the cards.

mod cards;
mod engine;
mod form;
mod view;

pub use view::LiveView;
