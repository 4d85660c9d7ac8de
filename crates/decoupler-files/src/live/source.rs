use std::{
    fmt,
    fs::File,
    io::{self, Read, stdin},
    net::TcpStream,
    path::{Path, PathBuf},
    str::FromStr,
    time::Duration,
};

use thiserror::Error;

use super::lines::Keeping;
use crate::machine::{system_cause, system_words};

/// Source of frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// Standard input.
    StandardInput,
    /// A file or a named pipe.
    File(PathBuf),
    /// A serial port with its baud rate, 8 data bits, no parity, 1 stop bit.
    Serial(String, u32),
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
    #[error("'{0}' does not support {1} baud: {2}; give a rate that it supports, for example 9600 or 115200")]
    Device(String, u32, String),
    /// The connection failed.
    #[error("cannot connect to 'tcp:{0}': {cause}; check that the sender listens there", cause = system_words(.1))]
    Connect(String, io::Error),
    /// The file cannot be opened.
    #[error("cannot open '{}': {}", .0.display(), system_cause(.1))]
    File(PathBuf, io::Error),
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
            return Ok(Self::Serial(path.to_owned(), baud));
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
            Self::Serial(path, baud) => write!(f, "'{path}:{baud}'"),
            Self::Tcp(address) => write!(f, "'tcp:{address}'"),
        }
    }
}

impl Source {
    /// Returns the overflow policy for lines that arrive faster than they are consumed.
    pub fn keeping(&self) -> Keeping {
        match self {
            Self::StandardInput | Self::File(_) => Keeping::All,
            Self::Serial(..) | Self::Tcp(_) => Keeping::Latest,
        }
    }

    /// Returns `true` if reading may begin in the middle of a line.
    pub fn begins_anywhere(&self) -> bool {
        matches!(self, Self::Serial(..))
    }

    /// Returns the message on an error that ends the reading of this source.
    pub fn lost(&self, error: &io::Error) -> String {
        let cause = match (self, error.kind()) {
            // The system reports an unplugged device like a pipe without a reader.
            (Self::Serial(..), io::ErrorKind::BrokenPipe | io::ErrorKind::NotFound) => {
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
            Self::File(path) => match File::open(path) {
                Ok(file) => Ok(Box::new(file)),
                Err(error) => Err(SourceError::File(path.clone(), error)),
            },
            Self::Serial(path, baud) => open_serial(path, *baud),
            Self::Tcp(address) => {
                let connected = TcpStream::connect(address);
                let ready = connected.and_then(|stream| stream.set_read_timeout(Some(TIMEOUT)).map(|()| stream));
                let stream = ready.map_err(|error| SourceError::Connect(address.clone(), error))?;
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
        _ => SourceError::Device(path.to_owned(), baud, error.description),
    };
    let port = serialport::new(path, baud).timeout(TIMEOUT).open().map_err(refused)?;
    Ok(Box::new(port))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unplugged_device_is_no_pipe_without_a_reader() {
        let broken = io::Error::from(io::ErrorKind::BrokenPipe);
        let device = Source::Serial("/dev/ttyUSB0".to_owned(), 9600).lost(&broken);
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
        let serial = |path: &str, baud| Source::Serial(path.to_owned(), baud);
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
}
