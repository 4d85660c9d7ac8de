//! The `decoupler` program.

fn main() {
    if let Err(error) = decoupler::app::open() {
        eprintln!("error: {error}");
        std::process::exit(1);
    }
}
