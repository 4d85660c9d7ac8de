//! Recordings and the files next to them, from files to samples and networks.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod damage;
mod derived;
mod networks;
mod positions;
mod readers;
mod recordings;
mod samples;
mod several_files;
mod suggestions;
mod support;
