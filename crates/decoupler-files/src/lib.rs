//! Files of Decoupler, in and out.
//!
//! | module | contents |
//! |---|---|
//! | [`machine`] | memory of the machine, errors of its operating system |
//! | [`import`] | recordings out of files: tables, joins by time, meanings of columns, recipes |
//! | [`figure`] | what a picture shows, for the window and for print |
//! | [`export`] | network files, checkpoints, run folders, tables, reports; [`export::bundle`] writes decoders for other programs, [`export::figures`] draws |
//! | [`live`] | live frames: serial ports, sockets and files, simulated frames, recordings of frames |
//!
//! Numerics are in [`decoupler_core`]; each module uses only those before it.

mod csv_row;
pub mod export;
pub mod figure;
pub mod import;
pub mod live;
pub mod machine;
