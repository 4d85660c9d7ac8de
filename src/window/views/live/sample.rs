use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::window::job::{Job, Wake};
use decoupler_files::export::{NetworkFile, atomic_write};

const NETWORK: (&str, &str) = (
    "sample network.json",
    include_str!("../../../../assets/samples/network.json"),
);
const RECORDING: (&str, &str) = (
    "sample recording.csv",
    include_str!("../../../../assets/samples/recording.csv"),
);

/// The sample recording, laid out as a file next to the user's own, and the network that decodes it.
#[derive(Debug)]
pub struct Sample {
    job: Job<Result<Laid, String>>,
}

/// The sample on the disk.
#[derive(Debug)]
pub struct Laid {
    /// The recording.
    pub recording: PathBuf,
    /// Name of the network.
    pub name: &'static str,
    /// The network.
    pub network: Box<NetworkFile>,
}

impl Sample {
    /// Nothing laid out yet. `wake` is called when it is.
    pub(super) fn new(wake: Wake) -> Self {
        Self {
            job: Job::prompt("sample", wake),
        }
    }

    /// Lays the sample out in `folder`.
    pub(super) fn lay_out(&mut self, folder: PathBuf) {
        self.job.start(
            move |_| lay_out(&folder),
            |laid| laid.unwrap_or_else(|error| Err(error.to_string())),
        );
    }

    /// Returns the sample once it is laid out, or the reason why it cannot be.
    pub(super) fn next(&mut self) -> Option<Result<Laid, String>> {
        self.job.next_event()
    }
}

fn lay_out(folder: &Path) -> Result<Laid, String> {
    let refused = |error: &dyn std::fmt::Display| format!("the sample cannot be written: {error}");
    fs::create_dir_all(folder).map_err(|error| refused(&error))?;
    let write = |(name, text): (&str, &str)| {
        let path = folder.join(name);
        let written = atomic_write(&path, |file| file.write_all(text.as_bytes()));
        written.map(|()| path).map_err(|error| refused(&error))
    };
    let (network, recording) = (write(NETWORK)?, write(RECORDING)?);
    let network = NetworkFile::load(&network).map_err(|error| error.to_string())?;
    Ok(Laid {
        recording,
        name: NETWORK.0,
        network: Box::new(network),
    })
}
