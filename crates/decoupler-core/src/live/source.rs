use std::{
    f64::consts::TAU,
    fmt,
    fs::File,
    io::{self, Read, stdin},
    net::TcpStream,
    path::{Path, PathBuf},
    str::FromStr,
    time::Duration,
};

use glam::DVec2;
use rand::{Rng, RngExt, rngs::ChaCha8Rng};
use thiserror::Error;

use super::lines::Keeping;
use crate::{
    dataset::{Seed, Stream},
    scene::{Deformation, Fault, FaultError, FaultySensor, Indenter, Loading, NoiseSource, Scene, SceneError},
    sensor::{SensorError, SensorModel},
    text::{system_cause, system_words},
};

/// Source of frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// Standard input.
    StandardInput,
    /// A file or a named pipe.
    File(PathBuf),
    /// A serial port with its baud rate, 8 data bits, no parity, 1 stop bit.
    Serial {
        /// Device.
        path: String,
        /// Baud rate.
        baud: u32,
    },
    /// A TCP socket to connect to, as `HOST:PORT`.
    Tcp(String),
}

/// Error in opening a source.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SourceError {
    /// The baud rate is missing.
    #[error("'{0}' is a serial device and needs its baud rate: give {0}:115200, or the rate at which it sends")]
    NoBaud(String),
    /// Not a socket.
    #[error("'tcp:{0}' is not a socket: give tcp:HOST:PORT, for example tcp:localhost:5000")]
    NoPort(String),
    /// The device does not exist.
    #[error("there is no device '{0}': check its cable and its name, for example with ls /dev/tty*")]
    NoDevice(String),
    /// Opening the device is not permitted.
    #[error(
        "no permission to read '{0}': join the group that owns it, on many systems with sudo usermod -aG dialout $USER, \
         and log in again"
    )]
    Permission(String),
    /// Another program is using the device.
    #[error("'{0}' is in use: close the other program that reads it")]
    InUse(String),
    /// The device does not support the baud rate.
    #[error("'{path}' does not support {baud} baud: {cause}; give a rate that it supports, for example 9600 or 115200")]
    Device {
        /// Device.
        path: String,
        /// Given rate.
        baud: u32,
        /// Message of the operating system.
        cause: String,
    },
    /// The connection failed.
    #[error("cannot connect to 'tcp:{address}': {}; check that the sender listens there", system_words(.source))]
    Connect {
        /// Given address.
        address: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file cannot be opened.
    #[error("cannot open '{}': {}", .path.display(), system_cause(.source))]
    File {
        /// Given file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

impl FromStr for Source {
    type Err = SourceError;

    /// Parses `-`, `tcp:HOST:PORT`, `DEVICE:BAUD` or the path of a file.
    fn from_str(text: &str) -> Result<Self, SourceError> {
        if text == "-" {
            return Ok(Self::StandardInput);
        }
        if let Some(address) = text.strip_prefix("tcp:") {
            let port = address.rsplit_once(':').filter(|(host, _)| !host.is_empty());
            return match port.and_then(|(_, port)| port.parse::<u16>().ok()) {
                Some(_) => Ok(Self::Tcp(address.to_owned())),
                None => Err(SourceError::NoPort(address.to_owned())),
            };
        }
        if !Path::new(text).exists()
            && let Some((path, baud)) = text.rsplit_once(':')
            && let Ok(baud @ 1..) = baud.parse()
            && (is_port(path) || path.starts_with("/dev/") || Path::new(path).exists())
        {
            let path = path.to_owned();
            return Ok(Self::Serial { path, baud });
        }
        if is_port(text) && !Path::new(text).is_file() {
            return Err(SourceError::NoBaud(text.to_owned()));
        }
        Ok(Self::File(PathBuf::from(text)))
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StandardInput => f.write_str("standard input"),
            Self::File(path) => write!(f, "'{}'", path.display()),
            Self::Serial { path, baud } => write!(f, "'{path}:{baud}'"),
            Self::Tcp(address) => write!(f, "'tcp:{address}'"),
        }
    }
}

impl Source {
    /// Returns the overflow policy for lines that arrive faster than they are consumed.
    pub fn keeping(&self) -> Keeping {
        match self {
            Self::StandardInput | Self::File(_) => Keeping::All,
            Self::Serial { .. } | Self::Tcp(_) => Keeping::Latest,
        }
    }

    /// Returns `true` if reading may begin in the middle of a line.
    pub fn begins_anywhere(&self) -> bool {
        matches!(self, Self::Serial { .. })
    }

    /// Returns the message on an error that ends the reading of this source.
    pub fn lost(&self, error: &io::Error) -> String {
        let cause = match (self, error.kind()) {
            // The system reports an unplugged device like a pipe without a reader.
            (Self::Serial { .. }, io::ErrorKind::BrokenPipe | io::ErrorKind::NotFound) => {
                "the device was unplugged or switched off".to_owned()
            }
            (Self::Tcp(_), _) => system_words(error),
            _ => system_cause(error),
        };
        format!("{self} is lost: {cause}; connect it again")
    }

    /// Opens the source. Reading from a device or socket times out regularly, so that the reader can be stopped.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub fn open(&self) -> Result<Box<dyn Read + Send>, SourceError> {
        match self {
            Self::StandardInput => Ok(Box::new(stdin())),
            Self::File(path) => {
                let file = File::open(path).map_err(|source| SourceError::File {
                    path: path.clone(),
                    source,
                })?;
                Ok(Box::new(file))
            }
            Self::Serial { path, baud } => open_serial(path, *baud),
            Self::Tcp(address) => {
                let connected = TcpStream::connect(address).and_then(|stream| {
                    stream.set_read_timeout(Some(TIMEOUT))?;
                    Ok(stream)
                });
                let stream = connected.map_err(|source| SourceError::Connect {
                    address: address.clone(),
                    source,
                })?;
                Ok(Box::new(stream))
            }
        }
    }
}

/// Returns `true` for a system name of a serial port: `COM` and digits on Windows, a path in `/dev` elsewhere.
fn is_port(name: &str) -> bool {
    let bare = name.strip_prefix(r"\\.\").unwrap_or(name);
    let is_numbered = bare
        .split_at_checked(3)
        .is_some_and(|(com, number)| com.eq_ignore_ascii_case("COM") && number.parse::<u16>().is_ok());
    is_numbered
        || ["/dev/tty", "/dev/pts/", "/dev/cu.", "/dev/rfcomm", "/dev/serial/"]
            .iter()
            .any(|start| name.starts_with(start))
}

/// Timeout for reading a byte.
const TIMEOUT: Duration = Duration::from_millis(200);

fn open_serial(path: &str, baud: u32) -> Result<Box<dyn Read + Send>, SourceError> {
    use serialport::ErrorKind;

    let refused = |error: serialport::Error| match error.kind {
        ErrorKind::Io(io::ErrorKind::NotFound) => SourceError::NoDevice(path.to_owned()),
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => SourceError::Permission(path.to_owned()),
        ErrorKind::Io(io::ErrorKind::WouldBlock) => SourceError::InUse(path.to_owned()),
        ErrorKind::NoDevice if Path::new(path).exists() => SourceError::InUse(path.to_owned()),
        ErrorKind::NoDevice => SourceError::NoDevice(path.to_owned()),
        _ => SourceError::Device {
            path: path.to_owned(),
            baud,
            cause: error.description,
        },
    };
    let port = serialport::new(path, baud).timeout(TIMEOUT).open().map_err(refused)?;
    Ok(Box::new(port))
}

/// Source of frames without hardware: an indenter that moves over the array, pressing and lifting.
///
/// Its position and depth are sums of sines whose phases are drawn from the seed, so that the state at any time can be
/// computed. Frames of all row-wires read have a given rate; time is simulated, and the caller paces them. At any time a
/// fault can be switched on or off, and the indenter held or lifted.
#[derive(Debug)]
pub struct Simulated {
    model: SensorModel,
    indenter: Indenter,
    rows: Vec<usize>,
    stroke_mm: f64,
    path: PressPath,
    source: NoiseSource,
    scene: Scene,
    noise_rng: ChaCha8Rng,
    fault: Option<FaultySensor>,
    frames_per_second: f64,
    frames: u64,
    motion: Motion,
    /// Number of frames during which the indenter did not move along its path.
    frames_at_rest: u64,
    deformation: Deformation,
}

/// Motion of the indenter of a [`Simulated`] source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// Moves along its path, pressing and lifting.
    #[default]
    Wandering,
    /// Held at its current position and depth.
    Held,
    /// Lifted from the array; it resumes from its last position.
    Lifted,
}

/// Error in setting up a simulated source.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SimulatedError {
    /// The scene is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The array has no resistance at rest.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The array does not have the wires of the fault.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// The rate is out of range.
    #[error("{} frames per second: give a number above 0 and at most 1000000", crate::sensor::short(*.0))]
    Rate(f64),
}

impl Simulated {
    /// Prepares frames of `model` with the rows, stroke and noise of `scene`, and its indenter, or a ball if it has
    /// another loading.
    ///
    /// # Errors
    /// If the scene or the rate is invalid, or the array has no resistance at rest.
    pub fn new(model: &SensorModel, scene: &Scene, seed: Seed, frames_per_second: f64) -> Result<Self, SimulatedError> {
        scene.check()?;
        if !(frames_per_second > 0.0 && frames_per_second <= 1e6) {
            return Err(SimulatedError::Rate(frames_per_second));
        }
        let noise = scene.noise.in_test();
        let indenter = match scene.loading {
            Loading::Indenter(indenter) => indenter,
            Loading::RandomNodes | Loading::SmoothField { .. } => Indenter::default(),
        };
        Ok(Self {
            model: *model,
            indenter,
            rows: scene.rows.read(model.scale.rows())?,
            stroke_mm: scene.stroke_mm(&model.geometry),
            path: PressPath::new(model, &mut seed.rng(Stream::Live)),
            source: noise.source(model)?,
            scene: *scene,
            noise_rng: seed.rng(Stream::LiveNoise),
            fault: None,
            frames_per_second,
            frames: 0,
            motion: Motion::default(),
            frames_at_rest: 0,
            deformation: Deformation::from_fn(model.scale, |_, _| glam::DVec3::ZERO),
        })
    }

    /// Returns the row-wires read, from 0.
    pub fn rows(&self) -> &[usize] {
        &self.rows
    }

    /// Returns the number of readings in a frame: rows × M4.
    pub fn readings(&self) -> usize {
        self.rows.len() * self.model.scale.columns()
    }

    /// Sets the motion of the indenter from the next frame on.
    pub fn set_motion(&mut self, motion: Motion) {
        self.motion = motion;
    }

    /// Skips `frames` frames, without drawing their noise.
    pub fn skip(&mut self, frames: u64) {
        self.frames += frames;
        if self.motion != Motion::Wandering {
            self.frames_at_rest += frames;
        }
    }

    /// Sets the fault of the following frames; `None` for none.
    ///
    /// # Errors
    /// If the array does not have its wires.
    pub fn set_fault(&mut self, fault: Option<Fault>) -> Result<(), SimulatedError> {
        let prepared = |fault: Fault| {
            fault.check(self.model.scale, &self.rows)?;
            let faulty = FaultySensor::new(&self.model, self.scene.noise.in_test(), fault)?;
            Ok::<_, SimulatedError>(faulty)
        };
        self.fault = fault.map(prepared).transpose()?;
        Ok(())
    }

    /// Writes the next frame, rows × M4 readings in ohm, and returns its time in seconds.
    ///
    /// # Errors
    /// If the model has no resistance for the deformation.
    ///
    /// # Panics
    /// If the slice has the wrong length.
    pub fn next_frame(&mut self, readings_ohm: &mut [f64]) -> Result<f64, SensorError> {
        assert_eq!(readings_ohm.len(), self.readings());
        let time_s = self.frames as f64 / self.frames_per_second;
        let along_path_s = (self.frames - self.frames_at_rest) as f64 / self.frames_per_second;
        self.skip(1);
        let (place_mm, depth) = self.path.at(along_path_s);
        let depth = if self.motion == Motion::Lifted { 0.0 } else { depth };
        self.deformation = self.indenter.press(&self.model, place_mm, depth * self.stroke_mm);
        let columns = self.model.scale.columns();
        for (&row, readings_ohm) in self.rows.iter().zip(readings_ohm.chunks_exact_mut(columns)) {
            self.model
                .row_resistances_into(row, self.deformation.row_mm(row), readings_ohm)?;
        }
        if let Some(fault) = &self.fault {
            fault.before_noise(&self.rows, &self.deformation, readings_ohm);
        }
        self.source.disturb(readings_ohm, &mut self.noise_rng);
        if let Some(fault) = &self.fault {
            fault.after_noise(&self.rows, readings_ohm);
        }
        Ok(time_s)
    }

    /// Returns the true deformation of the last frame; the undeformed state before the first frame.
    pub fn deformation(&self) -> &Deformation {
        &self.deformation
    }
}

/// Path of the indenter over the array.
#[derive(Clone, Copy, Debug)]
struct PressPath {
    middle_mm: DVec2,
    reach_mm: DVec2,
    /// Phases of the sines of x, y and depth in radians, two of each.
    phases: [[f64; 2]; 3],
}

/// Frequencies of the sines of x, y and depth in Hz, with ratios chosen for a long period.
const FREQUENCIES_HZ: [[f64; 2]; 3] = [[0.11, 0.29], [0.13, 0.31], [0.37, 0.89]];

impl PressPath {
    fn new(model: &SensorModel, rng: &mut impl Rng) -> Self {
        let (geometry, scale) = (&model.geometry, model.scale);
        let first_mm = geometry.row_node_mm(scale, 0, 0).truncate();
        let last_mm = geometry
            .row_node_mm(scale, scale.rows() - 1, scale.nodes_per_row() - 1)
            .truncate();
        Self {
            middle_mm: 0.5 * (first_mm + last_mm),
            reach_mm: 0.5 * (last_mm - first_mm),
            phases: FREQUENCIES_HZ.map(|pair| pair.map(|_| TAU * rng.random::<f64>())),
        }
    }

    /// Position at a time, and depth as a fraction of the stroke: 0 while the indenter is lifted.
    fn at(&self, time_s: f64) -> (DVec2, f64) {
        let wave = |axis: usize| {
            let pairs = FREQUENCIES_HZ[axis].iter().zip(self.phases[axis]).zip([0.6, 0.4]);
            pairs
                .map(|((frequency, phase), share)| share * (TAU * frequency * time_s + phase).sin())
                .sum::<f64>()
        };
        let place_mm = self.middle_mm + self.reach_mm * DVec2::new(wave(0), wave(1));
        (place_mm, (0.4 + 0.6 * wave(2)).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Noise;

    #[test]
    fn an_unplugged_device_is_no_pipe_without_a_reader() {
        let broken = io::Error::from(io::ErrorKind::BrokenPipe);
        let (path, baud) = ("/dev/ttyUSB0".to_owned(), 9600);
        let device = Source::Serial { path, baud }.lost(&broken);
        assert_eq!(
            device,
            "'/dev/ttyUSB0:9600' is lost: the device was unplugged or switched off; connect it again"
        );
        let socket = Source::Tcp("host:1".to_owned()).lost(&broken);
        assert_eq!(socket, "'tcp:host:1' is lost: broken pipe; connect it again");
        let pipe = Source::StandardInput.lost(&broken);
        assert!(pipe.contains("the program that reads it has ended"), "{pipe}");
    }

    #[test]
    fn sources_are_distinguished_by_their_names() {
        let serial = |path: &str, baud| Source::Serial {
            path: path.to_owned(),
            baud,
        };
        for (text, expected) in [
            ("-", Source::StandardInput),
            ("frames.csv", Source::File("frames.csv".into())),
            // Missing files, even if their names begin like those of ports.
            ("COMPARISON.csv", Source::File("COMPARISON.csv".into())),
            ("COM", Source::File("COM".into())),
            ("COM1.csv", Source::File("COM1.csv".into())),
            ("press at 12:30", Source::File("press at 12:30".into())),
            ("tcp:localhost:5000", Source::Tcp("localhost:5000".to_owned())),
            ("tcp:[::1]:5000", Source::Tcp("[::1]:5000".to_owned())),
            ("/dev/ttyUSB0:115200", serial("/dev/ttyUSB0", 115_200)),
            ("COM3:9600", serial("COM3", 9600)),
        ] {
            assert_eq!(text.parse::<Source>().unwrap(), expected, "{text}");
        }
        for (text, words) in [
            ("/dev/ttyUSB0", "give /dev/ttyUSB0:115200"),
            ("COM3", "give COM3:115200"),
            ("tcp:5000", "tcp:HOST:PORT"),
            ("tcp:host:99999", "tcp:HOST:PORT"),
        ] {
            let message = text.parse::<Source>().unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        }
    }

    #[test]
    fn a_device_that_cannot_be_opened_is_explained() {
        let message = |text: &str| match text.parse::<Source>().unwrap().open() {
            Ok(_) => panic!("{text} is open"),
            Err(error) => error.to_string(),
        };
        let found = message("/dev/no-such-tty:9600");
        assert!(found.starts_with("there is no device '/dev/no-such-tty'"), "{found}");
        let found = message("/dev/null:9600");
        assert!(found.contains("'/dev/null' does not support 9600 baud"), "{found}");
    }

    fn source() -> Simulated {
        let scene = Scene {
            noise: Noise::default(),
            ..Scene::default()
        };
        Simulated::new(&SensorModel::new("4x4_2x12".parse().unwrap()), &scene, Seed(3), 50.0).unwrap()
    }

    fn next(source: &mut Simulated) -> (f64, Vec<f64>) {
        let mut ohm = vec![0.0; source.readings()];
        (source.next_frame(&mut ohm).unwrap(), ohm)
    }

    #[test]
    fn a_held_indenter_stays_a_lifted_one_leaves_no_trace_and_both_resume() {
        let (mut source, mut wandering) = (source(), source());
        let path: Vec<Vec<f64>> = (0..40).map(|_| next(&mut wandering).1).collect();
        for frame in &path[..20] {
            assert_eq!(&next(&mut source).1, frame);
        }
        source.set_motion(Motion::Held);
        for frame in 20..25 {
            let (time_s, ohm) = next(&mut source);
            assert_eq!((time_s, &ohm), (f64::from(frame) / 50.0, &path[20]));
        }
        source.set_motion(Motion::Lifted);
        next(&mut source);
        assert!((0..4).all(|row| source.deformation().row_mm(row).iter().all(|u| u.length() == 0.0)));
        source.set_motion(Motion::Wandering);
        for frame in &path[20..] {
            assert_eq!(&next(&mut source).1, frame);
        }
    }

    #[test]
    fn skipped_frames_leave_the_others_unchanged() {
        let (mut source, mut whole) = (source(), source());
        source.skip(7);
        (0..7).for_each(|_| drop(next(&mut whole)));
        assert_eq!(next(&mut source), next(&mut whole));
    }
}
