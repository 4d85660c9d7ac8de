//! The memory of a network in a bundle: what computes the inputs of the network, its features, from readings as they come.
//!
//! Every format has the state as a value of its own, which a program may store and continue from: a struct in C99, an
//! array for NumPy and MATLAB, an input and an output of a graph. All but C99 have the same rows × channels: a row of
//! ones once there has been a sample (zeros before), the latest readings back to the longest lag, and the averages.
//!
//! `sequence.csv` has golden frames in order, with their intervals, features and targets, and a restart in the middle.

mod c99;
mod graph;
mod scripts;

use std::fmt::Write;

use decoupler_core::{
    dataset::{DatasetError, Memory, MemoryConstants, MemoryState, Seed, Span, Stream},
    text::{counted, format_number, inert},
};
use rand::RngExt;

use self::graph::sequence_of_graph;
use super::{
    BundleError, BundleFormat,
    c99::{Compiled, run_sources},
    exported_decoder::ExportedDecoder,
    folder::Draft,
    portable::Portable,
    report::BundleCheck,
    vectors::Deviation,
};

/// Frames before and after the restart, besides those of the longest lag.
const FRAMES: [usize; 2] = [200, 100];
/// Longest lag for which the sequence is lengthened.
const MAX_LENGTHENED: usize = 2000;
/// Longest lag of a graph, whose operations copy the whole state for each sample.
const MAX_LAG_OF_GRAPH: usize = 10_000;

/// A memory to be exported, with golden frames.
pub(super) struct ExportedMemory {
    constants: MemoryConstants,
    frames: Vec<Frame>,
}

/// A frame of the golden sequence. Its first features are the readings.
struct Frame {
    /// The state starts again with this frame.
    is_first: bool,
    interval_s: f64,
    features: Vec<f64>,
    targets: Vec<f64>,
}

impl ExportedMemory {
    /// Draws the golden sequence: readings in their range in training, at irregular intervals.
    ///
    /// # Errors
    /// The range in training is not known, or a frame cannot be decoded.
    pub(super) fn of(
        memory: &Memory,
        exported: &mut ExportedDecoder<'_>,
        portable: &Portable,
    ) -> Result<Self, BundleError> {
        let invalid = |error: DatasetError| BundleError::read_back("the network file", error.to_string());
        let channels = portable.channels / memory.features(1);
        let constants = MemoryConstants::of(memory, channels).map_err(invalid)?;
        let mut state = MemoryState::new(memory, channels).map_err(invalid)?;
        let range = portable
            .ranges
            .first()
            .and_then(Option::as_ref)
            .ok_or(BundleError::NoRange)?;
        let mut rng = Seed::default().rng(Stream::Test);
        let lengthened = constants.longest_lag().min(MAX_LENGTHENED);
        let (before, after) = (FRAMES[0] + lengthened, FRAMES[1]);
        let mut frames = Vec::with_capacity(before + after);
        for frame in 0..before + after {
            let is_first = frame == 0 || frame == before;
            if is_first {
                state.restart();
            }
            let interval_s = constants.interval_s * rng.random_range(0.5..1.5);
            let within = range.extremes.iter().take(channels);
            let readings = Vec::from_iter(within.map(|(low, high)| low + rng.random::<f64>() * (high - low)));
            let mut features = vec![0.0; state.features()];
            state.step(&readings, Some(interval_s), &mut features);
            let targets = exported.decode(0, &features)?;
            frames.push(Frame {
                is_first,
                interval_s,
                features,
                targets,
            });
        }
        Ok(Self { constants, frames })
    }

    /// Writes the files of the format into `draft`, reads them back and evaluates the sequence where this program can.
    ///
    /// # Errors
    /// A file cannot be written, or what was read back fails.
    pub(super) fn export(&self, format: BundleFormat, draft: &mut Draft<'_>) -> Result<Vec<BundleCheck>, BundleError> {
        let name = draft.name.to_owned();
        let mut checks = Vec::new();
        match format {
            BundleFormat::Json => {}
            BundleFormat::C99 => {
                for (file, text) in self.c99(&name) {
                    draft.write(&file, text)?;
                }
                let sources = ["", "_selftest"].map(|part| format!("{name}_memory{part}.c"));
                match run_sources(draft.folder.path(), &sources)? {
                    Compiled::Ran { deviation } => {
                        checks.push(BundleCheck::of("memory in C, compiled and run", deviation));
                    }
                    Compiled::NoCompiler(reason) => draft
                        .remarks
                        .push(format!("the memory in C was not compiled: {reason}")),
                }
            }
            BundleFormat::NumPy => {
                draft.write("memory.py", self.numpy())?;
            }
            BundleFormat::Matlab => {
                draft.write(&format!("{name}_memory.m"), self.matlab(&name))?;
            }
            BundleFormat::Onnx => {
                if self.constants.longest_lag() > MAX_LAG_OF_GRAPH {
                    return Err(BundleError::LongLag(self.constants.longest_lag()));
                }
                let file = "stream.onnx";
                let bytes = draft.write(file, self.graph(draft.portable, draft.weights, draft.metadata))?;
                let found = sequence_of_graph(&bytes, self).map_err(|reason| BundleError::read_back(file, reason))?;
                checks.push(BundleCheck::of(
                    "ONNX graph with its state, read back and evaluated",
                    self.deviation(draft.portable, &found),
                ));
            }
        }
        draft.write("sequence.csv", self.csv(draft.portable))?;
        Ok(checks)
    }

    /// Returns the usage section of the README.
    pub(super) fn call(&self, format: BundleFormat, name: &str) -> String {
        let usage = match format {
            BundleFormat::C99 => format!(
                "    #include \"{name}_memory.h\"\n    {name}_memory memory;\n    {name}_memory_init(&memory);\n    \
                 {name}_memory_step(&memory, readings, interval_s, features);\n    {name}_decode(features, targets);\n\n\
                 A copy of the struct is a state to continue from.\n"
            ),
            BundleFormat::NumPy => "    from memory import Memory\n    memory = Memory()\n    \
                 features = memory.step(readings, interval_s)\n    targets = decode(features[None])[0]\n\n\
                 memory.state is an array to store and to continue from: Memory(state).\n"
                .to_owned(),
            BundleFormat::Matlab => format!(
                "    [features, state] = {name}_memory(readings, interval_s, state);\n    \
                 targets = {name}_decode(features);\n\nreadings has a line for each sample in order of time; state is [] at the start.\n"
            ),
            BundleFormat::Onnx => "    targets, state = session.run([\"targets\", \"next_state\"],\n        \
                 {\"readings\": readings, \"interval_s\": np.array([[interval_s]]), \"state\": state})\n\n\
                 in a session of stream.onnx takes one sample (1 x channels); the state is zeros at the start.\n"
                .to_owned(),
            BundleFormat::Json => String::new(),
        };
        let restarts = self.restarts();
        format!(
            "\nMemory\n\nThe inputs of the network are features: readings and values from their past. They are computed from\n\
             the {} of each sample, interval_s seconds after the sample before (in training usually {} s):\n\n{usage}\n\
             {restarts}\n\n\
             sequence.csv has samples in order with their intervals, features and targets; the state starts again where\n\
             restart is 1.\n",
            counted(self.constants.channels, "reading"),
            self.constants.interval_s
        )
    }

    /// Sentence on where the caller has to restart the state, as this program does by itself.
    fn restarts(&self) -> String {
        format!(
            "Keep one state for each group and row-wire, and restart it where the time steps back and after a pause of more\n\
             than {} s (50 usual intervals): it does not restart by itself.",
            format_number(50.0 * self.constants.interval_s)
        )
    }

    /// Golden frames: restart, interval, features and targets.
    fn csv(&self, portable: &Portable) -> String {
        let quoted = |name: String| format!("\"{}\"", name.replace('"', "\"\""));
        let titles = portable.meaning.inputs().into_iter().chain(portable.meaning.targets());
        let titles = Vec::from_iter(titles.map(|channel| quoted(inert(&channel.title()))));
        let mut text = format!("restart,interval_s,{}\n", titles.join(","));
        for frame in &self.frames {
            let _ = write!(text, "{},{:e}", u8::from(frame.is_first), frame.interval_s);
            for value in frame.features.iter().chain(&frame.targets) {
                let _ = write!(text, ",{value:e}");
            }
            text.push('\n');
        }
        text
    }

    /// Largest deviation of `targets`, relative to the range of each target in training.
    fn deviation(&self, portable: &Portable, targets: &[Vec<f64>]) -> Deviation {
        let pairs = self.frames.iter().zip(targets);
        let relative = pairs.flat_map(|(frame, found)| {
            let values = frame.targets.iter().zip(found).zip(&portable.scales);
            values.map(|((expected, found), scale)| (found - expected).abs() / scale)
        });
        let largest = relative.fold(0.0, |largest: f64, value| {
            if value > largest || value.is_nan() {
                value
            } else {
                largest
            }
        });
        let total = if targets.len() == self.frames.len() {
            largest
        } else {
            f64::NAN
        };
        Deviation {
            total,
            of_arithmetic: total,
        }
    }

    /// Exponents Δt/τ of the averages as a rate per second and a constant: one of them is 0.
    fn exponents(&self) -> impl Iterator<Item = (f64, f64)> {
        self.constants.averages.iter().map(|average| match average {
            Span::Seconds(seconds) => (1.0 / seconds, 0.0),
            Span::Samples(samples) => (0.0, 1.0 / samples),
        })
    }

    /// Number of readings in the state: the latest, back to the longest lag.
    fn kept(&self) -> usize {
        self.constants.longest_lag() + 1
    }

    /// Number of rows of the state as an array.
    fn rows(&self) -> usize {
        1 + self.kept() + self.constants.averages.len()
    }
}
